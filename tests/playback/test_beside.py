"""Playbacks of several runs in one view, read without a browser."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from test_playback import Page

from drake_rnn import Result, load_experiment, simulate, write_playback

SHORT = {"duration": 2.0, "path.period": 2.0, "path.size": 0.02, "accept": None, "period": 5e-3}


@pytest.fixture(scope="module")
def runs() -> tuple[Result, Result]:
    names = ("naljdf_clover_iiwa", "galjdf_clover_iiwa")
    naljdf, galjdf = (simulate(load_experiment(name, SHORT)) for name in names)
    return naljdf, galjdf


@pytest.fixture(scope="module")
def page(runs: tuple[Result, Result], tmp_path_factory: pytest.TempPathFactory) -> Page:
    file = tmp_path_factory.mktemp("beside") / "playback.html"
    return Page(write_playback(runs[0], file, beside=runs[1:]))


def vertices(page: Page, place: str) -> np.ndarray:
    """All vertices of the meshes below a place, shape (k, 3) [m]."""
    found = []
    for path, mesh in page.objects.items():
        if path.startswith(place) and mesh["geometries"][0]["type"] == "BufferGeometry":
            data = mesh["geometries"][0]["data"]["attributes"]["position"]["array"].data
            found.append(np.frombuffer(data, dtype=np.float32).reshape(-1, 3))
    return np.concatenate(found)


def moved(page: Page, run: Result) -> np.ndarray:
    """How far the second drawing is moved aside, shape (3,) [m]."""
    _, point = page.tracks["/beside/1/traced/point", ".position"][0]
    return np.asarray(point) - run.series["p_WE"][0]


def test_the_first_drawing_is_where_its_arm_drew_it(
    runs: tuple[Result, Result], page: Page
) -> None:
    for name, series in (("desired", "p_WE_desired"), ("traced", "p_WE")):
        for sample in (0, -1):
            _, point = page.tracks[f"/{name}/point", ".position"][sample]
            np.testing.assert_allclose(point, runs[0].series[series][sample], atol=1e-9)


def test_the_second_is_moved_aside_as_a_whole(runs: tuple[Result, Result], page: Page) -> None:
    """Desired and traced alike: what lies between them is the run's own error."""
    aside = moved(page, runs[1])
    for name, series in (("desired", "p_WE_desired"), ("traced", "p_WE")):
        keys = page.tracks[f"/beside/1/{name}/point", ".position"]
        for sample in (0, 50, -1):
            _, point = keys[round(runs[1].time[sample] * 64)]
            np.testing.assert_allclose(point - aside, runs[1].series[series][sample], atol=1e-9)


def test_the_drawings_do_not_overlap(runs: tuple[Result, Result], page: Page) -> None:
    """Along the way that the second is moved, the thickness of the lines included."""
    along = moved(page, runs[1])
    along /= np.linalg.norm(along)
    first = np.concatenate([vertices(page, place) @ along for place in ("/desired", "/traced")])
    second = vertices(page, "/beside/1") @ along
    assert second.min() > first.max()


def test_both_trace_in_step_to_the_end(page: Page) -> None:
    for place in ("/traced/path", "/beside/1/traced/path"):
        time, faces = page.grows(place)
        assert np.all(np.diff(faces) > 0)
        assert len(faces) >= 40
        assert time[-1] == pytest.approx(2.0)


def test_one_arm_is_shown(page: Page) -> None:
    """A second one would stand in the first one's place."""
    assert {path.split("/")[1] for path in page.objects} >= {"arm", "beside"}
    assert not any("iiwa_link" in path for path in page.objects if path.startswith("/beside"))


def test_each_is_labelled_with_its_name_and_error(runs: tuple[Result, Result], page: Page) -> None:
    labels = [(label["name"], label["told"]) for label in page.data["labels"]]
    assert [name for name, _ in labels] == [run.experiment.name for run in runs]
    for run, (_, told) in zip(runs, labels, strict=True):
        number, unit = told.split(" off")[0].split()
        told_error = float(number) * {"m": 1.0, "mm": 1e-3, "µm": 1e-6, "nm": 1e-9}[unit]
        assert told_error == pytest.approx(run.metrics["position_error_max_m"], rel=0.01)
    assert "<title>naljdf_clover_iiwa beside galjdf_clover_iiwa</title>" in page.text


@pytest.mark.long
def test_runs_of_unlike_length_play_to_the_end_of_the_longer(
    runs: tuple[Result, Result], tmp_path: Path
) -> None:
    shorter = simulate(load_experiment("galjdf_clover_iiwa", SHORT | {"duration": 1.0}))
    page = Page(write_playback(shorter, tmp_path / "playback.html", beside=runs[:1]))
    assert {keys[-1][0] for keys in page.tracks.values()} == {128}


def test_three_stand_in_a_row(runs: tuple[Result, Result], tmp_path: Path) -> None:
    page = Page(write_playback(runs[0], tmp_path / "playback.html", beside=[runs[1], runs[0]]))
    along = moved(page, runs[1])
    along /= np.linalg.norm(along)
    rows = [vertices(page, place) @ along for place in ("/desired", "/beside/1", "/beside/2")]
    assert rows[0].max() < rows[1].min()
    assert rows[1].max() < rows[2].min()


def test_alone_a_run_is_shown_as_before(runs: tuple[Result, Result], tmp_path: Path) -> None:
    page = Page(write_playback(runs[0], tmp_path / "playback.html"))
    assert page.data["labels"] == []
    assert '<div class="label">' not in page.text
    assert not any(path.startswith("/beside") for path in page.objects)

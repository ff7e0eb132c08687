"""A playback in a browser without a network."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from browsing import ask, farthest, messages, open_page, requests, set_size
from drake_rnn.colours import SCALE, components
from drake_rnn.experiment import load_experiment
from drake_rnn.playback import playback_in_notebook, write_playback
from drake_rnn.runs.simulation import simulate
from process_helpers import wait_for
from shared_runs import shared_run

pytestmark = pytest.mark.long
DURATION = 2.0


@pytest.fixture
def browser(browser: Any) -> Any:
    """That of all tests here, which has forgotten what it asked for and complained about."""
    browser.switch_to.default_content()
    browser.get("about:blank")
    set_size(browser, (640, 460))
    messages(browser)
    list(requests(browser))
    return browser


@pytest.fixture(scope="module")
def known() -> Any:
    changes = {"duration": DURATION, "window": None}
    return simulate(load_experiment("slc_nephroid_known", changes))


@pytest.fixture(scope="module")
def small_page(known: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of few frames."""
    return write_playback(known, tmp_path_factory.mktemp("pages") / "playback.html", 8)


@pytest.fixture(scope="module")
def pair_page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two runs beside one another."""
    changes = {"period": 5e-3, "accept": None}
    naljdf, galjdf = (
        simulate(load_experiment(f"{scheme}_clover_iiwa", changes | {"name": scheme}))
        for scheme in ("naljdf", "galjdf")
    )
    page = tmp_path_factory.mktemp("pages") / "playback.html"
    return write_playback(naljdf, page, 8, beside=[galjdf])


def test_a_playback_plays_without_a_network(browser: Any, known: Any, tmp_path: Path) -> None:
    page = write_playback(known, tmp_path / "playback.html")
    open_page(browser, page)

    # It plays by itself, and over and over.
    assert ask(browser, "playback.playing")
    assert ask(browser, "playback.duration") == DURATION
    assert wait_for(lambda: ask(browser, "playback.time") > 0.1)
    browser.execute_script("playback.seek(1.9); playback.play(); playback.setSpeed(5)")
    assert wait_for(lambda: ask(browser, "playback.time") < 1.5)
    assert ask(browser, "playback.playing")
    times = ask(browser, "viewer.animator.actions.map(action => action.time)")
    assert max(times) - min(times) < 1e-6

    # The tool's origin is E, and the traced path follows it. In three.js, y points up.
    shown = []
    for sample in (0, 50, 125, 200):
        t = known.time[sample]
        browser.execute_script(f"playback.seek({t}); viewer.scene.updateMatrixWorld(true);")
        assert ask(browser, "playback.time") == pytest.approx(t)
        tool = "viewer.scene_tree.find(['arm', 'panda', 'tool']).object"
        x, y, z = ask(browser, f"{tool}.matrixWorld.elements.slice(12, 15)")
        np.testing.assert_allclose([x, -z, y], known.series["p_WE"][sample], atol=1e-3)
        traced = "viewer.scene_tree.find(['traced', 'path', '<object>']).object"
        drawn = f"{traced}.visible ? {traced}.geometry.drawRange.count : 0"
        shown.append(ask(browser, drawn))
    assert not ask(browser, "playback.playing")
    assert shown[0] == 0
    assert np.all(np.diff(shown) > 0)
    assert shown[-1] == ask(browser, f"{traced}.geometry.index.count")

    assert messages(browser) == []
    # Other requests are those of the empty tab before.
    sent = [one for one in requests(browser) if one["documentURL"] == page.as_uri()]
    urls = {one["request"]["url"] for one in sent}
    assert {url for url in urls if not url.startswith("data:")} == {page.as_uri()}


def test_a_traced_path_is_coloured_by_the_curve_of_the_chart(
    browser: Any, small_page: Path
) -> None:
    """Where the error is largest it has the last colour of the scale, and the first where least."""
    browser.get(small_page.as_uri() + "#t=2&trace=coloured")
    assert wait_for(lambda: ask(browser, "Boolean(window.playback && playback.ready)"))
    path = "viewer.scene_tree.find(['traced', 'path', '<object>']).object"
    assert ask(browser, f"{path}.material.vertexColors")
    shown = np.reshape(ask(browser, f"[...{path}.geometry.attributes.color.array]"), (-1, 3))
    for index, end in ((0, 0), (-1, -1)):
        # A colour in sRGB, as light.
        expected = ((np.array(components(SCALE[end])) + 0.055) / 1.055) ** 2.4
        extreme = np.argsort(shown @ [0.2, 0.7, 0.1])[index]
        np.testing.assert_allclose(shown[extreme], expected, atol=0.03)
    # It comes nearer to its path: the first point is the lightest.
    assert shown[0] @ [0.2, 0.7, 0.1] > 0.75
    legend = "document.getElementById('trace-scale')"
    assert "position error" in ask(browser, f"{legend}.textContent")
    browser.find_element("tag name", "body").send_keys("p")
    assert not ask(browser, f"{path}.material.vertexColors")
    assert ask(browser, f"{legend}.hidden")
    assert messages(browser) == []


def test_a_film_is_seen_without_bars(browser: Any, small_page: Path) -> None:
    """Whatever is asked for in one script is in the picture that the same script takes."""
    open_page(browser, small_page)
    browser.execute_script("playback.chrome(false); playback.setView('close')")
    assert ask(browser, "[innerWidth, innerHeight]") == ask(
        browser, "[viewer.renderer.domElement.width, viewer.renderer.domElement.height]"
    )
    taken = "viewer.render(); return viewer.renderer.domElement.toDataURL();"
    first, second, again = (
        browser.execute_script(f"playback.seek({t}); {taken}") for t in (0.5, 1.5, 0.5)
    )
    assert first != second
    assert first == again
    browser.execute_script("playback.chrome(true)")
    assert ask(browser, "document.getElementById('bar').offsetHeight") > 0


@pytest.mark.parametrize(
    "size",
    [
        (140, 240),
        (240, 140),
        (320, 200),
        (1000, 250),
    ],
)
def test_the_arm_is_in_a_picture_of_any_shape(
    browser: Any, small_page: Path, size: tuple[int, int]
) -> None:
    """With and without room for the path enlarged in a corner."""
    open_page(browser, small_page, (max(size[0], 500), 700))
    browser.execute_script("playback.chrome(false)")
    set_size(browser, size)
    canvas = "viewer.renderer.domElement"
    fits = f"[{canvas}.clientWidth, {canvas}.clientHeight].join() === '{size[0]},{size[1]}'"
    assert wait_for(lambda: ask(browser, fits))
    for t in (0.0, 2.0):
        browser.execute_script(f"playback.seek({t})")
        reach = farthest(browser, ["arm", "desired", "traced"])
        assert 0.5 < reach.max() < 1.0


def test_a_frame_of_a_notebook_has_room_for_the_arm(
    browser: Any, known: Any, tmp_path: Path
) -> None:
    notebook = tmp_path / "notebook.html"
    notebook.write_text(
        f"<!DOCTYPE html><body style='margin: 0'>{playback_in_notebook(known)}</body>"
    )
    set_size(browser, (800, 700))
    browser.get(notebook.as_uri())
    browser.switch_to.frame(0)
    assert wait_for(lambda: ask(browser, "Boolean(window.playback && playback.ready)"))
    assert ask(browser, "innerHeight") == 480
    assert ask(browser, "document.getElementById('meshcat-pane').offsetHeight") > 0.45 * 480
    assert messages(browser) == []


def test_the_ghost_stands_still_while_the_arm_comes_to_it(browser: Any, tmp_path: Path) -> None:
    result = shared_run("modified_state_adjustment")
    open_page(browser, write_playback(result, tmp_path / "playback.html"))

    def poses(scene: str, t: float) -> Any:
        browser.execute_script(f"playback.seek({t}); viewer.scene.updateMatrixWorld(true);")
        links = [f"iiwa_link_{k}" for k in range(1, 8)]
        find = f"viewer.scene_tree.find(['{scene}', 'iiwa14', link]).object.matrixWorld.elements"
        return np.array(ask(browser, f"arguments[0].map(link => {find})", links))

    ghost = poses("target", 0.0)
    assert np.abs(poses("arm", 0.0) - ghost).max() > 0.1
    np.testing.assert_allclose(poses("arm", result.time[-1]), ghost, atol=1e-4)
    np.testing.assert_array_equal(poses("target", result.time[-1]), ghost)
    # The viewer knows every property of the ghost.
    assert messages(browser) == []


@pytest.mark.parametrize("size", [(900, 600), (390, 800)])
def test_labels_are_below_their_drawings_in_any_window(
    browser: Any, pair_page: Path, size: tuple[int, int]
) -> None:
    """A narrow window, such as a telephone's, shows the whole width."""
    open_page(browser, pair_page, size)
    pane = ask(browser, "document.getElementById('stage').getBoundingClientRect().toJSON()")

    def places() -> list[dict[str, float]]:
        found: list[dict[str, float]] = ask(
            browser,
            "[...document.querySelectorAll('.label')].map(x => x.getBoundingClientRect().toJSON())",
        )
        return sorted(found, key=lambda label: label["left"])

    def seen() -> bool:
        one, other = places()
        low, high = pane["top"] + pane["height"] / 3, pane["bottom"]
        inside = all(
            label["left"] > 0 and label["right"] < size[0] and low < label["top"] < high
            for label in (one, other)
        )
        return inside and one["right"] < other["left"]

    assert wait_for(seen), places()
    assert messages(browser) == []

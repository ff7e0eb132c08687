"""Obstacles in a playback, read without a browser."""

import numpy as np
import pytest
from test_playback import Page

from drake_rnn import load_experiment, simulate
from drake_rnn.film.encoding import _legend
from drake_rnn.playback import write_playback

OBSTACLES = [
    {"kind": "ball", "center": [0.5, 0.3, 0.5], "radius": 0.05},
    {"kind": "box", "center": [0.6, -0.4, 0.2], "size": [0.1, 0.2, 0.3], "rpy": [0, 0, 0.5]},
    {"kind": "capsule", "ends": [[0.7, 0.3, 0.0], [0.7, 0.3, 0.6]], "radius": 0.04},
    {"kind": "half_space", "point": [0, 0, -0.1], "normal": [0, 0, 1]},
    {"kind": "cylinder", "center": [0.7, -0.3, 0.1], "radius": 0.05, "length": 0.2},
]


@pytest.fixture(scope="module")
def result():
    changes = {"obstacles": OBSTACLES, "duration": 0.1, "window": None, "accept": None}
    return simulate(load_experiment("adaptive_nephroid_known", changes))


@pytest.mark.long
def test_they_are_named_below_a_film_too(result):
    assert "obstacles" in [each.text for each in _legend(result)]


@pytest.mark.long
def test_they_are_drawn_where_they_are(result, tmp_path):
    page = Page(write_playback(result, tmp_path / "playback.html"))
    drawn = sorted(path for path in page.objects if path.startswith("/obstacles"))
    assert drawn == [f"/obstacles/{k}" for k in range(5)]
    places = [page.poses[path][:3, 3] for path in drawn]
    expected = [[0.5, 0.3, 0.5], [0.6, -0.4, 0.2], [0.7, 0.3, 0.3], [0, 0, -0.102]]
    expected.append([0.7, -0.3, 0.1])
    np.testing.assert_allclose(places, expected, atol=1e-12)
    (ball,) = page.objects["/obstacles/0"]["geometries"]
    assert ball["radius"] == 0.05


@pytest.mark.long
def test_one_that_moves_is_drawn_where_it_is_then(tmp_path):
    moves = {"kind": "line", "by": [0.0, 0.1, 0.0], "period": 0.1}
    ball = {**OBSTACLES[0], "speed": 1.0, "moves": moves}
    changes = {"obstacles": [ball], "duration": 0.1, "window": None, "accept": None}
    result = simulate(load_experiment("adaptive_nephroid_known", changes))
    page = Page(write_playback(result, tmp_path / "playback.html"))
    (first, *_, last) = (place for _, place in page.tracks["/obstacles/0", ".position"])
    np.testing.assert_allclose(first, [0.5, 0.3, 0.5], atol=1e-6)
    np.testing.assert_allclose(last, [0.5, 0.4, 0.5], atol=1e-2)


@pytest.mark.long
def test_capsules_are_drawn_round_the_bodies_they_move_with_and_hidden(result, tmp_path):
    page = Page(write_playback(result, tmp_path / "playback.html"))
    arm = result.experiment.clearance.arm
    places = page.data["capsules"]
    assert len(places) == len(arm.bodies)
    for place in places:
        assert place.startswith("/arm/")
        assert page.properties[place, "visible"] is False
        (shape,) = page.objects[f"{place}/tint"]["geometries"]
        assert shape["radius"] in arm.radii
    # They are below the bodies, which move them: nothing else is recorded.
    assert not any("capsules" in place for place, _ in page.tracks)


def test_without_distances_there_are_no_capsules_to_show(tmp_path):
    plain = simulate(load_experiment("slc_nephroid_known", {"duration": 0.1, "window": None}))
    page = Page(write_playback(plain, tmp_path / "playback.html"))
    assert page.data["capsules"] == []
    assert 'id="capsules"' not in page.text


def test_the_distance_is_among_curves_and_numbers(result):
    assert result.series["distance"].shape == result.time.shape
    assert result.metrics["distance_min_m"] <= result.series["distance"].min() + 1e-12

"""Joints that lock, marked in figures and playbacks, read without a browser."""

import numpy as np
import pytest
from test_playback import Page

from drake_rnn import load_experiment, simulate
from drake_rnn.figures.result_figures import figure
from drake_rnn.playback import write_playback


@pytest.fixture(scope="module")
def result():
    faults = [{"joint": 4, "time": 0.05}]
    changes = {"faults": faults, "duration": 0.1, "window": None, "accept": None}
    return simulate(load_experiment("adaptive_locked_joint", changes))


def test_the_moment_and_the_joint_are_marked_in_the_playback(result, tmp_path):
    page = Page(write_playback(result, tmp_path / "playback.html"))
    assert page.data["marks"] == [{"time": 0.05, "name": "joint 4 locks"}]
    assert "/locked/3" in page.objects
    (_, first), (at, then) = page.tracks["/locked/3", ".visible"]
    assert (first, then) == (False, True)
    assert at > 0
    # It is at the elbow, which the arm's start puts above the base.
    _, place = page.tracks["/locked/3", ".position"][0]
    assert place[2] > 0.5
    assert np.hypot(place[0], place[1]) < 0.4


def test_the_moment_is_marked_in_the_figures(result):
    axes = figure(result, "position_error").get_axes()
    lines = [line for ax in axes for line in ax.get_lines()]
    (mark,) = [line for line in lines if line.get_label() == "joint 4 locks"]
    np.testing.assert_allclose(mark.get_xdata(), 0.05)

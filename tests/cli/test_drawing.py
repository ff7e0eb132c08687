"""Figures that two processes draw are those that one draws; no process is left over."""

import os
import signal
from multiprocessing import active_children

import pytest

from drake_rnn.cli import saving as drawing
from drake_rnn.cli.saving import draw_figures
from drake_rnn.errors import InvalidInputError
from drake_rnn.experiment import load_experiment
from drake_rnn.figures import Paper
from drake_rnn.runs.simulation import simulate

NAMES = ["path_plane", "joint_velocities", "position_error"]


@pytest.fixture(scope="module")
def result():
    return simulate(load_experiment("slc_nephroid_known", {"duration": 0.05, "window": None}))


@pytest.mark.long
def test_two_processes_draw_the_same_pictures(result, tmp_path):
    alone = draw_figures(result, tmp_path / "alone", NAMES, in_helper=False)
    helped = draw_figures(result, tmp_path / "helped", NAMES, in_helper=True)
    assert [file.stem for file in helped] == [file.stem for file in alone] == NAMES
    for one, other in zip(alone, helped, strict=True):
        assert one.read_bytes() == other.read_bytes()
    assert not active_children()


def test_what_a_helper_fails_to_draw_is_drawn_all_the_same(result, tmp_path, monkeypatch):
    monkeypatch.setattr(drawing, "_draw_for", lambda *_: os._exit(3))
    files = draw_figures(result, tmp_path, NAMES, in_helper=True)
    assert [file.stem for file in files] == NAMES
    assert all(file.stat().st_size for file in files)


def test_a_folder_that_cannot_be_made_is_named(result, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InvalidInputError, match="file: is a file, not a folder"):
        draw_figures(result, tmp_path / "file", NAMES, in_helper=True)
    assert not active_children()


def test_an_interrupted_run_leaves_no_helper(result, tmp_path, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(drawing, "_draw_for", lambda *_: signal.pause())
    monkeypatch.setattr(drawing.figures, "write_figures", interrupted)
    with pytest.raises(KeyboardInterrupt):
        draw_figures(result, tmp_path, NAMES, in_helper=True)
    assert not active_children()


def test_a_helper_stops_with_the_process_that_it_helps(result, tmp_path, monkeypatch):
    """Else it would write old figures into the folder of a later run."""
    monkeypatch.setattr(drawing.signal, "signal", lambda *_: None)
    drawing._draw_for(result, tmp_path, NAMES, os.getppid() + 1, Paper())
    assert not list(tmp_path.iterdir())
    drawing._draw_for(result, tmp_path, NAMES[:1], os.getppid(), Paper())
    assert [file.stem for file in tmp_path.iterdir()] == NAMES[:1]

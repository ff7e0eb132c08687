"""`drake-rnn run --resume FOLDER`: a run that was stopped goes on."""

import json

import pytest
from cli_helpers import KNOWN, assert_same_series, call, run, sentence

from drake_rnn import load_experiment, simulate
from drake_rnn.errors import InterruptedRunError
from drake_rnn.runs import checkpoint as keeper


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A run that was interrupted."""
    monkeypatch.setattr(keeper, "_EVERY", 0.2)
    monkeypatch.setattr(keeper, "_PAUSE", 0.0)

    def progress(t):
        raise KeyboardInterrupt

    with pytest.raises(InterruptedRunError) as caught:
        simulate(load_experiment(KNOWN, {"duration": 0.3}), progress, keep=tmp_path / KNOWN)
    caught.value.result.save(tmp_path / KNOWN)
    return tmp_path / KNOWN


def test_it_goes_on_with_the_bits_of_a_whole_run(folder, tmp_path):
    result = call("run", "--resume", folder, "--no-playback", "--no-figures")
    assert result.exit_code == 0, result.stderr
    assert ", resumed at 0.2 s" in result.stdout
    whole = run(tmp_path / "whole", "--duration", 0.3, "--no-figures")
    assert_same_series(folder, whole)
    assert (folder / "metrics.json").read_text() == (whole / "metrics.json").read_text()
    assert json.loads((folder / "run.json").read_text())["status"] == "complete"
    again = call("run", "--resume", folder)
    assert sentence(again) == f"{folder}: the run is complete; there is nothing left to resume"


def test_scripts_are_told_as_of_any_run(folder):
    result = call("run", "--resume", folder, "--no-playback", "--no-figures", "--json")
    told = json.loads(result.stdout)[KNOWN]
    assert (told["folder"], told["status"]) == (str(folder), "complete")


@pytest.mark.parametrize(
    ("more", "option"),
    [
        ([KNOWN], "EXPERIMENT"),
        (["--set", "law.kappa=3"], "--set"),
        (["--seed", 0], "--seed"),
        (["--duration", 3], "--duration"),
        (["--series", "none"], "--series"),
        (["--compiled"], "--compiled"),
        (["--out", "elsewhere"], "--out"),
        (["--beside", KNOWN], "--beside"),
        (["--jobs", 2], "--jobs"),
        (["--dry-run"], "--dry-run"),
    ],
)
def test_the_run_stays_what_it_was(tmp_path, more, option):
    said = sentence(call("run", "--resume", tmp_path, *more))
    assert said == (
        f"{option}: cannot be combined with --resume, which goes on with the run as it was"
    )


def test_without_either_nothing_is_run():
    said = sentence(call("run"))
    assert said == "EXPERIMENT: must be given, or a run's folder with --resume"

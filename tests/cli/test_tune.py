"""Tuning on the command line."""

import pytest
from cli_helpers import KNOWN, call, sentence

from drake_rnn import load_experiment, simulate
from drake_rnn.runs.result import value_text

pytestmark = pytest.mark.usefixtures("undrawn")

OVER = ("--over", "law.kappa")
TWICE = ("--between", "law.kappa=1,9") * 2


@pytest.mark.long
def test_tune_writes_a_document_that_runs_and_a_picture(tmp_path):
    pytest.importorskip("jax")
    # On its path from the start on, so that a short run depends on the gain.
    keys = ("duration=0.3", "window=null", "accept=null", "path.offset=[0, 0, 0]")
    changes = [part for key in keys for part in ("--set", key)]
    found = call("tune", KNOWN, *OVER, *changes, "--steps", 3, "--out", tmp_path)
    assert found.exit_code == 0, found.stderr
    folder = tmp_path / f"tune_{KNOWN}_law.kappa"
    assert {file.name for file in folder.iterdir()} == {"tuned.yaml", "tuning.png"}
    tuned = load_experiment(folder / "tuned.yaml")
    assert tuned.law.kappa > 8.0
    assert tuned.name == f"{KNOWN}_tuned"
    assert "both run by Drake" in found.stdout
    value = simulate(tuned).metrics["position_error_rms_m"]
    assert f"{value_text('position_error_rms_m', value)} tuned" in found.stdout
    assert "with law.kappa=4" in found.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            (KNOWN, "--over", "law.kapa"),
            "law.kapa: no such key of SimultaneousLearning; nearest: kappa",
        ),
        ((KNOWN, *OVER, "--between", "law.kappa=1"), "--between: must be KEY=LOW,HIGH"),
        (
            (KNOWN, *OVER, *("--between", "law.kappa=1,9") * 2),
            "--between: law.kappa is given twice",
        ),
        ((KNOWN, *OVER, "--least", "error"), "metric: 'error' cannot be taken of this run"),
        (
            (KNOWN, *OVER, "--set", "law.rho=1", "--set", "law={kind: simultaneous_learning}"),
            "changes: law is set after law.rho and replaces it",
        ),
        (("slc_nephroid_dynamic", *OVER), "level: dynamic needs Drake's plant"),
    ],
)
def test_what_cannot_be_tuned_is_told_in_a_sentence(tmp_path, arguments, message, simulated):
    pytest.importorskip("jax")
    assert message in sentence(call("tune", *arguments, "--out", tmp_path))
    assert list(tmp_path.iterdir()) == []


def test_without_jax_it_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "jax", None)
    told = sentence(call("tune", KNOWN, *OVER, "--out", tmp_path))
    assert told == "tune: needs jax, which is not installed: pip install 'jax>=0.4.30'"

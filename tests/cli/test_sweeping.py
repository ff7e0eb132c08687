"""Sweeps on the command line."""

import json

import pytest
from cli_helpers import KNOWN, SHORT, call, notes

pytestmark = pytest.mark.usefixtures("undrawn")


def test_sweep_writes_a_table_and_a_picture(tmp_path):
    over = ("--over", "law.kappa=2,8")
    result = call("sweep", KNOWN, *over, "--out", tmp_path, *SHORT)
    assert result.exit_code == 0, result.stderr
    (folder,) = tmp_path.iterdir()
    assert {path.name for path in folder.iterdir()} == {"sweep.csv", "sweep.png"}
    header, first, second = (folder / "sweep.csv").read_text().splitlines()
    assert header.startswith("law.kappa,position_error_max_m,")
    assert first.startswith("2,")
    assert second.startswith("8,")
    assert "law.kappa" in result.stdout
    assert "sweep.csv" in result.stdout
    # In a pipe it is one table, however many columns it has.
    assert result.stdout.count("law.kappa  ") == 1


def test_a_sweep_in_which_a_run_fails_ends_with_1_and_shows_the_others(tmp_path, breaks):
    breaks(0.03)
    result = call("sweep", KNOWN, "--over", "duration=0.02,0.05", "--out", tmp_path)
    assert result.exit_code == 1
    assert "failed" in result.stdout
    assert "duration=0.05: controller: " in result.stderr
    assert "is no longer finite (at t = 0.03 s)" in result.stderr
    (table,) = tmp_path.rglob("sweep.csv")
    assert len(table.read_text().splitlines()) == 3


@pytest.mark.long
def test_a_sweep_tells_of_windows_that_are_dropped(tmp_path):
    result = call("sweep", KNOWN, "--over", "duration=0.01,0.02", "--out", tmp_path)
    assert [note.split(" at ")[1] for note in notes(result)] == ["0.01 s", "0.02 s"]


def test_a_sweep_can_be_read_by_a_script_and_only_planned(tmp_path):
    arguments = ("sweep", KNOWN, "--over", "law.kappa=2,8", "--out", tmp_path, *SHORT, "--json")
    plan = json.loads(call(*arguments, "--dry-run").stdout)
    assert plan["runs"] == 2
    # 50 steps each, some 50 us a step.
    assert 1e-3 < plan["expected_time_s"] < 0.1
    assert not list(tmp_path.iterdir())
    result = call(*arguments)
    assert all(line.startswith("note ") for line in result.stderr.splitlines())
    found = json.loads(result.stdout)
    assert [run["values"] for run in found["runs"]] == [{"law.kappa": 2}, {"law.kappa": 8}]
    assert [run["failure"] for run in found["runs"]] == ["", ""]
    assert all(run["metrics"]["position_error_max_m"] > 0 for run in found["runs"])

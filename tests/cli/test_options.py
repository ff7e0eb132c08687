"""Options of `run` for scripts, servers and the careful."""

import json
import signal
import subprocess
import sys

import numpy as np
import pytest
from typer.testing import CliRunner

from drake_rnn import Result
from drake_rnn.cli.commands import app
from drake_rnn.runs import simulation
from process_helpers import PATIENCE, wait_until_kept

LINE, OTHER = "pinv_line", "pinv_line_ur5"
BARE = ("--no-figures", "--no-playback")
SHORT = ("--duration", "0.05", *BARE)


def call(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def test_json_is_all_that_is_printed_and_holds_metrics_and_verdicts(tmp_path):
    result = call("run", LINE, *SHORT, "--json", "--out", tmp_path)
    assert result.exit_code == 0, (result.stderr, result.exception)
    (found,) = json.loads(result.stdout).values()
    folder = tmp_path / LINE
    assert found["folder"] == str(folder)
    assert found["metrics"] == json.loads((folder / "metrics.json").read_text())
    record = json.loads((folder / "run.json").read_text())
    assert {key: found[key] for key in record} == record
    assert found["accept"]["position_error_max_m"]["met"] is True


def test_quiet_prints_nothing_but_what_is_to_be_heeded(tmp_path):
    result = call("run", LINE, *SHORT, "--quiet", "--out", tmp_path)
    assert (result.exit_code, result.stdout, result.stderr) == (0, "", "")
    assert (tmp_path / LINE / "run.json").is_file()
    # A window that is dropped changes what is measured.
    result = call("run", "slc_nephroid_known", *SHORT, "--quiet", "--out", tmp_path)
    assert result.stdout == ""
    assert result.stderr.startswith("note slc_nephroid_known: window [12, 20] s")
    # The next command speaks again.
    assert "metric" in call("run", LINE, *SHORT, "--out", tmp_path).stdout


def test_without_figures_there_is_no_folder_of_figures(tmp_path):
    assert call("run", LINE, *SHORT, "--out", tmp_path).exit_code == 0
    assert not (tmp_path / LINE / "figures").exists()


def test_a_dry_run_checks_warns_and_estimates_but_runs_nothing(tmp_path, monkeypatch):
    def start(*arguments):
        raise AssertionError("a run was started")

    monkeypatch.setattr(simulation, "_advance", start)
    out = tmp_path / "out"
    fast = ("--set", "path.period=0.3")
    result = call("run", LINE, *fast, "--dry-run", "--out", out)
    assert result.exit_code == 0, (result.stderr, result.exception)
    assert "steps of period 0.001 s" in result.stdout
    assert result.stderr.startswith(f"warning {LINE}: path: asks ")
    result = call("run", LINE, *fast, "--dry-run", "--json", "--duration", "2", "--out", out)
    (plan,) = json.loads(result.stdout).values()
    assert plan["steps"] == pytest.approx(2000)
    assert plan["expected_time_s"] > 0
    assert plan["warnings"][0].startswith("path: asks ")
    result = call("run", LINE, "--set", "path.by=[3, 0, 0]", "--dry-run", "--out", out)
    assert result.exit_code == 2
    assert "out of reach" in result.stderr
    assert not out.exists()


@pytest.mark.long
def test_several_at_a_time_give_the_same_bits_and_are_told_of_in_order(tmp_path):
    for jobs in (1, 2):
        out = tmp_path / str(jobs)
        result = call("run", LINE, OTHER, *SHORT, "--jobs", jobs, "--out", out)
        assert result.exit_code == 0, (result.stderr, result.exception)
        titles = [line.strip() for line in result.stdout.splitlines()]
        assert [title for title in titles if title in {LINE, OTHER}] == [LINE, OTHER]
    for name in (LINE, OTHER):
        one, two = (Result.load(tmp_path / jobs / name) for jobs in "12")
        assert one.metrics == two.metrics
        for series in one.series:
            np.testing.assert_array_equal(one.series[series], two.series[series], strict=True)


def test_several_at_a_time_cannot_be_shown_beside_one_another(tmp_path):
    result = call("run", LINE, "--beside", OTHER, *SHORT, "--jobs", 2, "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert result.stderr == "error --jobs: cannot be combined with --beside\n"
    assert not (tmp_path / "out").exists()


@pytest.mark.long
def test_several_at_a_time_that_are_terminated_keep_what_they_had(tmp_path):
    """What waits does not begin, and is named."""
    names = (LINE, OTHER, "pinv_csv")
    command = [sys.executable, "-m", "drake_rnn", "run", *names, *BARE, "--jobs", "2"]
    process = subprocess.Popen(
        [*command, "--duration", "3000", "--out", tmp_path], stderr=subprocess.PIPE, text=True
    )
    wait_until_kept(process, tmp_path / LINE, tmp_path / OTHER)
    process.send_signal(signal.SIGTERM)
    _, said = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert "not run pinv_csv" in said
    for name in (LINE, OTHER):
        record = json.loads((tmp_path / name / "run.json").read_text())
        assert record["status"] == "interrupted"

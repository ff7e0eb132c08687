"""Runs that fail, are stopped or cannot begin: what is kept, and what is said."""

import json
import subprocess
import sys
from resource import RLIM_INFINITY, RLIMIT_FSIZE, setrlimit

import numpy as np
import pytest
from cli_helpers import KNOWN, SHORT, call, run, sentence, statuses

from drake_rnn import Result
from process_helpers import PATIENCE, wait_until_kept

pytestmark = pytest.mark.usefixtures("undrawn")


def test_a_path_out_of_reach_is_told_before_another_experiment_runs(tmp_path, simulated):
    mine = run(tmp_path / "a", *SHORT) / "experiment.yaml"
    simulated.clear()
    far = tmp_path / "far.yaml"
    far.write_text(
        mine.read_text()
        .replace(f"name: {KNOWN}", "name: far")
        .replace("size: 0.04", "size: 2")
        .replace("duration: 0.05", "duration: 1")
    )
    result = call("run", mine, far, "--out", tmp_path / "b", "--no-playback")
    assert sentence(result).startswith("far: path: out of reach")
    assert not simulated


def test_a_folder_that_cannot_be_written_to_is_told_before_anything_runs(tmp_path, simulated):
    (tmp_path / "file").write_text("here")
    message = sentence(call("run", KNOWN, *SHORT, "--out", tmp_path / "file"))
    assert "file" in message
    assert "Not a directory" in message
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / KNOWN).write_text("here")
    message = sentence(call("run", KNOWN, *SHORT, "--out", tmp_path / "out", "--no-playback"))
    assert KNOWN in message
    assert not simulated
    assert (tmp_path / "out" / KNOWN).read_text() == "here"


@pytest.mark.long
def test_a_run_that_fails_saves_what_there_was_and_names_the_time(tmp_path, breaks, drawn):
    breaks(0.03)
    result = call("run", KNOWN, "--out", tmp_path, "--no-playback", *SHORT)
    assert result.exit_code == 1
    assert "Traceback" not in result.stderr
    (line,) = result.stderr.splitlines()
    assert line.startswith(f"failed {KNOWN}: controller: ")
    assert line.endswith("is no longer finite (at t = 0.03 s)")
    until_then = Result.load(tmp_path / KNOWN)
    np.testing.assert_allclose(until_then.time, [0, 0.01, 0.02, 0.03], atol=1e-12)
    assert np.isfinite(until_then.series["position"]).all()
    assert until_then.metrics["joint_velocity_max_rad_s"] > 0
    assert list((tmp_path / KNOWN / "figures").iterdir())


def test_a_law_that_fails_at_once_is_refused_before_anything_runs(tmp_path, breaks, simulated):
    breaks(0.0)
    message = sentence(call("run", KNOWN, "--out", tmp_path, *SHORT))
    assert message.startswith("SimultaneousLearning.step: must return finite numbers, not [nan, ")
    assert message.endswith("(at t = 0 s)")
    assert not simulated


def test_after_a_run_that_fails_the_others_run(tmp_path, breaks):
    breaks(0.03)
    text = (run(tmp_path / "a", "--duration", 0.02) / "experiment.yaml").read_text()
    for name, duration in {"broken": 0.05, "calm": 0.02}.items():
        changed = text.replace(f"name: {KNOWN}", f"name: {name}")
        changed = changed.replace("duration: 0.02", f"duration: {duration}")
        (tmp_path / f"{name}.yaml").write_text(changed)
    files = [tmp_path / "broken.yaml", tmp_path / "calm.yaml"]
    result = call("run", *files, "--out", tmp_path / "b", "--no-playback")
    assert result.exit_code == 1
    verdicts = [line for line in result.stdout.splitlines() if line.startswith("verdict ")]
    assert "broken: failed at t = 0.03 s: criteria not judged; limits kept until" in verdicts[0]
    assert result.stdout.split("metric")[0].strip() == "broken: failed at t = 0.03 s"
    told = statuses(tmp_path / "b")["broken"]["accept"]
    assert {entry["met"] for entry in told.values()} == {None}
    assert Result.load(tmp_path / "b" / "broken").time[-1] == pytest.approx(0.03)
    assert Result.load(tmp_path / "b" / "calm").time[-1] == pytest.approx(0.02)


def test_a_queue_that_is_cut_names_what_was_not_run(tmp_path, interrupts):
    interrupts(0.02)
    names = ("pinv_line", "pinv_line_ur5", "pinv_csv")
    result = call("run", *names, "--no-playback", "--out", tmp_path, "--duration", "0.1")
    assert result.exit_code == 1
    assert "not run pinv_line_ur5, pinv_csv" in result.stderr
    assert statuses(tmp_path)["pinv_line"]["status"] == "interrupted"


def test_a_comparison_that_is_interrupted_names_what_was_not_run(tmp_path, interrupts):
    interrupts(0.05)
    names = ("pinv_line", "pinv_line_ur5", "pinv_csv")
    result = call("compare", *names, "--out", tmp_path, "--duration", "0.1")
    assert result.exit_code == 130
    assert "not run pinv_line_ur5, pinv_csv" in result.stderr
    assert not list(tmp_path.rglob("comparison.csv"))


@pytest.mark.long
def test_a_terminated_run_keeps_what_it_had(tmp_path):
    """As Ctrl-C does; the folder says that the run was interrupted."""
    command = [sys.executable, "-m", "drake_rnn", "run", KNOWN, "--no-playback"]
    process = subprocess.Popen(
        [*command, "--duration", "3000", "--out", tmp_path], stderr=subprocess.PIPE, text=True
    )
    wait_until_kept(process, tmp_path / KNOWN)
    process.terminate()
    _, said = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert f"failed {KNOWN}: interrupted (at t = " in said
    record = statuses(tmp_path)[KNOWN]
    assert record["status"] == "interrupted"
    assert 0.0 < record["until_s"] < 3000.0
    assert Result.load(tmp_path / KNOWN).time[-1] == record["until_s"]


@pytest.mark.long
def test_a_campaign_that_finds_no_room_ends_with_a_sentence_and_goes_on_from_its_rows(tmp_path):
    """A file may have 3 kB: rows have less, their page more. Nothing is lost."""
    campaign, out = tmp_path / "room.yaml", tmp_path / "out"
    vary = "vary: {law.damping: [0.01, 0.02, 0.03, 0.04, 0.05, 0.06]}"
    campaign.write_text(f"experiment: pinv_line\nchanges: {{duration: 0.05}}\n{vary}\n")
    program = "from drake_rnn.cli import main; main()"
    command = [sys.executable, "-c", program, "campaign", campaign, "--out", out, "--jobs", "1"]

    def ended(**options):
        pipes = {"capture_output": True, "text": True, "timeout": PATIENCE}
        return subprocess.run(command, check=False, **pipes, **options)

    full = ended(preexec_fn=lambda: setrlimit(RLIMIT_FSIZE, (3000, RLIM_INFINITY)))
    assert full.returncode == 2
    said = full.stderr.splitlines()
    assert [line.partition(" /")[0] for line in said if line] == ["error page"]
    assert said[-1].endswith("summary.html: File too large")
    rows = {file: file.stat().st_mtime_ns for file in out.glob("*/rows/*/*.json")}
    assert len(rows) == 6
    assert all(json.loads(file.read_text()) for file in rows)
    again = ended()
    assert again.returncode == 0, again.stderr
    assert "6 of them from before" in again.stdout
    assert rows == {file: file.stat().st_mtime_ns for file in rows}

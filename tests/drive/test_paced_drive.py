"""Whole drives of an FR3 in two processes: of a stand-in, and of a third party's simulator."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from itertools import count
from pathlib import Path

import numpy as np
import pytest

from drake_rnn import FR3, PacedConnection, RobotError, drive_experiment, driven_experiment
from drake_rnn.compiled.library import build_library
from drake_rnn.drive import DriveSettings, drive_diagram, driving, read_record, result_of, task_of
from drake_rnn.drive.shared_cycles import LAW, RECORD, STOP
from process_helpers import PATIENCE, wait_for

ROOT = Path(__file__).parents[2]
BENCHMARKS = ROOT / "benchmarks"
QUICK = DriveSettings(approach_velocity=1.0, approach_acceleration=3.0, approach_jerk=100.0)
# Pauses of a busy machine stop no robot.
PATIENT = DriveSettings(silence=60.0, late=60.0)
STAND_IN = "fr3_stand_in:StandIn"


@pytest.fixture(autouse=True)
def paths(monkeypatch):
    """What the pacer's process finds its stand-in by, and time for it to start and to end."""
    monkeypatch.setattr(driving, "_STARTS", PATIENCE)
    monkeypatch.setattr(driving, "_ENDS", PATIENCE)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join((str(ROOT), str(Path(__file__).parent))))


def experiment(duration=0.6):
    return driven_experiment("adaptive_fr3", FR3, {"duration": duration})


def once_it_runs(act):
    """Return what is told that a run begins, and what acts in its 50th cycle, seeing no stop."""
    said, cycles = [], count()

    def is_told_to_stop():
        if any(text.startswith("run") for text in said) and next(cycles) == 50:
            act()
        return False

    return {"say": said.append, "is_told_to_stop": is_told_to_stop}


def require_bounds(cycles):
    """What was commanded keeps the robot's bounds, where the robot has lost no cycle."""
    v, a = cycles["velocity_commanded"], cycles["acceleration_commanded"]
    assert (np.abs(v) <= FR3.command_limits.velocity).all()
    assert (np.abs(a) <= FR3.limits.acceleration * (1 + 1e-9)).all()
    assert (np.abs(np.diff(a, axis=0)) <= 1e-3 * FR3.limits.jerk * (1 + 1e-9)).all()


@pytest.mark.long
def test_it_runs_and_every_cycle_is_on_record():
    connection = PacedConnection("none", robot=STAND_IN)
    result, driven = drive_experiment(experiment(), FR3, connection, PATIENT)
    assert (result.status, driven.stopped) == ("complete", None)
    cycles = connection.cycles()
    np.testing.assert_array_equal(np.diff(cycles["number"].astype(int)), 1)
    assert (cycles["source"] == LAW).any()
    assert not cycles["velocity_commanded"][-20:].any()
    require_bounds(cycles)
    assert {"position", "position_commanded"} <= result.series.keys()


@pytest.mark.long
def test_cycles_that_the_robot_has_lost_are_those_of_its_pacer():
    connection = PacedConnection("lose=300:7", robot=STAND_IN)
    result, driven = drive_experiment(experiment(), FR3, connection, PATIENT)
    cycles = connection.cycles()
    moved = cycles["source"].nonzero()[0][0]
    lost = (cycles["passed"][moved:].astype(int) - 1).clip(0).sum()
    assert lost >= 7
    assert driven.lost == result.timings["cycles_lost"] == lost
    # What the robot gets, with what it makes of these cycles, is within its bounds; so it is told.
    q, t = driven.commanded["position"], driven.commanded["time"]
    np.testing.assert_allclose(np.diff(t), 1e-3, atol=1e-9)
    a, jerk = (np.diff(q, n=n, axis=0) / 1e-3**n for n in (2, 3))
    assert np.abs(a).max() <= 10.0 * (1 + 1e-6)
    assert np.abs(jerk).max() <= 5000.0 * (1 + 1e-6)
    (told,) = (text for text in result.warnings if text.startswith("measured: "))
    assert told.endswith("limits kept")


@pytest.mark.long
@pytest.mark.parametrize(("length", "late"), [(0.1, 60.0), (1.0, 0.5)])
def test_a_stalled_law_ends_in_a_stop_or_goes_on(length, late):
    connection = PacedConnection("none", robot=STAND_IN)
    settings = replace(PATIENT, late=late)
    stall = once_it_runs(lambda: time.sleep(length))
    result, driven = drive_experiment(experiment(2.0), FR3, connection, settings, **stall)
    cycles = connection.cycles()
    require_bounds(cycles)
    assert (cycles["source"] == STOP).sum() >= 15
    if length < late:
        assert result.status == "complete"
    else:
        assert driven.stopped.watch == "clock"
        assert result.status == "failed"


#: A process that ends as soon as its law moves the robot fast.
KILLED = f"""
import os, signal, sys
from drake_rnn import FR3, PacedConnection, drive_experiment, driven_experiment
from drake_rnn.drive import DriveSettings, driving
from pathlib import Path
driving._STARTS = {PATIENCE}
said, seen = [], []
class Killed(PacedConnection):
    def next(self, timeout):
        status = super().next(timeout)
        seen.append(status)
        runs = any(text.startswith("run") for text in said)
        if runs and abs(status.motion.velocity).max() > 0.1:
            os.kill(os.getpid(), signal.SIGKILL)
        return status
experiment = driven_experiment("adaptive_fr3", FR3, {{"duration": 5.0}})
connection = Killed("none", robot="{STAND_IN}", record=Path(sys.argv[1]))
settings = DriveSettings(silence=60.0, late=60.0)
compiled = sys.argv[2] == "in C"
drive_experiment(experiment, FR3, connection, settings, say=said.append, compiled=compiled)
print(said, len(seen))
"""


@pytest.mark.long
@pytest.mark.parametrize("where", ["in C", "beside the pacer"])
def test_a_law_that_is_killed_leaves_a_robot_at_rest_and_a_record(tmp_path, where):
    left = tmp_path / "cycles"
    command = [sys.executable, "-c", KILLED, left, where]
    law = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    # A law that sees less than 9 in 10 of the 5000 cycles is always late: the robot stays at rest.
    if law.returncode == 0 and (cycles := int(law.stdout.split()[-1])) < 4500:
        pytest.skip(f"a law in NumPy is too slow for 1 kHz here: it saw {cycles} of 5000 cycles")
    assert law.returncode == -signal.SIGKILL, law.stdout + law.stderr

    def is_written():
        size = left.stat().st_size if left.is_file() else 0
        return size > 0 and size % RECORD.size == 0

    assert wait_for(is_written)
    cycles = read_record(left)
    require_bounds(cycles)
    last = np.flatnonzero(cycles["source"] == LAW)[-1]
    rest = np.flatnonzero(~cycles["velocity_commanded"][last:].any(axis=1))[0]
    fastest = np.abs(cycles["velocity_commanded"][last]).max()
    assert fastest > 0.05
    # A stop by 10 rad/s^2, with the time to bring them on and off.
    assert rest <= 1e3 * fastest / 9.999 + 6


#: What a step in C does from 0.1 s on, and what the drive says of it.
WRONG_STEPS = {
    "fault": ("*(volatile int *)8 = 1;", "law: its step in C was ended by SIGSEGV"),
    "endless": ("for (;;) { }", "law: its step in C takes longer than 0.0005 s, 5 times in a row"),
}

AROUND = """
int law_sample(const double *x, const double *given, const double *row, double *after);
int law_sample(const double *x, const double *given, const double *row, double *after)
{{
    if (row[0] > 0.0995) {{
        {wrong}
    }}
    return own_sample(x, given, row, after);
}}
"""


@pytest.mark.long
@pytest.mark.parametrize("kind", WRONG_STEPS)
def test_a_step_in_c_that_goes_wrong_ends_in_a_stop_within_the_bounds(kind, monkeypatch):
    wrong, why = WRONG_STEPS[kind]
    task = task_of(experiment(), True, paced=True)
    native = task.law_in_c._native
    own = f"#define law_sample own_sample\n{native.source}\n#undef law_sample\n"
    monkeypatch.setattr(native, "library", build_library(own + AROUND.format(wrong=wrong)))
    connection = PacedConnection("none", robot=STAND_IN)
    outcome = drive_diagram(task, FR3, connection, PATIENT)
    result, cycles = result_of(task, outcome), connection.cycles()
    assert str(outcome.stopped) == why
    assert result.status == "failed"
    # Samples of a busy machine may be missing before.
    assert 50 <= result.timings["steps_in_c"] <= 100
    require_bounds(cycles)
    last = np.flatnonzero(cycles["source"] == LAW)[-1]
    assert cycles["velocity_commanded"][last].any()
    assert not cycles["velocity_commanded"][-20:].any()


@pytest.mark.long
def test_a_pacer_or_robot_that_ends_is_told():
    connection = PacedConnection("none", robot=STAND_IN)
    kill = once_it_runs(lambda: os.kill(connection.pid, signal.SIGKILL))
    # Nothing else tells of a process that is killed.
    silent = replace(PATIENT, silence=5.0)
    result, driven = drive_experiment(experiment(2.0), FR3, connection, silent, **kill)
    assert driven.stopped.watch in ("robot", "silence")
    assert result.status == "failed"
    # It gives up after 20 lost cycles, as the robot does.
    connection = PacedConnection("lose=200:25", robot=STAND_IN)
    result, driven = drive_experiment(experiment(), FR3, connection, PATIENT)
    assert driven.stopped.watch == "robot"
    assert "communication_constraints_violation" in result.failure
    # Also as the way to the start is worked out: its silence is no reason.
    connection = PacedConnection("lose=30:25", robot=STAND_IN)
    result, driven = drive_experiment(experiment(), FR3, connection, PATIENT)
    assert driven.stopped.watch == "robot"
    assert "communication_constraints_violation" in result.failure
    with pytest.raises(RobotError, match="ModuleNotFoundError"):
        PacedConnection("none", robot="no_such_module:Robot")


@pytest.mark.long
@pytest.mark.parametrize(
    ("kind", "watch"), [("nan", "status"), ("joints", "status"), ("clock", "clock")]
)
def test_what_is_no_state_ends_in_a_bounded_stop(kind, watch):
    connection = PacedConnection(f"{kind}=400", robot=STAND_IN)
    result, driven = drive_experiment(experiment(), FR3, connection, PATIENT)
    assert (result.status, driven.stopped.watch) == ("failed", watch)
    cycles = connection.cycles()
    require_bounds(cycles)
    assert not cycles["velocity_commanded"][-20:].any()


@pytest.mark.long
def test_a_third_partys_controller_takes_a_motion(tmp_path):
    """It is looked at whether it runs, not how late anybody is."""
    pytest.importorskip("pylibfranka", reason="pylibfranka, extra franka, is not installed")
    if not (python := os.environ.get("FRANKA_SIM_PYTHON")):
        pytest.skip("FRANKA_SIM_PYTHON names no Python that has franka-sim")
    line = [sys.executable, BENCHMARKS / "fr3_live.py", "--judge", python]
    few = ["--known", "1", "--learned", "0", "--slc", "0"]
    done = subprocess.run([*line, *few], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "| adaptive, J known, in C | 1 |" in done.stdout

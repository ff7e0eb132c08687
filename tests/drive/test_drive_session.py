"""Whole drives of scripted robots: every fault ends in a bounded stop, and says so."""

import ctypes
from dataclasses import replace

import numpy as np
import pytest
from drive_helpers import PERIOD, Scripted, derivatives, known, stopped_within
from pydrake.symbolic import Variable, cos, sin
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import SymbolicVectorSystem

from drake_rnn import Result, RobotArm, RobotTask, SimulationError, drive_diagram, load_arm
from drake_rnn.compiled import library
from drake_rnn.compiled.library import build_library
from drake_rnn.drive import IIWA, DriveSettings, drive_experiment, driven_experiment, task_of
from drake_rnn.drive.approach import DrivenLaw
from drake_rnn.errors import InvalidInputError, RobotError

IIWA_ARM = load_arm("iiwa14")
T = Variable("t")
HOME = IIWA_ARM.home.tolist()
SWING = [HOME[0] + 0.1 * (1 - cos(2 * T)), *(q + 0 * T for q in HOME[1:])]
RATE = [0.2 * sin(2 * T), *(0 * T for _ in HOME[1:])]


def driven(robot, duration=1.2, settings=None, **asked):
    said = []
    run = drive_experiment(known(duration), IIWA, robot, settings, say=said.append, **asked)
    return run, said


def test_it_approaches_runs_and_rests_within_the_bounds(tmp_path):
    robot = Scripted(known().start + 0.1)
    (result, made), said = driven(robot)
    assert said[0] == "approach: 0.1 rad to the start"
    assert said[1] == "run: 1.2 s"
    assert said[2].startswith("at rest")
    assert (result.status, made.stopped) == ("complete", None)
    speed, acceleration = derivatives(made.log)
    assert speed <= 0.5 * (1 + 1e-9)
    assert acceleration <= 1.0 * (1 + 1e-6)
    # The approach ends where the run begins, and what is sent last is what was sent before.
    approach, stop = made.log.of("approach"), made.log.of("stop")
    assert np.abs(approach["position_sent"][-1] - known().start).max() <= 1e-9
    np.testing.assert_array_equal(*stop["position_sent"][-2:])
    # A run has what was measured beside what was commanded; this robot is a cycle late.
    assert {"position", "position_commanded"} <= result.series.keys()
    late = result.series["position_commanded"] - result.series["position"]
    assert 0.0 < np.abs(late).max() <= 0.5 * PERIOD * (1 + 1e-6)
    assert result.timings["cycles_lost"] == result.timings["cycles_late"] == 0
    result.save(tmp_path / "run")
    loaded = Result.load(tmp_path / "run")
    assert loaded.experiment.document.level == "robot"
    np.testing.assert_array_equal(loaded.series["position"], result.series["position"])


def nan(t, status):
    return replace(status, velocity=np.full(7, np.nan)) if t > 0.6 else status


def beyond(t, status):
    if t <= 0.6:
        return status
    return replace(status, position=np.where(np.arange(7) == 3, 2.09, status.position))


def lagging(t, status):
    # It falls behind at 0.3 rad/s.
    return replace(status, position=status.position - max(t - 0.6, 0.0) * 0.3)


FAULTS = {
    "status": (nan, "velocity of iiwa_joint_1 is nan"),
    "limits": (beyond, "iiwa_joint_4 is at 2.09"),
    "silence": (lambda t, s: None if t > 0.6 else s, "no status for 0.1"),
    "clock": (lambda t, s: replace(s, time=s.time + 7.0 * (t > 0.6)), "clock went by 7.005 s"),
    "jump": (lambda t, s: replace(s, position=s.position + 0.05 * (t > 0.6)), "has moved by 0.0"),
    "lag": (lagging, "iiwa_joint_"),
}


@pytest.mark.parametrize("watch", FAULTS)
def test_a_fault_ends_in_a_stop_within_the_bounds(watch):
    script, sentence = FAULTS[watch]
    robot = Scripted(known().start, script)
    (result, made), said = driven(robot)
    assert made.stopped.watch == watch
    assert result.status == "failed"
    assert sentence in result.failure
    assert said[-2].startswith(f"stopped by {watch}: ")
    assert made.rested <= 0.6
    # Where the robot's clock jumps, the stop counts cycles.
    speed, acceleration = derivatives(made.log, *(["run"] if watch == "clock" else []))
    assert speed <= 0.5 * (1 + 1e-9)
    assert acceleration <= 1.0 + 1e-4
    velocity = np.diff(robot.sent, axis=0) / PERIOD
    assert np.abs(np.diff(velocity, axis=0)).max() / PERIOD <= 1.0 + 1e-4
    assert not velocity[-1].any()


@pytest.mark.parametrize("wrong", [beyond, nan])
@pytest.mark.parametrize("in_time", [True, False])
def test_a_single_wrong_status_is_seen_whenever_it_comes(wrong, in_time):
    """Of messages that come together only the newest moves the robot's clock on."""

    def together(t, status):
        # This side is late, and finds two; or the first came when its cycle was taken for lost.
        if t > 0.6 and robot.wrong is None:
            robot.wrong = wrong(t, status)
            return None
        if robot.wrong is not None and not robot.told:
            robot.told = True
            return replace(status, earlier=[robot.wrong]) if in_time else robot.wrong
        return status

    robot = Scripted(known().start, together)
    robot.wrong, robot.told = None, False
    (result, made), _ = driven(robot)
    assert made.stopped.watch == {beyond: "limits", nan: "status"}[wrong]
    assert result.status == "failed"


def test_whoever_wants_it_to_end_waits_until_the_robot_rests():
    robot = Scripted(known().start)
    (result, made), _ = driven(robot, is_told_to_stop=lambda: robot.now() > 1.2)
    assert made.stopped.watch == "interrupted"
    assert result.status == "interrupted"
    assert result.record["until_s"] == pytest.approx(0.69, abs=0.03)
    assert not (robot.sent[-1] - robot.sent[-2]).any()


def test_whoever_wants_it_to_end_while_it_listens_has_nothing_sent():
    robot = Scripted(known().start)
    (result, made), _ = driven(robot, is_told_to_stop=lambda: robot.now() > 0.2)
    assert (result.status, made.stopped.watch) == ("interrupted", "interrupted")
    assert robot.sent == []


def test_a_program_that_commands_it_too_is_a_reason_to_stop():
    robot = Scripted(known().start)
    robot.others = lambda: 2 * (robot.first is not None and robot.now() - robot.first > 0.6)
    (result, made), _ = driven(robot)
    assert made.stopped.watch == "others"
    assert "another program commands the robot, 2 times" in result.failure
    assert derivatives(made.log)[1] <= 1.0 + 1e-4


def test_a_robot_that_has_moved_since_it_was_listened_to_is_sent_nothing():
    def moves(t, status):
        away = 0.03 if robot.now() > 0.51 else 0.0
        return replace(status, position=status.position + away)

    robot = Scripted(known().start, moves)
    with pytest.raises(RobotError, match=r"has moved by 0\.03 rad since it was listened to"):
        driven(robot)
    assert robot.sent == []


def test_a_robot_that_stood_for_long_is_told_to_stay_where_it_was():
    # This side slept for a second, in which the robot has stopped by itself.
    def sleeps(t, status):
        if t > 0.6 and not robot.slept:
            robot.slept, robot.waited = True, robot.waited + 1.0
            return replace(status, time=robot.now())
        return status

    robot = Scripted(known().start, sleeps)
    robot.slept = False
    (_, made), _ = driven(robot)
    assert made.stopped.watch == "clock"
    stop = made.log.of("stop")["position_sent"]
    np.testing.assert_array_equal(stop, np.broadcast_to(stop[0], stop.shape))
    np.testing.assert_array_equal(stop[0], made.log.of("run")["position_sent"][-1])


def test_single_lost_messages_stop_nothing():
    rng = np.random.default_rng(0)
    robot = Scripted(known().start, lambda t, s: None if t > 0 and rng.random() < 0.05 else s)
    (result, made), _ = driven(robot)
    assert made.stopped is None
    assert result.timings["cycles_lost"] > 10
    assert derivatives(made.log, "run")[1] <= 1.0 + 1e-4


@pytest.mark.parametrize(
    ("script", "message"),
    [
        (lambda t, s: None, "no status within 5 s"),
        (lambda t, s: replace(s, velocity=s.velocity + 0.1), "iiwa_joint_1 moves at 0.1 rad/s"),
        (lambda t, s: replace(s, time=2.0 * s.time), "messages are 10 ms apart"),
        (lambda t, s: replace(s, position=s.position[:6]), "has 6 joints; the arm has 7"),
        (lambda t, s: replace(s, position=s.position * np.nan), "a status is not a number"),
    ],
)
def test_a_robot_that_is_not_ready_is_sent_nothing(script, message):
    robot = Scripted(known().start, script)
    with pytest.raises(RobotError, match=message):
        driven(robot)
    assert robot.sent == []


def test_a_robot_that_another_program_commands_is_sent_nothing():
    robot = Scripted(known().start)
    robot.others = lambda: 3
    with pytest.raises(RobotError, match="another program commands it, 3 times"):
        driven(robot)
    assert robot.sent == []


def test_a_start_that_is_not_reached_in_time_ends_in_a_stop():
    robot = Scripted(known().start + 0.3)
    (result, made), _ = driven(robot, settings=DriveSettings(approach_time=0.5))
    assert made.stopped.watch == "approach"
    assert result.record["until_s"] == 0.0
    assert derivatives(made.log)[1] <= 0.5 + 1e-6


def fails(task, until):
    raise SimulationError("the law failed", until)


def jumps(task, until):
    return task.start + 0.5


def ends_the_process(task, until):
    # As Drake does where one of its own conditions fails.
    raise SystemExit("condition failed")


def is_wrong(task, until):
    raise KeyError("q")


@pytest.mark.parametrize(
    ("watch", "wrong", "sentence"),
    [
        ("law", fails, "the law failed"),
        ("law", is_wrong, "KeyError: 'q'"),
        ("law", ends_the_process, "SystemExit: condition failed"),
        ("command", jumps, "is to move by"),
    ],
)
def test_a_law_that_goes_wrong_is_stopped_from_what_was_sent_last(
    monkeypatch, watch, wrong, sentence
):
    right = DrivenLaw.advance

    def advance(task, until, position, velocity):
        return right(task, until, position, velocity) if until < 0.6 else wrong(task, until)

    monkeypatch.setattr(DrivenLaw, "advance", advance)
    robot = Scripted(known().start)
    (result, made), _ = driven(robot)
    assert made.stopped.watch == watch
    assert sentence in result.failure
    speed, acceleration = derivatives(made.log)
    assert speed <= 0.5 * (1 + 1e-9)
    assert acceleration <= 1.0 + 1e-4


def test_a_diagram_of_ones_own_drives_a_robot():
    builder = DiagramBuilder()
    arm = builder.AddNamedSystem("arm", RobotArm(IIWA_ARM))
    # A joint that swings: q = q0 + 0.1 (1 - cos 2t).
    swing = builder.AddSystem(SymbolicVectorSystem(time=T, output=SWING))
    rate = builder.AddSystem(SymbolicVectorSystem(time=T, output=RATE))
    builder.Connect(swing.get_output_port(), arm.GetInputPort("position_commanded"))
    builder.Connect(rate.get_output_port(), arm.GetInputPort("velocity_commanded"))
    task = RobotTask(Simulator(builder.Build()), arm, duration=1.0, period=1e-3)
    robot = Scripted(arm.start)
    made = drive_diagram(task, IIWA, robot)
    assert made.stopped is None
    run = made.log.of("run")
    t = run["time"] - made.origin
    expected = arm.start[0] + 0.1 * (1 - np.cos(2 * t))
    np.testing.assert_allclose(run["position_sent"][:, 0], expected, atol=1e-9)
    # It was at full speed; the arm's own limit of the acceleration brings it to rest.
    assert not (robot.sent[-1] - robot.sent[-2]).any()


def test_what_nobody_foresaw_still_brings_the_robot_to_rest(monkeypatch):
    right = DrivenLaw.advance

    def advance(task, until, position, velocity):
        if until > 0.6:
            raise KeyboardInterrupt
        return right(task, until, position, velocity)

    monkeypatch.setattr(DrivenLaw, "advance", advance)
    robot = Scripted(known().start)
    with pytest.raises(KeyboardInterrupt):
        driven(robot)
    velocity = np.diff(robot.sent, axis=0) / PERIOD
    assert np.abs(np.diff(velocity, axis=0)).max() / PERIOD <= 1.0 + 1e-4
    assert not velocity[-1].any()


@pytest.mark.long
def test_steps_in_c_move_a_robot_as_those_of_numpy_do():
    pytest.importorskip("jax")
    sent, counts = [], []
    for compiled in (None, False):
        robot = Scripted(known().start + 0.1)
        result, _ = drive_experiment(known(), IIWA, robot, compiled=compiled)
        sent.append(robot.sent)
        counts.append(result.timings["steps_in_c"])
        assert result.status == "complete"
    np.testing.assert_allclose(*sent, rtol=0, atol=1e-10)
    assert counts == [1200, 0]


#: A step in C that ends in a fault once the arm moves.
FAULT = """
int law_sample(const double *x, const double *given, const double *row, double *after);
int law_sample(const double *x, const double *given, const double *row, double *after)
{
    (void)x, (void)given, (void)after;
    return row[0] > 0.3 ? *(volatile int *)8 : 0;
}
"""


def test_a_fault_of_a_step_in_c_ends_in_a_stop_within_the_bounds(monkeypatch):
    pytest.importorskip("jax")
    task = task_of(known(), True)
    native = task._steps.step._native
    own, broken = native.function, ctypes.PyDLL(str(build_library(FAULT))).law_sample
    # The law itself until it breaks.
    robot = Scripted(known().start, lambda t, status: broken_from(0.6, t) or status)

    def broken_from(begin, t):
        monkeypatch.setattr(native, "function", own if t < begin else broken)

    outcome = drive_diagram(task, IIWA, robot)
    assert outcome.stopped.watch == "law"
    assert "its step in C was ended by SIGSEGV" in outcome.stopped.reason
    assert stopped_within(robot.sent)


def test_a_law_that_cannot_be_compiled_is_made_in_numpy_and_says_why(monkeypatch):
    pytest.importorskip("jax")
    monkeypatch.setattr(library, "compiler", lambda: None)
    # No other test has built a law of these limits.
    changes = {"duration": 0.5, "limits.velocity": 0.43}
    experiment = driven_experiment("slc_nephroid_known", IIWA, changes)
    why = "compiled: no C compiler is found"
    assert task_of(experiment).way.startswith(f"its steps are made in NumPy, not in C: {why}")
    assert task_of(experiment, False).way == "its steps are made in NumPy"
    with pytest.raises(InvalidInputError, match=why):
        task_of(experiment, True)

"""Whatever a robot tells, in whatever phase: the bounded stop, its reason, and a result."""

import struct

import numpy as np
import pytest
from drive_helpers import Channels, known, status_bytes, stopped_within

from drake_rnn import RobotError
from drake_rnn.drive import IIWA, DriveSettings, drive_experiment
from drake_rnn.drive.approach import Approach, DrivenLaw
from drake_rnn.drive.iiwa_lcm import decoded_status

JOINTS = 7


def told(time=1.0, joints=JOINTS, **changes):
    return status_bytes(time, np.zeros(joints), np.zeros(joints), **changes)


def counted(count):
    """A message of seven joints that says to have another number of them."""
    return told()[:16] + struct.pack(">i", count) + told()[20:]


#: What is no status at all, and what is one that no robot can tell.
UNREADABLE = {
    "junk": b"junk",
    "nothing": b"",
    "half": told()[:150],
    "one byte short": told()[:-1],
    "one byte more": told() + b"\0",
    "a long one": bytes(70_000),
    "its class alone": told()[:8],
    "minus one joint": counted(-1),
    "six joints of seven": counted(6),
    "eight joints of seven": counted(8),
    "two thousand million joints": counted(2**31 - 1),
}
WRONG = {f"{count} joints": told(joints=count) for count in (0, 1, 6, 8, 100)}
CLOCKS = {"latest": 2**63 - 1, "earliest": -(2**63), "before zero": -1_000_000}
#: The phases of a drive, and the time after the first command at which each is gone through.
PHASES = {"approach": (0.02, 0.27), "run": (0.45, 1.05), "stop": (1.11, 1.3)}


def of_clock(name):
    return lambda data: told(joints=JOINTS, utime=CLOCKS[name])


def not_a_number(data):
    status = decoded_status(data)
    return status_bytes(status.time, [*status.position[:3], np.nan, 0, 0, 0], status.velocity)


MALFORMED = {name: (lambda data, message=message: message) for name, message in UNREADABLE.items()}
MALFORMED |= {name: (lambda data, message=message: message) for name, message in WRONG.items()}
MALFORMED |= {f"clock {name}": of_clock(name) for name in CLOCKS} | {"NaN": not_a_number}


def driven(script, off=0.02, duration=0.8):
    robot, said = Channels(known().start + off, script), []
    settings = DriveSettings(approach_velocity=0.5, approach_acceleration=1.0, approach_jerk=100.0)
    run = drive_experiment(known(duration), IIWA, robot.connection(), settings, say=said.append)
    return robot, run, said


def at(moment, malformed, *, instead):
    """A script by which a message comes once, in place of the status or before it."""
    came = []

    def script(since, data):
        if since < moment or came:
            return [data]
        came.append(since)
        return [malformed(data)] if instead else [malformed(data), data]

    return script


def test_phases_are_where_they_are_looked_for():
    _, (_, made), _ = driven(lambda t, data: [data])
    log = made.log.arrays()
    since = log["time"] - log["time"][np.isfinite(log["position_sent"][:, 0])][0]
    for phase, (first, last) in PHASES.items():
        begin, end = since[log["phase"] == phase][[0, -1]]
        assert begin <= first < last <= end, phase


def require_stopped(seed):
    rng = np.random.default_rng(seed)
    phase = rng.choice(list(PHASES))
    name = rng.choice(list(MALFORMED))
    moment = rng.uniform(*PHASES[phase])
    script = at(moment, MALFORMED[name], instead=bool(rng.integers(2)))
    robot, (result, made), said = driven(script)
    what = f"{name} in {phase}, {moment:.3f} s after the first command"
    assert stopped_within(robot.sent), what
    if phase == "stop":
        # It comes to rest already, and nothing else is owed.
        assert (result.status, made.stopped) == ("complete", None), what
        return
    assert result.status == "failed", what
    watch, reason = made.stopped.watch, made.stopped.reason
    assert watch == ("clock" if name.startswith("clock") else "status"), f"{what}: {reason}"
    assert "\n" not in result.failure
    assert said[-2] == f"stopped by {made.stopped}"
    assert made.log.arrays()["time"].size > 100


@pytest.mark.parametrize("seed", range(4))
def test_a_malformed_status_ends_in_a_bounded_stop(seed):
    require_stopped(seed)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(4, 40))
def test_a_malformed_status_ends_in_a_bounded_stop_in_every_try(seed):
    require_stopped(seed)


@pytest.mark.parametrize("name", UNREADABLE)
def test_what_is_no_status_is_named(name):
    status = decoded_status(UNREADABLE[name])
    says = status.complaint(JOINTS)
    if name == "six joints of seven":
        says = says or "a message"
    assert says.startswith(f"a message of {len(UNREADABLE[name])} bytes on IIWA_STATUS is no")


@pytest.mark.parametrize("name", MALFORMED)
def test_a_robot_that_is_listened_to_is_sent_nothing(name):
    def script(since, data):
        return [MALFORMED[name](data)] if robot.time > 0.2 else [data]

    robot = Channels(known().start, script)
    with pytest.raises(RobotError, match=r"^robot: "):
        drive_experiment(known(), IIWA, robot.connection())
    assert robot.sent == []


def test_nothing_else_than_malformed_statuses_is_no_end_of_the_stop():
    """In every cycle from some moment on, many of them, as from a program gone wild."""
    robot, (result, made), _ = driven(lambda t, data: [b"junk"] * 300 if t > 0.8 else [data])
    assert made.stopped.watch == "status"
    assert stopped_within(robot.sent)
    assert result.status == "failed"


def test_a_robot_whose_clock_stands_is_stopped():
    """Its statuses come as before."""
    stood = []

    def script(since, data):
        if since > 0.8:
            stood.append(data)
            return stood[:1]
        return [data]

    robot, (_, made), _ = driven(script)
    assert made.stopped.watch == "clock"
    assert "the robot's clock has stood at" in made.stopped.reason
    assert stopped_within(robot.sent)


def test_a_robot_whose_clock_goes_too_fast_is_stopped():
    def script(since, data):
        status = decoded_status(data)
        time = status.time + 2.0 * max(since - 0.6, 0.0)
        return [status_bytes(time, status.position, status.velocity)]

    _, (_, made), _ = driven(script)
    assert made.stopped.watch == "clock"
    assert "the robot's clock has gone 0.1" in made.stopped.reason


@pytest.mark.parametrize("times", [2])
def test_statuses_that_come_several_times_change_nothing(times):
    once, (_, _), _ = driven(lambda t, data: [data])
    robot, (result, made), _ = driven(lambda t, data: [data] * times)
    assert made.stopped is None
    assert result.timings["cycles_lost"] == result.timings["cycles_late"] == 0
    np.testing.assert_array_equal(robot.sent, once.sent)


@pytest.mark.parametrize("pace", [3])
def test_a_robot_that_is_slower_than_it_should_is_waited_for(pace):
    """As a simulated one on a busy machine; what is sent goes by its clock."""
    robot = Channels(known().start, pace=pace)
    result, made = drive_experiment(known(0.5), IIWA, robot.connection())
    assert (result.status, made.stopped) == ("complete", None)
    assert made.log.of("run")["time"].size <= 210


def test_who_cannot_send_is_told_so_after_the_stop():
    robot = Channels(known().start)
    publish = robot.Publish

    def fails(channel, data):
        if robot.first is not None and robot.time - robot.first > 0.6:
            raise OSError("no route to host")
        publish(channel, data)

    robot.Publish = fails
    result, made = drive_experiment(known(), IIWA, robot.connection())
    assert result.status == "failed"
    assert made.stopped.watch == "error"
    assert "commands of the stop could not be sent: OSError: no route to host" in result.failure
    assert made.log.of("stop")["time"].size > 40


def test_a_connection_that_fails_when_it_is_read_is_no_end_of_the_stop(monkeypatch):
    monkeypatch.setattr("drake_rnn.drive.cycles.time.sleep", lambda time: robot.wait(time))
    robot = Channels(known().start)
    connection = robot.connection()
    read = connection.next

    def fails(timeout):
        if robot.first is not None and robot.time - robot.first > 0.6:
            raise OSError("network is down")
        return read(timeout)

    monkeypatch.setattr(connection, "next", fails)
    result, made = drive_experiment(known(), IIWA, connection)
    assert made.stopped.watch == "error"
    assert "OSError: network is down" in result.failure
    assert stopped_within(robot.sent)


def test_whoever_hears_nothing_stops_nothing():
    """As where the standard output has been closed."""

    def say(text):
        raise BrokenPipeError

    robot = Channels(known().start)
    result, made = drive_experiment(known(), IIWA, robot.connection(), say=say)
    assert (result.status, made.stopped) == ("complete", None)


def test_a_drive_begins_with_a_status_that_has_just_come(monkeypatch):
    """The way to the start takes its time, in which LCM keeps the oldest status alone."""
    robot = Channels(known().start)

    class Slow(Approach):
        def __init__(self, *arguments):
            robot.busy(0.4)
            super().__init__(*arguments)

    monkeypatch.setattr("drake_rnn.drive.session.Approach", Slow)
    result, made = drive_experiment(known(0.5), IIWA, robot.connection())
    assert (result.status, made.stopped) == ("complete", None)
    assert result.timings["cycles_lost"] == result.timings["cycles_late"] == 0


def test_the_newest_status_is_waited_for_where_this_side_was_late(monkeypatch):
    """What has waited is older than what it is asked for."""

    def slow(since, data):
        status = decoded_status(data)
        return [status_bytes(status.time, status.position, 0.0 * status.velocity)]

    robot = Channels(known().start, slow)
    right, slept = DrivenLaw.advance, []

    def sleeps(task, until, position, velocity):
        if until > 0.3 and not slept and robot.first is not None:
            slept.append(until)
            robot.busy(0.03)
        return right(task, until, position, velocity)

    monkeypatch.setattr(DrivenLaw, "advance", sleeps)
    result, made = drive_experiment(known(0.5), IIWA, robot.connection())
    assert (result.status, made.stopped) == ("complete", None)
    assert np.diff(made.log.of("run")["time"]).max() == pytest.approx(0.035)

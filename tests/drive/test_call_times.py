"""Calls of `command` that take longer than their period are counted, and told once."""

import time
import warnings

import pytest

from drake_rnn import Guard, JointStream, Shield, ShieldSettings, load_arm
from drake_rnn.drive.call_times import CallTimes

ARM = load_arm("planar6")
LIMITS = ARM.limits.replace(velocity=1.0, acceleration=5.0, jerk=100.0)
# Shorter than any step by NumPy, and longer than any.
SHORT, LONG = 2e-5, 0.5


def guard(period):
    law = JointStream(limits=LIMITS, home=ARM.home)
    made = Guard(law, period, compiled=False)
    return made, lambda t: made.command(law.home, t=t)


def shield(period):
    settings = ShieldSettings(compiled=False)
    made = Shield(ARM, period, settings, limits=LIMITS, collisions=False)
    return made, made.command


def call(command, times):
    for t in times:
        command(t)


def now(count):
    """Yield what the machine's clock shows, each time that it is asked."""
    return (time.monotonic() for _ in range(count))


@pytest.mark.parametrize("make", [guard, shield])
def test_a_loop_in_real_time_that_is_too_slow_is_told_so_once(make):
    """With what would help."""
    made, command = make(SHORT)
    with pytest.warns(UserWarning, match="took longer than the period") as told:
        call(command, now(300))
    (message,) = (str(each.message) for each in told)
    assert message.startswith(f"{make.__name__}: ")
    assert "steps are made by: NumPy; compiled=None or True would help" in message
    assert made.overruns >= 250


@pytest.mark.parametrize("make", [guard, shield])
def test_a_loop_that_simulates_has_time(make):
    """Its overruns are counted all the same."""
    made, command = make(SHORT)
    with warnings.catch_warnings(action="error"):
        call(command, (k * SHORT for k in range(60)))
    assert made.overruns == 60
    # Of most of many calls it is told: none of these could command a robot.
    with pytest.warns(UserWarning, match="longer than the period"):
        call(command, (k * SHORT for k in range(60, 300)))
    patient, command = make(LONG)
    with warnings.catch_warnings(action="error"):
        call(command, (k * LONG for k in range(20)))
    assert patient.overruns == 0


def test_commands_of_a_process_that_are_too_late_are_told_as_soon_after_an_hour_without():
    times = CallTimes("shield", 1.0, lambda: "NumPy")

    def note(count, *, is_late):
        for _ in range(count):
            times.note(time.perf_counter(), 0.0, is_real=True, is_late=is_late)

    with warnings.catch_warnings(action="error"):
        note(20000, is_late=False)
    with pytest.warns(UserWarning, match=r"^shield: 0 of .*, and \d+ commands came too late"):
        note(60, is_late=True)

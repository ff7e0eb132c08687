"""Calls of `command` that take longer than their period are counted, and told once."""

import time
import warnings

import pytest

from drake_rnn import Guard, JointStream, Shield, ShieldSettings, load_arm

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


@pytest.mark.parametrize("make", [guard, shield])
def test_a_loop_in_real_time_that_is_too_slow_is_told_so_once(make):
    """With what would help."""
    made, command = make(SHORT)
    with pytest.warns(UserWarning, match="took longer than the period") as told:
        for _ in range(120):
            command(time.monotonic())
    (message,) = (str(each.message) for each in told)
    assert message.startswith(f"{make.__name__}: ")
    assert "steps are made by: NumPy; compiled=None or True would help" in message
    assert made.overruns >= 100


@pytest.mark.parametrize("make", [guard, shield])
def test_a_loop_that_simulates_has_time(make):
    """Its overruns are counted all the same."""
    made, command = make(SHORT)
    with warnings.catch_warnings(action="error"):
        for k in range(60):
            command(k * SHORT)
    assert made.overruns == 60
    # Of most of many calls it is told: none of these could command a robot.
    with pytest.warns(UserWarning, match="longer than the period"):
        for k in range(60, 300):
            command(k * SHORT)
    patient, command = make(LONG)
    with warnings.catch_warnings(action="error"):
        for k in range(20):
            command(k * LONG)
    assert patient.overruns == 0

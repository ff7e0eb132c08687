"""The next step of a stop of all joints, in plain numbers: for loops that NumPy is too slow for."""

from __future__ import annotations

from collections.abc import Sequence
from math import copysign

from . import joint_stop

# Speed and acceleration at which a joint rests [rad/s, rad/s^2].
_REST, _EVEN = 1e-12, 1e-6


def stop_step(
    v: Sequence[float],
    a: Sequence[float],
    most: Sequence[float],
    jerk: Sequence[float] | None,
    period: float,
) -> tuple[list[float], list[float]]:
    """Return velocities and accelerations of joints after a period of their fastest stop.

    It is the first step of `drake_rnn.robot.jerk_stop` or, without a bound of the jerk, of
    `drake_rnn.robot.held_stop`: the point that is known to lie in the box of a law that leaves
    itself this stop.

    Args:
        v: Velocities held until now, n of them [rad/s].
        a: Accelerations that led to them, n [rad/s^2], at most ``most`` where the jerk is bounded.
        most: Largest accelerations, n [rad/s^2].
        jerk: Largest jerks, n [rad/s^3]; None for none.
        period: Time for which a velocity is held [s].
    """
    speeds, changes = [], []
    for i, (speed, bound) in enumerate(zip(v, most, strict=True)):
        if jerk is None:
            left = max(abs(speed) - period * bound, 0.0)
            after, first = copysign(left, speed), (copysign(left, speed) - speed) / period
        else:
            first = _first(speed, a[i], bound, jerk[i] * period, period)
            after = speed + period * first
        if abs(after) < _REST and (jerk is None or abs(first) < _EVEN):
            after = 0.0
            first = first if jerk is None else 0.0
        speeds.append(after)
        changes.append(first)
    return speeds, changes


def _first(v: float, a: float, most: float, step: float, period: float) -> float:
    """Return the first acceleration of a stop, as `drake_rnn.robot.jerk_stop.Course.first`."""
    mirror, _, x, steps, longest, last = joint_stop.course(v, a, most, step, period)
    later = -most / step if longest > 0.0 else -last
    return mirror * (x - 1.0 if steps > 0.0 else later) * step

r"""The fastest stop of one joint whose jerk is bounded, in plain numbers.

The algebra is that of `drake_rnn.robot.jerk_stop`, in the same order, so that each result has the
same bits. For the joints of one robot it takes a tenth of the time: NumPy's overhead of a call is
that of a hundred operations on numbers, and most joints need none of the further counts that are
tried for all.

Velocities are in units of h d and accelerations in units of d where that is said.
"""

from __future__ import annotations

from math import copysign, sqrt

#: Whole steps that the count of a short stop's first periods may be off by, nearest first.
OFF = tuple(sorted(range(-3, 4), key=abs))
#: Share of one more than the acceleration that rounding may take a count off by.
SLACK = 1e-9

#: The phases of a stop: periods in which the acceleration falls by a step, periods at the largest
#: deceleration that follow, and the deceleration of the one period in between, in units of d.
Phases = tuple[float, float, float]


def gained(x: float) -> float:
    """Return T of an acceleration in units of d; zero of a negative one."""
    if not x > 0.0:
        return 0.0
    p = x // 1.0
    return (p + 1.0) * x - 0.5 * p * (p + 1.0)


def gaining(y: float) -> float:
    """Return the inverse of T, of a velocity in units of h d, >= 0."""
    p = 0.5 * (sqrt(1.0 + 8.0 * y) - 1.0) // 1.0
    return y / (p + 1.0) + 0.5 * p


def course(
    v: float, a: float, most: float, step: float, period: float
) -> tuple[float, float, float, float, float, float]:
    """Return mirror, velocity, acceleration in units of d, and phases, as if mirrored where it is.

    Args:
        v: Velocity held until now [rad/s].
        a: Acceleration that led to it [rad/s^2], at most ``most``.
        most: Largest acceleration [rad/s^2].
        step: Largest change of the acceleration in a period, d [rad/s^2].
        period: Time for which a velocity is held, h [s].
    """
    x, slow = a / step, -v / (period * step)
    # Where the acceleration alone, brought to zero, leaves the joint too slow, all is mirrored.
    mirror = -1.0 if slow > copysign(gained(abs(x) - 1.0), x) else 1.0
    x = mirror * x
    return mirror, mirror * v, x, *_phases(x, mirror * slow, most / step)


def _phases(x: float, slow: float, most: float) -> Phases:
    """Return the phases of a stop that is not mirrored.

    Args:
        x: Acceleration that led to the velocity, in units of d.
        slow: The velocity held until now with its sign changed, in units of h d.
        most: Largest acceleration, in units of d.
    """
    p = max((x + most) // 1.0, 0.0)
    left = p * x - 0.5 * p * (p + 1.0) - slow
    full = gained(most)
    m = max(-((full - left) / most // 1.0), 0.0)
    y = min(most, gaining(max(left - m * most, 0.0)))
    # The second condition catches a stop that is not long enough for the largest deceleration.
    if left > full - most and (m > 0.0 or y >= p - x - 1.0):
        return p, m, y
    return _short(x, slow)


def _short(x: float, slow: float) -> Phases:
    """Return the phases of a stop that never reaches the largest deceleration."""
    least = max(x // 1.0, 0.0)
    square = max(0.5 * x * x - 0.5 * x + 0.25 - slow, 0.0)
    guess = max((x + sqrt(square)) // 1.0, least)
    slack = SLACK * (1.0 + abs(x))
    for step in OFF:
        p = guess + step
        left = p * x - 0.5 * p * (p + 1.0) - slow
        if p >= least and left >= -slack:
            y = gaining(max(left, 0.0))
            if p - x - 1.0 - slack <= y <= p - x + 1.0 + slack:
                return p, 0.0, y
    return guess, 0.0, 0.0


def turn(v: float, x: float, steps: float, change: float) -> float:
    """Return the number of periods after which a joint turns, zero where it does not.

    Args:
        v: Velocity held until now [rad/s].
        x: Acceleration that led to it, in units of d.
        steps: Periods in which the acceleration falls by a step.
        change: Change of the velocity in a period by a step of the acceleration, h d [rad/s].
    """
    if not (v < 0.0 and x > 0.0):
        return 0.0
    half = x - 0.5
    root = sqrt(max(half * half + 2.0 * v / change, 0.0))
    return min(max((half - root) // 1.0, 0.0), steps)


def end(v: float, x: float, of: Phases, most: float, step: float, period: float) -> float:
    """Return how far a joint has gone when it rests [rad].

    Args:
        v: Velocity held until now [rad/s].
        x: Acceleration that led to it, in units of d.
        of: The phases.
        most: Largest acceleration [rad/s^2].
        step: Largest change of the acceleration in a period, d [rad/s^2].
        period: Time for which a velocity is held, h [s].
    """
    a, (n, m, last) = x * step, of
    gone = way(v, a, -step, n, period)
    v = v + period * (n * a - step * 0.5 * n * (n + 1.0))
    gone = gone + way(v, -most, 0.0, m, period)
    v = v - period * m * most
    v = v - period * last * step
    gone = gone + period * v
    return gone + way(v, -last * step, step, last // 1.0, period)


def way(v: float, a: float, change: float, n: float, h: float) -> float:
    """Return how far a joint gets in n periods [rad].

    Args:
        v: Velocity before them [rad/s].
        a: Acceleration before them [rad/s^2].
        change: Change of the acceleration from each to the next [rad/s^2].
        n: Their number.
        h: Length of a period [s].
    """
    rise = a * n * (n + 1.0) / 2.0 + change * n * (n + 1.0) * (n + 2.0) / 6.0
    return h * (n * v + h * rise)

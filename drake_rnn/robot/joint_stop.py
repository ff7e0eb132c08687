r"""The fastest stop of a joint whose jerk is bounded, and its envelope, in plain numbers.

The algebra is that of `drake_rnn.robot.jerk_stop` and `drake_rnn.robot.velocity_envelope`, in the
same order, so that each result has the same bits. For the joints of one robot it takes a tenth of
the time: NumPy's overhead of a call is that of a hundred operations on numbers, and most joints
need none of the further counts that are tried for all.

`stop_step` is the next step of a stop of all joints, for loops that NumPy is too slow for;
`stop_after` is where a stop has led after any number of samples.

Velocities are in units of h d and accelerations in units of d where that is said.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import copysign, inf, isfinite, sqrt
from typing import NamedTuple

#: Whole steps that the count of a short stop's first periods may be off by, nearest first.
OFF = tuple(sorted(range(-3, 4), key=abs))
#: Share of one more than the acceleration that rounding may take a count off by.
SLACK = 1e-9

#: The phases of a stop: periods in which the acceleration falls by a step, periods at the largest
#: deceleration that follow, and the deceleration of the one period in between, in units of d.
Phases = tuple[float, float, float]


def time_gain(x: float) -> float:
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
    mirror = -1.0 if slow > copysign(time_gain(abs(x) - 1.0), x) else 1.0
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
    full = time_gain(most)
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
    distance = way(v, a, -step, n, period)
    v = v + period * (n * a - step * 0.5 * n * (n + 1.0))
    distance = distance + way(v, -most, 0.0, m, period)
    v = v - period * m * most
    v = v - period * last * step
    distance = distance + period * v
    return distance + way(v, -last * step, step, last // 1.0, period)


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
    `drake_rnn.robot.jerk_stop`: the point that is known to lie in the box of a law that leaves
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
    mirror, _, x, steps, longest, last = course(v, a, most, step, period)
    later = -most / step if longest > 0.0 else -last
    return mirror * (x - 1.0 if steps > 0.0 else later) * step


# A loss of speed that stops any joint within a sample [rad/s].
_AT_ONCE = 1e9

#: How far a joint has gone [rad], its velocity [rad/s], and the acceleration that led to it.
JointMotion = tuple[float, float, float]


def stop_after(
    v: float, a: float, most: float, jerk: float | None, period: float, samples: float
) -> JointMotion:
    """Return where the fastest stop of a joint has led after some samples.

    It is the stop that is certified with each command, and that a robot goes on along to which no
    further command comes.

    Args:
        v: Velocity held until now [rad/s].
        a: Acceleration that led to it [rad/s^2], at most ``most`` where the jerk is bounded.
        most: Largest acceleration [rad/s^2]; may be infinite.
        jerk: Largest jerk [rad/s^3]; None for none.
        period: Time for which a velocity is held [s].
        samples: Whole number of samples since then.
    """
    if samples <= 0.0:
        return 0.0, v, a
    if jerk is not None:
        return _jerk_stop_after(v, a, most, jerk * period, period, samples)
    speed, loss = abs(v), min(most * period, _AT_ONCE)
    braking = min(samples, speed / loss // 1.0)
    distance = period * braking * (speed - 0.5 * loss * (braking + 1.0))
    before, after = (max(speed - k * loss, 0.0) for k in (samples - 1.0, samples))
    sign = copysign(1.0, v)
    return sign * distance, sign * after, sign * (after - before) / period


def _jerk_stop_after(
    v: float, a: float, most: float, step: float, period: float, samples: float
) -> JointMotion:
    """Return what `stop_after` does with the jerk bounded; ``step`` is that of `course`."""
    mirror, v, x, p, m, last = course(v, a, most, step, period)
    rise = last // 1.0
    n = min(samples, p)
    distance, a = way(v, x * step, -step, n, period), (x - n) * step
    v = v + period * step * n * (x - 0.5 * (n + 1.0))
    if (n := min(samples - p, m)) > 0.0:
        distance, a = distance + way(v, -most, 0.0, n, period), -most
        v = v - period * n * most
    if (n := min(samples - p - m, 1.0)) > 0.0:
        a, v = -last * step, v - period * last * step
        distance = distance + period * v
    if (n := min(samples - p - m - 1.0, rise)) > 0.0:
        distance, a = distance + way(v, -last * step, step, n, period), (n - last) * step
        v = v - period * step * n * (last - 0.5 * (n + 1.0))
    over = samples - (p + m + 1.0 + rise)
    # Rounding is left of what is zero where it rests.
    v, a = 0.0 if over >= 0.0 else v, 0.0 if over > 0.0 else a
    return mirror * distance, mirror * v, mirror * a


#: Times that an interval of samples is halved; each takes as long as a tenth of all the rest.
HALVINGS = 8
#: More than one, by more than rounding.
ROUNDING = 1.0 + 1e-12


class JointEnvelope(NamedTuple):
    """The envelope of a joint.

    Attributes:
        offset: o [rad/s].
        deceleration: D [rad/s^2]; infinite for none.
    """

    offset: float
    deceleration: float

    def room(self, v: float) -> float:
        """Return the way to the limit that a velocity towards it needs [rad]."""
        speed = max(v, 0.0) + self.offset
        return speed * speed * (0.5 / self.deceleration)


class _Falling(NamedTuple):
    """The steps down of a stop, as if mirrored where it is; see `joint_stop.course`."""

    v: float
    x: float
    steps: float
    step: float
    period: float

    def velocity(self, k: float) -> float:
        return self.v + self.period * self.step * k * (self.x - 0.5 * (k + 1.0))

    def way(self, k: float) -> float:
        return way(self.v, self.x * self.step, -self.step, k, self.period)


def farthest(
    w: float, b: float, envelope: JointEnvelope, most: float, jerk: float, period: float
) -> float:
    """Return the largest H, less q, of a joint that accelerates at b and then stops [rad].

    Args:
        w: Velocity after the acceleration [rad/s].
        b: The acceleration [rad/s^2].
        envelope: The envelope.
        most: Largest acceleration [rad/s^2].
        jerk: Largest jerk [rad/s^3].
        period: Time for which a velocity is held [s].
    """
    d, v = jerk * period, w
    if w > 0.0:
        sign = 1.0 if b > 0.0 else -1.0 if b < 0.0 else 0.0
        v = max(w, -ROUNDING * period * d * sign * time_gain(abs(b) / d - 1.0))
    mirror, v, x, steps, longest, last = course(v, b, most, d, period)
    beyond = -inf
    if mirror > 0.0:
        falling = _Falling(v, x, steps, d, period)
        x_end = end(v, x, (steps, longest, last), most, d, period)
        beyond = max(
            _falling(falling, envelope),
            _longest_hold(falling, longest, envelope, most),
            x_end + _rising(last, envelope, d, period),
        )
    return period * w + max(envelope.room(w), beyond)


def _falling(of: _Falling, envelope: JointEnvelope) -> float:
    """Return a bound of H where the acceleration falls by steps."""
    offset, D = envelope
    x, d, h, steps = of.x, of.step, of.period, of.steps
    share = d / D
    low = min(max(x // 1.0, 0.0), steps)
    high = min(max(-(-(x + D / d) // 1.0), low), steps) if isfinite(D) else steps
    for _ in range(HALVINGS):
        if not low < high:
            break
        middle = -(-0.5 * (low + high) // 1.0)
        v, a = of.velocity(middle), x - middle
        if 2.0 * v + share * a * (2.0 * v - h * d * a + 2.0 * offset) > 0.0:
            low = middle
        else:
            high = middle - 1.0
    return of.way(high) + envelope.room(of.velocity(low))


def _longest_hold(of: _Falling, longest: float, envelope: JointEnvelope, most: float) -> float:
    """Return the largest H at the largest deceleration, from its beginning on."""
    offset, D = envelope
    h, count = of.period, 0.0
    excess, velocity = 1.0 - most / D, of.velocity(of.steps)
    if excess > 0.0:
        mean = most * (offset / D + 0.5 * h) / excess
        count = min(max(((velocity - mean) / (h * most) + 0.5) // 1.0, 0.0), longest)
    way = h * count * (velocity - 0.5 * h * most * (count + 1.0))
    return of.way(of.steps) + way + envelope.room(velocity - h * most * count)


def _rising(last: float, envelope: JointEnvelope, d: float, h: float) -> float:
    """Return a bound of H beyond the end, where the acceleration rises by steps to zero."""
    share = 1.0 / envelope.deceleration
    factor = 1.0 + 2.0 * envelope.offset * share / h
    square = 1.0 - 4.0 * d * share * factor
    steps = first = last // 1.0
    if square > 0.0:
        first = min(steps, 2.0 * factor / (1.0 + sqrt(square)) // 1.0)

    def beyond(z: float) -> float:
        left = h * h * d * (z**3 - z) / 6.0
        return envelope.room(0.5 * h * d * z * (z + 1.0)) - left

    return max(beyond(first), beyond(steps))

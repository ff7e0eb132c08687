r"""The fastest stop of a joint whose jerk is bounded, and the accelerations that leave one.

A velocity is held for a period h, so a joint that accelerates at a has v + h a next and moves by
h (v + h a). From one period to the next its acceleration changes by at most d = J h. With
velocities in units of h d and accelerations in units of d, the stop from acceleration x, as it
returns to zero in whole steps and a rest, gains

.. math::
    T(x) = \sum_{j \ge 0} \max(x - j, 0) = (p + 1) x - \tfrac12 p (p + 1), \quad
    p = \lfloor x \rfloor, \qquad
    T^{-1}(y) = \frac{y}{p + 1} + \frac p2, \quad
    p = \lfloor \tfrac12 (\sqrt{1 + 8 y} - 1) \rfloor.

The stop changes the acceleration by -d for some periods, holds the largest deceleration for some
periods, brakes once in between, and returns to zero by steps of d; or it is the mirror image of
this. After its first period, the rest of a stop is the stop from there. A joint that can stop
within its limits now can therefore do so one period later, and the set of accelerations that allow
it is never empty.

All functions take leading axes of robots, in NumPy or in JAX arrays, and work joint by joint. For
the joints of one robot a stop is worked out in plain numbers, with the same bits, see
`drake_rnn.robot.joint_stop`.

Where joints pass that accelerate for a period, and then stop as fast as their jerk allows.

The stop is the one above: steps of the acceleration, some periods of the
largest deceleration, one that is less, and steps back to zero. A joint that moves away from where
it accelerates to turns once on the way.

The fastest stop of joints whose velocities are held, and whose accelerations are bounded.

A velocity w is held for a period h; then each joint loses a h of its speed at every sample, until
it rests. After k samples, with m = min(k - 1, floor(|w| / (a h))), it is

.. math::
    (m + 1) h |w| - \tfrac12 m (m + 1) a h^2

from where it was. After its first sample, what is left of a stop is the stop from there.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..arrays.algebra import AnyArray, clip, functions_of, is_one
from ..inputs.fields import Array
from . import joint_stop
from .sides import Bound, Sides

# Joints up to which plain numbers are faster than arrays.
_FEW = 32


def time_gain(x: AnyArray) -> AnyArray:
    """Return T of accelerations in units of d, shape (..., n); zero of negative ones."""
    xp = functions_of(x)
    p = xp.floor(xp.maximum(x, 0.0))
    return xp.where(x > 0.0, (p + 1.0) * x - 0.5 * p * (p + 1.0), 0.0)


def gaining(y: AnyArray) -> AnyArray:
    """Return the inverse of T, of velocities in units of h d, shape (..., n); they are >= 0."""
    xp = functions_of(y)
    p = xp.floor(0.5 * (xp.sqrt(1.0 + 8.0 * y) - 1.0))
    return y / (p + 1.0) + 0.5 * p


@dataclass(frozen=True)
class Stop:
    """A joint's fastest stop.

    Attributes:
        first: Acceleration of its first period, shape (..., n) [rad/s^2].
        highest: Largest position from now on, shape (..., n) [rad].
    """

    first: Array
    highest: Array


@dataclass(frozen=True)
class Course:
    """A joint's fastest stop, phase by phase; all as if mirrored where it is.

    Attributes:
        mirror: -1 where all is mirrored, 1 elsewhere, shape (..., n).
        v: Velocity held until now, shape (..., n) [rad/s].
        x: Acceleration that led to it, in steps, shape (..., n).
        steps: Periods in which the acceleration falls by a step, shape (..., n).
        longest: Periods at the largest deceleration that follow, shape (..., n).
        last: Deceleration of the one period in between, in steps, shape (..., n).
        most: Largest acceleration, shape (..., n) [rad/s^2].
        step: Largest change of the acceleration in a period, shape (..., n) [rad/s^2].
        period: Time for which a velocity is held [s].
    """

    mirror: Array
    v: Array
    x: Array
    steps: Array
    longest: Array
    last: Array
    most: Array
    step: Array
    period: float

    @property
    def first(self) -> Array:
        """Acceleration of its first period, shape (..., n) [rad/s^2]."""
        xp = functions_of(self.x)
        later = xp.where(self.longest > 0.0, -self.most / self.step, -self.last)
        return self.mirror * xp.where(self.steps > 0.0, self.x - 1.0, later) * self.step

    @cached_property
    def samples(self) -> Array:
        """Number of periods until the joint rests, shape (..., n)."""
        return self.steps + self.longest + 1.0 + functions_of(self.last).floor(self.last)

    @cached_property
    def turn(self) -> Array:
        """Number of periods after which it turns, zero where it does not, shape (..., n)."""
        xp, x = functions_of(self.x), self.x
        turns = (self.v < 0.0) & (x > 0.0)
        fall = xp.where(turns, 2.0 * self.v / (self.period * self.step), 0.0)
        with np.errstate(invalid="ignore"):
            root = xp.sqrt(xp.maximum((x - 0.5) ** 2 + fall, 0.0))
        return xp.where(turns, clip(xp.floor(x - 0.5 - root), 0.0, self.steps), 0.0)

    @cached_property
    def ends(self) -> tuple[Any, Any]:
        """How far it is where it turns, and where it rests, shape (..., n) each [rad]."""
        if not are_few(self.x):
            way = _way(self.v, self.x * self.step, -self.step, self.turn, self.period)
            return self.mirror * way, self.travel(self.samples)
        h, ends = self.period, []
        for sign, v, x, p, m, y, most, d in zip(
            *(part.tolist() for part in (self.mirror, self.v, self.x)),
            *(part.tolist() for part in (self.steps, self.longest, self.last)),
            *(part.tolist() for part in (self.most, self.step)),
            strict=True,
        ):
            turn = joint_stop.turn(v, x, p, h * d)
            way = joint_stop.way(v, x * d, -d, turn, h)
            end = joint_stop.end(v, x, (p, m, y), most, d, h)
            ends.append((sign * way, sign * end))
        turn_ends, ends_row = np.array(ends).T
        return turn_ends, ends_row

    def falling_velocity(self, k: Array) -> Any:
        """Return the velocity after k <= `steps` periods, if not mirrored, (..., n) [rad/s]."""
        return self.v + self.period * self.step * k * (self.x - 0.5 * (k + 1.0))

    def falling_way(self, k: Array) -> Any:
        """Return how far the joint is then, if not mirrored, shape (..., n) [rad]."""
        return _way(self.v, self.x * self.step, -self.step, k, self.period)

    def travel(self, k: Array) -> Any:
        """Return how far the joint is after k periods, shape (..., n) [rad].

        Args:
            k: Whole numbers, that axes of the joints broadcast with.
        """
        xp = functions_of(self.x)
        h, d, p, m = self.period, self.step, self.steps, self.longest
        a = self.x * d
        n = xp.minimum(k, p)
        way = _way(self.v, a, -d, n, h)
        v = self.v + h * (n * a - d * 0.5 * n * (n + 1.0))
        n = clip(k - p, 0.0, m)
        way = way + _way(v, -self.most, 0.0 * d, n, h)
        v = v - h * n * self.most
        n = clip(k - p - m, 0.0, 1.0)
        v = v - n * h * self.last * d
        way = way + n * h * v
        n = clip(k - p - m - 1.0, 0.0, xp.floor(self.last))
        return self.mirror * (way + _way(v, -self.last * d, d, n, h))


def course(v: Array, a: Array, most: Bound, jerk: Array, period: float) -> Course:
    """Return the fastest stop, phase by phase.

    Args:
        v: Velocities held until now, shape (..., n) [rad/s].
        a: Accelerations that led to them, shape (..., n) [rad/s^2], at most ``most``.
        most: Largest accelerations, shape (..., n) [rad/s^2], or those of both directions.
        jerk: Largest jerks, shape (..., n) [rad/s^3].
        period: Time for which a velocity is held [s].
    """
    d, most = jerk * period, braking(v, a, most, jerk, period)
    if are_few(v) and are_few(a):
        joints = zip(v.tolist(), a.tolist(), most.tolist(), d.tolist(), strict=True)
        rows = np.array([joint_stop.course(*joint, period) for joint in joints])
        mirror, v, x, steps, longest, last = rows.T
        return Course(mirror, v, x, steps, longest, last, most, d, period)
    xp = functions_of(v, a)
    x, slow = a / d, -v / (period * d)
    mirror = xp.where(_are_mirrored(x, slow), -1.0, 1.0)
    x, slow = mirror * x, mirror * slow
    return Course(mirror, mirror * v, x, *_phases(x, slow, most / d), most, d, period)


def _are_mirrored(x: Array, slow: Array) -> Any:
    """Return where the acceleration alone, brought to zero, leaves a joint too slow."""
    xp = functions_of(x, slow)
    return slow > xp.sign(x) * time_gain(xp.abs(x) - 1.0)


def braking(v: Array, a: Array, most: Bound, jerk: Array | None, period: float) -> Array:
    """Return the largest accelerations that the fastest stops brake with, shape (..., n) [rad/s^2].

    A stop reaches the bound of one direction alone, however long it is.

    Args:
        v: Velocities held until now, shape (..., n) [rad/s].
        a: Accelerations that led to them, shape (..., n) [rad/s^2].
        most: Largest accelerations, shape (..., n) [rad/s^2], or those of both directions.
        jerk: Largest jerks, shape (..., n) [rad/s^3]; None if they are not bounded.
        period: Time for which a velocity is held [s].
    """
    sides = Sides.of(most)
    if sides.are_one:
        same: Array = sides.up
        return same
    if jerk is None:
        brakes: Array = sides.against(v)
        return brakes
    d = jerk * period
    brakes = sides.toward(_are_mirrored(a / d, -v / (period * d)))
    return brakes


def stop(q: Array, v: Array, a: Array, most: Bound, jerk: Array, period: float) -> Stop:
    """Return the fastest stop.

    Args:
        q: Joint positions, shape (..., n) [rad].
        v: Velocities held until now, shape (..., n) [rad/s].
        a: Accelerations that led to them, shape (..., n) [rad/s^2], at most ``most``.
        most: Largest accelerations, shape (..., n) [rad/s^2], or those of both directions.
        jerk: Largest jerks, shape (..., n) [rad/s^3].
        period: Time for which a velocity is held [s].
    """
    stop_course = course(v, a, most, jerk, period)
    xp = functions_of(q, v, a)
    turn_ends, stop_ends = stop_course.ends
    return Stop(stop_course.first, q + xp.maximum(xp.maximum(stop_ends, turn_ends), 0.0))


def are_few(x: AnyArray) -> bool:
    """Return whether joints, shape (..., n), are those of one robot, in NumPy, and not too many."""
    return is_one(x) and x.size <= _FEW


def _phases(x: Array, slow: Array, most: Array) -> tuple[Array, Array, Array]:
    """Return the periods of steps by -1, those at -``most``, and the deceleration in between."""
    xp = functions_of(x)
    p = xp.maximum(xp.floor(x + most), 0.0)
    left = p * x - 0.5 * p * (p + 1.0) - slow
    full = time_gain(most)
    m = xp.maximum(xp.ceil((left - full) / most), 0.0)
    y = xp.minimum(most, gaining(xp.maximum(left - m * most, 0.0)))
    # The second condition catches a stop that is not long enough for the largest deceleration.
    long = (left > full - most) & ((m > 0.0) | (y >= p - x - 1.0))
    short_p, short_y = _short(x, slow)
    return xp.where(long, p, short_p), xp.where(long, m, 0.0), xp.where(long, y, short_y)


def _short(x: Array, slow: Array) -> tuple[Array, Array]:
    """Return periods and deceleration of a stop that never reaches the largest deceleration."""
    xp = functions_of(x)
    least = xp.maximum(xp.floor(x), 0.0)
    square = xp.maximum(0.5 * x * x - 0.5 * x + 0.25 - slow, 0.0)
    guess = xp.maximum(xp.floor(x + xp.sqrt(square)), least)
    best, best_y, is_short = guess, xp.zeros_like(guess), guess < 0.0
    # The guess is exact for infinitely small steps. With whole steps it was off by at most two in
    # all tests; the nearest count that fits is taken.
    for step in joint_stop.OFF:
        p = guess + step
        left = p * x - 0.5 * p * (p + 1.0) - slow
        y = gaining(xp.maximum(left, 0.0))
        slack = joint_stop.SLACK * (1.0 + xp.abs(x))
        fits = (p >= least) & (left >= -slack) & (y >= p - x - 1.0 - slack)
        fits = fits & (y <= p - x + 1.0 + slack) & ~is_short
        best, best_y = xp.where(fits, p, best), xp.where(fits, y, best_y)
        is_short = is_short | fits
    return best, best_y


def _way(v: Array, a: Array, s: Array, n: Array, h: float) -> Any:
    return h * (n * v + h * (a * n * (n + 1.0) / 2.0 + s * n * (n + 1.0) * (n + 2.0) / 6.0))


@dataclass(frozen=True, eq=False)
class HeldJerkStop:
    """The fastest stop of n joints that have a velocity and an acceleration.

    Attributes:
        v: Velocities held until now, shape (n,) [rad/s].
        acceleration: Bounds, shape (n,) [rad/s^2], or those of both directions.
        jerk: Bounds, shape (n,) [rad/s^3].
        period: Time for which a velocity is held [s].
    """

    v: Array
    acceleration: Bound
    jerk: Array
    period: float

    @property
    def largest(self) -> Array:
        """By how much velocities change at most, shape (n,) [rad/s^2]."""
        most: Array = Sides.of(self.acceleration).largest
        return most

    def samples(self, b: Array) -> Any:
        """Return after how many samples all joints rest that accelerate at b, shape (n,), first."""
        most = self._course(b).samples.max()
        return (float(most) if isinstance(most, np.generic) else most) + 1.0

    def way(self, b: Array) -> Array:
        """Return how far each joint gets from where it is at most, shape (n,) [rad]."""
        stop = self._course(b)
        travel_in_period = self.period * (self.v + self.period * b)
        turn_ends, stop_ends = stop.ends
        xp = functions_of(travel_in_period)
        ways = xp.maximum(abs(travel_in_period + turn_ends), abs(travel_in_period + stop_ends))
        return xp.maximum(abs(travel_in_period), ways)

    def travel(self, b: Array, k: Array) -> Array:
        """Return how far the joints have gone after k samples, shape (s, n) [rad].

        Args:
            b: Accelerations in the first of them, shape (n,) [rad/s^2].
            k: Numbers of samples, at least 0, shape (s,) or (s, n); velocities are held. In arrays
                of JAX they must be whole.
        """
        k = k[:, None] if k.ndim == 1 else k
        if not isinstance(k, np.ndarray):
            return self._after(b, k)
        whole = np.floor(k)
        first_part, part = self._after(b, whole), k - whole
        if not part.any():
            return first_part
        return np.asarray(first_part + part * (self._after(b, whole + 1.0) - first_part))

    def _after(self, b: Array, k: Array) -> Array:
        """Return how far the joints have gone after whole numbers of samples, shape (s, n)."""
        xp = functions_of(k, b)
        first = xp.minimum(k, 1.0) * self.period * (self.v + self.period * b)
        return first + self._course(b).travel(xp.maximum(k - 1.0, 0.0))

    def travel_and_way(self, b: Array, k: Array) -> tuple[Array, Array]:
        """Return what `moved` does, and the way of each joint until then, there and back.

        Args:
            b: Accelerations in the first sample, shape (n,) [rad/s^2].
            k: Numbers of samples, at least 0, shape (s,).

        Returns:
            Both of shape (s, n) [rad].
        """
        xp = functions_of(k, b)
        k = xp.repeat(k[:, None], b.size, axis=1)
        both = xp.concatenate((k, xp.minimum(k, 1.0 + self._course(b).turn)))
        both = self.travel(b, both)
        travel, at_turn = both[: len(k)], both[len(k) :]
        return travel, abs(at_turn) + abs(travel - at_turn)

    def _course(self, b: Array) -> Course:
        if not isinstance(b, np.ndarray) or not isinstance(self.v, np.ndarray):
            return self._traced_course(b)
        # It is asked for the same few again and again, and each takes as long as all the rest.
        key = b.tobytes()
        if key not in self._courses:
            w = self.v + self.period * b
            self._courses[key] = course(w, b, self.acceleration, self.jerk, self.period)
        return self._courses[key]

    def _traced_course(self, b: AnyArray) -> Course:
        """Return the course of accelerations that JAX traces, once of each array of them."""
        same = [each for array, each in self._traced if array is b]
        if not same:
            w = self.v + self.period * b
            same = [course(w, b, self.acceleration, self.jerk, self.period)]
            self._traced.append((b, same[0]))
        return same[0]

    @cached_property
    def _traced(self) -> list[tuple[AnyArray, Course]]:
        return []

    @cached_property
    def _courses(self) -> dict[bytes, Course]:
        return {}


# A loss of speed that stops any joint within a sample [rad/s].
_AT_ONCE = 1e9


@dataclass(frozen=True, eq=False)
class HeldStop:
    """The fastest stop of n joints.

    Attributes:
        acceleration: Their bounds, shape (n,) [rad/s^2], or those of both directions; may be
            infinite.
        period: Time for which a velocity is held [s].
    """

    acceleration: Bound
    period: float

    @property
    def largest(self) -> Array:
        """By how much velocities change at most, shape (n,) [rad/s^2]."""
        most: Array = Sides.of(self.acceleration).largest
        return most

    def after(self, v: Array) -> Array:
        """Return the velocities one sample later, shape (n,) [rad/s].

        Args:
            v: Velocities, shape (n,) [rad/s].
        """
        xp = functions_of(v)
        brakes = Sides.of(self.acceleration).against(v)
        slower = xp.maximum(abs(v) - brakes * self.period, 0.0)
        return _with_sign(slower, v)

    def samples(self, w: Array) -> Any:
        """Return after how many samples all joints rest that have velocities w, shape (n,)."""
        most = self._braking(w).max()
        return (float(most) if isinstance(most, np.generic) else most) + 1.0

    def way(self, w: Array) -> Array:
        """Return how far each joint goes until it rests, shape (n,) [rad]."""
        return self._travel_of(w, self._braking(w))

    def travel(self, w: Array, k: Array) -> Array:
        """Return how far the joints have gone after k samples, shape (s, n) [rad].

        Args:
            w: Velocities in the first of them, shape (n,) [rad/s].
            k: Numbers of samples, at least 0, shape (s,); between two, velocities are held. In
                arrays of JAX they must be whole.
        """
        xp = functions_of(w, k)
        whole, k = xp.floor(k)[:, None], k[:, None]
        distance = self._travel_of(w, xp.minimum(whole - 1.0, self._braking(w)))
        if xp is np and np.count_nonzero(part := k - whole):
            left = np.maximum(abs(w) - whole * self._loss(w), 0.0)
            distance = distance + part * self.period * left
        return _with_sign(distance, w)

    def travel_and_way(self, w: Array, k: Array) -> tuple[Array, Array]:
        """Return what `moved` does, and the way of each joint until then, shape (s, n) [rad].

        None turns on it.
        """
        travel = self.travel(w, k)
        return travel, abs(travel)

    def leverage(self, w: Array, k: Array) -> Array:
        """Return by how much a change of w moves the joints after k samples, shape (s, n) [s].

        Args:
            w: Velocities, shape (n,) [rad/s].
            k: Numbers of samples, at least 1, shape (s,).
        """
        braking = self._braking(w)
        return self.period * (1.0 + functions_of(k, braking).minimum(k[:, None] - 1.0, braking))

    def _braking(self, w: Array) -> Array:
        """Return for how many samples a joint brakes before it rests, shape (n,)."""
        return functions_of(w).floor(abs(w) / self._loss(w))

    def _travel_of(self, w: Array, m: Array) -> Array:
        """Return how far a joint has gone after m + 1 samples, in m of which it braked."""
        half: Array = self._halves.against(w)
        return (m + 1.0) * (self.period * abs(w) - m * half)

    def _loss(self, w: Array) -> Array:
        """Return what joints lose of their speeds in a sample, shape (n,) [rad/s]."""
        loss: Array = self._losses.against(w)
        return loss

    @cached_property
    def _losses(self) -> Sides:
        """What a joint loses of its speed in a sample; a number also where it may stop at once."""

        def loss_of(acceleration: Array) -> Array:
            loss = acceleration * self.period
            return functions_of(loss).minimum(loss, _AT_ONCE)

        return Sides.of(self.acceleration).map(loss_of)

    @cached_property
    def _halves(self) -> Sides:
        return self._losses.map(lambda loss: 0.5 * self.period * loss)


def _with_sign(size: AnyArray, like: AnyArray) -> AnyArray:
    """Return sizes >= 0 with the signs of numbers."""
    xp = functions_of(size, like)
    return np.copysign(size, like) if xp is np else xp.where(like < 0.0, -size, size)

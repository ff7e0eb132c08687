r"""Velocity limits that fall as a joint comes near its position limit, and stops that keep them.

The controllers of some robots bound the velocity by the way r left to the position limit,

.. math::
    v \le -o + \sqrt{2 D r} \quad\Leftrightarrow\quad
    r \ge \frac{(v + o)^2}{2 D} \quad\text{for } v \ge 0,

and downwards as if mirrored: the *envelope* of a joint, with an offset o and a deceleration D. At
rest r must be at least o^2 / 2D, so that part of its range is out of a joint's reach. With

.. math::
    H_i = q_i + \frac{(\max(v_i, 0) + o)^2}{2 D}

a joint keeps its envelope in sample i exactly if H_i is not beyond its position limit, and then it
keeps the position limit, too. v_i is the velocity held until q_i is reached; as q_i >= q_(i - 1)
where v_i > 0, the velocity is within the envelope at both ends of the sample. No square root is
taken, so nothing happens where that of the envelope ends.

**Why the box of the jerk keeps it.** Let c be the first acceleration of the
fastest stop from now (`drake_rnn.robot.jerk_stop`), and v_i(b), q_i(b) what follows where b is
taken first and then the stop from there. Of stops that are not mirrored, which end from above:

1. *The stop is the least of all motions* that keep the bounds of acceleration and jerk and, once it
   has turned, do not go below v = 0. In its steps down and at the largest deceleration its
   acceleration is as small as it may be. From the one deceleration in between on, the acceleration
   rises by whole steps: a motion whose v_i were smaller first there would have a smaller
   acceleration, as its v_(i - 1) is not smaller, and could never catch up before the stop is at
   rest, where it would be below zero.
2. So v_i(b) is the least value of a linear program in which b stands on the right hand side, and
   *convex in b*; by the same argument it rises with b. q_i(b) is a sum of such velocities, and H_i
   of both with positive slopes; the largest H_i is convex in b, too.
3. A b > c leads to such a stop. Of those below c, each v_i(b) <= v_i(c): the accelerations of both
   rise by whole steps, or c is as small as it may be, so that there are none.

So if H keeps the limit after c, it does after every b <= c, and on the chord from c to the largest
acceleration, where H breaks it, up to where the chord meets the limit. What is left of the stop
after its first step is that stop: by induction c keeps the limit in the next sample, and the box is
never empty. At rest c = 0 keeps it where o^2 / 2D are left, and nowhere else: a start nearer to
the limit is refused.

**How many samples have to be looked at.** Let

.. math::
    \delta_i = \frac{2 (H_i - H_{i-1})}{h} = 2 v_i + a_i \frac{v_i + v_{i-1} + 2 o}{D}.

While the acceleration falls and while it is held, delta_i changes its sign once, from above zero to
below: divided by v_i + v_(i - 1) + 2 o its parts both fall. So the sample with the largest H is
found by halving the steps down, of which there are at most 2 A / J h + 1, or is that of those at
the largest deceleration at which delta_i ends to be positive,

.. math:: \tfrac12 (v_i + v_{i-1}) = \frac{A (o + D h / 2)}{D - A}.

Where the acceleration rises again, by steps of d = J h, z of which are left, H is beyond the end of
the stop by

.. math::
    E(z) = \frac{(h d\, T(z) + o)^2}{2 D} - h^2 d \sum_{j \ge 1} T(z - j) .

T is that of `drake_rnn.robot.jerk_stop`. Between whole z it is convex, so never more than at the
nearest two, and over these it rises, falls and rises again, or only rises. Its largest value is at
the first fall or at the most steps there are. For the limits of a Franka FR3 at 1 kHz these are
four steps down and two back. With a bound of the jerk so low that there are more than
2^`HALVINGS` steps down, a bound is taken of the samples between which the largest is.

All functions take leading axes of robots, in NumPy or in JAX arrays, and work joint by joint. For
the joints of one robot `farthest` is worked out in plain numbers, with the same bits, see
`drake_rnn.robot.joint_stop`.

Bounds on the next acceleration that leave a joint a stop within its limits up to the jerk.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..arrays.algebra import clip, differentiable, functions_of, is_one, root
from ..inputs.fields import Array
from . import joint_stop as joint_envelope
from .jerk_stop import Course, are_few, course, gaining, stop, time_gain
from .sides import Bound, Sides


class VelocityEnvelope(NamedTuple):
    """Bounds of the velocities of joints by the ways left to their position limits.

    Attributes:
        offset: o, shape (..., n) [rad/s].
        deceleration: D, shape (..., n) [rad/s^2]; infinite where there is none.
    """

    offset: Array
    deceleration: Array

    def room(self, v: Array) -> Any:
        """Return the ways to the limits that velocities towards them need, shape (..., n) [rad].

        Args:
            v: The velocities, shape (..., n) [rad/s]; those away from the limits count as none.
        """
        xp = functions_of(v, self.offset)
        return (xp.maximum(v, 0.0) + self.offset) ** 2 * (0.5 / self.deceleration)

    def velocities(self, q: Array, position: tuple[Any, Any]) -> tuple[Any, Any]:
        """Return the lowest and the highest velocities, shape (..., n) [rad/s]; infinite without.

        Args:
            q: Joint positions, shape (..., n) [rad].
            position: Lower and upper position limits, shape (..., n) each [rad].
        """
        xp = functions_of(q, self.offset)
        is_there = xp.isfinite(self.deceleration)
        twice = 2.0 * xp.where(is_there, self.deceleration, 1.0)
        rooms = (xp.where(is_there, room, 1.0) for room in (q - position[0], position[1] - q))
        down, up = (
            xp.where(is_there, root(twice * xp.maximum(room, 0.0)) - self.offset, xp.inf)
            for room in rooms
        )
        return -down, up


def farthest(
    w: Array, b: Array, envelope: VelocityEnvelope, most: Array, jerk: Array, period: float
) -> Array:
    """Return the largest H, less q, of a joint that accelerates at b and then stops [rad].

    Args:
        w: Velocities after the acceleration, shape (..., n) [rad/s].
        b: The accelerations, shape (..., n) [rad/s^2].
        envelope: The envelope.
        most: Largest accelerations, shape (..., n) [rad/s^2].
        jerk: Largest jerks, shape (..., n) [rad/s^3].
        period: Time for which a velocity is held [s].
    """
    if are_few(w) and are_few(b):
        envelopes = map(joint_envelope.JointEnvelope, *(part.tolist() for part in envelope))
        joints = zip(w.tolist(), b.tolist(), envelopes, most.tolist(), jerk.tolist(), strict=True)
        return np.array([joint_envelope.farthest(*joint, period) for joint in joints])
    xp, d = functions_of(w, b), jerk * period
    # What is left of a stop from above is one, too, whatever rounding makes of it.
    least = -joint_envelope.ROUNDING * period * d * xp.sign(b) * time_gain(xp.abs(b) / d - 1.0)
    after = course(xp.where(w > 0.0, xp.maximum(w, least), w), b, most, jerk, period)
    falling, holding = _falling(after, envelope), _longest_hold(after, envelope)
    largest = xp.maximum(xp.maximum(falling, holding), _rising(after, envelope))
    # One that stops from below moves away from its upper limit.
    beyond = xp.where(after.mirror > 0.0, largest, -xp.inf)
    return period * w + xp.maximum(envelope.room(w), beyond)


def _falling(after: Course, envelope: VelocityEnvelope) -> Any:
    """Return a bound of H where the acceleration falls by steps."""
    xp, x, h, d = functions_of(after.x), after.x, after.period, after.step
    share = d / envelope.deceleration
    # As long as the acceleration is positive H rises; at -D and below it falls.
    low = xp.clip(xp.floor(x), 0.0, after.steps)
    high = xp.clip(xp.ceil(x + envelope.deceleration / d), low, after.steps)
    for _ in range(joint_envelope.HALVINGS):
        if xp is np and not (low < high).any():
            break
        middle = xp.ceil(0.5 * (low + high))
        v, a = after.falling_velocity(middle), x - middle
        rises = 2.0 * v + share * a * (2.0 * v - h * d * a + 2.0 * envelope.offset) > 0.0
        low, high = (
            xp.where(rises & (low < high), middle, low),
            xp.where(rises | (low >= high), high, middle - 1.0),
        )
    # Between the two the velocity falls.
    return after.falling_way(high) + envelope.room(after.falling_velocity(low))


def _longest_hold(after: Course, envelope: VelocityEnvelope) -> Any:
    """Return the largest H at the largest deceleration, from its beginning on."""
    xp, h, most = functions_of(after.x), after.period, after.most
    D = envelope.deceleration
    excess = 1.0 - most / D
    mean = most * (envelope.offset / D + 0.5 * h) / xp.where(excess > 0.0, excess, 1.0)
    velocity = after.falling_velocity(after.steps)
    count = xp.floor((velocity - mean) / (h * most) + 0.5)
    count = xp.where(excess > 0.0, xp.clip(count, 0.0, after.longest), 0.0)
    way = h * count * (velocity - 0.5 * h * most * (count + 1.0))
    return after.falling_way(after.steps) + way + envelope.room(velocity - h * most * count)


def _rising(after: Course, envelope: VelocityEnvelope) -> Any:
    """Return a bound of H where the acceleration rises by steps to zero."""
    xp, h, d = functions_of(after.x), after.period, after.step
    share = 1.0 / envelope.deceleration
    factor = 1.0 + 2.0 * envelope.offset * share / h
    square = 1.0 - 4.0 * d * share * factor
    fall = 2.0 * factor / (1.0 + xp.sqrt(xp.maximum(square, 0.0)))
    steps = xp.floor(after.last)
    first = xp.where(square > 0.0, xp.minimum(steps, xp.floor(fall)), steps)

    def beyond(z: Array) -> Any:
        left = h * h * d * (z**3 - z) / 6.0
        return envelope.room(0.5 * h * d * z * (z + 1.0)) - left

    return after.travel(after.samples) + xp.maximum(beyond(first), beyond(steps))


# What rounding may make of a velocity at its limit, in steps of the acceleration over a period.
_ROUNDING = 1e-9


# A joint this far beyond a position limit is outside [rad]; nearer is rounding.
_OUTSIDE = 1e-9
# Speed of a joint that comes back: share of its velocity limit, and the largest [rad/s].
_RETURN_SHARE, _RETURN_MOST = 0.2, 0.5


def are_outside(q: Array, position: tuple[Array, Array]) -> tuple[Any, Any]:
    """Return which joints are below their lower and above their upper limit, (..., n) each.

    Args:
        q: Joint positions, shape (..., n) [rad].
        position: Lower and upper position limits, shape (..., n) each [rad].
    """
    return position[0] - q > _OUTSIDE, q - position[1] > _OUTSIDE


def return_speed(velocity: Array) -> Any:
    """Return how fast joints come back from outside their position limits, (..., n) [rad/s].

    Args:
        velocity: Velocity limits, shape (..., n) [rad/s].
    """
    return functions_of(velocity).minimum(_RETURN_SHARE * velocity, _RETURN_MOST)


class JerkLimits(NamedTuple):
    """Limits of joints, their jerk included; any of position and velocity may be infinite.

    Attributes:
        position: Lower and upper position limits, shape (..., n) each [rad].
        velocity, acceleration: Largest magnitudes, shape (..., n) [rad/s, rad/s^2], or those of
            both directions.
        jerk: Largest magnitudes, shape (..., n) [rad/s^3].
        envelope: How much less the velocities may be near the position limits; None without one.
    """

    position: tuple[Array, Array]
    velocity: Bound
    acceleration: Bound
    jerk: Array
    envelope: VelocityEnvelope | None = None

    @property
    def mirrored(self) -> JerkLimits:
        """Those of joints that are mirrored where they are; positions stay as they are."""
        both = Sides.of(self.velocity).mirrored, Sides.of(self.acceleration).mirrored
        return self._replace(velocity=both[0], acceleration=both[1])


def jerk_box(
    q: Array, v: Array, a: Array, limits: JerkLimits, period: float
) -> tuple[Array, Array]:
    """Return the lower and upper accelerations of the next period, shape (..., n) [rad/s^2].

    Between them lies the first acceleration of the fastest stop from now, and after any of them
    there is a stop within the limits, if there is one now. Where a position limit is close, the
    chord between the largest acceleration and that of the stop gives the bound: between these two,
    how far a joint gets is convex in its next acceleration. With an envelope, the way that it needs
    for its velocity counts as gone; the proof is in `drake_rnn.robot.velocity_envelope`.

    A joint that has no such stop, as after samples in which it has held its acceleration, brakes:
    as fast as it may where its stop leads beyond a position limit or the envelope, and until it is
    within its velocity limit again where it is faster. A joint that is outside its position limits
    has no choice: it comes back at the speed of `return_speed`.

    Args:
        q: Joint positions, shape (..., n) [rad].
        v: Velocities held until now, shape (..., n) [rad/s].
        a: Accelerations that led to them, shape (..., n) [rad/s^2].
        limits: The limits.
        period: Time for which a velocity is held [s].
    """
    # Infinite limits give some entries that are not numbers; no such entry is selected.
    with np.errstate(invalid="ignore"):
        return _box(q, v, a, limits, period)


def _box(q: Array, v: Array, a: Array, limits: JerkLimits, period: float) -> tuple[Array, Array]:
    xp = functions_of(q, v, a)
    d, most, velocity = limits.jerk * period, *map(Sides.of, (limits.acceleration, limits.velocity))
    slowest = xp.maximum(-most.down, a - d)
    fastest = xp.minimum(most.up, a + d)
    # Upwards, and downwards as if mirrored.
    room = xp.stack((limits.position[1] - q, q - limits.position[0]))
    bounds: Any
    speeds: Any
    speeds, ends, together = (v, -v), (fastest, -slowest), is_one(fastest)
    if together:
        speeds = np.array(speeds)
        both = velocity.up if velocity.are_one else np.array((velocity.up, velocity.down))
        bounds = _upper(speeds, np.array(ends), both, d, period)
    else:
        of_sides = zip(speeds, ends, (velocity.up, velocity.down), strict=True)
        bounds = [_upper(*each, d, period) for each in of_sides]
    near = room < _long_room(v, a, limits, period)
    if xp is not np or near.any():
        c = course(v, a, most, limits.jerk, period).first
        if together:
            bounds = _held_back_of_one(
                near, bounds, np.array((c, -c)), room, speeds, limits, period
            )
        else:
            sides = zip(near, bounds, (c, -c), room, speeds, strict=True)
            each = zip(sides, (limits, limits.mirrored), strict=True)
            bounds = [_held_back_of_many(*side, own, period) for side, own in each]
    # Without this, rounding could move a bound beyond the jerk limit.
    upper = clip(bounds[0], slowest, fastest)
    lower = xp.minimum(clip(-bounds[1], slowest, fastest), upper)
    below, above = are_outside(q, limits.position)
    if xp is np and not (below | above).any():
        return lower, upper
    speed = velocity.map(return_speed)
    ends = _upper(v, fastest, speed.up, d, period), -_upper(-v, -slowest, speed.down, d, period)
    back = clip(xp.where(below, ends[0], ends[1]), lower, upper)
    return xp.where(below | above, back, lower), xp.where(below | above, back, upper)


#: Rounding of a way [rad], more than that by which the limits of a law lie inside; and of a rate.
ROUNDING_OF_WAY, SHARE_OF_RATE = 1.1e-12, 1.0 + 1e-10


def have_stop(q: Array, v: Array, a: Array, limits: JerkLimits, period: float) -> Any:
    """Return which joints can go on within all limits, with a stop at any time, shape (..., n).

    These are the states from which the box of `jerk_box` leads to others of them.

    Args:
        q: Joint positions, shape (..., n) [rad].
        v: Velocities held until now, shape (..., n) [rad/s].
        a: Accelerations that led to them, shape (..., n) [rad/s^2].
        limits: The limits.
        period: Time for which a velocity is held [s].
    """
    xp, d = functions_of(q, v, a), limits.jerk * period
    most, velocity = Sides.of(limits.acceleration), Sides.of(limits.velocity)
    # What is left of the acceleration still changes the velocity.
    later = v + period * d * xp.sign(a) * time_gain(xp.abs(a) / d - 1.0)
    first = course(v, a, most, limits.jerk, period).first
    with np.errstate(invalid="ignore"):
        up = _way(first, v, limits, period) - (limits.position[1] - q)
        down = _way(-first, -v, limits.mirrored, period) - (q - limits.position[0])
    return (
        (xp.maximum(up, down) <= ROUNDING_OF_WAY)
        & (xp.abs(v) <= velocity.toward(v > 0.0) * SHARE_OF_RATE)
        & (xp.abs(later) <= velocity.toward(later > 0.0) * SHARE_OF_RATE)
        & (xp.abs(a) <= most.toward(a > 0.0) * SHARE_OF_RATE)
    )


def _upper(v: Array, fastest: Array, most: Array, d: Array, period: float) -> Array:
    """Return the accelerations that can be brought to zero before the velocity limit."""
    xp = functions_of(v)
    left = (most - v) / (period * d)
    room = gaining(xp.maximum(differentiable(left), 0.0))
    too_fast = left < -_ROUNDING
    if xp is not np or too_fast.any():
        room = xp.where(too_fast, -gaining(xp.maximum(-left, 0.0)), room)
    return xp.minimum(fastest, xp.where(xp.isfinite(left), d * room, fastest))


def _held_back_of_many(
    near: Array, upper: Array, c: Array, room: Array, v: Array, limits: JerkLimits, period: float
) -> Array:
    """Return the upper accelerations, held back where a joint is ``near`` its position limit.

    Args:
        near: Which joints are, shape (..., n).
        upper: Largest accelerations otherwise, shape (..., n) [rad/s^2].
        c: First accelerations of the stop from now, likewise.
        room: Ways to the position limit, shape (..., n) [rad].
        v: Velocities until now, shape (..., n) [rad/s].
        limits: The limits.
        period: Time for which a velocity is held [s].
    """
    xp = functions_of(upper)
    most = xp.maximum(upper, c)
    ways = (_way(b, v, limits, period) for b in (most, c))
    return xp.where(near, _held_back(most, c, room, *ways), upper)


def _held_back_of_one(
    near: Array, upper: Array, c: Array, room: Array, v: Array, limits: JerkLimits, period: float
) -> Array:
    """Return the same for both sides of one robot, shape (2, n) each.

    Only the joints that are near are looked at, and all that there is to know of them at once:
    calls cost more than numbers. Joint by joint, so that a joint near its limit changes no bit of
    another joint.
    """
    is_mirrored, joints = np.nonzero(near)
    joints = np.concatenate((joints, joints))
    most = Sides.of(limits.acceleration).map(lambda bound: bound[joints])
    if not most.are_one:
        down = np.concatenate((is_mirrored, is_mirrored)) > 0
        most = Sides(most.toward(down), most.toward(~down))
    fewer = limits._replace(
        acceleration=most,
        jerk=limits.jerk[joints],
        envelope=limits.envelope and VelocityEnvelope(*(part[joints] for part in limits.envelope)),
    )
    first, speed = c[near], v[near]
    fastest = np.maximum(upper[near], first)
    both = np.concatenate((fastest, first)), np.concatenate((speed, speed))
    ways = np.split(_way(*both, fewer, period), 2)
    bounds = upper.copy()
    bounds[near] = _held_back(fastest, first, room[near], *ways)
    return bounds


def _held_back(upper: Array, c: Array, room: Array, way: Array, way_of_stop: Array) -> Array:
    """Return the upper accelerations after which the stop keeps position limit and envelope.

    Args:
        upper: Largest accelerations otherwise, at least ``c``, shape (..., n) [rad/s^2].
        c: First accelerations of the stop from now, likewise.
        room: Ways to the position limit, shape (..., n) [rad].
        way: How far up joints get by the first, shape (..., n) [rad].
        way_of_stop: How far up they get by the second, likewise.
    """
    xp = functions_of(upper)
    left = differentiable(room)
    over, at_best = way - left, way_of_stop - left
    # If even the stop from now exceeds the limit, the bound is the stop itself.
    gap = xp.where(over > 0.0, over - at_best, 1.0)
    share = xp.where(gap > 0.0, -at_best / xp.where(gap > 0.0, gap, 1.0), 0.0)
    bounds = c + (upper - c) * xp.clip(share, 0.0, 1.0)
    return xp.where((over > 0.0) & xp.isfinite(room), bounds, upper)


def _way(b: Array, v: Array, limits: JerkLimits, period: float) -> Array:
    """Return how far up a joint gets that accelerates at ``b`` and then stops [rad]."""
    w = v + period * b
    if limits.envelope is not None:
        # What moves up brakes downwards; other stops do not count.
        brakes = Sides.of(limits.acceleration).down
        return farthest(w, b, limits.envelope, brakes, limits.jerk, period)
    after = stop(period * w, w, b, limits.acceleration, limits.jerk, period)
    return after.highest


def _long_room(v: Array, a: Array, limits: JerkLimits, period: float) -> Array:
    """Return a room that no stop needs, whatever the next acceleration is [rad]."""
    xp = functions_of(v, a)
    most, velocity = Sides.of(limits.acceleration), Sides.of(limits.velocity).largest
    ramp = most.largest / limits.jerk + 3.0 * period
    speed = xp.abs(v) + period * most.largest + 0.5 * xp.abs(a) * ramp
    speed = xp.minimum(speed + period * most.largest, velocity + xp.abs(v))
    way = speed * (speed / most.least + 2.0 * ramp)
    return way if limits.envelope is None else way + limits.envelope.room(speed)

"""Bounds on the next acceleration that leave a joint a stop within its limits up to the jerk."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..arrays.algebra import clipped, differentiable, functions_of, is_one
from ..inputs.fields import Array
from .jerk_stop import course, gaining, stop
from .velocity_envelope import VelocityEnvelope, farthest

# What rounding may make of a velocity at its limit, in steps of the acceleration over a period.
_ROUNDING = 1e-9


class JerkLimits(NamedTuple):
    """Limits of joints, their jerk included; any of position and velocity may be infinite.

    Attributes:
        position: Lower and upper position limits, shape (..., n) each [rad].
        velocity, acceleration, jerk: Largest magnitudes, shape (..., n) [rad/s .. rad/s^3].
        envelope: How much less the velocities may be near the position limits; None without one.
    """

    position: tuple[Array, Array]
    velocity: Array
    acceleration: Array
    jerk: Array
    envelope: VelocityEnvelope | None = None


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
    within its velocity limit again where it is faster.

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
    d = limits.jerk * period
    slowest = xp.maximum(-limits.acceleration, a - d)
    fastest = xp.minimum(limits.acceleration, a + d)
    # Upwards, and downwards as if mirrored.
    room = xp.stack((limits.position[1] - q, q - limits.position[0]))
    bounds: Any
    speeds: Any
    speeds, ends, together = (v, -v), (fastest, -slowest), is_one(fastest)
    if together:
        speeds = np.array(speeds)
        bounds = _upper(speeds, np.array(ends), limits.velocity, d, period)
    else:
        bounds = [
            _upper(*each, limits.velocity, d, period) for each in zip(speeds, ends, strict=True)
        ]
    near = room < _long_room(v, a, limits, period)
    if xp is not np or near.any():
        c = course(v, a, limits.acceleration, limits.jerk, period).first
        if together:
            bounds = _held_back_of_one(
                near, bounds, np.array((c, -c)), room, speeds, limits, period
            )
        else:
            sides = zip(near, bounds, (c, -c), room, speeds, strict=True)
            bounds = [_held_back_of_many(*side, limits, period) for side in sides]
    # Without this, rounding could move a bound beyond the jerk limit.
    upper = clipped(bounds[0], slowest, fastest)
    return xp.minimum(clipped(-bounds[1], slowest, fastest), upper), upper


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
    joints = np.nonzero(near)[1]
    joints = np.concatenate((joints, joints))
    fewer = limits._replace(
        acceleration=limits.acceleration[joints],
        jerk=limits.jerk[joints],
        envelope=limits.envelope and VelocityEnvelope(*(part[joints] for part in limits.envelope)),
    )
    first, speed = c[near], v[near]
    most = np.maximum(upper[near], first)
    both = np.concatenate((most, first)), np.concatenate((speed, speed))
    ways = np.split(_way(*both, fewer, period), 2)
    found = upper.copy()
    found[near] = _held_back(most, first, room[near], *ways)
    return found


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
    held = c + (upper - c) * xp.clip(share, 0.0, 1.0)
    return xp.where((over > 0.0) & xp.isfinite(room), held, upper)


def _way(b: Array, v: Array, limits: JerkLimits, period: float) -> Array:
    """Return how far up a joint gets that accelerates at ``b`` and then stops [rad]."""
    w = v + period * b
    if limits.envelope is not None:
        bounds = limits.acceleration, limits.jerk
        return farthest(w, b, limits.envelope, *bounds, period)
    after = stop(period * w, w, b, limits.acceleration, limits.jerk, period)
    return after.highest


def _long_room(v: Array, a: Array, limits: JerkLimits, period: float) -> Array:
    """Return a room that no stop needs, whatever the next acceleration is [rad]."""
    xp = functions_of(v, a)
    ramp = limits.acceleration / limits.jerk + 3.0 * period
    speed = xp.abs(v) + period * limits.acceleration + 0.5 * xp.abs(a) * ramp
    speed = xp.minimum(speed + period * limits.acceleration, limits.velocity + xp.abs(v))
    way = speed * (speed / limits.acceleration + 2.0 * ramp)
    return way if limits.envelope is None else way + limits.envelope.room(speed)

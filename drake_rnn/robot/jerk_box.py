"""Bounds on the next acceleration that leave a joint a stop within its limits up to the jerk."""

from __future__ import annotations

from typing import NamedTuple

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
    upwards = _upper(v, fastest, limits.velocity, d, period)
    downwards = _upper(-v, -slowest, limits.velocity, d, period)
    room = xp.stack((limits.position[1] - q, q - limits.position[0]))
    near = room < _long_room(v, a, limits, period)
    if xp is not np or near.any():
        c = course(v, a, limits.acceleration, limits.jerk, period).first
        upwards = _before_end(near[0], upwards, c, room[0], v, limits, period)
        downwards = _before_end(near[1], downwards, -c, room[1], -v, limits, period)
    # Without this, rounding could move a bound beyond the jerk limit.
    upper = clipped(upwards, slowest, fastest)
    return xp.minimum(clipped(-downwards, slowest, fastest), upper), upper


def _upper(v: Array, fastest: Array, most: Array, d: Array, period: float) -> Array:
    """Return the accelerations that can be brought to zero before the velocity limit."""
    xp = functions_of(v)
    left = (most - v) / (period * d)
    room = gaining(xp.maximum(differentiable(left), 0.0))
    too_fast = left < -_ROUNDING
    if xp is not np or too_fast.any():
        room = xp.where(too_fast, -gaining(xp.maximum(-left, 0.0)), room)
    return xp.minimum(fastest, xp.where(xp.isfinite(left), d * room, fastest))


def _before_end(
    near: Array, upper: Array, c: Array, room: Array, v: Array, limits: JerkLimits, period: float
) -> Array:
    """Return the upper accelerations, held back where a joint is ``near`` its position limit.

    Joint by joint, so that a joint near its limit changes no bit of another joint. The other
    arguments are those of `_held_back`.
    """
    if not is_one(upper):
        held = _held_back(upper, c, room, v, limits, period)
        return functions_of(upper).where(near, held, upper)
    # Of one robot only the joints that are near are looked at.
    if not near.any():
        return upper
    fewer = limits._replace(
        acceleration=limits.acceleration[near],
        jerk=limits.jerk[near],
        envelope=limits.envelope and VelocityEnvelope(*(part[near] for part in limits.envelope)),
    )
    found = upper.copy()
    found[near] = _held_back(upper[near], c[near], room[near], v[near], fewer, period)
    return found


def _held_back(
    upper: Array, c: Array, room: Array, v: Array, limits: JerkLimits, period: float
) -> Array:
    """Return the upper accelerations after which the stop keeps position limit and envelope.

    Args:
        upper: Largest accelerations otherwise, shape (..., n) [rad/s^2].
        c: First accelerations of the stop from now, likewise.
        room: Ways to the position limit, shape (..., n) [rad].
        v: Velocities until now, shape (..., n) [rad/s].
        limits: The limits.
        period: Time for which a velocity is held [s].
    """
    xp = functions_of(upper)
    upper = xp.maximum(upper, c)
    way = differentiable(room)
    over, at_best = (_way(b, v, limits, period) - way for b in (upper, c))
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

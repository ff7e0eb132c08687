"""Braking in time: a velocity is cut only where its joint could not stop before a limit any more.

A velocity that is bounded in proportion to the way left, as by `JointLimits.velocity_box`, keeps a
position limit only if it follows that bound at once. One whose acceleration is bounded may come too
fast, however its network computes it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ...arrays.algebra import clipped, differentiable, functions_of, is_one
from ...inputs.fields import Array
from ...robot.limits import JointLimits
from .bounded_velocity import inner_limits

# Ratio of the velocity allowed per radian, close to a limit, to that of the velocity box: so much
# larger that a network which keeps to the box never notices it.
_STIFFER = 10.0


@dataclass(frozen=True)
class Braking:
    """Position limits kept by joints with a bounded acceleration.

    Attributes:
        limits: Limits of the joints.
        acceleration: Largest acceleration of each joint, shape (..., n) [rad/s^2].
        stiffness: Velocity that the law's velocity box allows per radian left [1/s].
    """

    limits: JointLimits
    acceleration: Array
    stiffness: Any

    def held(self, v: Array, before: Array, q: Array, period: float) -> Array:
        """Return the velocity to hold for a period; ``v`` itself wherever it allows to stop.

        From a state in which each joint could stop, as from rest, each can after the period.

        Args:
            v: Velocity that is wanted, shape (..., n) [rad/s].
            before: Velocity held until now, which is changed at the largest acceleration or less.
            q: Joint positions at the beginning of the period, shape (..., n) [rad].
            period: Time for which the velocity is held [s].
        """
        # Far enough from its limits for any way of sampling, a joint needs no closer look.
        xp = functions_of(v, q)
        room = xp.minimum(q - self._inner.position_lower, self._inner.position_upper - q)
        fast = xp.abs(v) + self.acceleration * (period / 2.0)
        far = fast * fast < 2.0 * self.acceleration * room
        if xp is np and far.all():
            return v
        lower, upper = self._inner.stopping_box(q, period, self.acceleration)
        cut = clipped(v, lower, upper)
        reach = self.acceleration * period
        free = (cut == v) | far.all(axis=-1, keepdims=True)
        if xp is np and free.all():
            return v
        return xp.where(free, v, xp.clip(cut, before - reach, before + reach))

    def is_idle(self, lower: Array, upper: Array, period: float) -> bool:
        """Return whether `held` would change nothing, at hardly any cost; False if in doubt.

        It is in doubt about all but one robot alone.

        Args:
            lower: Lower end of the law's velocity box, shape (n,) [rad/s].
            upper: Its upper end, shape (n,) [rad/s].
            period: Time for which a velocity is held [s].
        """
        # Where the box is the velocity limit on both sides, the way left is at least velocity over
        # stiffness. Comparing lists of a few numbers is faster than arrays.
        return (
            is_one(upper)
            and period <= self._longest_period
            and upper.tolist() == self._fastest
            and lower.tolist() == self._slowest
        )

    def rate(self, v_dot: Array, v: Array, q: Array) -> Array:
        """Return the acceleration, cut where a joint could not stop before a limit any more.

        The speed allowed is that of braking at the bound, and in proportion to the way left on the
        last bit of it. It is approached at the rate of the same stiffness, so that an integrator
        sees no jump.

        Args:
            v_dot: Acceleration that is wanted, within its bound, shape (..., n) [rad/s^2].
            v: Velocity, shape (..., n) [rad/s].
            q: Joint positions, shape (..., n) [rad].
        """
        most, k = self.acceleration, _STIFFER * self.stiffness
        to_lower, to_upper = q - self._inner.position_lower, self._inner.position_upper - q
        xp = functions_of(v_dot, q)
        upper = xp.maximum(self._steepest(v, to_upper, k), -most)
        lower = -xp.maximum(self._steepest(-v, to_lower, k), -most)
        return clipped(v_dot, lower, upper)

    def _steepest(self, v: Array, room: Array, k: Any) -> Array:
        """Return the largest acceleration towards a limit, ``room`` [rad] ahead."""
        xp, way = functions_of(room), differentiable(room)
        most = self.acceleration
        last = most / k**2
        with np.errstate(invalid="ignore"):
            braked = xp.sqrt(2.0 * most * xp.maximum(way - last / 2.0, last / 2.0))
            allowed = xp.where(way < last, k * way, braked)
            # How fast what is allowed changes as the joint moves on.
            slope = xp.where(way < last, k, most / xp.maximum(allowed, most / k))
            steepest = k * (allowed - v) - slope * v
        return xp.where(xp.isfinite(room), steepest, np.inf)

    @cached_property
    def _inner(self) -> JointLimits:
        return inner_limits(self.limits)

    @cached_property
    def _fastest(self) -> list[float]:
        return self.limits.velocity.tolist()

    @cached_property
    def _slowest(self) -> list[float]:
        return (-self.limits.velocity).tolist()

    @cached_property
    def _longest_period(self) -> float:
        """Longest period with which any joint stops within velocity / stiffness [s].

        In samples of h it stops within (v + a h / 2)^2 / (2 a).
        """
        v, a = self.limits.velocity, self.acceleration
        with np.errstate(invalid="ignore"):
            longest = 2.0 * (np.sqrt(2.0 * a * v / self.stiffness) - v) / a
        return float(np.nan_to_num(longest, nan=-1.0).min())

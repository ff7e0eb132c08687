r"""What is asked of an end effector along its path: a feed-forward, and a feedback that can brake.

The feed-forward is the secant to the next sample of the path. The feedback is one
that can brake, of the position and, with the orientation held, of the rotation vector.

Where it presses on a surface with the outward normal n, both of the position are those along the
surface alone, and along the normal the tip retreats as the force asks, which can be braked too:

.. math:: b = P_t \left(\frac{p_d(t + h) - p_d(t)}{h}\right) + s(P_t (p_d - p)) + s_n(d - d_d)\, n,
    \qquad P_t = I - n n^T,

with d - d_d how much too deep the tip is for the force that is desired
(`drake_rnn.laws.parts.surface_task`), and s_n the same function s with the gain of the force and
the
largest speed along the normal. The row along the normal has a thousandth of the softness of the
others: a wall that leaves no way to follow the path costs the path, not the force.

The speed at which an error is reduced: in proportion to it, and so that it can be braked.

.. math:: s(e) = \min(\kappa |e|, \sqrt{2 a |e|}, s_{max}) \frac{e}{|e|}

Pixels of points on a tool, which a law that follows positions takes as positions.

A pixel is taken to be so many metres at the tool. That is a guess: where it is wrong by a factor,
the gains of the law are, and its learned Jacobian makes up for all else.

Braking in time: a velocity is cut only where its joint could not stop before a limit any more.

A velocity that is bounded in proportion to the way left, as by `JointLimits.velocity_box`, keeps a
position limit only if it follows that bound at once. One whose acceleration is bounded may come too
fast, however its network computes it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from math import sqrt
from typing import Any

import numpy as np

from ...arrays.algebra import (
    clip,
    differentiable,
    dot,
    functions_of,
    is_one,
    join,
    outer,
    root,
)
from ...inputs.fields import Array
from ...robot.limits import JointLimits
from ...robot.rotation import rotation_error
from ..law import Signals, State
from .bounded_velocity import inner_limits
from .surface_task import SurfaceTask

# Errors below this have no direction worth the name [m or rad].
_TINY = 1e-12


def approach(error: Array, gain: Any, deceleration: Any, limit: Any) -> Array:
    """Return the velocity that reduces an error, shape (..., m).

    Args:
        error: The way to go, shape (..., m) [m or rad].
        gain: Gain kappa [1/s].
        deceleration: Deceleration a at the end of the way [m/s^2 or rad/s^2].
        limit: Largest speed [m/s or rad/s].
    """
    square = dot(error, error)
    if is_one(error):
        length = sqrt(square)
        if length < _TINY:
            return gain * error
        return error * (min(gain * length, sqrt(2.0 * deceleration * length), limit) / length)
    xp = functions_of(error)
    length = root(square)
    far = length >= _TINY
    way = xp.where(far, length, 1.0)
    speed = xp.minimum(xp.minimum(gain * way, xp.sqrt(2.0 * deceleration * way)), limit)
    return error * xp.where(far, speed / way, gain)


def gain_within_jerk(jerk: float, deceleration: float) -> float:
    """Return the largest gain whose changes of speed a bounded jerk can follow [1/s].

    Where the speed begins to fall in proportion to the error, which is 2 a / kappa^2 then, it has
    the second derivative kappa^3 |e| = 2 a kappa. A gain that asks for more leads beyond the target
    and back, for long or without end.

    Args:
        jerk: Largest jerk of the end effector [m/s^3 or rad/s^3].
        deceleration: Deceleration a at the end of the way [m/s^2 or rad/s^2].
    """
    return jerk / (2.0 * deceleration)


# Softness along the normal of a surface that is pressed on, as a share of that along the surface.
_FIRM = 1e-3


@dataclass(frozen=True)
class PathTask:
    """A path that an end effector follows, and a surface that it may press on.

    Attributes:
        kappa: Gain of the feedback [1/s].
        braking: Its deceleration [m/s^2].
        limit: Its largest speed [m/s].
        turn_braking: Its deceleration for the orientation [rad/s^2].
        turn_limit: Its largest speed for the orientation [rad/s].
        turns: Whether the task includes the orientation.
        surface: The surface; None where it does not press.
    """

    kappa: Any
    braking: Any
    limit: Any
    turn_braking: Any
    turn_limit: Any
    turns: bool
    surface: SurfaceTask | None

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of its parts of the state, by name."""
        return {} if self.surface is None else self.surface.shapes

    def init(self, u: Signals, rng: np.random.Generator) -> State:
        """Return its parts of the initial state; see `Component.init`."""
        return {} if self.surface is None else self.surface.init(u, rng)

    def step(
        self, state: State, u: Signals, period: float, since: Array | None
    ) -> tuple[tuple[Array, Array], State]:
        """Return the task velocity of the path and the error, shape (..., m).

        Where it presses, both of the position are those along the surface, of which it knows more
        after this sample of the force. See `Component.step`.

        Args:
            state: Parts of the law's state, by name.
            u: Signals at the sample.
            period: Time until the next sample [s].
            since: Motion of the end effector since it was measured, shape (..., m); None if it is
                measured at once.
        """
        parts = {} if self.surface is None else self.surface.step(state, u, period)[1]
        return self._task_velocity(u, since, period), parts

    def _task_velocity(self, u: Signals, since: Array | None, period: float) -> tuple[Array, Array]:
        """Return the task velocity of the path and the error, shape (..., m)."""
        p_desired = u["p_WE_desired"]
        along, away = (u["p_preview"] - p_desired) / period, p_desired - u["p_WE"]
        if since is not None:
            away = away - since[..., -away.shape[-1] :]
        if self.surface is not None:
            along, away = self.sliding(along, u), self.sliding(away, u)
        if not self.turns:
            return along, away
        R_desired = u["R_WE_desired"]
        turning = rotation_error(R_desired, u["R_preview"]) / period
        rotation = rotation_error(u["R_WE"], R_desired)
        if since is not None:
            rotation = rotation - since[..., :3]
        return join((turning, along)), join((rotation, away))

    def back(self, error: Array) -> Array:
        """Return the task velocity of the feedback of an error, both of shape (..., m)."""
        if not self.turns:
            return approach(error, self.kappa, self.braking, self.limit)
        rotation, away = error[..., :3], error[..., 3:]
        back = approach(away, self.kappa, self.braking, self.limit)
        return join((approach(rotation, self.kappa, self.turn_braking, self.turn_limit), back))

    def part_within(self, rate: Array) -> Any:
        """Return which part of a task velocity the feedback's largest speeds allow, at most 1.

        Args:
            rate: The velocity of a pose, shape (..., 6).

        Returns:
            A number or shape (..., 1).
        """
        xp = functions_of(rate)
        parts = (self.turn_limit, rate[..., :3]), (self.limit, rate[..., 3:])
        most = [limit / xp.maximum(root(dot(each, each)), _TINY) for limit, each in parts]
        return xp.minimum(xp.minimum(*most), 1.0)

    def sliding(self, velocity: Array, u: Signals) -> Array:
        """Return a task velocity without the part along the normal of the surface it presses on.

        Args:
            velocity: The velocity, or an error, shape (..., m).
            u: Signals at the sample.
        """
        if self.surface is None:
            return velocity
        n = u["normal_WE"]
        if velocity.shape[-1] == 3:
            return velocity - dot(n, velocity) * n
        away = velocity[..., 3:]
        return join((velocity[..., :3], away - dot(n, away) * n))

    def weigh(self, softness: Array, u: Signals) -> Array:
        """Return the softness of the rows, that along the normal much smaller, shape (..., m, m).

        Where bounds and what is in the way leave no velocity that does the whole task, the force is
        kept first.

        Args:
            softness: Softness of the rows, with one number for the position, shape (..., m, m).
            u: Signals at the sample.
        """
        if self.surface is None:
            return softness
        n = u["normal_WE"]
        along = join((0.0 * n, n)) if self.turns else n
        return softness - (1.0 - _FIRM) * softness[..., -1:, -1:] * outer(along, along)

    def pressing(
        self, state: Signals, u: Signals, along: Array, back: Array
    ) -> tuple[Array, Array]:
        """Return the velocities of path and feedback, with what the force asks for.

        Args:
            state: Parts of the law's state, by name, with what is known of the surface.
            u: Signals at the sample.
            along: Task velocity of the path, shape (..., m).
            back: That of the feedback, likewise.
        """
        surface = self.surface
        if surface is None:
            return along, back
        n = u["normal_WE"]
        fastest = math.inf if surface.approach_speed is None else surface.approach_speed
        too_deep = surface.depth_error(state, u)
        if isinstance(too_deep, float):
            too_deep = np.array([too_deep])
        rise = approach(too_deep, surface.gain, self.braking, fastest)
        # Without contact nothing of the path is followed.
        slide = surface.unless_lost(state, along[..., -3:], 0.0 * n)
        tip = surface.unless_lost(state, back[..., -3:] + rise * n, n)
        if not self.turns:
            return slide, tip
        return join((along[..., :3], slide)), join((back[..., :3], tip))


#: Signals of pixels, and what they are to a law that follows positions.
PIXELS = {
    "pixels": "p_WE",
    "pixels_desired": "p_WE_desired",
    "pixels_preview": "p_preview",
}
#: Share of the softness that suits errors of positions which suits those of pixels: what turns
#: several points is seen less, and a task as soft as for positions gives that up.
FIRMER = 0.1


def in_metres(u: Signals, pixel_size: Any) -> Signals:
    """Return signals with the positions that pixels are taken to be [m].

    Args:
        u: Signals, of which pixels have the shape (..., 2 k), two for each point.
        pixel_size: What a pixel is taken to be at the tool [m].
    """
    return {**u, **{name: pixel_size * u[pixels] for pixels, name in PIXELS.items()}}


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

    def hold(self, v: Array, before: Array, q: Array, period: float) -> Array:
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
        cut = clip(v, lower, upper)
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
        return clip(v_dot, lower, upper)

    def _steepest(self, v: Array, room: Array, k: Any) -> Array:
        """Return the largest acceleration towards a limit, ``room`` [rad] ahead."""
        xp, way = functions_of(room), differentiable(room)
        most = self.acceleration
        last = most / k**2
        with np.errstate(invalid="ignore"):
            braking_speed = xp.sqrt(2.0 * most * xp.maximum(way - last / 2.0, last / 2.0))
            speed = xp.where(way < last, k * way, braking_speed)
            # How fast what is allowed changes as the joint moves on.
            slope = xp.where(way < last, k, most / xp.maximum(speed, most / k))
            steepest = k * (speed - v) - slope * v
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

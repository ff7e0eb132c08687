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
from collections.abc import Callable, Sequence
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
    matvec,
    outer,
    root,
)
from ...inputs.fields import Array
from ...robot.limits import JointLimits
from ...robot.rotation import rotation_error
from ...robot.task_objectives import RowBlock
from ..law import Signals, State
from .bounded_velocity import Program, inner_limits
from .programs import unbounded_velocity, within_box
from .surface_task import SurfaceTask

# Stands for a speed without a bound.
_UNBOUND = 1e6
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


def _slices(blocks: Sequence[RowBlock]) -> list[tuple[RowBlock, slice]]:
    """Return blocks of rows, each with its place among all rows."""
    placed, begin = [], 0
    for block in blocks:
        placed.append((block, slice(begin, begin + block.size)))
        begin += block.size
    return placed


# Softness of a row at its bound, as a share of that of the rows of values, and the share of the
# deceleration with which it comes there; and both with a bounded jerk. There a firm row whose
# direction turns, as at the edge of a narrow cone, would ask for more than joints can follow.
_FIRM_BOUND, _EARLY = (1e-6, 1e-2), (1.0, 0.2)
# Rounds in which rows at their bounds join the others, and speeds that are the same [m/s, rad/s].
_ROUNDS, _SAME_RATE = 3, 1e-12


@dataclass(frozen=True)
class RowRanges:
    """Rows that are to stay within bounds, and are let alone elsewhere.

    A row goes towards a bound at most as fast as a feedback takes back such a way: in proportion to
    it, and so that it can be braked. Where the velocity of the other rows would be faster, the row
    joins them with this speed, much firmer than they are. Beyond a bound it is led back.

    Attributes:
        objectives: What is known of the rows of all objectives.
        task: Gains of the feedback.
        softness: Softness of the rows of values [m^2].
        lever: Length that makes an angle count like a position [m].
        has_jerk: Whether the jerk of the joints is bounded.
    """

    objectives: tuple[RowBlock, ...]
    task: PathTask
    softness: Any
    lever: Any
    has_jerk: bool

    @cached_property
    def blocks(self) -> tuple[RowBlock, ...]:
        """What is known of each row of a range."""
        return tuple(block for block in self.objectives if block.is_range)

    @cached_property
    def _numbers(self) -> tuple[list[int], list[int]]:
        """Numbers of the rows of values, and of those of ranges."""
        is_range = [block.is_range for block in self.objectives for _ in range(block.size)]
        numbers = range(len(is_range))
        return [k for k in numbers if not is_range[k]], [k for k in numbers if is_range[k]]

    def leave_out(
        self, J: Array, u: Signals, state: State, moved: Array | None
    ) -> tuple[Array, Signals, State, Array | None]:
        """Return the same of the rows of values alone.

        Args:
            J: Jacobian of all rows, shape (..., m, n).
            u: Signals, by name.
            state: Parts of the state, by name.
            moved: How far the rows have come since they were measured, shape (..., m); None for
                what is not late.
        """
        values, _ = self._numbers
        u = {**u, **{name: u[name][..., values] for name in PIXELS.values()}}
        if "J" in u:
            u["J"] = u["J"][..., values, :]
        if "J_hat" in state:
            state = {**state, "J_hat": state["J_hat"][..., values, :]}
        return J[..., values, :], u, state, None if moved is None else moved[..., values]

    def beside(
        self,
        program: Program,
        J: Array,
        x: Array,
        moved: Array | None,
        box: Callable[[Program], tuple[Array, Array]],
    ) -> Program:
        """Return a program with the rows that are at their bounds; others are zero.

        Args:
            program: The program of the rows of values.
            J: Jacobian of all rows, shape (..., m, n).
            x: Their coordinates, shape (..., m).
            moved: See `leave_out`.
            box: Returns the bounds within which a program is solved, shape (..., n) each.
        """
        _, ranges = self._numbers
        J, x = J[..., ranges, :], x[..., ranges]
        if moved is not None:
            x = x + moved[..., ranges]
        xp = functions_of(J)
        low, high = self._speeds(x)
        joined, softness = program, self._beside(program.softness)
        # What the path alone wants is to be what it is without these rows: it tells accelerations.
        free = matvec(J, unbounded_velocity(program.J, program.along, program.g, program.softness))
        edge = counts = 0.0 * x
        for _ in range(_ROUNDS):
            v = within_box(joined.J, joined.b, joined.g, joined.softness, *box(joined))
            rate = matvec(J, v)
            below, above = rate < low - _SAME_RATE, rate > high + _SAME_RATE
            edge = xp.where(below, low, xp.where(above, high, edge))
            counts = xp.where(below | above, 1.0, counts)
            rows = xp.concatenate((program.J, counts[..., None] * J), axis=-2)
            b = join((program.b, counts * edge))
            joined = Program(rows, b, join((program.along, counts * free)), program.g, softness)
        return joined

    def _speeds(self, x: Array) -> tuple[Array, Array]:
        """Return the least and the largest speeds of the rows, shape (..., r) each."""
        xp = functions_of(x)
        lows, highs = [], []
        for number, block in enumerate(self.blocks):
            here, none = x[..., number : number + 1], 0.0 * x[..., number : number + 1]
            low, high = none - _UNBOUND, none + _UNBOUND
            if block.lower is not None:
                low = -self._approach(here - block.lower, block.turns)
            if block.upper is not None:
                high = self._approach(block.upper - here, block.turns)
            lows.append(low)
            highs.append(xp.maximum(low, high))
        return join(lows), join(highs)

    def _approach(self, way: Array, turns: bool) -> Array:
        """Return the speed with which a bound is neared, negative beyond it, shape (..., 1)."""
        task, xp = self.task, functions_of(way)
        braking, limit = task.braking, task.limit
        if turns:
            braking, limit = task.turn_braking, task.turn_limit
        size, braking = abs(way), _EARLY[self.has_jerk] * braking
        speed = xp.minimum(task.kappa * size, xp.minimum(root(2.0 * braking * size), limit))
        return xp.where(way < 0.0, -speed, speed)

    def _beside(self, softness: Array) -> Array:
        """Return the softness of all rows, shape (..., m + r, m + r)."""
        weights = np.array([block.weight for block in self.blocks])
        turning = np.array([1.0 if block.turns else 0.0 for block in self.blocks])
        firm = _FIRM_BOUND[self.has_jerk] * self.softness / weights
        firm = firm * (1.0 - turning + turning / (self.lever * self.lever))
        own = softness.diagonal(axis1=-2, axis2=-1)
        every = join((own, firm + 0.0 * own[..., :1]))
        return every[..., None] * np.eye(every.shape[-1])


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
        rows: What is known of the rows of objectives that have values; None for a position or a
            pose.
    """

    kappa: Any
    braking: Any
    limit: Any
    turn_braking: Any
    turn_limit: Any
    turns: bool
    surface: SurfaceTask | None
    rows: tuple[RowBlock, ...] | None = None

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
        if self.rows is not None:
            return self._of_objectives(error)
        if not self.turns:
            return approach(error, self.kappa, self.braking, self.limit)
        rotation, away = error[..., :3], error[..., 3:]
        back = approach(away, self.kappa, self.braking, self.limit)
        return join((approach(rotation, self.kappa, self.turn_braking, self.turn_limit), back))

    def _of_objectives(self, error: Array) -> Array:
        """Return the same of objectives: of all positions together, of each that turns alone."""
        blocks = _slices(self.rows or ())
        turning = [
            approach(error[..., place], self.kappa, self.turn_braking, self.turn_limit)
            for block, place in blocks
            if block.turns
        ]
        placed = [error[..., place] for block, place in blocks if not block.turns]
        if not placed:
            return join(turning)
        back = approach(join(placed), self.kappa, self.braking, self.limit)
        parts, begin = [], 0
        for block, _ in blocks:
            if block.turns:
                parts.append(turning.pop(0))
            else:
                parts.append(back[..., begin : begin + block.size])
                begin += block.size
        return join(parts)

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

r"""Choosing the velocity of the next sample within bounds to the acceleration, or to the jerk.

With the acceleration bounded, the program's box is that of `JointLimits.held_velocity_box`. With
the jerk bounded, or with an envelope of the velocity, it is made of that of the next acceleration,
`JointLimits.held_acceleration_box`. With a low bound of the jerk this is so narrow that a law which
aims at the velocity alone swings about it: by the time the velocity is reached, the acceleration is
not the path's. So the same program is solved for z, the velocity once
the acceleration has been brought to a reference a_r,

.. math::
    z = v + h a_r + \tau(b - a_r), \qquad \tau(x) = \operatorname{sign}(x) h d T(|x| / d),

over the box that this makes of that of the next acceleration b; T and d = J h are those of
`drake_rnn.robot.jerk_stop`. The reference is the acceleration of the velocities that the program
wants for the path alone, without feedback and without a box.

Limits as a law with a period meets them: a trace inside, and those alone that it can reach.

Names of the limits that a law declares to keep, by what chooses its velocity.

A velocity that is chosen within all bounds, with the stop behind it, keeps all that are known. A
velocity that lags behind targets within a box keeps what its time constant lets it keep.

The box is that of `JointLimits.velocity_box`, with stiffness k. As a mean of targets, the velocity
never exceeds its largest speed. If it follows its target with the time constant tau, the distance s
to a position limit obeys tau s'' + s' + k s >= 0, so that from rest it reaches zero only if that
equation oscillates, for 4 k tau > 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ...arrays.algebra import clip, functions_of, join
from ...inputs.fields import Array
from ...inputs.messages import replace_unchecked
from ...robot.jerk_stop import HeldJerkStop, HeldStop, course, gaining, time_gain
from ...robot.limits import JointLimits
from ...robot.sides import Sides
from ..law import Signals, State
from .programs import unbounded_velocity, within_box


class Program(NamedTuple):
    """What the law wants of the next velocity, see `drake_rnn.laws.parts.programs`.

    Attributes:
        J: Jacobian, shape (..., m, n).
        b: Task velocity, shape (..., m).
        along: Task velocity of the path alone, without feedback, shape (..., m).
        g: Preferred joint velocities, shape (..., n) [rad/s].
        softness: Softness of the rows, a symmetric matrix, shape (..., m, m).
    """

    J: Array
    b: Array
    along: Array
    g: Array
    softness: Array


# A box that is no wider than this leaves no choice [rad/s].
_NARROW = 1e-15


class Choice(Protocol):
    """What a robot may do in the next sample, and where it stops after each.

    What is chosen, u, is the next velocity or, with the jerk bounded, the next acceleration. The
    program is solved for z, which goes along with it joint by joint.
    """

    @property
    def box(self) -> tuple[Array, Array]:
        """Bounds of z, shape (n,) each [rad/s]."""

    @property
    def first(self) -> Array:
        """The u that the fastest stop begins with, shape (n,)."""

    @property
    def first_z(self) -> Array:
        """The z of it, shape (n,) [rad/s]."""

    def variable_of(self, z: Array) -> Array:
        """Return the u of a z, shape (n,)."""

    def clip(self, u: Array) -> Array:
        """Return the nearest u within its bounds, shape (n,)."""

    def apply(self, u: Array) -> tuple[Array, State]:
        """Return the next velocity, shape (n,) [rad/s], and what is kept in the state."""

    @property
    def stop(self) -> HeldStop | HeldJerkStop:
        """Where each u leads."""

    def leverage(self, k: Array) -> Array:
        """Return by how much a change of z moves the joints after k samples, shape (s, n) [s]."""


@dataclass(frozen=True, eq=False)
class VelocityChoice:
    """A `Choice` of the next velocity, which z is too.

    Attributes:
        box: See `Choice.box`.
        v: Velocities until now, shape (n,) [rad/s].
        stop: See `Choice.stop`.
    """

    box: tuple[Array, Array]
    v: Array
    stop: HeldStop

    @cached_property
    def first(self) -> Array:
        """See `Choice.first`."""
        return self.stop.after(self.v)

    @property
    def first_z(self) -> Array:
        """See `Choice.first_z`."""
        return self.first

    def variable_of(self, z: Array) -> Array:
        """See `Choice.variable_of`."""
        return z

    def clip(self, u: Array) -> Array:
        """See `Choice.clip`."""
        return clip(u, *self.box)

    def apply(self, u: Array) -> tuple[Array, State]:
        """See `Choice.apply`."""
        return u, {}

    def leverage(self, k: Array) -> Array:
        """See `Choice.leverage`."""
        return self.stop.leverage(self.first, k)


@dataclass(frozen=True, eq=False)
class AccelerationChoice:
    """A `Choice` of the next acceleration.

    Attributes:
        accelerations: Its bounds, shape (..., n) each [rad/s^2].
        v, a: Velocities and accelerations until now, shape (..., n) [rad/s, rad/s^2].
        reference: Acceleration a_r, shape (..., n) [rad/s^2].
        wanted: Velocities that the program wants for the path alone, shape (..., n) [rad/s].
        limits: Limits of the joints.
        period: Time for which a velocity is held [s].
    """

    accelerations: tuple[Array, Array]
    v: Array
    a: Array
    reference: Array
    wanted: Array
    limits: JointLimits
    period: float

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """See `Choice.box`."""
        least, most = (self._z(a) for a in self.accelerations)
        return least, most

    @cached_property
    def first(self) -> Array:
        """See `Choice.first`."""
        return course(self.v, self.a, self._most, self._jerk, self.period).first

    @cached_property
    def first_z(self) -> Array:
        """See `Choice.first_z`."""
        return self._z(self.first)

    def variable_of(self, z: Array) -> Array:
        """See `Choice.variable_of`."""
        a = self.reference + self._d * _odd(gaining, (z - self._base) / (self.period * self._d))
        return clip(a, *self.accelerations)

    def clip(self, u: Array) -> Array:
        """See `Choice.clip`."""
        return clip(u, *self.accelerations)

    def apply(self, u: Array) -> tuple[Array, State]:
        """See `Choice.apply`."""
        parts = {"a": u, "a_path": self.reference, "v_path": self.wanted}
        return self.v + self.period * u, parts

    @cached_property
    def stop(self) -> HeldJerkStop:
        """See `Choice.stop`."""
        return HeldJerkStop(self.v, self._most, self._jerk, self.period)

    def leverage(self, k: Array) -> Array:
        """See `Choice.leverage`; a mean over the box."""
        (least, most), (lower, upper) = self.box, self.accelerations
        width = most - least
        # Two joints for each, so that both ends of the box are worked out at once.
        v, jerk = (join((x, x)) for x in (self.v, self._jerk))
        brakes = self._most.map(lambda x: join((x, x)))
        ends = HeldJerkStop(v, brakes, jerk, self.period).travel(join((upper, lower)), k)
        change, xp = ends[:, : width.size] - ends[:, width.size :], functions_of(ends)
        return xp.where(width > _NARROW, change / xp.maximum(width, _NARROW), 0.0)

    def _z(self, a: Array) -> Array:
        d = self._d
        return self._base + self.period * d * _odd(time_gain, (a - self.reference) / d)

    @cached_property
    def _base(self) -> Array:
        return self.v + self.period * self.reference

    @cached_property
    def _d(self) -> Array:
        return self._jerk * self.period

    @property
    def _most(self) -> Sides:
        return self.limits.sides("acceleration")

    @property
    def _jerk(self) -> Array:
        return self.limits.require("jerk", "its bound")


@dataclass(frozen=True)
class WithinAcceleration:
    """Limits of position, velocity and, if there are any, of acceleration.

    Attributes:
        limits: Limits of the joints.
    """

    limits: JointLimits

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of its parts of the state, by name."""
        return {}

    def init(self, u: Signals, rng: np.random.Generator) -> State:
        """Return its parts of the initial state; see `Component.init`."""
        return {}

    def resumed(self, state: State, motion: State, elapsed: float | None) -> State:
        """Return its parts of the state after a time in which the law commanded nothing.

        Args:
            state: The parts of the state until then, by name.
            motion: ``commanded`` positions, velocities ``v`` and accelerations ``a`` now, by name.
            elapsed: The time [s]; None if it is not known.
        """
        return {}

    def choice(self, state: State, period: float, program: Program) -> VelocityChoice:
        """Return what one robot may choose from, of the arguments of `step`."""
        v = state["v"]
        box = self.limits.held_velocity_box(state["commanded"], v, period)
        return VelocityChoice(box, v, self._stop(period))

    def _stop(self, period: float) -> HeldStop:
        """Return the fastest stop with velocities held for a period [s]; the last is remembered."""
        if (held_stop := self._stops.get(period)) is None:
            most = self.limits.sides("acceleration", "braking in time")
            self._stops.clear()
            held_stop = self._stops[period] = HeldStop(most, period)
        return held_stop

    @cached_property
    def _stops(self) -> dict[float, HeldStop]:
        return {}

    def step(
        self, state: State, u: Signals, period: float, program: Program
    ) -> tuple[Array, State]:
        """Return the next velocity, shape (..., n) [rad/s]; see `Component.step`.

        It reads the parts ``commanded``, joint positions [rad], and ``v``, the velocities until now
        [rad/s], as well.

        Args:
            state: Parts of the law's state, by name.
            u: Signals at the sample.
            period: Time for which a velocity is held [s].
            program: What is wanted.
        """
        J, b, _, g, softness = program
        box = self.limits.held_velocity_box(state["commanded"], state["v"], period)
        return within_box(J, b, g, softness, *box), {}


@dataclass(frozen=True)
class WithinJerk:
    """Limits of position, velocity, acceleration and jerk.

    Attributes:
        limits: Limits of the joints.
        smoothing: Share of the newest value in the reference of the acceleration.
    """

    limits: JointLimits
    smoothing: Any

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of its parts of the state, by name."""
        n = self.limits.size
        return {"a": (n,), "a_path": (n,), "v_path": (n,)}

    def init(self, u: Signals, rng: np.random.Generator) -> State:
        """Return its parts of the initial state; see `Component.init`."""
        return {name: np.zeros(shape) for name, shape in self.shapes.items()}

    def resumed(self, state: State, motion: State, elapsed: float | None) -> State:
        """Return its parts of the state, as `WithinAcceleration.resumed` does."""
        return {"a": motion["a"]}

    def choice(self, state: State, period: float, program: Program) -> AccelerationChoice:
        """Return what the robots may choose from, of the arguments of `step`."""
        J, _, along, g, softness = program
        v, a = state["v"], state["a"]
        accelerations = self.limits.held_acceleration_box(state["commanded"], v, a, period)
        x = unbounded_velocity(J, along, g, softness)
        newest = self.limits.sides("acceleration").clip((x - state["v_path"]) / period)
        a_r = state["a_path"] + self.smoothing * (newest - state["a_path"])
        return AccelerationChoice(accelerations, v, a, a_r, x, self.limits, period)

    def step(
        self, state: State, u: Signals, period: float, program: Program
    ) -> tuple[Array, State]:
        """Return the next velocity, as `WithinAcceleration.step` does."""
        choice = self.choice(state, period, program)
        z = within_box(program.J, program.b, program.g, program.softness, *choice.box)
        return choice.apply(choice.variable_of(z))


#: Limits that may bound the next velocity; of those that would, the first one here is named.
BOUNDING = ("position", "velocity", "acceleration", "jerk")
# Ends of a box that differ by less are the same [rad/s].
_SAME_END = 1e-12


def bounding_limits(
    limits: JointLimits, q: Array, v: Array, a: Array | None, period: float
) -> tuple[tuple[Array, Array], tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """Return the least and the largest next velocities of one robot, and what bounds each of them.

    An end that would be farther out without the position limits, and their envelope, is bounded by
    these; one that would be without the velocity limit by that. What is left is the acceleration
    that is next at most, of which the limit of the acceleration or that of the jerk is the nearer.

    Args:
        limits: Limits that can be reached, see `reached_limits`.
        q: Joint positions, shape (n,) [rad].
        v: Velocities until now, shape (n,) [rad/s].
        a: Accelerations until now, shape (n,) [rad/s^2]; used if the jerk is bounded.
        period: Time for which a velocity is held [s].

    Returns:
        Both ends, shape (n,) each [rad/s], and numbers of `BOUNDING`, shape (n,) each.
    """
    if limits.jerk is None or a is None:
        nearer = np.full(q.shape, BOUNDING.index("acceleration")), None
        numbers = [nearer[0], nearer[0].copy()]
    else:
        step, by = limits.jerk * period, (BOUNDING.index("acceleration"), BOUNDING.index("jerk"))
        sides = zip((-1.0, 1.0), limits.sides("acceleration"), strict=True)
        numbers = [np.where(most <= step + side * a, *by) for side, most in sides]
    box = _velocity_box(limits, q, v, a, period)
    infinite = np.full(q.shape, np.inf)
    unplaced = replace_unchecked(
        limits,
        position_lower=-infinite,
        position_upper=infinite,
        envelope_offset=None,
        envelope_deceleration=None,
    )
    wider = [_velocity_box(unplaced, q, v, a, period)]
    unbounded = replace_unchecked(unplaced, velocity=infinite, velocity_lower=None)
    wider += [_velocity_box(unbounded, q, v, a, period)]
    inner = box
    for number, outer in enumerate(wider):
        for side, sign in enumerate((-1.0, 1.0)):
            is_wider = sign * (outer[side] - inner[side]) > _SAME_END
            is_first = numbers[side] >= BOUNDING.index("acceleration")
            numbers[side] = np.where(is_wider & is_first, number, numbers[side])
        inner = outer
    return box, (numbers[0], numbers[1])


def _velocity_box(
    limits: JointLimits, q: Array, v: Array, a: Array | None, period: float
) -> tuple[Array, Array]:
    """Return the least and the largest next velocities, shape (n,) each [rad/s]."""
    if limits.jerk is None or a is None:
        return limits.held_velocity_box(q, v, period)
    lower, upper = limits.held_acceleration_box(q, v, a, period)
    return v + period * lower, v + period * upper


def within_limits(limits: JointLimits, smoothing: Any) -> WithinAcceleration | WithinJerk:
    """Return what keeps limits, those of `drake_rnn.laws.parts.bounded_velocity`.

    Args:
        limits: Limits of the joints; with a jerk, it is bounded.
        smoothing: See `WithinJerk`.
    """
    return WithinAcceleration(limits) if limits.jerk is None else WithinJerk(limits, smoothing)


def _odd(of: Any, x: Array) -> Any:
    """Return an odd function, which is given for what is positive."""
    xp = functions_of(x)
    return xp.sign(x) * of(xp.abs(x))


# A joint stops this far before its limit [rad].
_SLACK = 1e-12


def inner_limits(limits: JointLimits) -> JointLimits:
    """Return limits whose position limits are a trace inside of those given.

    Args:
        limits: Limits of the joints, of one robot or of many.
    """
    lower, upper = limits.position_lower, limits.position_upper
    slack = functions_of(lower, upper).minimum(_SLACK, (upper - lower) / 4.0)
    return replace_unchecked(limits, position_lower=lower + slack, position_upper=upper - slack)


# Stands for the infinite acceleration of a joint without limits [rad/s^2].
_NO_BOUND = 1e9


def reached_limits(limits: JointLimits, period: float) -> JointLimits:
    """Return the limits that a box of velocities or accelerations is made of.

    Their acceleration is infinite if none is known, they have no jerk that no change of the
    acceleration in a period can reach, and their position limits are a trace inside of the true
    ones. An envelope of the velocity needs the box with a jerk: it has the largest that can be
    reached then, which bounds nothing.

    Args:
        limits: Limits of the joints.
        period: Time for which a velocity is held [s].
    """
    acceleration = np.inf if limits.acceleration is None else limits.acceleration
    limits_inside = inner_limits(limits).replace(acceleration=acceleration)
    if limits.jerk is None and limits.envelope is None:
        return limits_inside
    # How far a stop goes needs a finite acceleration: what the other limits leave of it.
    farthest = (limits.position_upper - limits.position_lower) / period
    speed = limits.sides("velocity").map(lambda most: np.minimum(most, farthest))
    range_of_speed = speed.down + speed.up

    def reached(bound: Array) -> Array:
        return np.minimum(np.minimum(bound, range_of_speed / period), _NO_BOUND)

    most = limits_inside.sides("acceleration").map(reached)
    change = (most.down + most.up) / period
    jerk = change if limits.jerk is None else np.minimum(limits.jerk, change)
    if (jerk >= change).all() and limits.envelope is None:
        return limits_inside.replace(jerk=None)
    if not most.are_one:
        limits_inside = limits_inside.replace(acceleration_lower=-most.down)
    return limits_inside.replace(acceleration=most.up, jerk=jerk)


def limits_within_bounds(limits: JointLimits) -> tuple[str, ...]:
    """Return the names of the limits that a velocity within all bounds keeps, up to the jerk.

    Args:
        limits: Limits that are known.
    """
    higher = (name for name in ("acceleration", "jerk") if limits.bounds[name] is not None)
    return ("position", "velocity", *higher, *(("envelope",) if limits.envelope else ()))


def kept_with_lag(limit_stiffness: float, time_constant: float) -> tuple[str, ...]:
    """Return the names of the limits that a velocity keeps which lags behind targets in a box.

    Args:
        limit_stiffness: Velocity allowed per radian left to a position limit [1/s].
        time_constant: Time constant of the velocity [s].
    """
    if 4.0 * limit_stiffness * time_constant <= 1.0:
        return ("position", "velocity")
    return ("velocity",)

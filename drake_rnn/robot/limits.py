"""Joint limits, and the bounds on velocity and acceleration that follow from them.

- Where joints may rest: within their position limits, and within the envelope of the velocity.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from numbers import Real
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from ..arrays.algebra import clip, differentiable, functions_of, is_one
from ..errors import InvalidInputError, OldName
from ..inputs.fields import Array, Bounds, validated
from ..inputs.keys import Meaning
from ..inputs.messages import fields_of, short
from .jerk_stop import HeldStop
from .sides import Sides
from .velocity_envelope import (
    ROUNDING_OF_WAY,
    SHARE_OF_RATE,
    JerkLimits,
    VelocityEnvelope,
    are_outside,
    have_stop,
    jerk_box,
    return_speed,
)

#: Limits of the derivatives of the joint positions, first to fifth, and their units.
DERIVATIVE_UNITS = {
    "velocity": "rad/s",
    "acceleration": "rad/s^2",
    "jerk": "rad/s^3",
    "snap": "rad/s^4",
    "crackle": "rad/s^5",
}

#: How far the start may lie outside the position limits for a law that brings it back [rad].
OUTSIDE = 0.2

# Of any derivative, in its unit: what is slower than a micrometre a second does not move.
_LEAST = 1e-6
#: Largest finite bounds of the derivatives: what is larger bounds nothing, and is a slip. Laws
#: have a jerk of up to 2e14 where the acceleration has no bound.
MOST = {"velocity": 1e6, "acceleration": 1e9, "jerk": 1e15, "snap": 1e18, "crackle": 1e21}

#: Fields of bounds downwards by the name of the bound upwards, which is mirrored without them.
LOWER = {"velocity": "velocity_lower", "acceleration": "acceleration_lower"}

# The two fields of a velocity envelope, which go together.
_OFFSET, _DECELERATION = "envelope_offset", "envelope_deceleration"

#: The fields of `JointLimits` and their units for a joint that turns.
FIELD_UNITS = {
    "position_lower": "rad",
    "position_upper": "rad",
    **DERIVATIVE_UNITS,
    **{lower: DERIVATIVE_UNITS[name] for name, lower in LOWER.items()},
    _OFFSET: "rad/s",
    _DECELERATION: "rad/s^2",
}

#: All limits by name and their units; ``position`` stands for its lower and its upper limit, and
#: ``envelope`` for that of the velocity by the position.
LIMIT_UNITS = {"position": "rad", **DERIVATIVE_UNITS, "envelope": "rad/s"}


def _check_most(name: str, bound: Array, most: float) -> None:
    """Raise a ValueError if bounds are finite and of larger magnitude than these."""
    size = np.abs(bound)
    if (np.isfinite(size) & (size > most)).any():
        raise ValueError(
            f"{name}: may be of magnitude {most:g}, or infinite where there is no bound, not "
            f"{bound.tolist()}"
        )


@validated
class JointLimits:
    """Limits of each joint; infinite where a joint has none, None where none is known.

    Bounds on velocity and acceleration take leading axes of robots, in NumPy or in JAX arrays.
    """

    position_lower: Annotated[Bounds, Meaning("Position limits, shape (n,).", unit="rad")]
    position_upper: Annotated[Bounds, Meaning("Position limits, shape (n,).", unit="rad")]
    velocity: Annotated[
        Bounds,
        Meaning(
            "Largest speeds, shape (n,); with velocity_lower, upwards alone.",
            unit="rad/s",
        ),
    ]
    acceleration: Annotated[
        Bounds | None,
        Meaning("Largest magnitudes of the higher derivatives, shape (n,) [rad/s^2 .. rad/s^5]."),
    ] = None
    jerk: Annotated[
        Bounds | None,
        Meaning("Largest magnitudes of the higher derivatives, shape (n,) [rad/s^2 .. rad/s^5]."),
    ] = None
    snap: Annotated[
        Bounds | None,
        Meaning("Largest magnitudes of the higher derivatives, shape (n,) [rad/s^2 .. rad/s^5]."),
    ] = None
    crackle: Annotated[
        Bounds | None,
        Meaning("Largest magnitudes of the higher derivatives, shape (n,) [rad/s^2 .. rad/s^5]."),
    ] = None
    velocity_lower: Annotated[
        Bounds | None,
        Meaning(
            "Lowest velocities, shape (n,), negative; by default those of ``velocity`` mirrored.",
            unit="rad/s",
        ),
    ] = None
    acceleration_lower: Annotated[
        Bounds | None,
        Meaning(
            "Lowest accelerations, shape (n,), negative, which slow down what moves upwards; by "
            "default those of ``acceleration`` mirrored. Bounds of the jerk have no direction.",
            unit="rad/s^2",
        ),
    ] = None
    envelope_offset: Annotated[
        Bounds | None,
        Meaning(
            "Offset o and deceleration D of the envelope of the velocity, shape (n,) [rad/s, "
            "rad/s^2]: at a way r from a position limit, the velocity towards it is at most -o + "
            "sqrt(2 D r), see `drake_rnn.robot.velocity_envelope`. Give both or none; D is "
            "infinite for a joint without an envelope.",
        ),
    ] = None
    envelope_deceleration: Annotated[
        Bounds | None,
        Meaning(
            "Offset o and deceleration D of the envelope of the velocity, shape (n,) [rad/s, "
            "rad/s^2]: at a way r from a position limit, the velocity towards it is at most -o + "
            "sqrt(2 D r), see `drake_rnn.robot.velocity_envelope`. Give both or none; D is "
            "infinite for a joint without an envelope.",
        ),
    ] = None

    def __post_init__(self) -> None:
        names = (*DERIVATIVE_UNITS, *LOWER.values(), _OFFSET, _DECELERATION)
        bounds_given = {name: bound for name in names if (bound := self.bounds[name]) is not None}
        for name, bound in {"position_upper": self.position_upper, **bounds_given}.items():
            if bound.size != self.position_lower.size:
                raise ValueError(
                    f"{name}: must have {self.position_lower.size} entries like position_lower, "
                    f"not {bound.size}"
                )
        is_inverted = ~(self.position_lower < self.position_upper)
        if is_inverted.any():
            joint = int(np.argmax(is_inverted))
            lower, upper = self.position_lower[joint], self.position_upper[joint]
            raise ValueError(
                "position_lower: must be below position_upper, but they are "
                f"{lower:g} and {upper:g} for joint {joint + 1}"
            )
        offset = bounds_given.pop(_OFFSET, None)
        self._check_magnitudes(bounds_given)
        self._check_envelope(offset)

    def _check_magnitudes(self, bounds_given: dict[str, Array]) -> None:
        """Raise a ValueError unless the bounds of derivatives that are given have their signs."""
        for name, lower_name in LOWER.items():
            bound = bounds_given.pop(lower_name, None)
            if bound is not None and self.bounds[name] is None:
                raise ValueError(f"{name}: must be given where {lower_name} is")
            if bound is not None and not (bound <= -_LEAST).all():
                raise ValueError(
                    f"{lower_name}: must be negative, at most {-_LEAST:g}, not {bound.tolist()}"
                )
            if bound is not None:
                _check_most(lower_name, bound, MOST[name])
        for name, bound in bounds_given.items():
            if not (bound > 0).all():
                raise ValueError(f"{name}: must be positive, not {bound.tolist()}")
            if not (bound >= _LEAST).all():
                raise ValueError(f"{name}: must be at least {_LEAST:g}, not {bound.tolist()}")
            _check_most(name, bound, MOST.get(name, np.inf))

    def _check_envelope(self, offset: Array | None) -> None:
        """Raise a ValueError unless an envelope is known as a whole and leaves some positions."""
        values = {_OFFSET: offset, _DECELERATION: self.envelope_deceleration}
        for name, other in ((_OFFSET, _DECELERATION), (_DECELERATION, _OFFSET)):
            if values[name] is None and values[other] is not None:
                raise ValueError(f"{name}: must be given where {other} is")
        if offset is None:
            return
        if not (np.isfinite(offset) & (offset >= 0)).all():
            raise ValueError(f"{_OFFSET}: must be finite and at least 0, not {offset.tolist()}")
        lower, upper = self.resting
        if not (lower < upper).all():
            joint = int(np.argmin(upper - lower))
            raise ValueError(
                f"{_OFFSET}: leaves joint {joint + 1} no position to rest at, with "
                f"{offset[joint]:g} rad/s; it must be smaller, or {_DECELERATION} larger"
            )

    def nearest_turn(self, target: Array, near: Array, endless: NDArray[np.bool_]) -> Array:
        """Return the same target, of joints that turn without end the nearest turn within limits.

        Args:
            target: Positions, shape (..., n) [rad].
            near: Where they are to be near, shape (..., n) [rad].
            endless: Which joints turn without end, shape (n,).
        """
        if not endless.any():
            return target
        lower, upper, turn = self.position_lower, self.position_upper, 2.0 * np.pi
        xp = functions_of(target, near, lower, upper)

        def is_outside(x: Array) -> Any:
            return (x < lower) | (x > upper)

        nearest = target - turn * xp.where(endless, xp.round((target - near) / turn), 0.0)
        for shift in (turn, -turn):
            back = endless & is_outside(nearest) & ~is_outside(nearest + shift)
            nearest = xp.where(back, nearest + shift, nearest)
        result: Array = xp.where(endless & is_outside(nearest), target, nearest)
        return result

    @classmethod
    def unlimited(cls, size: int) -> JointLimits:
        """Return infinite limits for ``size`` joints.

        Raises:
            InvalidInputError: If ``size`` is not a positive whole number.
        """
        if not isinstance(size, int) or isinstance(size, bool) or size < 1:
            raise InvalidInputError(f"size: must be a positive whole number, not {short(size)}")
        infinite = np.full(size, np.inf)
        return cls(position_lower=-infinite, position_upper=infinite, velocity=infinite)

    @cached_property
    def bounds(self) -> Mapping[str, Array | None]:
        """All limits by the name of the field; None where none is known."""
        return fields_of(self)

    def sides(self, name: str, reason: str = "its bound") -> Sides:
        """Return the bounds of a derivative downwards and upwards, as magnitudes.

        Args:
            name: Its name.
            reason: What needs the bound, for the message.

        Raises:
            InvalidInputError: If the limit is not known.
        """
        up = self.require(name, reason)
        lower = self.bounds[LOWER[name]] if name in LOWER else None
        return Sides(up, up) if lower is None else Sides(-lower, up)

    def known_sides(self, name: str) -> Sides | None:
        """Return the same as `sides`; None if the limit is not known."""
        return None if self.bounds[name] is None else self.sides(name)

    def has_sides(self, name: str) -> bool:
        """Return whether a derivative has another bound downwards than upwards."""
        return name in LOWER and self.bounds[LOWER[name]] is not None

    def toward(self, name: str, values: Array) -> Array | None:
        """Return the bounds of a derivative in the directions of its values; None without bounds.

        Args:
            name: Its name.
            values: Its values, shape (..., n).
        """
        sides = self.known_sides(name)
        return None if sides is None else np.asarray(sides.toward(values > 0.0))

    def require_one_bound(self, what: str) -> None:
        """Raise an InvalidInputError if bounds of the two directions differ.

        Args:
            what: What has one bound for both, for the message.
        """
        for name, lower in LOWER.items():
            if self.has_sides(name):
                raise InvalidInputError(
                    f"limits.{lower}: must be left out for {what}, which has one bound of the "
                    f"{name} for both directions; the laws adaptive and joint_stream keep both"
                )

    def mirrored(self, joints: NDArray[np.bool_]) -> dict[str, Array]:
        """Return the fields that change if the positions of some joints count the other way.

        Those of positions are not among them.

        Args:
            joints: Which joints, shape (..., n).
        """
        fields: dict[str, Array] = {}
        for name, lower in LOWER.items():
            if self.has_sides(name):
                sides = self.sides(name)
                fields |= {name: sides.toward(~joints), lower: -sides.toward(joints)}
        return fields

    @property
    def envelope(self) -> VelocityEnvelope | None:
        """How much less the velocities may be near the position limits; None without one."""
        if self.envelope_offset is None or self.envelope_deceleration is None:
            return None
        return VelocityEnvelope(self.envelope_offset, self.envelope_deceleration)

    @property
    def resting(self) -> tuple[Array, Array]:
        """Lowest and highest positions at which a joint may rest, shape (..., n) each [rad].

        These are the position limits, or farther inside where there is an envelope.
        """
        if (envelope := self.envelope) is None:
            return self.position_lower, self.position_upper
        room = envelope.room(0.0 * envelope.offset)
        return self.position_lower + room, self.position_upper - room

    @property
    def size(self) -> int:
        """Number of joints."""
        return self.position_lower.shape[-1]

    def merge(self, bounds: Mapping[str, Any]) -> dict[str, Any]:
        """Return these limits' fields, updated by ``bounds``; a number applies to every joint."""
        fields: dict[str, Any] = dict(self.bounds)
        for name, bound in bounds.items():
            is_number = isinstance(bound, Real) and not isinstance(bound, bool)
            fields[name] = np.full(self.size, float(bound)) if is_number else bound
        return fields

    def replace(self, **bounds: Any) -> JointLimits:
        """Return these limits with the given ones replaced; a number applies to every joint."""
        return JointLimits(**self.merge(bounds))

    def select(self, joints: Sequence[int]) -> JointLimits:
        """Return the limits of some joints, given by their indices."""
        bounds: dict[str, Any] = {
            name: bound[joints] for name, bound in self.bounds.items() if bound is not None
        }
        return JointLimits(**bounds)

    @classmethod
    def beside(cls, one: JointLimits, other: JointLimits) -> JointLimits:
        """Return the limits of the joints of two arms, one after the other.

        A limit that only one of them has is none for the joints of the other.
        """
        bounds: dict[str, Array] = {}
        for name in FIELD_UNITS:
            both = [(each.bounds[name], each.size) for each in (one, other)]
            if all(bound is None for bound, _ in both):
                continue
            none = 0.0 if name == _OFFSET else np.inf
            parts = [np.full(size, none) if bound is None else bound for bound, size in both]
            if name in LOWER.values():
                mirrored = name.removesuffix("_lower")
                parts = [
                    -np.full(each.size, np.inf) if own is None else -each.sides(mirrored).down
                    for each, own in ((each, each.bounds[mirrored]) for each in (one, other))
                ]
            bounds[name] = np.concatenate(parts)
        return cls(**bounds)

    def require(self, name: str, reason: str) -> Array:
        """Return the limit of this name, shape (n,).

        Args:
            name: Name of a field.
            reason: What needs the limit, for the message.

        Raises:
            InvalidInputError: If the limit is not known.
        """
        if name not in self.bounds:
            raise InvalidInputError(
                f"limits.{name}: no such limit; it may be {', '.join(self.bounds)}"
            )
        bound = self.bounds[name]
        if bound is None:
            raise InvalidInputError(
                f"limits.{name}: not known for this arm, but needed for {reason}; give it"
            )
        return bound

    @cached_property
    def _position(self) -> Array:
        return np.stack([self.position_lower, self.position_upper])

    @cached_property
    def _slowest(self) -> Array:
        """Lowest velocities."""
        down: Array = self.sides("velocity").down
        return -down

    def velocity_box(self, q: Array, stiffness: float) -> tuple[Array, Array]:
        """Return the lower and upper velocities that the limits allow, shape (..., n) [rad/s].

        Besides its velocity limit, a joint keeps its position limit: it may approach it at
        ``stiffness`` [1/s] times the remaining distance. From beyond the position limit it returns
        at its largest speed or slower, so the box is never empty.
        """
        if is_one(q):
            box = np.maximum(stiffness * (self._position - q), self._slowest)
            np.minimum(box, self.velocity, out=box)
            return box[0], box[1]
        slowest, fastest = -self.sides("velocity").down, self.velocity
        lower = clip(stiffness * (self.position_lower - q), slowest, fastest)
        return lower, clip(stiffness * (self.position_upper - q), slowest, fastest)

    def _room(self, q: Array) -> Array:
        """Return the ways to the lower and to the upper position limit, shape (2, ..., n) [rad]."""
        if is_one(q):
            return self._position - q
        return functions_of(q).stack((self.position_lower - q, self.position_upper - q))

    def acceleration_box(self, q: Array, v: Array, period: float) -> tuple[Array, Array]:
        """Return bounds on the accelerations of a period after which all limits can still be kept.

        At the end of the period the velocity is within its limit, and if the joint then brakes at
        its acceleration limit, in samples of ``period``, it comes to rest within its position
        limits. From such a state the box is never empty, so limits once kept are always kept. From
        any other state, the box brings the joint back, to rest at the limit that it violates.

        Args:
            q: Joint positions, shape (..., n) [rad].
            v: Joint velocities, shape (..., n) [rad/s].
            period: Time for which the accelerations are held [s].

        Returns:
            Lower and upper accelerations, shape (..., n) [rad/s^2].

        Raises:
            InvalidInputError: If the acceleration limits are not known.
        """
        most = self.sides("acceleration", "braking in time")
        # To come to rest from velocity w, a joint needs the distance w^2 / 2a, and w h / 2 more
        # because it may not stop between samples. With the ramp from v to w before,
        # q + h (v + w) / 2 + w^2 / 2a + w h / 2 must stay below the limit; this is solved for w.
        # Beyond the limit, the same holds for the way back.
        room = self._room(q + period / 2 * v)
        xp = functions_of(room)
        way = differentiable(room)
        with np.errstate(invalid="ignore"):
            square = period**2 + 2.0 * xp.abs(way) / most.against(way)
            ends = 2.0 * way / (period + xp.sqrt(square))
        ends = xp.where(xp.isfinite(room), ends, room)
        slowest, fastest = xp.clip(ends, -self.sides("velocity").down, self.velocity)
        lower = xp.clip((slowest - v) / period, -most.down, most.up)
        upper = xp.clip((fastest - v) / period, -most.down, most.up)
        return lower, upper

    def stopping_box(
        self, q: Array, period: float, acceleration: Array | None = None
    ) -> tuple[Array, Array]:
        """Return the velocities from which a joint can stop within its position limits.

        The velocity is held for a period; after it the joint brakes as hard as it may, in samples
        of ``period``. These are the fastest such velocities, to the last digit: the limits of
        velocity and acceleration do not cut them. From beyond a position limit they lead back, to
        rest at that limit.

        Args:
            q: Joint positions, shape (..., n) [rad].
            period: Time for which a velocity is held [s].
            acceleration: Deceleration of each joint, shape (..., n) [rad/s^2], may be infinite;
                by default its acceleration limit.

        Returns:
            Lower and upper velocities, shape (..., n) [rad/s]; infinite where nothing limits them.

        Raises:
            InvalidInputError: If no acceleration is given, and the limits are not known.
        """
        room = self._room(q)
        brakes = acceleration
        if brakes is None:
            brakes = self.sides("acceleration", "braking in time").against(room)
        xp = functions_of(room)
        # A joint that has w now, then w - a h, w - 2 a h ... down to zero, stops in m + 1 samples,
        # after (m + 1) w h - m (m + 1) / 2 a h^2. That is solved for w, with the m that fits.
        distance = xp.abs(differentiable(room))
        with np.errstate(invalid="ignore"):
            more = xp.floor((xp.sqrt(1.0 + 8.0 * distance / (brakes * period**2)) - 1.0) / 2.0)
            slower = xp.where(more > 0.0, brakes * period * more / 2.0, 0.0)
            fastest = distance / ((more + 1.0) * period) + slower
        ends = xp.where(xp.isfinite(room), xp.copysign(fastest, room), room)
        return ends[0], ends[1]

    def held_velocity_box(self, q: Array, v: Array, period: float) -> tuple[Array, Array]:
        """Return bounds on the velocity held for a period, after which all limits can be kept.

        That is: it is within its limit, the change from ``v`` within that of the acceleration, and
        the joint can still stop within its position limits, see `stopping_box`. From a state in
        which it could stop, as from rest, the box is never empty, so limits once kept are always
        kept. From any other, the acceleration limit comes first, and then the velocity's. A joint
        outside its position limits comes back at the speed of `return_speed`.

        Args:
            q: Joint positions, shape (..., n) [rad].
            v: Velocities held until now, shape (..., n) [rad/s].
            period: Time for which the velocity is held [s].

        Returns:
            Lower and upper velocities, shape (..., n) [rad/s].

        Raises:
            InvalidInputError: If the acceleration limits are not known.
        """
        reach = self.sides("acceleration", "braking in time").map(lambda most: most * period)
        if is_one(q) and self._is_far(q, v, period):
            least, most = v - reach.down, v + reach.up
            return np.maximum(self._slowest, least), np.minimum(self.velocity, most)
        xp, velocity = functions_of(q, v), self.sides("velocity")
        ends = xp.clip(xp.stack(self.stopping_box(q, period)), -velocity.down, velocity.up)
        below, above = are_outside(q, (self.position_lower, self.position_upper))
        if xp is not np or (below | above).any():
            # Never so fast that it could not stop before the other limit.
            speed = velocity.map(return_speed)
            back = xp.where(below, xp.minimum(speed.up, ends[1]), xp.maximum(-speed.down, ends[0]))
            ends = xp.where(below | above, back, ends)
        lower, upper = xp.clip(ends, v - reach.down, v + reach.up)
        return lower, upper

    def _is_far(self, q: Array, v: Array, period: float) -> bool:
        """Return whether one robot's joints could stop from any velocity that they may have next.

        Then its position limits bound none of them.
        """
        # Plain floats: NumPy's overhead would take as long as all of the box.
        for x, w, (lower, upper, most, brakes, fastest, slowest) in zip(
            q.tolist(), v.tolist(), self._rows, strict=True
        ):
            room, speed = min(x - lower, upper - x), min(abs(w) + most * period, fastest)
            if abs(w) > slowest or not room >= speed * (speed / brakes + 2.0 * period):
                return False
        return True

    @cached_property
    def _rows(self) -> list[list[float]]:
        """Position limits of each joint, and the larger and smaller of the two other bounds."""
        most, v = self.sides("acceleration", "braking in time"), self.sides("velocity")
        ends = self.position_lower, self.position_upper
        bounds = np.stack((*ends, most.largest, most.least, v.largest, v.least), axis=-1)
        rows: list[list[float]] = bounds.tolist()
        return rows

    def held_acceleration_box(
        self, q: Array, v: Array, a: Array, period: float
    ) -> tuple[Array, Array]:
        """Return bounds on the next acceleration, after which all limits to the jerk can be kept.

        The velocity held for the next period is v + ``period`` times the acceleration. The box
        leaves every joint a stop within its limits of position, velocity, acceleration and jerk,
        and within its envelope if it has one, see `drake_rnn.robot.velocity_envelope`. From a
        state that has such a stop, as from rest, the box is never empty. From any other, the joint
        stops as fast as it may. A joint outside its position limits comes
        back at the speed of `return_speed`.

        Args:
            q: Joint positions, shape (..., n) [rad].
            v: Velocities held until now, shape (..., n) [rad/s].
            a: Accelerations that led to them, shape (..., n) [rad/s^2].
            period: Time for which a velocity is held [s].

        Returns:
            Lower and upper accelerations, shape (..., n) [rad/s^2].

        Raises:
            InvalidInputError: If the limits of acceleration or jerk are not known.
        """
        return jerk_box(q, v, a, self.jerk_limits, period)

    @property
    def jerk_limits(self) -> JerkLimits:
        """Those of joints whose jerk is bounded.

        Raises:
            InvalidInputError: If the limits of acceleration or jerk are not known.
        """
        most = self.sides("acceleration", "stopping in time")
        jerk = self.require("jerk", "stopping in time")
        position = self.position_lower, self.position_upper
        return JerkLimits(position, self.sides("velocity"), most, jerk, self.envelope)

    def have_stop(self, q: Array, v: Array, a: Array, period: float) -> NDArray[np.bool_]:
        """Return which joints can go on from a motion within all limits, and stop, shape (n,).

        Args:
            q: Joint positions, shape (n,) [rad].
            v: Velocities held until now, shape (n,) [rad/s].
            a: Accelerations that led to them, shape (n,) [rad/s^2]; used if the jerk is bounded.
            period: Time for which a velocity is held [s].
        """
        if self.jerk is not None:
            return np.asarray(have_stop(q, v, a, self.jerk_limits, period))
        stop = HeldStop(self.sides("acceleration", "stopping in time"), period)
        first = stop.after(v)
        end = q + np.copysign(stop.way(first), first)
        room = np.minimum(end - self.position_lower, self.position_upper - end)
        fastest = self.sides("velocity").toward(v > 0.0)
        return (room >= -ROUNDING_OF_WAY) & (np.abs(v) <= fastest * SHARE_OF_RATE)

    def violation(self, q: Array) -> Array:
        """Return how far ``q``, shape (..., n), is outside the position limits [rad]; 0 inside.

        Raises:
            InvalidInputError: If it has another shape.
        """
        if np.shape(q)[-1:] != (self.size,):
            raise InvalidInputError(f"q: must have {self.size} entries, not {short(q)}")
        return np.maximum(np.maximum(self.position_lower - q, q - self.position_upper), 0.0)

    def require_size(self, name: str, posture: Array) -> None:
        """Raise a ValueError that begins with a name unless a posture has an entry per joint."""
        if posture.size != self.size:
            raise ValueError(
                f"{name}: must have {self.size} entries, one per joint, not {posture.size}"
            )

    def complaint(
        self,
        q: Array,
        outside: float = 0.0,
        names: Sequence[str] | None = None,
        units: Sequence[str] | None = None,
    ) -> str:
        """Return a message about the joint farthest beyond its position limits.

        Args:
            q: Joint positions, shape (n,) [rad].
            outside: Distance beyond the limits that is allowed [rad].
            names: Names of the joints; by default their numbers.
            units: Units of the joints' positions; by default rad.
        """
        worst = int(np.argmax(self.violation(q)))
        name = f"joint {worst + 1}" if names is None else names[worst]
        lower, upper = self.position_lower[worst] - outside, self.position_upper[worst] + outside
        unit = "rad" if units is None else units[worst]
        text = f"{name} is at {q[worst]:.6g} {unit}; it may be {lower:.6g} to {upper:.6g}"
        return text + degree_hint((*q, *self.position_lower, *self.position_upper), unit)

    merged = OldName("merge")


# Angles that only degrees explain [rad].
_DEGREES = 20.0


def degree_hint(values: Iterable[float], unit: str) -> str:
    """Return what is added to a message about angles [rad] of which some must be degrees."""
    if unit != "rad" or not any(_DEGREES < abs(value) < np.inf for value in values):
        return ""
    return "; angles are in radians, and these look like degrees"


# A posture this far outside is there but for rounding [rad].
_ROUNDING = 1e-9


def require_resting(
    limits: JointLimits,
    q: Array,
    key: str,
    names: Sequence[str] | None = None,
    units: Sequence[str] | None = None,
) -> None:
    """Raise an InvalidInputError if a joint is too close to a limit to rest under its envelope.

    Without an envelope nothing is checked.

    Args:
        limits: Limits of the joints.
        q: Their positions, shape (n,) [rad].
        key: Begins the message.
        names: Names of the joints; by default their numbers.
        units: Units of their positions; by default rad.
    """
    if limits.envelope is None:
        return
    lower, upper = limits.resting
    beyond = np.maximum(lower - q, q - upper)
    worst = int(np.argmax(beyond))
    if not beyond[worst] > _ROUNDING:
        return
    name = f"joint {worst + 1}" if names is None else names[worst]
    unit = "rad" if units is None else units[worst]
    raise InvalidInputError(
        f"{key}: {name} is at {q[worst]:.6g} {unit}; under the envelope of its velocity it may "
        f"rest at {lower[worst]:.6g} to {upper[worst]:.6g} {unit}"
    )

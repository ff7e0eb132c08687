"""Joint limits, and how they fold into one box for the joint velocity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from numbers import Real
from typing import Any

import numpy as np

from ..errors import InvalidInputError
from ..inputs.dataclass_fields import fields_of
from ..inputs.fields import Array, Bounds, validated

#: Bounds of the derivatives of the joint positions, first to fifth, and their units.
DERIVATIVE_UNITS = {
    "velocity": "rad/s",
    "acceleration": "rad/s^2",
    "jerk": "rad/s^3",
    "snap": "rad/s^4",
    "crackle": "rad/s^5",
}


@validated
class JointLimits:
    """Bounds of each joint; infinite where a joint has none, None where none is known.

    Args:
        position_lower, position_upper: Shape (n,) [rad].
        velocity: Largest speed, shape (n,) [rad/s].
        acceleration, jerk, snap, crackle: Largest magnitude of the higher derivatives,
            shape (n,) [rad/s^2 .. rad/s^5].
    """

    position_lower: Bounds
    position_upper: Bounds
    velocity: Bounds
    acceleration: Bounds | None = None
    jerk: Bounds | None = None
    snap: Bounds | None = None
    crackle: Bounds | None = None

    def __post_init__(self) -> None:
        known = {
            name: bound for name in DERIVATIVE_UNITS if (bound := self.bounds[name]) is not None
        }
        for name, bound in {"position_upper": self.position_upper, **known}.items():
            if bound.size != self.position_lower.size:
                raise ValueError(
                    f"{name}: must have {self.position_lower.size} entries like position_lower, "
                    f"not {bound.size}"
                )
        inverted = ~(self.position_lower < self.position_upper)
        if inverted.any():
            joint = int(np.argmax(inverted))
            lower, upper = self.position_lower[joint], self.position_upper[joint]
            raise ValueError(
                f"position_lower: must be below position_upper, not {lower:g} and {upper:g} "
                f"as for joint {joint + 1}"
            )
        for name, bound in known.items():
            if not (bound > 0).all():
                raise ValueError(f"{name}: must be positive, not {bound.tolist()}")

    @classmethod
    def unlimited(cls, size: int) -> JointLimits:
        """No bound on any of ``size`` joints."""
        infinite = np.full(size, np.inf)
        return cls(position_lower=-infinite, position_upper=infinite, velocity=infinite)

    @cached_property
    def bounds(self) -> Mapping[str, Array | None]:
        """Every bound by the name of its field; None where none is known."""
        return fields_of(self)

    @property
    def size(self) -> int:
        """Number of joints."""
        return int(self.position_lower.size)

    def merged(self, bounds: Mapping[str, Any]) -> dict[str, Any]:
        """The fields of these limits with ``bounds`` in place; a number stands for every joint."""
        fields: dict[str, Any] = dict(self.bounds)
        for name, bound in bounds.items():
            is_number = isinstance(bound, Real) and not isinstance(bound, bool)
            fields[name] = np.full(self.size, float(bound)) if is_number else bound
        return fields

    def replace(self, **bounds: Any) -> JointLimits:
        """The same limits but for the given ones; a number stands for every joint."""
        return JointLimits(**self.merged(bounds))

    def select(self, joints: Sequence[int]) -> JointLimits:
        """The limits of some joints, by their numbers."""
        known: dict[str, Any] = {
            name: bound[joints] for name, bound in self.bounds.items() if bound is not None
        }
        return JointLimits(**known)

    def require(self, name: str, reason: str) -> Array:
        """The bound of this name, shape (n,).

        Raises:
            InvalidInputError: If it is not known.
        """
        bound = self.bounds[name]
        if bound is None:
            raise InvalidInputError(
                f"limits.{name}: not known for this arm, but needed for {reason}; give it"
            )
        return np.asarray(bound)

    @cached_property
    def _position(self) -> Array:
        return np.stack([self.position_lower, self.position_upper])

    @cached_property
    def _velocity_lower(self) -> Array:
        return -self.velocity

    def velocity_box(self, q: Array, stiffness: float) -> tuple[Array, Array]:
        """Velocities that respect both bounds: lower and upper, shape (..., n) [rad/s].

        A joint may approach its position limit at ``stiffness`` [1/s] times the distance
        left, and from beyond the limit returns at no more than its largest speed, so the
        box is never empty.
        """
        box = np.maximum(stiffness * (self._position - q[..., np.newaxis, :]), self._velocity_lower)
        np.minimum(box, self.velocity, out=box)
        return box[..., 0, :], box[..., 1, :]

    def acceleration_box(self, q: Array, v: Array, period: float) -> tuple[Array, Array]:
        """Accelerations held for a period after which every bound can still be kept.

        That is: the velocity is within its bound at the end, and if the joint then brakes as
        hard as it may, in samples of ``period`` [s], it comes to rest inside its position
        limits. From a state like that the box is never empty, so bounds once kept are kept for
        ever; from any other, it is what brings the joint back, to rest at the limit it is beyond.

        Args:
            q: Joint positions, shape (n,) [rad].
            v: Joint velocities, shape (n,) [rad/s].
            period: For which the acceleration is held [s].

        Returns:
            Lower and upper, shape (n,) [rad/s^2].
        """
        most = self.require("acceleration", "braking in time")
        # From velocity w a joint needs w^2 / 2a and, as it may not stop between samples, w h / 2
        # to come to rest; with the ramp from v to w before, q + h (v + w) / 2 + w^2 / 2a + w h / 2
        # must stay below the limit: solved for w. Beyond the limit the same holds of the way back.
        room = self._position - (q + period / 2 * v)
        with np.errstate(invalid="ignore"):
            ends = 2.0 * room / (period + np.sqrt(period**2 + 2.0 * np.abs(room) / most))
        ends = np.where(np.isfinite(room), ends, room)
        slowest, fastest = np.clip(ends, -self.velocity, self.velocity)
        lower = np.clip((slowest - v) / period, -most, most)
        upper = np.clip((fastest - v) / period, -most, most)
        return lower, upper

    def violation(self, q: Array) -> Array:
        """How far ``q``, shape (..., n), lies outside its position limits [rad]; 0 inside."""
        return np.maximum(np.maximum(self.position_lower - q, q - self.position_upper), 0.0)

    def complaint(self, q: Array, outside: float = 0.0, names: Sequence[str] | None = None) -> str:
        """Where the joint farthest beyond its position limits is, and where it may be.

        Args:
            q: Joint positions, shape (n,) [rad].
            outside: How far beyond the limits they may be [rad].
            names: Of the joints; by default their numbers.
        """
        worst = int(np.argmax(self.violation(q)))
        name = f"joint {worst + 1}" if names is None else names[worst]
        lower, upper = self.position_lower[worst] - outside, self.position_upper[worst] + outside
        return f"{name} is at {q[worst]:.6g} rad; it may be {lower:.6g} to {upper:.6g}"

"""The base classes of paths: closed curves with time laws, in space (`Path`) or in a plane."""

# No postponed annotations: older pydantic resolves inherited ones in the subclass's module.
import math
from abc import ABC, abstractmethod
from cmath import exp
from functools import cached_property
from typing import Annotated, Literal

import numpy as np
from pydantic import Field
from pydrake.math import RollPitchYaw, RotationMatrix

from ..errors import InvalidInputError
from ..inputs.fields import Array, Count, Finite, Point, validated, zeros
from .timing import TimeLaw, Timing, time_at, time_law

Triple = tuple[float, float, float]

TURN = 2.0 * math.pi
_INSTANT = 1e-12  # share of a segment; this close to its end counts as the start of the next one


@validated
class Path(ABC):
    """A closed curve with a time law.

    Args:
        period: Duration of one lap [s].
        timing: Time law of each segment.
        ramp: Fraction of a segment's time taken by each of the two ramps of "ramps".
        laps: Number of laps, after which the point rests at the start; None for no end.
        offset: Arm's start relative to the path's first point, shape (3,) [m].
    """

    period: Annotated[float, Field(strict=True, ge=1e-3, allow_inf_nan=False)]
    timing: Timing = "uniform"
    ramp: Annotated[float, Field(gt=0, le=0.5)] = 0.2
    laps: Count | None = None
    offset: Point = Field(default_factory=zeros)

    @property
    def segments(self) -> int:
        """Number of segments of a lap; all have the same duration and the same time law."""
        return 1

    @property
    def bends(self) -> tuple[float, ...]:
        """Phases of a one-segment curve at which its derivatives by phase jump [rad]."""
        return ()

    @property
    def duration(self) -> float:
        """Duration of all laps [s]; infinite without ``laps``."""
        return math.inf if self.laps is None else self.laps * self.period

    @abstractmethod
    def trace(self, phase: float) -> tuple[Triple, Triple, Triple]:
        """Return the displacement from the first point and its two derivatives by phase [m]."""

    def start_point(self, p_WE: Array) -> Array:
        """Return the path's first point for an arm that starts at ``p_WE``, shape (3,) [m]."""
        return p_WE - self.offset

    @cached_property
    def _law(self) -> TimeLaw:
        return time_law(self.timing, self.ramp)

    @cached_property
    def _frequency(self) -> float:
        return self.segments / self.period

    @cached_property
    def _last(self) -> float:
        return math.inf if self.laps is None else float(self.laps * self.segments)

    def evaluate(self, t: float) -> tuple[Array, Array, Array]:
        """Return the motion of the point at time ``t`` [s].

        Before t = 0 and after the last lap, the point rests at the start. Where a derivative
        jumps, the value after the jump is returned.

        Returns:
            Displacement from the first point [m], velocity [m/s], acceleration [m/s^2]; each
            of shape (3,), in the base frame.

        Raises:
            InvalidInputError: If ``t`` is not finite.
        """
        elapsed = t * self._frequency
        done = (elapsed + _INSTANT) // 1.0
        if not 0.0 <= done < self._last:
            if not math.isfinite(t):
                raise InvalidInputError(f"t: must be finite, not {t}")
            return np.zeros(3), np.zeros(3), np.zeros(3)
        s, ds, dds = self._law(max(elapsed - done, 0.0))
        stretch = TURN / self.segments
        rate = ds * stretch * self._frequency
        gain = dds * stretch * self._frequency**2
        p, (ux, uy, uz), (wx, wy, wz) = self.trace((done % self.segments + s) * stretch)
        square = rate * rate
        return (
            np.array(p),
            np.array((ux * rate, uy * rate, uz * rate)),
            np.array((wx * square + ux * gain, wy * square + uy * gain, wz * square + uz * gain)),
        )

    def knots(self, until: float) -> Array:
        """Return the times in [0, until] at which a derivative may jump or the point rests [s].

        These are the start, the end of the last lap, the ends of segments (except on a smooth
        curve with uniform timing), and ``bends``.

        Raises:
            InvalidInputError: If ``until`` and the duration are both infinite.
        """
        until = min(until, self.duration)
        if not math.isfinite(until):
            raise InvalidInputError(f"until: must be finite, not {until}")
        shares = {time_at(self._law, bend / TURN) for bend in self.bends}
        if self.timing != "uniform" or self.segments > 1:
            shares.add(0.0)
        count = math.floor(until * self._frequency + _INSTANT) + 1
        inner = [
            (k + share) * self.period / self.segments for k in range(count) for share in shares
        ]
        times = np.unique([0.0, *inner, self.duration])
        return times[times <= until]

    def sample(self, count: int) -> Array:
        """Return one closed lap of displacements at equal steps of phase, shape (count, 3) [m]."""
        return np.array([self.trace(phase)[0] for phase in np.linspace(0.0, TURN, count)])


_AXES: dict[str, list[int]] = {"xy": [0, 1], "xz": [0, 2], "yz": [1, 2]}


@validated
class Planar(Path):
    """A curve in a plane.

    Args:
        plane: Axes of the base frame along which the curve's x and y lie.
        angle: Rotation of the curve within its plane, from x to y [rad].
        rotation: Roll, pitch and yaw of the plane about the base's fixed axes, shape (3,) [rad].
        centre: Position of the curve's own origin in the base frame, shape (3,) [m]; if None, the
            path starts at the arm's start, apart from ``offset``.
    """

    plane: Literal["xy", "xz", "yz"] = "xy"
    angle: Finite = 0.0
    rotation: Point = Field(default_factory=zeros)
    centre: Point | None = None

    def __post_init__(self) -> None:
        if self.centre is not None and self.offset.any():
            raise ValueError(
                "offset: cannot be combined with centre, which also sets where the path starts; "
                "give one of them"
            )

    @abstractmethod
    def curve(self, phase: float) -> tuple[complex, complex, complex]:
        """Return z relative to the curve's own origin, and its two derivatives by phase [m]."""

    @cached_property
    def _components(self) -> tuple[complex, complex, complex]:
        """Weights w such that Re(w z) is the component of z along x, y and z of the base."""
        R = RotationMatrix(RollPitchYaw(*self.rotation)).matrix()[:, _AXES[self.plane]]
        wx, wy, wz = (complex(x, -y) * exp(1j * self.angle) for x, y in R)
        return wx, wy, wz

    @cached_property
    def _first(self) -> complex:
        return self.curve(0.0)[0]

    def trace(self, phase: float) -> tuple[Triple, Triple, Triple]:
        """See `Path.trace`."""
        z, dz, ddz = self.curve(phase)
        z -= self._first
        a, b, c = self._components
        return (
            ((a * z).real, (b * z).real, (c * z).real),
            ((a * dz).real, (b * dz).real, (c * dz).real),
            ((a * ddz).real, (b * ddz).real, (c * ddz).real),
        )

    def start_point(self, p_WE: Array) -> Array:
        """See `Path.start_point`; with a ``centre`` it does not depend on the arm's start."""
        if self.centre is None:
            return super().start_point(p_WE)
        first: Array = np.array([(w * self._first).real for w in self._components])
        return self.centre + first

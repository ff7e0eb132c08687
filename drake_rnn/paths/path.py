"""What a path is: a closed curve and its time law, in space (`Path`) or in a plane (`Planar`)."""

# No postponed annotations: older pydantic looks for inherited ones in the subclass's module.
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
_INSTANT = 1e-12  # of a segment: closer than this to its end counts as the next one's start


@validated
class Path(ABC):
    """A closed curve with a time law.

    Args:
        period: Time of one lap [s].
        timing: Time law of each segment.
        ramp: Share of a segment's time taken by each of the two ramps of "ramps".
        laps: After so many the point rests at the start; None goes on for ever.
        offset: Where the arm starts, relative to the path's first point [m].
    """

    period: Annotated[float, Field(strict=True, ge=1e-3, allow_inf_nan=False)]
    timing: Timing = "uniform"
    ramp: Annotated[float, Field(gt=0, le=0.5)] = 0.2
    laps: Count | None = None
    offset: Point = Field(default_factory=zeros)

    @property
    def segments(self) -> int:
        """Stretches of equal duration per lap, on each of which the time law holds."""
        return 1

    @property
    def bends(self) -> tuple[float, ...]:
        """Phases of a one-segment curve at which its own derivatives jump [rad]."""
        return ()

    @property
    def duration(self) -> float:
        """Of all laps [s]; infinite without ``laps``."""
        return math.inf if self.laps is None else self.laps * self.period

    @abstractmethod
    def trace(self, phase: float) -> tuple[Triple, Triple, Triple]:
        """Displacement from the first point, and its two derivatives with the phase [m]."""

    def start_point(self, p_WE: Array) -> Array:
        """The path's first point for an arm that starts at ``p_WE``, shape (3,) [m]."""
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
        """Where the point is at time ``t``; where a derivative jumps, its value after that.

        Before t = 0 and after the last lap it rests at the start.

        Returns:
            Displacement from the first point [m], velocity [m/s], acceleration [m/s^2]; each
            of shape (3,), in the base frame.
        """
        elapsed = t * self._frequency
        done = (elapsed + _INSTANT) // 1.0
        if not 0.0 <= done < self._last:
            if not math.isfinite(t):
                raise InvalidInputError(f"time must be finite, not {t}")
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
        """Times in [0, until] at which a derivative may jump or the point rests [s].

        That is the start, the end of the last lap, the ends of segments (but not where a
        smooth curve is run through uniformly), and ``bends``.
        """
        until = min(until, self.duration)
        if not math.isfinite(until):
            raise InvalidInputError(f"until must be finite, not {until}")
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
        """One lap for drawing: displacements at equal steps of phase, closed, (count, 3) [m]."""
        return np.array([self.trace(phase)[0] for phase in np.linspace(0.0, TURN, count)])


_AXES: dict[str, list[int]] = {"xy": [0, 1], "xz": [0, 2], "yz": [1, 2]}


@validated
class Planar(Path):
    """A curve in a plane.

    Args:
        plane: Axes of the base frame along which the curve's x and y lie.
        angle: Turns the curve within its plane, from x to y [rad].
        rotation: Roll, pitch, yaw: turns the plane about the base's fixed axes [rad].
        centre: Where the curve's own origin lies in the base frame [m]; None lets the path
            start at the arm's start, ``offset`` aside.
    """

    plane: Literal["xy", "xz", "yz"] = "xy"
    angle: Finite = 0.0
    rotation: Point = Field(default_factory=zeros)
    centre: Point | None = None

    def __post_init__(self) -> None:
        if self.centre is not None and self.offset.any():
            raise ValueError("offset and centre both say where the path starts: give one of them")

    @abstractmethod
    def curve(self, phase: float) -> tuple[complex, complex, complex]:
        """Place z from the curve's own origin, and its two derivatives with the phase [m]."""

    @cached_property
    def _components(self) -> tuple[complex, complex, complex]:
        """Weights w with which Re(w z) is the component of z along x, y and z of the base."""
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
        """See `Path.start_point`; with a ``centre`` the arm's start does not matter."""
        if self.centre is None:
            return super().start_point(p_WE)
        first: Array = np.array([(w * self._first).real for w in self._components])
        return self.centre + first

r"""Closed curves and how they are run through, with exact first and second derivatives.

A planar curve maps a phase f in [0, 2 pi] to the complex number z(f) = x + i y, relative
to an origin of its own; a time law (see `timing`) turns time into phase.

=============  =======================================================================
kind           z(f); a = size
=============  =======================================================================
circle         a e^{if}
nephroid       a (3 e^{if} - e^{3if}), from the cusp at 2a
four_ring      a (e^{if} + b e^{-3if}), b = ring
clover         a cos(2f) e^{if} from a tip, or a sin(2f) e^{if} from the centre
deltoid        a (2 e^{if} + e^{-2if}), from the cusp at 3a
cat            a R(S) e^{iS}, S = f - pi/2: a head with two ears, from the chin
square         side a, from a corner: -x, +y, +x, -y; the origin is its centre
parallelogram  sides u, v: +u, +v, -u, -v; the origin is its centre
points         periodic cubic spline through given points, in three dimensions
=============  =======================================================================

Source:
    Classical curves. The papers whose experiments follow a nephroid, a four-ring, a
    four-leaf clover, a tricuspid or a cat name them and print no formula; these are ours.

The cat's outline is R = 1 + .4 g(.32 pi, .17) + .4 g(.68 pi, .17) - .12 g(.5 pi, .2)
- .1 g(1.5 pi, .5) - .1 g(-.5 pi, .5), with g(c, w) = exp(-(S - c)^2 / (2 w^2)); its two ends
meet within 1e-30.

Straight edges of "sharp" figures take equal times, and the time law holds on each of them:
all but "uniform" rest at the corners; "uniform" keeps its speed along an edge, and the
velocity jumps at the corners. Everything else is one stretch a lap.
"""

from __future__ import annotations

import csv
import math
from abc import ABC, abstractmethod
from bisect import bisect_right
from cmath import exp
from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field
from pydrake.math import RollPitchYaw, RotationMatrix
from pydrake.trajectories import PiecewisePolynomial

from .errors import InvalidInputError
from .fields import Array, Count, Finite, Point, Positive, Vector, validated
from .timing import TimeLaw, Timing, time_at, time_law

Triple = tuple[float, float, float]
Harmonics = tuple[tuple[int, complex], ...]

TURN = 2.0 * math.pi
_INSTANT = 1e-12  # of a segment: closer than this to its end counts as the next one's start


def _zeros() -> Array:
    zeros = np.zeros(3)
    zeros.setflags(write=False)
    return zeros


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

    period: Positive
    timing: Timing = "uniform"
    ramp: Annotated[float, Field(gt=0, le=0.5)] = 0.2
    laps: Count | None = None
    offset: Point = Field(default_factory=_zeros)

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
    rotation: Point = Field(default_factory=_zeros)
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


@validated
class Trigonometric(Planar):
    """A sum of c exp(i k f) over its ``harmonics`` (k, c)."""

    size: Positive

    @property
    @abstractmethod
    def harmonics(self) -> Harmonics:
        """Pairs (k, c) [m]."""

    @cached_property
    def _harmonics(self) -> tuple[tuple[complex, complex], ...]:
        return tuple((1j * k, c) for k, c in self.harmonics)

    def curve(self, phase: float) -> tuple[complex, complex, complex]:
        """See `Planar.curve`."""
        z = dz = ddz = 0j
        for ik, c in self._harmonics:
            term = c * exp(ik * phase)
            z += term
            term *= ik
            dz += term
            ddz += ik * term
        return z, dz, ddz


@validated
class Circle(Trigonometric):
    """A circle of radius ``size`` [m]."""

    kind: Literal["circle"] = "circle"

    @property
    def harmonics(self) -> Harmonics:
        """See `Trigonometric.harmonics`."""
        return ((1, self.size),)


@validated
class Nephroid(Trigonometric):
    """A nephroid, 4 by 8 times ``size`` [m]; uniformly run through, its top speed is 6 size w."""

    kind: Literal["nephroid"] = "nephroid"

    @property
    def harmonics(self) -> Harmonics:
        """See `Trigonometric.harmonics`."""
        return (1, 3 * self.size), (3, -self.size)


@validated
class FourRing(Trigonometric):
    """Four rings round a centre: loops for ``ring`` > 1/3, four petals at 1."""

    kind: Literal["four_ring"] = "four_ring"
    ring: Finite = 0.7

    @property
    def harmonics(self) -> Harmonics:
        """See `Trigonometric.harmonics`."""
        return (1, self.size), (-3, self.size * self.ring)


@validated
class Clover(Trigonometric):
    """A four-leaf clover (rose) with leaves of length ``size`` [m]; starts at ``begin``."""

    kind: Literal["clover"] = "clover"
    begin: Literal["tip", "centre"] = "tip"

    @property
    def harmonics(self) -> Harmonics:
        """See `Trigonometric.harmonics`."""
        half = self.size / 2
        if self.begin == "tip":
            return (3, half), (-1, half)
        return (3, -1j * half), (-1, 1j * half)


@validated
class Deltoid(Trigonometric):
    """A tricuspid; ``size`` is the radius of the circle that rolls [m], a third of its reach."""

    kind: Literal["deltoid"] = "deltoid"

    @property
    def harmonics(self) -> Harmonics:
        """See `Trigonometric.harmonics`."""
        return (1, 2 * self.size), (-2, self.size)


# Height, place S and width of each bump on the cat's round head.
_BUMPS = (
    (0.4, 0.32 * math.pi, 0.17),
    (0.4, 0.68 * math.pi, 0.17),
    (-0.12, 0.5 * math.pi, 0.2),
    (-0.1, 1.5 * math.pi, 0.5),
    (-0.1, -0.5 * math.pi, 0.5),
)


@validated
class Cat(Planar):
    """A cat's head of radius ``size`` [m], ears up along the plane's y."""

    kind: Literal["cat"] = "cat"
    size: Positive

    def curve(self, phase: float) -> tuple[complex, complex, complex]:
        """See `Planar.curve`."""
        S = phase - math.pi / 2
        R, dR, ddR = 1.0, 0.0, 0.0
        for height, place, width in _BUMPS:
            u = (S - place) / width
            bump = height * math.exp(-0.5 * u * u)
            R += bump
            dR -= bump * u / width
            ddR += bump * (u * u - 1.0) / (width * width)
        a = self.size * exp(1j * S)
        return a * R, a * complex(dR, R), a * complex(ddR - R, 2.0 * dR)


_RIGHT_TURNS = (1 + 0j, -1j, -1 + 0j, 1j)


@validated
class Square(Planar):
    """A square, clockwise as seen with the plane's x to the right and y up.

    Args:
        size: Side [m].
        corners: "sharp": four segments, from corner to corner. "rounded": one segment; the
            phase is the arc length, and the point starts at the end of a corner, on the edge
            along -x.
        corner_radius: Of rounded corners, at most half the side [m].
    """

    kind: Literal["square"] = "square"
    size: Positive
    corners: Literal["sharp", "rounded"] = "sharp"
    corner_radius: Positive | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.corners == "sharp" and self.corner_radius is not None:
            raise ValueError("corner_radius belongs to rounded corners")
        if self.corners == "rounded" and self.corner_radius is None:
            raise ValueError("rounded corners need a corner_radius")
        if self._radius > self.size / 2:
            raise ValueError(f"corner_radius must be at most half the side, {self.size / 2:g}")

    @property
    def segments(self) -> int:
        """Four with sharp corners, else one."""
        return 4 if self.corners == "sharp" else 1

    @property
    def bends(self) -> tuple[float, ...]:
        """Where the straight parts and the rounded corners meet."""
        if self.corners == "sharp":
            return ()
        straight, quarter = self._lengths
        return tuple(TURN / 4 * (i + x) for i in range(4) for x in (0.0, straight / quarter))

    @cached_property
    def _radius(self) -> float:
        return self.corner_radius or 0.0

    @cached_property
    def _lengths(self) -> tuple[float, float]:
        """Of a straight part, and of it with a corner."""
        straight = self.size - 2 * self._radius
        return straight, straight + math.pi / 2 * self._radius

    def curve(self, phase: float) -> tuple[complex, complex, complex]:
        """See `Planar.curve`."""
        straight, quarter = self._lengths
        edges = phase / (TURN / 4)
        edge = min(int(edges), 3)
        turned = _RIGHT_TURNS[edge]
        way = (edges - edge) * quarter
        rate = quarter / (TURN / 4)
        if way < straight or self._radius == 0.0:
            z = complex(straight / 2 - way, -self.size / 2)
            return turned * z, -turned * rate, 0j
        spoke = turned * exp(-1j * (math.pi / 2 + (way - straight) / self._radius))
        z = turned * complex(-straight, -straight) / 2 + self._radius * spoke
        return z, -1j * spoke * rate, -spoke / self._radius * rate**2


def _pair(side: Array) -> Array:
    if side.size != 2:
        raise ValueError(f"must have 2 entries, not {side.size}")
    if not side.any():
        raise ValueError("must not be zero")
    return side


Side = Annotated[Vector, AfterValidator(_pair)]


@validated
class Parallelogram(Planar):
    """A parallelogram: along the first of its ``sides``, along the second, and back [m]."""

    kind: Literal["parallelogram"] = "parallelogram"
    sides: tuple[Side, Side]

    @property
    def segments(self) -> int:
        """Four: one per edge."""
        return 4

    @cached_property
    def _edges(self) -> tuple[tuple[complex, complex], ...]:
        """Start and direction of each edge."""
        u, v = (complex(*side) for side in self.sides)
        return (-(u + v) / 2, u), ((u - v) / 2, v), ((u + v) / 2, -u), ((v - u) / 2, -v)

    def curve(self, phase: float) -> tuple[complex, complex, complex]:
        """See `Planar.curve`."""
        edges = phase / (TURN / 4)
        edge = min(int(edges), 3)
        start, side = self._edges[edge]
        return start + (edges - edge) * side, side / (TURN / 4), 0j


def _number(cell: Any, row: int, column: int) -> float:
    try:
        number = float(cell)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f"row {row}, column {column}: {cell!r} is not a finite number")
    return number


def _closed(numbered: Iterable[tuple[int, Sequence[Any]]]) -> Array:
    """The points in numbered rows of cells, the first one repeated as the last; read-only."""
    rows: list[int] = []
    table: list[list[float]] = []
    for row, cells in numbered:
        if not isinstance(cells, (list, tuple, np.ndarray)) or len(cells) != 3:
            raise ValueError(f"row {row}: must be 3 numbers, x, y and z")
        rows.append(row)
        table.append([_number(cell, row, column) for column, cell in enumerate(cells, 1)])
    points = np.array(table).reshape(-1, 3)
    same = 1e-9 * np.ptp(points, axis=0).max() if table else 0.0
    repeated = np.linalg.norm(np.diff(points, axis=0), axis=1) <= same
    if repeated.any():
        raise ValueError(f"row {rows[int(repeated.argmax()) + 1]}: repeats the point before it")
    if table and np.linalg.norm(points[-1] - points[0]) <= same:
        points = points[:-1]
    distinct = len(np.unique(points, axis=0))
    if distinct < 4:
        raise ValueError(f"a closed curve needs at least 4 distinct points, not {distinct}")
    points = np.vstack([points, points[:1]])
    points.setflags(write=False)
    return points


def _listed(value: Any) -> Array:
    rows = value.tolist() if isinstance(value, np.ndarray) else value
    if not isinstance(rows, (list, tuple)):
        raise ValueError("must be a list of points [x, y, z]")
    return _closed(enumerate(rows, 1))


def _read(file: str) -> Array:
    try:
        with open(file, newline="", encoding="utf-8-sig") as lines:
            reader = csv.reader(lines)
            return _closed((reader.line_num, cells) for cells in reader if cells)
    except OSError as error:
        raise ValueError(f"file {file}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ValueError(f"file {file}: is not a text file") from None
    except (ValueError, csv.Error) as error:
        raise ValueError(f"file {file}: {error}") from None


@validated
class Points(Path):
    """A smooth closed curve through given points: a periodic cubic spline over their chords.

    Args:
        file: CSV of three columns x, y, z without a header [m]; give this or ``points``.
        points: Rows x, y, z in the base frame [m]. At least 4 distinct ones; the first may
            be repeated as the last.
        absolute: The points are where they are; else the whole curve is moved so that the
            first one is where the arm starts, ``offset`` aside.
    """

    kind: Literal["points"] = "points"
    file: str | None = None
    points: Annotated[Array, BeforeValidator(_listed)] | None = None
    absolute: bool = False

    def __post_init__(self) -> None:
        if (self.file is None) == (self.points is None):
            raise ValueError("give either a file or points")
        if self.absolute and self.offset.any():
            raise ValueError("offset and absolute both say where the path starts: give one")
        self._table  # noqa: B018 (a bad file is refused now, not during a run)

    @cached_property
    def _table(self) -> Array:
        """The points, the first one repeated as the last, shape (n + 1, 3) [m]."""
        return _read(self.file) if self.file is not None else np.asarray(self.points)

    @cached_property
    def _spline(self) -> tuple[list[float], list[list[list[float]]]]:
        """Phases at the points, and between them the coefficients of x, y and z."""
        way = np.cumsum([0.0, *np.linalg.norm(np.diff(self._table, axis=0), axis=1)])
        phase = TURN * way / way[-1]
        displacement = (self._table - self._table[0]).T
        spline = PiecewisePolynomial.CubicWithContinuousSecondDerivatives(
            breaks=phase, samples=displacement, periodic_end_condition=True
        )
        slope = spline.MakeDerivative(1).vector_values(phase)
        second = spline.MakeDerivative(2).vector_values(phase)
        third = np.diff(second) / np.diff(phase)
        orders = displacement[:, :-1], slope[:, :-1], second[:, :-1] / 2, third / 6
        return phase.tolist(), np.stack(orders, axis=-1).swapaxes(0, 1).tolist()

    def trace(self, phase: float) -> tuple[Triple, Triple, Triple]:
        """See `Path.trace`."""
        phases, coefficients = self._spline
        piece = min(bisect_right(phases, phase), len(coefficients)) - 1
        u = phase - phases[piece]
        p, dp, ddp = zip(
            *[
                (a + u * (b + u * (c + u * d)), b + u * (2 * c + 3 * u * d), 2 * c + 6 * u * d)
                for a, b, c, d in coefficients[piece]
            ],
            strict=True,
        )
        return p, dp, ddp

    def start_point(self, p_WE: Array) -> Array:
        """See `Path.start_point`; of ``absolute`` points it is the first of them."""
        return self._table[0].copy() if self.absolute else super().start_point(p_WE)


PATHS: dict[str, type[Path]] = {
    "circle": Circle,
    "nephroid": Nephroid,
    "four_ring": FourRing,
    "clover": Clover,
    "deltoid": Deltoid,
    "cat": Cat,
    "square": Square,
    "parallelogram": Parallelogram,
    "points": Points,
}

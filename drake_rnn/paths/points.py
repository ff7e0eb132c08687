"""Smooth curves through points that are given or read from a CSV file, open or closed."""

# No postponed annotations: see `path`.
from bisect import bisect_right
from functools import cached_property
from typing import Annotated, Literal

import numpy as np
from pydantic import BeforeValidator
from pydrake.trajectories import PiecewisePolynomial

from ..inputs.fields import Array, Flag, validated
from ..inputs.keys import Meaning
from .curve import TURN, Curve, Triple
from .table import QUATERNION, RPY, TIME, Table, listed, read_table

# Difference between two points, relative to the extent of all, up to which they are the same.
_SAME = 1e-9


@validated
class ThroughPoints(Curve):
    """A smooth curve through given points: a cubic spline over the chord length."""

    file: Annotated[
        str | None,
        Meaning("CSV file of three columns x, y, z; give this or ``points``.", unit="m"),
    ] = None
    points: Annotated[
        Annotated[Array, BeforeValidator(listed)] | None,
        Meaning("Rows x, y, z, shape (k, 3); at least 2 points.", unit="m"),
    ] = None
    absolute: Annotated[
        Flag,
        Meaning(
            "Whether the points stay where they are; otherwise the curve is moved so that the "
            "first point is at the arm's start, apart from ``offset``.",
        ),
    ] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.file is None) == (self.points is None):
            raise ValueError("give either a file or points")
        if self.absolute:
            self._require_no_offset("absolute")
        self._knots  # noqa: B018 (a bad file is refused now, not during a run)

    @property
    def has_place(self) -> bool:
        """Whether the points stay where they are."""
        return self.absolute

    @cached_property
    def _knots(self) -> Array:
        """The points that the spline goes through, shape (k, 3) [m]."""
        if self.points is not None:
            return self._checked(Table.of_points(self.points))
        table = read_table(str(self.file))
        try:
            for group in (TIME, QUATERNION, RPY):
                if group[0] in table.columns:
                    raise ValueError(
                        f"column {group[0]}: is not used here, where period and timing say how "
                        "the curve is passed; kind: waypoints takes times and orientations"
                    )
            return self._checked(table)
        except ValueError as error:
            raise ValueError(f"file {self.file}: {error}") from None

    def _checked(self, table: Table) -> Array:
        points = table.points
        same = _SAME * np.ptp(points, axis=0).max() if len(points) else 0.0
        repeated = np.linalg.norm(np.diff(points, axis=0), axis=1) <= same
        if repeated.any():
            row = table.rows[int(repeated.argmax()) + 1]
            raise ValueError(f"row {row}: repeats the point before it")
        if self.closed:
            return _closed(points, same)
        if len(points) < 2:
            raise ValueError(f"an open curve needs at least 2 points, not {len(points)}")
        # The middle of two points is on the line between them; a spline needs three.
        return points if len(points) > 2 else np.array([points[0], points.mean(axis=0), points[1]])

    @cached_property
    def _spline(self) -> tuple[list[float], list[list[list[float]]]]:
        """Phases at the points, and the coefficients of x, y and z between them."""
        way = np.cumsum([0.0, *np.linalg.norm(np.diff(self._knots, axis=0), axis=1)])
        phase = TURN * way / way[-1]
        displacement = (self._knots - self._knots[0]).T
        spline = PiecewisePolynomial.CubicWithContinuousSecondDerivatives(
            breaks=phase, samples=displacement, periodic_end_condition=self.closed
        )
        slope = spline.MakeDerivative(1).vector_values(phase)
        second = spline.MakeDerivative(2).vector_values(phase)
        third = np.diff(second) / np.diff(phase)
        orders = displacement[:, :-1], slope[:, :-1], second[:, :-1] / 2, third / 6
        return phase.tolist(), np.stack(orders, axis=-1).swapaxes(0, 1).tolist()

    def trace(self, phase: float) -> tuple[Triple, Triple, Triple]:
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

    def start_point(self, p_FE: Array) -> Array:
        """See `RelativePath.start_point`; with ``absolute`` it is the first of the points."""
        return self._knots[0].copy() if self.absolute else super().start_point(p_FE)


@validated
class Spline(ThroughPoints):
    """A smooth open curve through given points."""

    kind: Literal["spline"] = "spline"
    summary = "A smooth open curve through given points."

    @property
    def closed(self) -> bool:
        return False


@validated
class Points(ThroughPoints):
    """A smooth curve through given points, open unless it is said to be closed."""

    kind: Literal["points"] = "points"
    summary = "A smooth curve through given points, open unless it is said to be closed."
    closed: Annotated[
        Flag,
        Meaning(
            "Whether the curve leads back to its first point; it then needs at least 4 distinct "
            "points, of which the first may be repeated as the last.",
        ),
    ] = False


def _closed(points: Array, same: float) -> Array:
    """Return the points of a closed curve with the first repeated as the last."""
    if len(points) and np.linalg.norm(points[-1] - points[0]) <= same:
        points = points[:-1]
    distinct = len(np.unique(points, axis=0))
    if distinct < 4:
        raise ValueError(f"a closed curve needs at least 4 distinct points, not {distinct}")
    return np.vstack([points, points[:1]])

r"""Trajectories of vectors through given values, as piecewise polynomials of degree 5 or less.

With values y_k at times t_k, and rest at both ends:

=========  ==================================================================================
cubic      cubic spline: y, y', y'' continuous; y' = 0 at the ends, where y'' jumps
quintic    quintic spline: y to y'''' continuous; y' = y'' = 0 at the ends
legs       straight, by 10 s^3 - 15 s^4 + 6 s^5 from rest to rest at each value
blended    straight at constant rates between the values, round the inner ones by a blend of
           a stated time: parabolic (y'' constant in it) or quintic (y'' continuous)
=========  ==================================================================================

A blend of time b about t_k begins and ends on the two straight legs, b / 2 before and after t_k;
half-way it is b |y'_{k} - y'_{k-1}| / 8 (parabolic) or 3 b |y'_{k} - y'_{k-1}| / 32 (quintic) from
y_k. At the ends a blend leads from rest to the rate of the leg, and back.

Source:
    J. J. Craig, Introduction to Robotics, for straight legs with parabolic blends; L. Biagiotti
    and C. Melchiorri, Trajectory Planning for Automatic Machines and Robots, for splines.

Smooth curves by their arc length: straight, through points, or round a corner.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import repeat
from math import pow as power
from typing import Literal

import numpy as np
from pydrake.polynomial import Polynomial
from pydrake.trajectories import PiecewisePolynomial

from ..inputs.fields import Array

Blend = Literal["quintic", "parabolic"]

# Share of the whole time up to which a piece has no duration.
_NO_TIME = 1e-9


@dataclass(frozen=True, eq=False)
class Pieces:
    """Polynomials one after another, in a hundredth of the memory that Drake's objects take.

    Attributes:
        times: Increasing times at which they meet, shape (k,).
        coefficients: In ascending order, of the time since the start of each piece, shape
            (degree + 1, k - 1, m).
    """

    times: Array
    coefficients: Array

    @property
    def trajectory(self) -> PiecewisePolynomial:
        """The same as an object of Drake."""
        pieces = np.moveaxis(self.coefficients, 0, -1)
        return PiecewisePolynomial(
            [np.array([[Polynomial(row)] for row in piece]) for piece in pieces],
            self.times.tolist(),
        )

    def values(self, at: Array, orders: Sequence[int]) -> list[Array]:
        """Return values and derivatives, to the last bit those of the trajectory.

        Args:
            at: Times from the first to the last one, shape (n,).
            orders: Which derivatives, in ascending order; 0 for the values.

        Returns:
            For each order, shape (n, m).
        """
        number = np.searchsorted(self.times, at, side="right") - 1
        number = np.clip(number, 0, len(self.times) - 2)
        t = at - self.times[number]
        # Those of the C library, as in Drake; NumPy's own may differ in the last bit.
        several, most = t.tolist(), len(self.coefficients) - 1 - min(orders)
        powers = [t, *(np.array([*map(power, several, repeat(n))]) for n in range(2, most + 1))]
        rows = []
        for order in orders:
            total = np.zeros((len(t), self.coefficients.shape[2]))
            for n, factor in enumerate(self.coefficients[order:, number]):
                for exponent in range(n + order, n, -1):
                    factor = factor * exponent
                total += factor * powers[n - 1][:, np.newaxis] if n else factor
            rows.append(total)
        return rows


def join(pieces: Sequence[Pieces]) -> Pieces:
    """Return polynomials that begin where those before them end as one."""
    times = [pieces[0].times[:1], *(each.times[1:] for each in pieces)]
    coefficients = [each.coefficients for each in pieces]
    return Pieces(np.concatenate(times), np.concatenate(coefficients, axis=1))


def cubic_spline(times: Array, values: Array) -> PiecewisePolynomial:
    """Return the cubic spline through values, at rest at both ends.

    Args:
        times: Increasing times, shape (k,) [s].
        values: Shape (k, m).
    """
    still = np.zeros((values.shape[1], 1))
    return PiecewisePolynomial.CubicWithContinuousSecondDerivatives(times, values.T, still, still)


def quintic_spline(times: Array, values: Array) -> PiecewisePolynomial:
    """Return the quintic spline through values, at rest at both ends without acceleration.

    Args:
        times: Increasing times, shape (k,) [s].
        values: Shape (k, m).
    """
    # Unknown are y' and y'' at the inner times, where y''' and y'''' must be the same on both
    # sides: a block tridiagonal system, solved by elimination from the first block to the last.
    duration = np.diff(times)
    inner = len(times) - 2
    u = np.zeros((len(times), 2, values.shape[1]))
    upper = np.zeros((inner + 1, 2, 2))
    right = np.zeros((inner + 1, 2, values.shape[1]))
    for k in range(1, inner + 1):
        before, after = duration[k - 1], duration[k]
        ends, starts = _higher_at_end(before), _higher_at_start(after)
        middle = ends[:, 4:6] - starts[:, 1:3]
        lower = ends[:, 1:3]
        right_side = np.outer(starts[:, 0], values[k]) + np.outer(starts[:, 3], values[k + 1])
        right_side -= np.outer(ends[:, 0], values[k - 1]) + np.outer(ends[:, 3], values[k])
        pivot = middle - lower @ upper[k - 1]
        upper[k] = np.linalg.solve(pivot, -starts[:, 4:6])
        right[k] = np.linalg.solve(pivot, right_side - lower @ right[k - 1])
    for k in range(inner, 0, -1):
        u[k] = right[k] - upper[k] @ u[k + 1]
    return quintic_pieces(times, values, u[:, 0], u[:, 1])


def rest_to_rest(times: Array, values: Array) -> PiecewisePolynomial:
    """Return straight legs between values, each from rest to rest.

    Args:
        times: Increasing times, shape (k,) [s].
        values: Shape (k, m).
    """
    still = np.zeros_like(values)
    return quintic_pieces(times, values, still, still)


def blend(times: Array, values: Array, blends: Array, kind: Blend) -> PiecewisePolynomial:
    """Return straight legs between values, with blends at all of them.

    Args:
        times: Increasing times, shape (k,) [s].
        values: Shape (k, m).
        blends: Time of the blend at each value, shape (k,) [s]; with their halves at inner values
            and their whole at the ends, two blends must fit in the leg between them.
        kind: Kind of the blends.
    """
    reach = blends / 2.0
    # A leg takes its rate half a blend after the first value and keeps it to half a blend before
    # the last: there the blends begin and end.
    leaves, arrives = times.copy(), times.copy()
    leaves[0] += reach[0]
    arrives[-1] -= reach[-1]
    rate = np.diff(values, axis=0) / (arrives[1:] - leaves[:-1])[:, np.newaxis]
    before = np.vstack((np.zeros_like(rate[:1]), rate))
    after = np.vstack((rate, np.zeros_like(rate[:1])))
    begins, ends = times - reach, times + reach
    begins[0], ends[0] = times[0], times[0] + blends[0]
    begins[-1], ends[-1] = times[-1] - blends[-1], times[-1]
    middle = begins + reach
    at = np.column_stack((begins, ends)).ravel()
    y = np.stack(
        (
            values - before * (middle - begins)[:, np.newaxis],
            values + after * (ends - middle)[:, np.newaxis],
        ),
        axis=1,
    ).reshape(-1, values.shape[1])
    dy = np.stack((before, after), axis=1).reshape(y.shape)
    apart = np.concatenate(([True], np.diff(at) > _NO_TIME * (times[-1] - times[0])))
    at, y, dy = at[apart], y[apart], dy[apart]
    if kind == "quintic":
        return quintic_pieces(at, y, dy, np.zeros_like(y))
    T = np.diff(at)[:, np.newaxis]
    return Pieces(at, np.stack([y[:-1], dy[:-1], np.diff(dy, axis=0) / (2 * T)])).trajectory


def quintic_pieces(times: Array, y: Array, dy: Array, ddy: Array) -> PiecewisePolynomial:
    """Return the polynomials of `quintics` as a trajectory."""
    return quintics(times, y, dy, ddy).trajectory


def quintics(times: Array, y: Array, dy: Array, ddy: Array) -> Pieces:
    """Return the polynomials of degree 5 between given values and derivatives.

    Args:
        times: Increasing times, shape (k,) [s].
        y: Values there, shape (k, m).
        dy: Their first derivatives, shape (k, m).
        ddy: Their second derivatives, shape (k, m).
    """
    T = np.diff(times)[:, np.newaxis]
    rise, v, w, a, b = np.diff(y, axis=0), dy[:-1], dy[1:], ddy[:-1], ddy[1:]
    coefficients = [
        y[:-1],
        v,
        a / 2,
        (20 * rise - (8 * w + 12 * v) * T - (3 * a - b) * T**2) / (2 * T**3),
        (-30 * rise + (14 * w + 16 * v) * T + (3 * a - 2 * b) * T**2) / (2 * T**4),
        (12 * rise - 6 * (w + v) * T - (a - b) * T**2) / (2 * T**5),
    ]
    return Pieces(times, np.stack(coefficients))


def _higher_at_start(T: float) -> Array:
    """Return y''' and y'''' at the start of a piece of duration ``T`` [s], as a matrix.

    It multiplies y, y', y'' at the start, then at the end; shape (2, 6).
    """
    return np.array(
        [
            [-60 / T**3, -36 / T**2, -9 / T, 60 / T**3, -24 / T**2, 3 / T],
            [360 / T**4, 192 / T**3, 36 / T**2, -360 / T**4, 168 / T**3, -24 / T**2],
        ]
    )


def _higher_at_end(T: float) -> Array:
    """Return y''' and y'''' at the end of a piece, like `_higher_at_start`."""
    return np.array(
        [
            [-60 / T**3, -24 / T**2, -3 / T, 60 / T**3, -36 / T**2, 9 / T],
            [-360 / T**4, -168 / T**3, -24 / T**2, 360 / T**4, -192 / T**3, 36 / T**2],
        ]
    )


# Gauss-Legendre rule with which the speed of a curve is integrated over a piece.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
# Pieces into which the rounding of a corner is divided.
_PIECES = 24
# Points at which a curve is given, and at which its length is looked at before.
_POINTS, _LOOKED_AT = 25, 129
# Turn between two chords above which points are too far apart, and up to which a curve is looked at
# to place more [rad].
_TURN, _FINE_TURN = np.deg2rad(8.0), np.deg2rad(3.0)
# Length of a chord, relative to its curve, below which a turn is a corner; how often chords are
# halved until then; length, relative to the shorter one beside it, up to which no point is added.
_CHORD, _HALVINGS, _LONG = 1e-6, 24, 2.5
#: Angle between two chords from which the point between them is a corner, not of a curve [rad].
CORNER = np.deg2rad(55.0)


@dataclass(frozen=True, eq=False)
class Arc:
    """A smooth curve, given at some of its arc lengths; polynomials of degree 5 lie between.

    Attributes:
        at: Increasing arc lengths from 0, shape (k,) [m].
        p: Points there, shape (k, 3) [m].
        tangent: Unit tangents there, shape (k, 3).
        curvature: Derivatives of the tangent by arc length there, shape (k, 3) [1/m].
    """

    at: Array
    p: Array
    tangent: Array
    curvature: Array

    @property
    def length(self) -> float:
        """Length of the curve [m]."""
        return float(self.at[-1])

    @property
    def straight(self) -> bool:
        """Whether the curve is a straight line."""
        return not self.curvature.any()

    def part(self, begin: float, end: float) -> Arc:
        """Return the curve between two of its arc lengths [m]."""
        inner = self.at[(self.at > begin) & (self.at < end)]
        at = np.array([begin, *inner, end])
        p, tangent, curvature = self.pieces(0.0).values(at, range(3))
        return Arc(at - begin, p, tangent, curvature)

    def pieces(self, begin: float) -> Pieces:
        """Return the points as a function of arc length, counted from ``begin`` [m]."""
        return quintics(begin + self.at, self.p, self.tangent, self.curvature)


def turn(t: Array, u: Array) -> float:
    """Return the angle between two unit vectors [rad]."""
    return float(2.0 * np.arctan2(np.linalg.norm(u - t), np.linalg.norm(u + t)))


def line(p: Array, q: Array) -> Arc:
    """Return the straight line between two points, each of shape (3,) [m]."""
    length = float(np.linalg.norm(q - p))
    tangent = np.tile((q - p) / length, (2, 1))
    return Arc(np.array([0.0, length]), np.stack((p, q)), tangent, np.zeros((2, 3)))


def through(points: Array, pieces: int) -> Arc:
    """Return a smooth curve through points: a cubic spline over the chord length.

    It is periodic if the last point is the first one, and no `CORNER`.

    Args:
        points: Shape (k, 3) [m], k > 2.
        pieces: Pieces into which the curve between two points is divided.
    """
    chords = np.cumsum([0.0, *np.linalg.norm(np.diff(points, axis=0), axis=1)])
    meets = len(points) > 3 and bool((points[0] == points[-1]).all())
    ends = points[-1] - points[-2], points[1] - points[0]
    closes = bool(meets and turn(*(way / np.linalg.norm(way) for way in ends)) < CORNER)
    spline = PiecewisePolynomial.CubicWithContinuousSecondDerivatives(
        breaks=chords, samples=points.T, periodic_end_condition=closes
    )
    shares = np.arange(pieces) / pieces
    u = np.append((chords[:-1, None] + np.diff(chords)[:, None] * shares).ravel(), chords[-1])
    return _by_arc_length(spline, u)


def rounding(before: Arc, after: Arc, reach: float) -> Arc:
    """Return the curve that leads from the end of one curve to the start of another.

    Tangent and curvature are those of the two curves where it meets them. With two straight lines
    that end and begin at the distance ``reach`` from their corner, it passes the corner at
    3 reach |u - t| / 16, where t and u are their directions.

    Args:
        before: The curve before the corner.
        after: The curve after it.
        reach: Arc length from the corner at which they end and begin [m].
    """
    ends = (
        (before.p[-1], after.p[0]),
        (before.tangent[-1], after.tangent[0]),
        (before.curvature[-1], after.curvature[0]),
    )
    blend = quintic_pieces(np.array([0.0, 2.0 * reach]), *map(np.stack, ends))
    return _by_arc_length(blend, np.linspace(0.0, 2.0 * reach, _PIECES + 1))


def _by_arc_length(curve: PiecewisePolynomial, u: Array) -> Arc:
    """Return a curve by its arc length, given at these values ``u`` of its own parameter."""
    rate, gain = curve.MakeDerivative(1), curve.MakeDerivative(2)
    half = np.diff(u)[:, None] / 2.0
    nodes = (u[:-1, None] + half * (1.0 + _NODES)).ravel()
    speeds = np.linalg.norm(rate.vector_values(nodes), axis=0).reshape(-1, _NODES.size)
    at = np.concatenate(([0.0], np.cumsum((speeds @ _WEIGHTS) * half[:, 0])))
    d, dd = rate.vector_values(u).T, gain.vector_values(u).T
    speed = np.linalg.norm(d, axis=1, keepdims=True)
    tangent = d / speed
    across = dd - np.sum(dd * tangent, axis=1, keepdims=True) * tangent
    return Arc(at, curve.vector_values(u).T, tangent, across / speed**2)


def points_along(curve: Callable[[Array], Array], none: float) -> Array | None:
    """Return points through which a plane curve is drawn, shape (k, 2).

    These are 25 at equal distances; more, and the tips of its bends, where it turns sharply.

    Args:
        curve: Points, shape (k, 2), of parameters from 0 to 1, shape (k,).
        none: Length up to which it is none.

    Returns:
        The points, or None if it has no length.

    Raises:
        ValueError: If a point is not finite.
    """
    shares = np.linspace(0.0, 1.0, _LOOKED_AT)
    looked_at = curve(shares)
    if not np.isfinite(looked_at).all():
        raise ValueError("has a point that is not finite")
    way = np.cumsum([0.0, *_chords(looked_at)])
    if way[-1] <= none:
        return None
    points = curve(np.interp(np.linspace(0.0, way[-1], _POINTS), way, shares))
    if _turns(points).max() <= _TURN:
        return points
    return curve(_spread(curve, shares, _CHORD * float(way[-1])))


def _chords(points: Array) -> Array:
    return np.asarray(np.linalg.norm(np.diff(points, axis=0), axis=1))


def _turns(points: Array) -> Array:
    """Return the angles between chords, 0 at both ends, shape (k,) [rad]."""
    ways = np.diff(points, axis=0)
    cross = ways[:-1, 0] * ways[1:, 1] - ways[:-1, 1] * ways[1:, 0]
    inner = np.arctan2(np.abs(cross), np.sum(ways[:-1] * ways[1:], axis=1))
    return np.concatenate(([0.0], inner, [0.0]))


def _spread(curve: Callable[[Array], Array], shares: Array, least: float) -> Array:
    """Return parameters of a curve, evenly spread over its length and its turn together.

    A point at which it turns by a corner, even between chords of length ``least``, is one of them.
    """
    for _ in range(_HALVINGS):
        points = curve(shares)
        sharp = _turns(points) > _FINE_TURN
        is_halved = (sharp[:-1] | sharp[1:]) & (_chords(points) > least)
        if not is_halved.any():
            break
        shares = np.sort(np.concatenate((shares, (shares[:-1] + shares[1:])[is_halved] / 2.0)))
    shares = shares[np.concatenate(([True], _chords(curve(shares)) > 0.0))]
    points = curve(shares)
    turns = _turns(points)
    corners = turns >= CORNER
    turns[corners] = 0.0
    way = np.cumsum([0.0, *_chords(points)])
    spread = way / way[-1] * (_POINTS - 1) + np.cumsum(turns) / _TURN
    at = np.linspace(0.0, spread[-1], int(np.ceil(spread[-1])) + 1)
    even = np.interp(at, spread, shares)
    # The nearest point is moved to a corner; another beside it would leave a chord of no length.
    for corner in shares[corners]:
        even[np.abs(even[1:-1] - corner).argmin() + 1] = corner
    even = np.unique(even)
    # Where a chord is long beside the next, a spline would swing.
    for _ in range(_HALVINGS):
        chords = _chords(curve(even))
        chords_with_ends = np.concatenate(([np.inf], chords, [np.inf]))
        long = chords > _LONG * np.minimum(chords_with_ends[:-2], chords_with_ends[2:])
        if not long.any():
            break
        even = np.sort(np.concatenate((even, (even[:-1] + even[1:])[long] / 2.0)))
    return even

"""Smooth curves by their arc length: straight, through points, or round a corner."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pydrake.trajectories import PiecewisePolynomial

from ..inputs.fields import Array
from .pieces import Pieces, quintic_pieces, quintics

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
    closed = meets and turn(*(way / np.linalg.norm(way) for way in ends)) < CORNER
    spline = PiecewisePolynomial.CubicWithContinuousSecondDerivatives(
        breaks=chords, samples=points.T, periodic_end_condition=closed
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
        halved = (sharp[:-1] | sharp[1:]) & (_chords(points) > least)
        if not halved.any():
            break
        shares = np.sort(np.concatenate((shares, (shares[:-1] + shares[1:])[halved] / 2.0)))
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
        framed = np.concatenate(([np.inf], chords, [np.inf]))
        long = chords > _LONG * np.minimum(framed[:-2], framed[2:])
        if not long.any():
            break
        even = np.sort(np.concatenate((even, (even[:-1] + even[1:])[long] / 2.0)))
    return even

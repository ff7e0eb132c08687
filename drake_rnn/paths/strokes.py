"""Strokes of a pen: lines and curves with corners, divided into runs from rest to rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..inputs.fields import Array
from .arc_length import CORNER, Arc, line, rounding, through, turn
from .run import Run

#: Lines and curves, each given by points of shape (k, 3) [m]: two of a straight line, more of a
#: curve through them. Each begins where the one before it ends.
Stroke = Sequence[Array]

# Distance up to which a stroke begins where the one before it ended [m].
_SAME = 1e-9
# Largest share of a line or curve that the rounding of one corner takes.
_SHARE = 0.45
# Turns at a corner: one that is none [rad], one that is rounded where others are stopped at, and
# one that is stopped at where others are rounded, because the point all but goes back.
_NONE, _SLIGHT, _BACK = 1e-9, np.deg2rad(10.0), np.deg2rad(170.0)
# Pieces into which a curve is divided between two of its points.
_PIECES = 2


@dataclass(frozen=True)
class Pen:
    """How strokes are drawn.

    Attributes:
        radius: Largest distance from a corner at which its rounding begins or ends [m]; None to
            stop at corners.
        slight: The same for corners of at most 10 degrees, which are always rounded [m].
        lift: Vector by which moves between strokes lie away from them, shape (3,) [m].
        returns: Whether a move leads from the last stroke back to the first.
    """

    radius: float | None
    slight: float
    lift: Array
    returns: bool

    def runs(self, strokes: Sequence[Stroke]) -> list[Run]:
        """Return the runs that draw strokes one after another.

        A stroke that begins where the one before it ends goes on with it.
        """
        strokes = _joined(strokes)
        runs = self._drawn(strokes[0])
        for before, stroke in pairwise(strokes):
            runs += [*self._move(before[-1][-1], stroke[0][0]), *self._drawn(stroke)]
        if self.returns:
            runs += self._move(strokes[-1][-1][-1], strokes[0][0][0])
        return runs

    def _drawn(self, stroke: Stroke) -> list[Run]:
        arcs = [
            line(*points) if len(points) == 2 else through(points, _PIECES) for points in stroke
        ]
        return _runs(arcs, [self._radius(*pair) for pair in pairwise(arcs)])

    def _radius(self, before: Arc, after: Arc) -> float | None:
        """Return the reach of the rounding between two curves [m]; None for a stop."""
        angle = turn(before.tangent[-1], after.tangent[0])
        if angle <= _NONE and before.straight and after.straight:
            return 0.0
        if angle <= _SLIGHT:
            return self.slight if self.radius is None else max(self.radius, self.slight)
        return None if angle >= _BACK else self.radius

    def _move(self, p: Array, q: Array) -> list[Run]:
        """Return the move from the end of a stroke to a start; none if they are the same."""
        if np.linalg.norm(q - p) < _SAME:
            return []
        if not self.lift.any():
            return [Run((line(p, q),))]
        arcs = [line(*pair) for pair in pairwise((p, p + self.lift, q + self.lift, q))]
        return _runs(arcs, [float(np.linalg.norm(self.lift))] * 2)


def _joined(strokes: Sequence[Stroke]) -> list[Stroke]:
    joined = [list(strokes[0])]
    for stroke in strokes[1:]:
        if np.linalg.norm(stroke[0][0] - joined[-1][-1][-1]) < _SAME:
            joined[-1] += stroke
        else:
            joined.append(list(stroke))
    return list(joined)


def _runs(arcs: Sequence[Arc], radii: Sequence[float | None]) -> list[Run]:
    """Return the runs of curves one after another, divided where there is a stop.

    Args:
        arcs: The curves.
        radii: Reach of the rounding between each two of them [m]; None for a stop.
    """
    reaches = [
        0.0 if radius is None else min(radius, _SHARE * one.length, _SHARE * other.length)
        for radius, (one, other) in zip(radii, pairwise(arcs), strict=True)
    ]
    cut = [
        arc.part(begin, arc.length - end) if begin or end else arc
        for arc, begin, end in zip(arcs, [0.0, *reaches], [*reaches, 0.0], strict=True)
    ]
    runs: list[list[Arc]] = [[cut[0]]]
    for radius, reach, (before, after) in zip(radii, reaches, pairwise(cut), strict=True):
        if radius is None:
            runs.append([])
        elif reach:
            runs[-1].append(rounding(before, after, reach))
        runs[-1].append(after)
    return [Run(tuple(run)) for run in runs]


def divided(points: Array) -> list[Array]:
    """Return points, shape (k, 3), divided at corners: where lines between them turn sharply."""
    ways = np.diff(points, axis=0)
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    t, u = ways[:-1], ways[1:]
    turns = 2.0 * np.arctan2(*(np.linalg.norm(way, axis=1) for way in (u - t, u + t)))
    ends = [0, *(np.flatnonzero(turns >= CORNER) + 1).tolist(), len(points) - 1]
    return [points[begin : end + 1] for begin, end in pairwise(ends)]

r"""Choosing the velocity of the next sample without collisions, within bounds to the acceleration.

The law may always brake as hard as it can, and what it certifies is that this stop is free. With
w_0 the first velocity of the full stop from v, that stop passes postures q_k. At four of them, each
pair whose distance d may matter gives the program a row, by its slope n with respect to the joints
and by D, how far a change of w moves them there,

.. math::
    n^T D (w - w_0) \ge -\gamma h \max(d(q_k) - d_0, 0),

which w_0 satisfies: with rows or without, the program has a solution. Rows are linear and local,
and promise nothing. What promises is the certificate behind them: w is held for a period, then
the stop follows; wherever two postures of that motion are l apart (`drake_rnn.robot.clearance`), no
pair may come nearer in between than (d_1 + d_2 - l) / 2, or postures between them are looked at. If
it fails, w moves towards w_0, by halves, in the end all the way. w_0 needs no look: what is left of
a certified stop after its first sample is that stop, and was certified a sample ago. And it lies
within the box, which is convex, so a velocity on the way keeps every bound as well.

To look at distances takes longer than the rest of the law. So those of the last look are kept,
with the posture they belong to: no pair can have come nearer since than the joints' way allows, and
where that leaves room for the whole stop, nothing is looked at.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...inputs.fields import Array, Gain, Length, validated
from ...robot.clearance import Clearance
from ...robot.held_stop import HeldStop
from ...robot.limits import JointLimits
from .box_program import within_box
from .held_within import Kept, Program
from .rows_program import Rows, within_rows

#: Parts of the stop at which rows are set up.
_PARTS = np.array([0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0])
# Postures of a stop that are looked at first, and how often intervals between them are halved.
_POSTURES, _HALVINGS = 6, 12
# Shares of the way from the stop's first velocity to one that is not free that are tried.
_SHARES = (0.5, 0.25)
# Slope of a row that no joint changes [m].
_FLAT = 1e-9


@validated
class Avoidance:
    """How near a law lets its arm come to itself and to obstacles.

    Args:
        floor: Distance that no pair comes below: that is certified [m].
        distance: Distance at which it comes to rest before an obstacle in its way [m].
        approach: Share of the distance left that may be used up in a second [1/s].
    """

    floor: Length = 0.005
    distance: Length = 0.01
    approach: Gain = 10.0

    def __post_init__(self) -> None:
        if not self.distance > self.floor:
            raise ValueError(
                f"distance: must be greater than floor, {self.floor:g} m, not {self.distance:g}"
            )


class Known(NamedTuple):
    """Distances that were looked at.

    Attributes:
        q: The posture that they belong to, shape (n,) [rad].
        gaps: Distances of the pairs there, shape (p,) [m].
        stop: Those along the full stop from there, if they were looked at in this sample: the
            numbers of samples, shape (s,), postures, shape (s, n), and distances, shape (s, p).
    """

    q: Array
    gaps: Array
    stop: tuple[Array, Array, Array] | None = None


@dataclass(frozen=True, eq=False)
class WithinClear:
    """Limits of position, velocity and, if there are any, of acceleration; and no collision.

    Attributes:
        limits: Limits of the joints.
        clearance: The pairs that are to stay apart.
        avoidance: How near they may come.
    """

    limits: JointLimits
    clearance: Clearance
    avoidance: Avoidance

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of its parts of the state, by name."""
        return {"seen": (self.limits.size,), "gaps": (self.clearance.count,), "held_back": (1,)}

    def start(self, q: Array) -> Kept:
        """Return its parts of the state in a posture, shape (n,) [rad]."""
        return {"seen": q, "gaps": self.clearance.gaps(q), "held_back": np.zeros(1)}

    def chosen(
        self, program: Program, q: Array, v: Array, kept: Kept, period: float
    ) -> tuple[Array, Kept]:
        """Return the next velocity, as `WithinAcceleration.chosen` does."""
        J, b, _, g, softness = program
        stop = HeldStop(self.limits.require("acceleration", "braking in time"), period)
        first = stop.after(v)
        lower, upper = self.limits.held_velocity_box(q, v, period)
        known, rows = Known(kept["seen"], kept["gaps"]), None
        widest = np.maximum(upper - first, first - lower)
        if self._may_bind(q, first, widest, known, stop):
            known, rows = self._rows(q, first, widest, stop)
        if rows is None:
            w = within_box(J, b, g, softness, lower, upper)
        else:
            found = within_rows(J, b, g, softness, lower, upper, rows)
            w = first if found is None else found
        held_back = kept["held_back"]
        if not self._is_free(q, w, known, stop):
            nearer = (first + share * (w - first) for share in _SHARES)
            w = next((u for u in nearer if self._is_free(q, u, known, stop)), first)
            held_back = held_back + 1.0
        return w, {"seen": known.q, "gaps": known.gaps, "held_back": held_back}

    def _left(self, q: Array, known: Known, way: Array) -> Array:
        """Return how far each pair is apart at least after a way of the joints, shape (p,) [m]."""
        return known.gaps - self.clearance.reaches @ (np.abs(q - known.q) + way)

    def _may_bind(
        self, q: Array, first: Array, widest: Array, known: Known, stop: HeldStop
    ) -> bool:
        """Return whether any velocity of the box can fail a row, by what is known of distances."""
        (leverage,) = stop.leverage(first, np.array([stop.samples(first)]))
        rate = self.avoidance.approach * stop.period
        room = rate * (self._left(q, known, stop.way(first)) - self.avoidance.distance)
        return bool((self.clearance.reaches @ (leverage * widest) > room).any())

    def _rows(
        self, q: Array, first: Array, widest: Array, stop: HeldStop
    ) -> tuple[Known, Rows | None]:
        """Return what is known of distances now, and the rows of the pairs that may matter."""
        k = np.unique(np.rint(1.0 + _PARTS * (stop.samples(first) - 1.0)))
        leverage = stop.leverage(first, k)
        rate = self.avoidance.approach * stop.period
        # Of a pair that is farther away no velocity of the box can fail the row.
        within = self.avoidance.distance + (leverage * widest) @ self.clearance.reaches.T / rate
        path = q + np.vstack((np.zeros_like(q), stop.moved(first, k)))
        # Where the arm is, distances are all that is wanted.
        near = self.clearance.near(path, np.vstack((np.full_like(within[0], -np.inf), within)))
        known = Known(q, near.gaps[0], (np.concatenate(([0.0], k)), path, near.gaps))
        A = near.slopes * leverage[near.postures - 1]
        size = np.sqrt((A * A).sum(axis=1))
        some = size > _FLAT
        if not some.any():
            return known, None
        room = near.gaps[near.postures, near.pairs] - self.avoidance.distance
        c = A @ first - rate * np.maximum(room, 0.0)
        return known, Rows(A[some] / size[some, None], c[some] / size[some])

    def _is_free(self, q: Array, w: Array, known: Known, stop: HeldStop) -> bool:
        """Return whether the arm can hold a velocity for a period and then stop, always free."""
        floor, reaches = self.avoidance.floor, self.clearance.reaches
        if (self._left(q, known, stop.way(w)) >= floor).all():
            return True
        if known.stop is not None:
            # Its postures are near those of the full stop.
            k, path, gaps = known.stop
            # To the end of this stop, which may take a sample more.
            k = np.append(k[:-1], max(k[-1], stop.samples(w)))
            passed = q + stop.moved(w, k)
            least = gaps - np.abs(passed - path) @ reaches.T
            between = np.abs(np.diff(passed, axis=0)) @ reaches.T
            if (least[1:] + least[:-1] - between >= 2.0 * floor).all():
                return True
        k = np.linspace(0.0, stop.samples(w), _POSTURES)
        begins, ends = k[:-1], k[1:]
        q_begin, q_end = q + stop.moved(w, begins), q + stop.moved(w, ends)
        gaps = self.clearance.gaps(np.concatenate((q_begin[:1], q_end)))
        # Where it is now it was certified to be free.
        if (gaps[1:] < floor).any():
            return False
        d_begin, d_end = gaps[:-1], gaps[1:]
        for _ in range(_HALVINGS):
            nearer = 0.5 * (d_begin + d_end - np.abs(q_end - q_begin) @ reaches.T)
            unsure = (nearer < floor).any(axis=1)
            if not unsure.any():
                return True
            begins, ends = begins[unsure], ends[unsure]
            middles = 0.5 * (begins + ends)
            q_middle = q + stop.moved(w, middles)
            d_middle = self.clearance.gaps(q_middle)
            if (d_middle < floor).any():
                return False
            begins, ends = np.concatenate((begins, middles)), np.concatenate((middles, ends))
            q_begin = np.concatenate((q_begin[unsure], q_middle))
            q_end = np.concatenate((q_middle, q_end[unsure]))
            d_begin = np.concatenate((d_begin[unsure], d_middle))
            d_end = np.concatenate((d_middle, d_end[unsure]))
        return False

r"""Choosing the velocity of the next sample without collisions, within bounds to the jerk.

The law may always brake as hard as it can, and what it certifies is that this stop is free. With
w_0 the first velocity of the full stop from v, that stop passes postures q_k. At five of them, each
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

With the jerk bounded the same holds of the next acceleration, and rows are of the velocity z that
the program is solved for (`drake_rnn.laws.parts.held_within`).

An obstacle that moves is measured, p_WO, with an error of at most e, and is at most u fast: t
later a pair with it is apart by the distance from where it is measured less e + u t, which takes
the place of d. So what is certified holds whatever it does until the arm rests; and a stop that was
certified a sample ago holds whatever is measured now. To an arm that rests nothing is promised.

Rows alone leave the arm at their edge, where they come and go from sample to sample. So joints that
the task leaves free may be led away before (`drake_rnn.laws.parts.led_away`).

To look at distances takes longer than the rest of the law. So those of the last look are kept,
with the posture they belong to: no pair can have come nearer since than the joints' way allows, and
where that leaves room for the whole stop, nothing is looked at.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ...errors import InvalidInputError
from ...inputs.fields import Array, Gain, Length, validated
from ...robot.clearance import Clearance
from ...robot.clearance.clearance import Near
from ...robot.clearance.neighbour import Neighbour
from ...robot.limits import JointLimits
from .box_program import within_box
from .held_within import (
    Choice,
    Kept,
    Program,
    Seen,
    WithinAcceleration,
    WithinJerk,
    within_limits,
)
from .led_away import LedAway
from .rows_program import Rows, within_rows
from .world import BothStop, Stop, World

#: Parts of the stop at which rows are set up.
_PARTS = np.array([0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0])
# Postures of a stop that are looked at first, and how often intervals between them are divided,
# into how many pieces at most.
_POSTURES, _ROUNDS, _PIECES = 6, 8, 8
# Room that counts as none where intervals are divided [m].
_CLOSE = 1e-4
# More intervals than this that may not be free are not looked into: that would take too long.
_UNSURE = 40
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


def require_free(clearance: Clearance, floor: float, q: Array, p_WO: Array | None = None) -> None:
    """Raise an InvalidInputError if an arm starts nearer to something than it may come.

    Args:
        clearance: The pairs that are to stay apart.
        floor: How near they may come [m].
        q: Posture at the start, shape (n,) [rad].
        p_WO: How far obstacles have moved, shape (m, 3) [m]; None if not at all.
    """
    gaps = clearance.gaps(q, p_WO) - clearance.errors
    if gaps.min(initial=np.inf) < floor:
        one, other = clearance.names[int(gaps.argmin())]
        raise InvalidInputError(
            f"clearance: at the start {one} and {other} are {gaps.min():.3g} m apart, where "
            f"{floor:g} m are kept, avoidance.floor; clear the way or start elsewhere"
        )


class Known(NamedTuple):
    """Distances that were looked at.

    Errors of what was measured, and what obstacles may have moved since, are taken off.

    Attributes:
        q: The posture that they belong to, shape (n,) [rad].
        gaps: Distances of the pairs there, at least, shape (p,) [m].
        stop: Those along the full stop from there, if they were looked at in this sample: the
            numbers of samples, shape (s,), postures, shape (s, n), and distances, shape (s, p).
    """

    q: Array
    gaps: Array
    stop: tuple[Array, Array, Array] | None = None


class Looked(NamedTuple):
    """What was seen along the full stop, where the arm is first.

    Attributes:
        known: The distances.
        near: What is near, of these postures.
        gaps: Distances that pairs have at least, shape (1 + s, p) [m].
        leverage: By how much a change of z moves the joints to the others, shape (s, n) [s].
    """

    known: Known
    near: Near
    gaps: Array
    leverage: Array


@dataclass(frozen=True, eq=False)
class WithinClear:
    """Limits of the joints, and no collision.

    Attributes:
        within: What bounds the joints.
        clearance: The pairs that are to stay apart.
        avoidance: How near they may come.
        neighbour: The arm beside it; None without one.
        led_away: How joints that the task leaves free make way; None if they do not.
    """

    within: WithinAcceleration | WithinJerk
    clearance: Clearance
    avoidance: Avoidance
    neighbour: Neighbour | None = None
    led_away: LedAway | None = None

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of its parts of the state, by name."""
        own = {"seen": (self.clearance.size,), "gaps": (self.clearance.count,), "held_back": (1,)}
        return self.within.shapes | own

    def start(self, q: Array, seen: Seen) -> Kept:
        """Return its parts of the state in a posture, shape (n,) [rad], as all begins to move.

        Raises:
            InvalidInputError: If the arm is nearer to something there than it may come.
        """
        world = World(self.clearance, self.neighbour, seen, 0.0)
        whole = world.posture(q)
        require_free(self.clearance, self.avoidance.floor, whole, world.p_WO)
        gaps = self.clearance.gaps(whole, world.p_WO) - self.clearance.errors
        own = {"seen": whole, "gaps": gaps, "held_back": np.zeros(1)}
        return self.within.start(q, seen) | own

    def chosen(
        self, program: Program, q: Array, v: Array, kept: Kept, period: float, seen: Seen
    ) -> tuple[Array, Kept]:
        """Return the next velocity, as `WithinAcceleration.chosen` does."""
        J, b, _, g, softness = program
        choice = self.within.choice(program, q, v, kept, period)
        world = World(self.clearance, self.neighbour, seen, period)
        known = Known(kept["seen"], kept["gaps"] - world.nearer(1.0))
        # From here on q is the posture of all.
        q, stop = world.posture(q), world.around(choice.stop)
        looked = None
        if self.led_away is not None and self._may_lead(q, known, self.led_away):
            looked = self._looked(q, choice, stop, world)
            away = self.led_away.preferred(looked.near, looked.gaps)
            g = g + away[: g.size]
        z = within_box(J, b, g, softness, *choice.box)
        if looked is None and self._may_bind(
            q, np.abs(z - choice.first_z), known, choice, stop, world
        ):
            looked = self._looked(q, choice, stop, world)
        if looked is not None:
            known = looked.known
            rows = self._rows(looked, choice, world)
            if rows is not None and not rows.hold(z):
                found = within_rows(v, J, b, g, softness, *choice.box, rows)
                z = choice.first_z if found is None else found
        first, u, held_back = choice.first, choice.chosen(z), kept["held_back"]
        if not self._is_free(q, u, known, stop, world):
            way = (first + share * (u - first) for share in _SHARES)
            u = next((x for x in way if self._is_free(q, x, known, stop, world)), first)
            held_back = held_back + 1.0
        v, own = choice.taken(u)
        return v, own | {"seen": known.q, "gaps": known.gaps, "held_back": held_back}

    @cached_property
    def _reaches(self) -> Array:
        """How much nearer pairs come by the arm's own joints; see `Clearance.reaches`."""
        return self.clearance.reaches[:, : self.within.limits.size]

    def _left(self, q: Array, known: Known, way: Array) -> Array:
        """Return how far each pair is apart at least after a way of the joints, shape (p,) [m]."""
        return known.gaps - self.clearance.reaches @ (np.abs(q - known.q) + way)

    def _may_bind(
        self,
        q: Array,
        change: Array,
        known: Known,
        choice: Choice,
        stop: Stop | BothStop,
        world: World,
    ) -> bool:
        """Return whether a z can fail a row that is so far from the stop's, as far as is known."""
        first, samples = choice.first, choice.stop.samples(choice.first)
        (leverage,) = choice.leverage(np.array([samples]))
        left = self._left(q, known, stop.way(first)) - world.nearer(samples)
        room = self.avoidance.approach * world.period * (left - self.avoidance.distance)
        return bool((self._reaches @ (leverage * change) > room).any())

    def _may_lead(self, q: Array, known: Known, led_away: LedAway) -> bool:
        """Return whether an obstacle may be within the zone, as far as is known."""
        left = self._left(q, known, np.zeros_like(q))
        return bool((left[len(self.clearance.own) :] < led_away.zone).any())

    def _looked(self, q: Array, choice: Choice, stop: Stop | BothStop, world: World) -> Looked:
        """Return distances along the full stop, with the slopes of those that may matter."""
        first = choice.first
        k = np.unique(np.rint(1.0 + _PARTS * (choice.stop.samples(first) - 1.0)))
        leverage = choice.leverage(k)
        # Of a pair that is farther away no velocity of the box can fail the row.
        widest = np.maximum(choice.box[1] - choice.first_z, choice.first_z - choice.box[0])
        rate = self.avoidance.approach * world.period
        within = self.avoidance.distance + (leverage * widest) @ self._reaches.T / rate
        # Where the arm is, joints are led away from obstacles, whose pairs come last.
        now = np.full(self.clearance.count, -np.inf)
        if self.led_away is not None:
            now[len(self.clearance.own) :] = self.led_away.zone
        path = q + np.vstack((np.zeros_like(q), stop.moved(first, k)))
        k_path = np.concatenate(([0.0], k))
        doubt = world.doubt(k_path)
        near = self.clearance.near(path, np.vstack((now, within)) + doubt, world.p_WO)
        gaps = world.least(near.gaps, doubt)
        return Looked(Known(q, gaps[0], (k_path, path, gaps)), near, gaps, leverage)

    def _rows(self, looked: Looked, choice: Choice, world: World) -> Rows | None:
        """Return the rows of the pairs that may matter; None without any."""
        near = looked.near
        ahead = near.postures > 0
        postures, pairs = near.postures[ahead], near.pairs[ahead]
        leverage = looked.leverage[postures - 1]
        A = near.slopes[ahead, : leverage.shape[1]] * leverage
        size = np.sqrt((A * A).sum(axis=1))
        some = size > _FLAT
        if not some.any():
            return None
        room = looked.gaps[postures, pairs] - self.avoidance.distance
        rate = self.avoidance.approach * world.period
        c = A @ choice.first_z - rate * np.maximum(room, 0.0)
        return Rows(A[some] / size[some, None], c[some] / size[some])

    def _is_free(
        self, q: Array, u: Array, known: Known, stop: Stop | BothStop, world: World
    ) -> bool:
        """Return whether the arm can do u for a period and then stop, always free."""
        floor, samples = self.avoidance.floor, stop.samples(u)
        if (self._left(q, known, stop.way(u)) - world.nearer(samples) >= floor).all():
            return True
        if known.stop is not None:
            # The full stop, which was looked at, passes near; this one may take a sample more.
            seen, path, gaps = known.stop
            k = np.append(seen[:-1], max(seen[-1], samples))
            off = np.abs(q + stop.moved(u, k) - path) @ self.clearance.reaches.T
            least = gaps - off - world.nearer(k - seen)
            if self._is_free_between(q, u, k, least, stop, world):
                return True
        k = np.linspace(0.0, samples, _POSTURES)
        gaps = world.gaps(q + stop.moved(u, k), k)
        return self._is_free_between(q, u, k, gaps, stop, world)

    def _is_free_between(
        self, q: Array, u: Array, k: Array, gaps: Array, stop: Stop | BothStop, world: World
    ) -> bool:
        """Return whether it is, by how far pairs are apart at least after k samples, shape (s, p).

        A pair that came nearer than the floor between two of these would have had too short a way.
        """
        floor, reaches = self.avoidance.floor, self.clearance.reaches
        # Where it is now it was certified to be free. What is not a number is not free.
        if not (gaps[1:] >= floor).all():
            return False
        # Intervals of the stop: when they begin and end, and how far pairs are apart there.
        begin, end, d_begin, d_end = k[:-1], k[1:], gaps[:-1], gaps[1:]
        for _ in range(_ROUNDS):
            way = stop.travelled(u, end) - stop.travelled(u, begin)
            nearer = way @ reaches.T + world.nearer(end - begin)
            unsure = ~(0.5 * (d_begin + d_end - nearer) >= floor).all(axis=1)
            if not unsure.any():
                return True
            if unsure.sum() > _UNSURE:
                return False
            begin, end, d_begin, d_end = (x[unsure] for x in (begin, end, d_begin, d_end))
            count = _pieces(nearer[unsure], np.minimum(d_begin, d_end) - floor)
            edges = begin[:, None] + np.arange(count + 1) / count * (end - begin)[:, None]
            inner = edges[:, 1:-1].ravel()
            d_inner = world.gaps(q + stop.moved(u, inner), inner)
            if not (d_inner >= floor).all():
                return False
            d_inner = d_inner.reshape(begin.size, count - 1, -1)
            d_edges = np.concatenate((d_begin[:, None], d_inner, d_end[:, None]), axis=1)
            begin, end = edges[:, :-1].ravel(), edges[:, 1:].ravel()
            d_begin = d_edges[:, :-1].reshape(begin.size, -1)
            d_end = d_edges[:, 1:].reshape(end.size, -1)
        return False


def _pieces(nearer: Array, room: Array) -> int:
    """Return into how many pieces intervals are divided so that all of them should be sure.

    Args:
        nearer: How much nearer pairs may come in each interval, shape (s, p) [m].
        room: How much nearer than at its ends they may come, likewise.
    """
    # Of a piece at the nearer end, half of its way must leave room; more of what is not linear.
    needed = 0.5 * (nearer / np.maximum(room, _CLOSE)).max()
    return int(np.clip(np.ceil(1.2 * needed), 2, _PIECES))


#: What chooses a velocity that keeps limits and, maybe, distances.
Within = WithinAcceleration | WithinJerk | WithinClear


def within_safe(
    limits: JointLimits,
    smoothing: Any,
    avoids: tuple[Clearance, Avoidance] | None,
    neighbour: Neighbour | None = None,
    led_away: LedAway | None = None,
) -> Within:
    """Return what keeps limits, see `within_limits`, and, where anything is avoided, a distance.

    Args:
        limits: Limits of the joints, those of `drake_rnn.laws.parts.reached_limits`.
        smoothing: See `WithinJerk`.
        avoids: What the arm is to stay clear of, and how near it may come; None for nothing.
        neighbour: The arm beside it that ``avoids`` counts; None without one.
        led_away: How joints that the task leaves free make way; None if they do not.
    """
    found = within_limits(limits, smoothing)
    return found if avoids is None else WithinClear(found, *avoids, neighbour, led_away)

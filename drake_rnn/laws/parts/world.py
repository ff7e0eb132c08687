"""What is in an arm's way from now on: obstacles that move, and another arm beside it.

Whether a motion and the stop behind it are free, between samples too.

A pair that is d_1 apart at one posture of a motion and d_2 at another, between which the joints can
bring it nearer by l (`drake_rnn.robot.clearance`), is never nearer in between than
(d_1 + d_2 - l) / 2. Where that is too near, postures between them are looked at.

Most pairs need no look. Two bounds on their distances are exact, whatever the motion is:

- where the arm is now, a pair is apart by what it was when it was looked at last, less what the
  joints have gone since, joint by joint and sample by sample, times how much nearer that can bring
  it. So what was looked at once is known from then on, the less the farther the joints have gone;
- during the whole motion it is apart by that, less the way of the whole motion likewise.

Only pairs that the second leaves too near are looked at, and then all that is said above is said of
them alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...inputs.fields import Array
from ...robot.clearance import Clearance, Flags, Indices, Near
from ...robot.clearance.clearance import OTHER, Neighbour
from ...robot.jerk_stop import HeldJerkStop, HeldStop, course
from ..law import Signals
from .obstacle_tracks import ANYWHERE, Places

#: The fastest stop of an arm.
Stop = HeldStop | HeldJerkStop

_ALL = slice(None)


@dataclass(frozen=True, eq=False)
class NeighbourStop:
    """How another arm goes on: what it has chosen, and then its fastest stop.

    Attributes:
        neighbour: The arm.
        seen: What is seen of it.
        period: Length of a sample [s].
    """

    neighbour: Neighbour
    seen: Signals
    period: float

    @cached_property
    def posture(self) -> Array:
        """Where it is now, shape (n,) [rad]."""
        return self.seen[f"{OTHER}commanded"] - self._sample_count * self.period * self._v

    @property
    def samples(self) -> float:
        """After how many samples it rests."""
        return self._stop.samples(self._first) + self._sample_count

    def way(self) -> Array:
        """Return how far each joint goes until it rests, shape (n,) [rad]."""
        return self._sample_count * self.period * np.abs(self._v) + self._stop.way(self._first)

    def travel(self, k: Array) -> Array:
        """Return how far the joints have gone after k samples, shape (s, n) [rad]."""
        hold = np.minimum(k, self._sample_count)[:, None] * self.period * self._v
        return hold + self._stop.travel(self._first, np.maximum(k - self._sample_count, 0.0))

    def travel_and_way(self, k: Array) -> tuple[Array, Array]:
        """Return the same and the way of each joint until then, there and back, (s, n) each."""
        hold = np.minimum(k, self._sample_count)[:, None] * self.period * self._v
        travel, way = self._stop.travel_and_way(
            self._first, np.maximum(k - self._sample_count, 0.0)
        )
        return hold + travel, np.abs(hold) + way

    @property
    def _sample_count(self) -> float:
        """Number of samples for which it has chosen."""
        return float(self.neighbour.has_chosen)

    @property
    def _v(self) -> Array:
        return self.seen[f"{OTHER}v"]

    @cached_property
    def _stop(self) -> Stop:
        limits = self.neighbour.limits
        most = limits.require("acceleration", "braking in time")
        if limits.jerk is None:
            return HeldStop(most, self.period)
        return HeldJerkStop(self._v, most, limits.jerk, self.period)

    @cached_property
    def _first(self) -> Array:
        """What its stop begins with."""
        stop = self._stop
        if isinstance(stop, HeldStop):
            return stop.after(self._v)
        a = self.seen[f"{OTHER}a"]
        return course(self._v, a, stop.acceleration, stop.jerk, self.period).first


@dataclass(frozen=True, eq=False)
class BothStop:
    """The stop of an arm and what another one beside it does meanwhile, joints behind joints.

    Attributes:
        own: The arm's.
        other: The other one's.
    """

    own: Stop
    other: NeighbourStop

    def samples(self, u: Array) -> float:
        """Return after how many samples both rest; see `HeldStop` and `HeldJerkStop`."""
        return max(self.own.samples(u), self.other.samples)

    def way(self, u: Array) -> Array:
        """Return how far each joint goes until it rests, shape (n,) [rad]."""
        return np.concatenate((self.own.way(u), self.other.way()))

    def travel(self, u: Array, k: Array) -> Array:
        """Return how far the joints have gone after k samples, shape (s, n) [rad]."""
        return np.concatenate((self.own.travel(u, k), self.other.travel(k)), axis=1)

    def travel_and_way(self, u: Array, k: Array) -> tuple[Array, Array]:
        """Return the same and the way of each joint until then, there and back, (s, n) each."""
        parts = zip(self.own.travel_and_way(u, k), self.other.travel_and_way(k), strict=True)
        travel, way = (np.concatenate(part, axis=1) for part in parts)
        return travel, way


@dataclass(frozen=True, eq=False)
class World:
    """What is in an arm's way from now on, as far as it is known.

    Postures are those of the arm and, behind them, of the one beside it, if there is one.

    Attributes:
        clearance: The pairs that are to stay apart.
        neighbour: The arm beside it; None without one.
        seen: What is seen of it.
        period: Length of a sample [s].
        places: Where obstacles may be; None if none may move.
        delay: Time by which obstacles count as going on for longer than they are seen to [s].
    """

    clearance: Clearance
    neighbour: Neighbour | None
    seen: Signals
    period: float
    places: Places | None = None
    delay: float = 0.0

    @cached_property
    def _other(self) -> NeighbourStop:
        """What the other arm does; there must be one."""
        assert self.neighbour is not None
        return NeighbourStop(self.neighbour, self.seen, self.period)

    def posture(self, q: Array) -> Array:
        """Return the posture of all, for that of the arm itself, shape (n,) [rad]."""
        return q if self.neighbour is None else np.concatenate((q, self._other.posture))

    def around(self, stop: Stop) -> Stop | BothStop:
        """Return what all do, for a stop of the arm itself."""
        return stop if self.neighbour is None else BothStop(stop, self._other)

    def gaps(self, q: Array, k: Array, pairs: Indices) -> Array:
        """Return the least that pairs can be apart, shape (s, r) [m].

        Args:
            q: Postures, shape (s, n) [rad].
            k: After how many samples they are reached, shape (s,).
            pairs: The pairs, in order, shape (r,).
        """
        if self.places is None:
            return self.clearance.gaps(q, None, pairs)
        distances = [
            self.clearance.gaps(q, p_WO, pairs) - (doubt[pairs] + self.nearer(k, pairs))
            for p_WO, doubt in self._places
        ]
        return distances[0] if len(distances) == 1 else np.minimum(*distances)

    def near(self, q: Array, k: Array, pairs: Indices, with_slopes: Indices | slice) -> Near:
        """Return the same with the slopes in some postures, of `Clearance.near`.

        Of an obstacle that may be anywhere there are none.
        """
        if self.places is None:
            return self.clearance.near(q, None, pairs, with_slopes)
        distances = [self._near_at(*place, q, k, pairs, with_slopes) for place in self._places]
        near = distances[0]
        if len(distances) == 1:
            return near
        other = distances[1]
        nearer = other.gaps < near.gaps
        slopes = np.where(nearer[with_slopes][..., None], other.slopes, near.slopes)
        return Near(pairs, np.where(nearer, other.gaps, near.gaps), slopes)

    def _near_at(
        self,
        p_WO: Array,
        doubt: Array,
        q: Array,
        k: Array,
        pairs: Indices,
        with_slopes: Indices | slice,
    ) -> Near:
        """Return what `near` does if obstacles are at places, with a doubt of each pair's gap."""
        near = self.clearance.near(q, p_WO, pairs, with_slopes)
        gaps = near.gaps - (doubt[pairs] + self.nearer(k, pairs))
        return Near(pairs, gaps, np.where((doubt[pairs] < ANYWHERE)[:, None], near.slopes, 0.0))

    def gaps_now(self, q: Array) -> Array:
        """Return the least that all pairs can be apart in a posture of all, shape (p,) [m]."""
        if self.places is None:
            return self.clearance.gaps(q)
        gaps = [self.clearance.gaps(q, p) - doubt for p, doubt in self._places]
        return np.stack(gaps).min(axis=0)

    @cached_property
    def _places(self) -> tuple[tuple[Array, Array], ...]:
        """Places where obstacles may be, and how much nearer each pair may be there, (p,) [m]."""
        assert self.places is not None
        p_WO, radii, others, other_radii = self.places
        places = [(p_WO, radii)] if others is None else [(p_WO, radii), (others, other_radii)]
        return tuple((p, self._doubt(farther)) for p, farther in places)

    def _doubt(self, radii: Array | None) -> Array:
        """Return how much nearer than where it is taken to be each pair may be, (p,) [m]."""
        errors = self.clearance.errors
        if radii is not None:
            errors = errors + self.clearance.of_moving(radii)
        return errors + self.delay * self.clearance.speeds if self.delay else errors

    def nearer(self, k: float | Array, pairs: Indices | slice = _ALL) -> Array | float:
        """Return how much nearer obstacles can come in k samples, shape (..., r) [m].

        Args:
            k: Numbers of samples, shape (...).
            pairs: The pairs.
        """
        if not self.clearance.solids.moving.size:
            return 0.0
        return np.multiply.outer(k, self.clearance.speeds[pairs] * self.period)


def seen_signals(
    clearance: Clearance | None, neighbour: Neighbour | None = None
) -> dict[str, tuple[int, ...]]:
    """Return the signals by which a law sees what moves in its way, with their shapes."""
    count = 0 if clearance is None else len(clearance.solids.moving)
    signals: dict[str, tuple[int, ...]] = {"p_WO": (count, 3)} if count else {}
    if neighbour is None:
        return signals
    return signals | {signal: (neighbour.limits.size,) for signal in neighbour.parts}


# Postures of a stop that are looked at first, and how often intervals between them are divided,
# into how many pieces at most.
_POSTURES, _ROUNDS, _PIECES = 6, 8, 8
# Room that counts as none where intervals are divided [m].
_CLOSE = 1e-4
# More intervals than this that may not be free are not looked into: that would take too long.
_UNSURE = 40


class Along(NamedTuple):
    """What was seen along a motion.

    Attributes:
        pairs: The pairs that were looked at, in order, shape (r,).
        k: Numbers of samples after which postures are reached, the first of them 0, shape (s,).
        path: The postures, shape (s, n) [rad].
        gaps: Distances of the pairs in them, at least, shape (s, r) [m].
    """

    pairs: Indices
    k: Array
    path: Array
    gaps: Array

    def lower_bounds(self, left: Array) -> Array:
        """Return how far all pairs are apart where it begins, at least, shape (p,) [m].

        Args:
            left: What was known of that before, shape (p,) [m].
        """
        bounds = left.copy()
        bounds[self.pairs] = self.gaps[0]
        return bounds


@dataclass(frozen=True, eq=False)
class Certificate:
    """What is certified of motions: that no pair comes nearer than a floor.

    Attributes:
        clearance: The pairs.
        floor: The least distance [m].
    """

    clearance: Clearance
    floor: float

    def is_given(
        self,
        u: Array,
        q: Array,
        left: Array,
        along: Along | None,
        stop: Stop | BothStop,
        world: World,
    ) -> bool:
        """Return whether all can do u for a period and then stop, always free.

        Args:
            u: What is begun with, see `drake_rnn.laws.parts.bounded_velocity.Choice`, shape (n,).
            q: Where all are, shape (n,) [rad].
            left: How far pairs are apart there, at least, shape (p,) [m].
            along: What was seen along a motion from there that is much like this one, or in the
                posture alone; None if nothing was.
            stop: Where each u leads.
            world: What is in the way.
        """
        samples = stop.samples(u)
        least = left - self.clearance.reaches @ stop.way(u) - world.nearer(samples)
        # What is not a number is not sure.
        doubtful = ~(least >= self.floor)
        if not (count := np.count_nonzero(doubtful)):
            return True
        if along is not None and len(along.k) > 1:
            is_doubtful = doubtful[along.pairs]
            if np.count_nonzero(is_doubtful) == count and self._is_free_beside(
                u, q, along, is_doubtful, samples, stop, world
            ):
                return True
        (pairs,), k = doubtful.nonzero(), np.linspace(0.0, samples, _POSTURES)
        travel, way = stop.travel_and_way(u, k)
        gaps = world.gaps(q + travel, k, pairs)
        return self._is_free_between(u, q, pairs, k, way, gaps, stop, world)

    def _is_free_beside(
        self,
        u: Array,
        q: Array,
        along: Along,
        flags: Flags,
        samples: float,
        stop: Stop | BothStop,
        world: World,
    ) -> bool:
        """Return whether pairs that were chosen of those seen along a motion stay free on this."""
        pairs, k, gaps = along.pairs[flags], along.k, along.gaps[:, flags]
        if samples > k[-1]:
            k = k.copy()
            k[-1] = samples
        travel, way = stop.travel_and_way(u, k)
        off = np.abs(q + travel - along.path) @ self.clearance.reaches[pairs].T
        least = gaps - off - world.nearer(k - along.k, pairs)
        return self._is_free_between(u, q, pairs, k, way, least, stop, world)

    def _is_free_between(
        self,
        u: Array,
        q: Array,
        pairs: Indices,
        k: Array,
        travelled: Array,
        gaps: Array,
        stop: Stop | BothStop,
        world: World,
    ) -> bool:
        """Return whether pairs stay free, by how far they are apart at least after k samples.

        A pair that came nearer than the floor between two of these would have had too short a way.

        Args:
            u: What is begun with, shape (n,).
            q: Where all are, shape (n,) [rad].
            pairs: The pairs, shape (r,).
            k: Numbers of samples, the first of them 0, shape (s,).
            travelled: The way of each joint until then, shape (s, n) [rad].
            gaps: How far they are apart then, at least, shape (s, r) [m].
            stop: Where each u leads.
            world: What is in the way.
        """
        floor, reaches = self.floor, self.clearance.reaches[pairs]
        # Where it is now it was certified to be free. What is not a number is not free.
        if np.count_nonzero(gaps[1:] >= floor) < gaps[1:].size:
            return False
        # Intervals of the stop: when they begin and end, and how far pairs are apart there.
        begin, end, d_begin, d_end = k[:-1], k[1:], gaps[:-1], gaps[1:]
        way = travelled[1:] - travelled[:-1]
        for _ in range(_ROUNDS):
            nearer = way @ reaches.T + world.nearer(end - begin, pairs)
            sure = 0.5 * (d_begin + d_end - nearer) >= floor
            if np.count_nonzero(sure) == sure.size:
                return True
            unsure = ~sure.all(axis=1)
            if unsure.sum() > _UNSURE:
                return False
            begin, end, d_begin, d_end = (x[unsure] for x in (begin, end, d_begin, d_end))
            count = _pieces(nearer[unsure], np.minimum(d_begin, d_end) - floor)
            edges = begin[:, None] + np.arange(count + 1) / count * (end - begin)[:, None]
            travel, travelled = (
                x.reshape(*edges.shape, -1) for x in stop.travel_and_way(u, edges.ravel())
            )
            way = (travelled[:, 1:] - travelled[:, :-1]).reshape(-1, q.size)
            postures = q + travel[:, 1:-1].reshape(-1, q.size)
            d_inner = world.gaps(postures, edges[:, 1:-1].ravel(), pairs)
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
    count = 0.5 * (nearer / np.maximum(room, _CLOSE)).max()
    return int(np.clip(np.ceil(1.2 * count), 2, _PIECES))

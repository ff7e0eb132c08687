r"""What is in an arm's way from now on: obstacles that move, and another arm beside it.

Whether a motion and the stop behind it are free, between samples too.

Distances are computed in a fixed number of postures, after whole samples. Of each piece between two
of them there are two bounds, and a pair that either one leaves at the floor or above is free there.

**By the way.** A pair that is d_0 apart at one end and d_1 at the other, between which the joints
can bring it nearer by l (`drake_rnn.robot.clearance`), is never nearer in between than
(d_0 + d_1 - l) / 2.

**By a plane.** Let n be a vector of length 1 in a frame F, and s_0 and s_1 how far it parts the two
sides at the ends: the lowest point of the one along n less the highest of the other. Let x be a
point of the one less a point of the other, f = n x. At the ends f is at least s_0 and s_1. In
between, at a share t of the time,

.. math::
    f \ge (1 - t) s_0 + t s_1 - \tfrac12 t (1 - t) B - \sum_i \delta_i \rho_i, \qquad
    B = \sum_{i, j} |\Delta_i| |\Delta_j| \rho_{\max(i, j)},

and the distance, which is at least f for one n and all points, is no less. For let q be the joints
at a time between the ends, and q' those on the straight line between them at the same share of the
time. Joint i is off by at most delta_i, so that x is off its place at q' by at most the last sum,
as no posture changes that a unit of joint i moves x by at most rho_i. Along the straight line, a
function that is twice differentiable is above the parabola through its ends that has its largest
second derivative. That of x by the joints i and j, of which j follows i from F on, is
z_i x (z_j x (x - p_j)), of a length of at most rho_j; it is 0 if i slides, and at most 1 = rho_j if
j does. What moves F and both sides with it does not count. So F is the link of the side that fewer
joints move, if these move both; of two arms, which no joint has in common, it is the world, and no
second derivative is of joints of both.

The lowest point of the parabola is below both ends only where these differ by less than B / 2. What
begins at the floor itself and leads away from there is free if it is short enough, as B is of
second order in its length.

A segment that turns leaves a plane along which it lies: one of its ends comes nearer by what is of
first order, though the distance grows. So a third n goes straight from n_0, the normal of the
nearest points at the one end, to n_1 at the other. It is never longer than 1, and parts the sides
by their distance at both ends. Its derivative adds 2 |n_1 - n_0| l to B, where x moves by at most
l.

Velocities are held, and from sample to sample they change by at most a h. In a piece of T = N h
that begins and ends with a sample a joint is off its straight line by e_k after k samples, with
e_0 = e_N = 0 and second differences of at most a h^2: so by at most a h^2 k (N - k) / 2, and linear
between samples. The largest of these, at the middle, is delta: none of a piece of one sample. By
more than its way in the piece it never is.

Unlike the first bound the second one is off by what is of second order in the length of a piece.
Where axes cross there is no normal; any n would be right, but 0 is taken, and only the way counts.
While time passes, an obstacle that moves comes nearer by its speed: by that much until the end of a
piece both bounds are less.

Most pairs need no look. Two bounds on their distances are exact, whatever the motion is:

- where the arm is now, a pair is apart by what it was when it was looked at last, less what the
  joints have gone since, joint by joint and sample by sample, times how much nearer that can bring
  it. So what was looked at once is known from then on, the less the farther the joints have gone;
- during the whole motion it is apart by that, less the way of the whole motion likewise.

Only pairs that the second leaves too near are looked at, and then all that is said above is said of
them alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ...arrays.algebra import either, entries, functions_of, join, knows_branches
from ...inputs.fields import Array
from ...robot.clearance import Clearance, Flags, Indices, Near
from ...robot.clearance.clearance import OTHER, Needs, Neighbour
from ...robot.jerk_stop import HeldJerkStop, HeldStop, course
from ..law import Signals
from .obstacle_tracks import ANYWHERE, Places

#: The fastest stop of an arm.
Stop = HeldStop | HeldJerkStop

_ALL = slice(None)
# By how much distances that are computed in two ways may differ [m].
_ROUNDING = 1e-9


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

    @property
    def largest(self) -> Array:
        """By how much its velocities change at most, shape (n,) [rad/s^2]."""
        return self._stop.largest

    def way(self) -> Array:
        """Return how far each joint goes until it rests, shape (n,) [rad]."""
        return self._sample_count * self.period * abs(self._v) + self._stop.way(self._first)

    def travel(self, k: Array) -> Array:
        """Return how far the joints have gone after k samples, shape (s, n) [rad]."""
        xp = functions_of(k)
        hold = xp.minimum(k, self._sample_count)[:, None] * self.period * self._v
        return hold + self._stop.travel(self._first, xp.maximum(k - self._sample_count, 0.0))

    def travel_and_way(self, k: Array) -> tuple[Array, Array]:
        """Return the same and the way of each joint until then, there and back, (s, n) each."""
        xp = functions_of(k)
        hold = xp.minimum(k, self._sample_count)[:, None] * self.period * self._v
        travel, way = self._stop.travel_and_way(
            self._first, xp.maximum(k - self._sample_count, 0.0)
        )
        return hold + travel, abs(hold) + way

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
        most = limits.sides("acceleration", "braking in time")
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

    @property
    def largest(self) -> Array:
        """By how much velocities change at most, shape (n,) [rad/s^2]."""
        return np.concatenate((self.own.largest, self.other.largest))

    def samples(self, u: Array) -> float:
        """Return after how many samples both rest; see `HeldStop` and `HeldJerkStop`."""
        own, other = self.own.samples(u), self.other.samples
        return functions_of(own, other).maximum(own, other)

    def way(self, u: Array) -> Array:
        """Return how far each joint goes until it rests, shape (n,) [rad]."""
        return join((self.own.way(u), self.other.way()))

    def travel(self, u: Array, k: Array) -> Array:
        """Return how far the joints have gone after k samples, shape (s, n) [rad]."""
        return join((self.own.travel(u, k), self.other.travel(k)))

    def travel_and_way(self, u: Array, k: Array) -> tuple[Array, Array]:
        """Return the same and the way of each joint until then, there and back, (s, n) each."""
        parts = zip(self.own.travel_and_way(u, k), self.other.travel_and_way(k), strict=True)
        travel, way = (join(part) for part in parts)
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

    def __post_init__(self) -> None:
        # What JAX traces first in a branch is not known outside of it.
        self.clearance.lay_out()
        if self.places is not None and not isinstance(self.places.p_WO, np.ndarray):
            _ = self._places

    @cached_property
    def _other(self) -> NeighbourStop:
        """What the other arm does; there must be one."""
        assert self.neighbour is not None
        return NeighbourStop(self.neighbour, self.seen, self.period)

    def posture(self, q: Array) -> Array:
        """Return the posture of all, for that of the arm itself, shape (n,) [rad]."""
        return q if self.neighbour is None else join((q, self._other.posture))

    def around(self, stop: Stop) -> Stop | BothStop:
        """Return what all do, for a stop of the arm itself."""
        return stop if self.neighbour is None else BothStop(stop, self._other)

    def gaps(self, q: Array, k: Array, pairs: Indices | slice) -> Array:
        """Return the least that pairs can be apart, shape (s, r) [m]; see `view`."""
        return self.view(q, k, pairs)[0]

    def view(
        self, q: Array, k: Array, pairs: Indices | slice, flags: Flags | None = None
    ) -> tuple[Array, Callable[[Array, Array], Array]]:
        """Return the least that pairs can be apart, and what planes leave between postures.

        Args:
            q: Postures, shape (s, n) [rad].
            k: After how many samples they are reached, shape (s,).
            pairs: The pairs, in order, shape (r,), or all.
            flags: Which of these count, see `Clearance.view`.

        Returns:
            Distances, shape (s, r) [m], and a function that returns what planes leave of pairs in
            each piece, shape (s - 1, r) [m], less what obstacles may come nearer until its end,
            given ``bend`` and ``nearer`` of `Pairs.gaps_between`.
        """
        numbers = None if isinstance(pairs, slice) else pairs
        if self.places is None:
            return self.clearance.view(q, None, numbers, flags)
        nearer = self.nearer(k, pairs)
        views = [
            (*self.clearance.view(q, p_WO, numbers, flags), entries(doubt, pairs) + nearer)
            for p_WO, doubt in self._places
        ]
        xp = functions_of(q, nearer)

        def between(bend: Array, way: Array) -> Array:
            return _least([planes(bend, way) - doubt[1:] for _, planes, doubt in views], xp)

        return _least([gaps - doubt for gaps, _, doubt in views], xp), between

    def near(
        self,
        q: Array,
        k: Array,
        pairs: Indices | slice,
        with_slopes: Indices | slice,
        needs: Needs | None = None,
    ) -> Near:
        """Return the same with the slopes in some postures, of `Clearance.near`.

        Of an obstacle that may be anywhere there are none.
        """
        numbers = None if isinstance(pairs, slice) else pairs
        if self.places is None:
            return self.clearance.near(q, None, numbers, with_slopes, needs)
        near, *others = (
            self._near_at(*place, (q, k), pairs, with_slopes, needs) for place in self._places
        )
        for other in others:
            xp, nearer = functions_of(near.gaps), other.gaps < near.gaps
            slopes = xp.where(nearer[with_slopes][..., None], other.slopes, near.slopes)
            near = Near(near.pairs, xp.where(nearer, other.gaps, near.gaps), slopes)
        return near

    def _near_at(
        self,
        p_WO: Array,
        doubt: Array,
        way: tuple[Array, Array],
        pairs: Indices | slice,
        with_slopes: Indices | slice,
        needs: Needs | None,
    ) -> Near:
        """Return what `near` does if obstacles are at places, with a doubt of each pair's gap."""
        q, k = way
        doubt = entries(doubt, pairs)
        less = doubt + self.nearer(k, pairs)
        if needs is not None:
            needs = needs._replace(bounds=needs.bounds + less[with_slopes] + _ROUNDING)
        numbers = None if isinstance(pairs, slice) else pairs
        near = self.clearance.near(q, p_WO, numbers, with_slopes, needs)
        gaps, is_known = near.gaps - less, (doubt < ANYWHERE)[:, None]
        return Near(near.pairs, gaps, functions_of(gaps).where(is_known, near.slopes, 0.0))

    def gaps_now(self, q: Array) -> Array:
        """Return the least that all pairs can be apart in a posture of all, shape (p,) [m]."""
        if self.places is None:
            return self.clearance.gaps(q)
        gaps = [self.clearance.gaps(q, p) - doubt for p, doubt in self._places]
        return functions_of(*gaps).stack(gaps).min(axis=0)

    @cached_property
    def _places(self) -> tuple[tuple[Array, Array], ...]:
        """Places where obstacles may be, and how much nearer each pair may be there, (p,) [m]."""
        assert self.places is not None
        p_WO, radii, others, other_radii = self.places
        places = [(p_WO, radii)] + ([] if others is None else [(others, other_radii)])
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
        speeds = entries(self.clearance.speeds, pairs) * self.period
        if isinstance(k, float):
            return k * speeds
        return k[..., None] * speeds


def _least(arrays: Sequence[Array], xp: Any) -> Array:
    """Return the least of arrays, entry by entry."""
    return arrays[0] if len(arrays) == 1 else xp.minimum(*arrays)


def seen_signals(
    clearance: Clearance | None, neighbour: Neighbour | None = None
) -> dict[str, tuple[int, ...]]:
    """Return the signals by which a law sees what moves in its way, with their shapes."""
    count = 0 if clearance is None else len(clearance.solids.moving)
    signals: dict[str, tuple[int, ...]] = {"p_WO": (count, 3)} if count else {}
    if neighbour is None:
        return signals
    return signals | {signal: (neighbour.limits.size,) for signal in neighbour.parts}


# A loss of speed in a sample that is larger than any [rad/s].
_AT_ONCE = 1e9
#: Parts of what is left of a stop after its first sample at which postures are looked at, denser
#: where more of the way is gone; and places of those at which rows are set up.
PARTS = np.array([0.0, 0.06, 0.12, 0.185, 0.255, 1.0 / 3.0, 0.42, 0.53, 2.0 / 3.0, 0.82, 1.0])
OF_ROWS = np.array([0, 5, 8, 10])


def samples_of(samples: Any) -> Array:
    """Return the numbers of samples of a stop after which it is looked at, from 0 on, shape (s,).

    Args:
        samples: After how many samples all rest.
    """
    xp = functions_of(samples)
    return xp.concatenate((np.zeros(1), xp.floor(1.5 + PARTS * (samples - 1.0))))


class Along(NamedTuple):
    """What was seen along a motion.

    Attributes:
        pairs: The pairs that were looked at, in order, shape (r,), or all.
        flags: Which of all pairs these are, shape (p,).
        k: Numbers of samples after which postures are reached, the first of them 0, shape (s,).
        path: The postures, shape (s, n) [rad].
        gaps: Distances of the pairs in them, at least, shape (s, r) [m].
        places: Of each pair with a flag, its place among those that were looked at, if a compiler
            does not know these, shape (p,); else None.
    """

    pairs: Indices | None
    flags: Flags
    k: Array
    path: Array
    gaps: Array
    places: Indices | None = None

    def of(self, function: Callable[[Along], Any]) -> Any:
        """Return what a function says of it."""
        return function(self)

    def lower_bounds(self, left: Array) -> Array:
        """Return how far all pairs are apart where it begins, at least, shape (p,) [m].

        Args:
            left: What was known of that before, shape (p,) [m].
        """
        if self.pairs is None:
            return functions_of(left).where(self.flags, self.gaps[0], left)
        if self.places is not None:
            return functions_of(left).where(self.flags, self.gaps[0][self.places], left)
        bounds = left.copy()
        bounds[self.pairs] = self.gaps[0]
        return bounds


class Alongs(NamedTuple):
    """What compiled code saw along a motion: of few pairs, or of all.

    Attributes:
        are_few: Whether it was of few.
        few: What was seen of these; what does not count is infinitely far.
        every: What was seen of all.
    """

    are_few: Any
    few: Along
    every: Along

    def of(self, function: Callable[[Along], Any]) -> Any:
        """Return what a function says of that one."""
        return either(self.are_few, lambda: function(self.few), lambda: function(self.every))


def selection(flags: Flags) -> Indices | None:
    """Return the numbers of pairs that are looked at: those with a flag in NumPy, None for all.

    In arrays of JAX all are, and it does not count what is seen of those without.
    """
    return flags.nonzero()[0] if isinstance(flags, np.ndarray) else None


@dataclass(frozen=True, eq=False)
class Certificate:
    """What is certified of motions: that no pair comes nearer than a floor.

    Attributes:
        clearance: The pairs.
        floor: The least distance [m].
        groups: Which pairs belong to each group that it tells of, shape (g, p); None to tell of all
            pairs together.
    """

    clearance: Clearance
    floor: float
    groups: Flags | None = None

    def is_given(
        self,
        u: Array,
        q: Array,
        left: Array,
        along: Along | Alongs | None,
        stop: Stop | BothStop,
        world: World,
    ) -> Any:
        """Return whether all can do u for a period and then stop, always free.

        It is told of all pairs, or of each group of them, shape (g,).

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

        def sure() -> Any:
            return self.each(samples >= 0.0)

        def is_free() -> Any:
            beside = self._is_free_beside(u, q, along, doubtful, samples, stop, world)

            def is_free_along() -> Any:
                return beside | self._is_free_along(u, q, doubtful, samples, stop, world)

            return either(beside.all(), sure, is_free_along)

        return either(doubtful.any(), is_free, sure)

    def each(self, flag: Any) -> Any:
        """Return a flag as that of all pairs, or of each group."""
        if self.groups is None:
            return flag
        return functions_of(flag).zeros(len(self.groups), dtype=bool) | flag

    def _all(self, flags: Flags, pairs: Indices | slice = _ALL) -> Any:
        """Return whether all flags of pairs are set, shape (..., r), or those of each group."""
        if self.groups is None:
            return flags.all()
        is_other = ~entries(self.groups.T, pairs)
        rows: Any = flags.reshape(-1, flags.shape[-1])
        return (rows.all(axis=0)[:, None] | is_other).all(axis=0)

    def failures(
        self, u: Array, q: Array, left: Array, stop: Stop | BothStop, world: World
    ) -> Indices:
        """Return the pairs that are not certified to be free, by number, in NumPy.

        Args:
            u: See `is_given`, as all others.
            q: Where all are, shape (n,) [rad].
            left: How far pairs are apart there, at least, shape (p,) [m].
            stop: Where each u leads.
            world: What is in the way.
        """
        samples = stop.samples(u)
        least = left - self.clearance.reaches @ stop.way(u) - world.nearer(samples)
        doubtful = np.flatnonzero(~(least >= self.floor))
        alone = np.arange(len(left)) == doubtful[:, None]
        free = [self._is_free_along(u, q, one, samples, stop, world) for one in alone]
        return np.asarray(doubtful[~np.array(free, dtype=bool)])

    def _is_free_beside(
        self,
        u: Array,
        q: Array,
        along: Along | Alongs | None,
        doubtful: Flags,
        samples: Any,
        stop: Stop | BothStop,
        world: World,
    ) -> Any:
        """Return whether what was seen along a motion tells that pairs stay free on this one."""
        if along is None:
            return self.each(np.bool_(False))
        return along.of(lambda each: self._is_free_by(u, q, each, doubtful, samples, stop, world))

    def _is_free_by(
        self,
        u: Array,
        q: Array,
        along: Along,
        doubtful: Flags,
        samples: Any,
        stop: Stop | BothStop,
        world: World,
    ) -> Any:
        """Return what `_is_free_beside` does, by what was seen of some pairs or of all."""
        if len(along.k) < 2:
            return self.each(np.bool_(False))
        seen_all = self._all(~doubtful | along.flags)
        if isinstance(doubtful, np.ndarray) and not seen_all.any():
            return seen_all
        pairs: Any = _ALL
        gaps, counts = along.gaps, doubtful
        if along.places is not None:
            pairs, counts = along.pairs, entries(doubtful, along.pairs)
        elif along.pairs is not None:
            counts = doubtful[along.pairs]
            pairs, gaps = along.pairs[counts], gaps[:, counts]
            counts = counts[counts]
        xp = functions_of(u)
        k = join((along.k[:-1], xp.maximum(along.k[-1:], samples)))
        travel, way = stop.travel_and_way(u, k)
        reaches = entries(self.clearance.reaches, pairs).T
        off = abs(q + travel - along.path) @ reaches
        least = gaps - off - world.nearer(k - along.k, pairs)
        nearer = (way[1:] - way[:-1]) @ reaches
        sure = self._by_way(least, nearer + world.nearer(k[1:] - k[:-1], pairs))
        return seen_all & self._all(sure | ~counts, pairs)

    def _is_free_along(
        self,
        u: Array,
        q: Array,
        doubtful: Flags,
        samples: Any,
        stop: Stop | BothStop,
        world: World,
    ) -> Any:
        """Return whether pairs stay free, by how far they are apart in postures of the stop."""
        numbers = selection(doubtful)
        if numbers is not None:
            return self._are_free(u, q, numbers, doubtful[numbers], samples, stop, world)

        def all_free() -> Any:
            return self._are_free(u, q, _ALL, doubtful, samples, stop, world)

        if not knows_branches(samples):
            return all_free()
        few, counts, _, are_all = self.clearance.few(doubtful)
        return either(
            are_all, lambda: self._are_free(u, q, few, counts, samples, stop, world), all_free
        )

    def _are_free(
        self,
        u: Array,
        q: Array,
        pairs: Indices | slice,
        counts: Flags,
        samples: Any,
        stop: Stop | BothStop,
        world: World,
    ) -> Any:
        """Return what `_is_free_along` does, of those of some pairs, or of all, that count."""
        k = samples_of(samples)
        travel, way = stop.travel_and_way(u, k)
        path = q + travel
        is_sparse = isinstance(pairs, slice) and knows_branches(samples)
        gaps, planes_between = world.view(path, k, pairs, counts if is_sparse else None)
        way = way[1:] - way[:-1]
        nearer, bend = self.clearance.way_and_bend(way, pairs)
        by_way = self._by_way(gaps, nearer + world.nearer(k[1:] - k[:-1], pairs)) | ~counts
        # Where it is now it was certified to be free, but for rounding or what has moved up to an
        # arm at rest: from there a motion that brings it no nearer is free.
        level = functions_of(gaps).minimum(self.floor, gaps[0])
        ends = self._all((gaps[1:] >= level) | ~counts, pairs)

        def by_planes() -> Any:
            reaches = entries(self.clearance.reaches, pairs)
            off = self._deviation(way, k, stop, world) @ reaches.T
            return self._all(by_way | (planes_between(bend, nearer) - off >= level), pairs)

        is_open = (ends & ~self._all(by_way, pairs)).any()
        return ends & either(is_open, by_planes, lambda: ends)

    def _by_way(self, gaps: Array, nearer: Array) -> Flags:
        """Return whether pairs stay free in each piece, by how much nearer they can come in it.

        Args:
            gaps: How far pairs are apart at its ends, at least, shape (s, r) [m].
            nearer: By how much they come nearer at most, shape (s - 1, r) [m].
        """
        # What is not a number is not sure.
        return 0.5 * (gaps[:-1] + gaps[1:] - nearer) >= self.floor

    def _deviation(self, way: Array, k: Array, stop: Stop | BothStop, world: World) -> Array:
        """Return how far joints leave straight lines in each piece, shape (s - 1, n) [rad].

        Args:
            way: How far each joint goes in a piece, there and back, shape (s - 1, n) [rad].
            k: Numbers of samples, whole, shape (s,).
            stop: Where each u leads.
            world: What is in the way.
        """
        xp, h = functions_of(way), world.period
        count = k[1:] - k[:-1]
        most = xp.minimum(stop.largest, _AT_ONCE / h)
        return xp.minimum((0.5 * h * h * xp.floor(0.25 * count * count))[:, None] * most, way)

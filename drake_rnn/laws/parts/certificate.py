"""Whether a motion and the stop behind it are free, between samples too.

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
from typing import NamedTuple

import numpy as np

from ...inputs.fields import Array
from ...robot.clearance import Clearance, Flags, Indices
from .world import BothStop, Stop, World

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

    def known(self, left: Array) -> Array:
        """Return how far all pairs are apart where it begins, at least, shape (p,) [m].

        Args:
            left: What was known of that before, shape (p,) [m].
        """
        found = left.copy()
        found[self.pairs] = self.gaps[0]
        return found


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
            u: What is begun with, see `drake_rnn.laws.parts.held_within.Choice`, shape (n,).
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
            seen = doubtful[along.pairs]
            if np.count_nonzero(seen) == count and self._is_free_beside(
                u, q, along, seen, samples, stop, world
            ):
                return True
        (pairs,), k = doubtful.nonzero(), np.linspace(0.0, samples, _POSTURES)
        moved, gone = stop.gone(u, k)
        gaps = world.gaps(q + moved, k, pairs)
        return self._is_free_between(u, q, pairs, k, gone, gaps, stop, world)

    def _is_free_beside(
        self,
        u: Array,
        q: Array,
        along: Along,
        chosen: Flags,
        samples: float,
        stop: Stop | BothStop,
        world: World,
    ) -> bool:
        """Return whether pairs that were chosen of those seen along a motion stay free on this."""
        pairs, k, gaps = along.pairs[chosen], along.k, along.gaps[:, chosen]
        if samples > k[-1]:
            k = k.copy()
            k[-1] = samples
        moved, gone = stop.gone(u, k)
        off = np.abs(q + moved - along.path) @ self.clearance.reaches[pairs].T
        least = gaps - off - world.nearer(k - along.k, pairs)
        return self._is_free_between(u, q, pairs, k, gone, least, stop, world)

    def _is_free_between(
        self,
        u: Array,
        q: Array,
        pairs: Indices,
        k: Array,
        gone: Array,
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
            gone: The way of each joint until then, shape (s, n) [rad].
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
        way = gone[1:] - gone[:-1]
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
            moved, gone = (x.reshape(*edges.shape, -1) for x in stop.gone(u, edges.ravel()))
            way = (gone[:, 1:] - gone[:, :-1]).reshape(-1, q.size)
            postures = q + moved[:, 1:-1].reshape(-1, q.size)
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
    needed = 0.5 * (nearer / np.maximum(room, _CLOSE)).max()
    return int(np.clip(np.ceil(1.2 * needed), 2, _PIECES))

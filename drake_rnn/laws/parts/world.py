"""What is in an arm's way from now on: obstacles that move, and another arm beside it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...inputs.fields import Array
from ...robot.clearance import Clearance, Indices, Near
from ...robot.clearance.neighbour import OTHER, Neighbour
from ...robot.held_jerk_stop import HeldJerkStop
from ...robot.held_stop import HeldStop
from ...robot.jerk_stop import course
from .held_within import Seen
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
    seen: Seen
    period: float

    @cached_property
    def posture(self) -> Array:
        """Where it is now, shape (n,) [rad]."""
        return self.seen[f"{OTHER}commanded"] - self._chosen * self.period * self._v

    @property
    def samples(self) -> float:
        """After how many samples it rests."""
        return self._stop.samples(self._first) + self._chosen

    def way(self) -> Array:
        """Return how far each joint goes until it rests, shape (n,) [rad]."""
        return self._chosen * self.period * np.abs(self._v) + self._stop.way(self._first)

    def moved(self, k: Array) -> Array:
        """Return how far the joints have gone after k samples, shape (s, n) [rad]."""
        held = np.minimum(k, self._chosen)[:, None] * self.period * self._v
        return held + self._stop.moved(self._first, np.maximum(k - self._chosen, 0.0))

    def gone(self, k: Array) -> tuple[Array, Array]:
        """Return the same and the way of each joint until then, there and back, (s, n) each."""
        held = np.minimum(k, self._chosen)[:, None] * self.period * self._v
        moved, way = self._stop.gone(self._first, np.maximum(k - self._chosen, 0.0))
        return held + moved, np.abs(held) + way

    @property
    def _chosen(self) -> float:
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

    def moved(self, u: Array, k: Array) -> Array:
        """Return how far the joints have gone after k samples, shape (s, n) [rad]."""
        return np.concatenate((self.own.moved(u, k), self.other.moved(k)), axis=1)

    def gone(self, u: Array, k: Array) -> tuple[Array, Array]:
        """Return the same and the way of each joint until then, there and back, (s, n) each."""
        parts = zip(self.own.gone(u, k), self.other.gone(k), strict=True)
        moved, way = (np.concatenate(part, axis=1) for part in parts)
        return moved, way


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
    seen: Seen
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
        found = [
            self.clearance.gaps(q, p_WO, pairs) - (doubt[pairs] + self.nearer(k, pairs))
            for p_WO, doubt in self._places
        ]
        return found[0] if len(found) == 1 else np.minimum(*found)

    def near(self, q: Array, k: Array, pairs: Indices, sloped: Indices | slice) -> Near:
        """Return the same with the slopes in some postures, of `Clearance.near`.

        Of an obstacle that may be anywhere there are none.
        """
        if self.places is None:
            return self.clearance.near(q, None, pairs, sloped)
        found = [self._near_at(*place, q, k, pairs, sloped) for place in self._places]
        near = found[0]
        if len(found) == 1:
            return near
        other = found[1]
        nearer = other.gaps < near.gaps
        slopes = np.where(nearer[sloped][..., None], other.slopes, near.slopes)
        return Near(pairs, np.where(nearer, other.gaps, near.gaps), slopes)

    def _near_at(
        self, p_WO: Array, doubt: Array, q: Array, k: Array, pairs: Indices, sloped: Indices | slice
    ) -> Near:
        """Return what `near` does if obstacles are at places, with a doubt of each pair's gap."""
        near = self.clearance.near(q, p_WO, pairs, sloped)
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
        known = [(p_WO, radii)] if others is None else [(p_WO, radii), (others, other_radii)]
        return tuple((p, self._doubt(farther)) for p, farther in known)

    def _doubt(self, radii: Array | None) -> Array:
        """Return how much nearer than where it is taken to be each pair may be, (p,) [m]."""
        found = self.clearance.errors
        if radii is not None:
            found = found + self.clearance.of_moving(radii)
        return found + self.delay * self.clearance.speeds if self.delay else found

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
    found: dict[str, tuple[int, ...]] = {"p_WO": (count, 3)} if count else {}
    if neighbour is None:
        return found
    return found | {signal: (neighbour.limits.size,) for signal in neighbour.parts}

r"""Where obstacles may be, by what was measured of them and by the time since.

An obstacle is at most u fast, and a measured place is off by at most e. So t after it was measured
at p it is within e + u t of p. A measurement that fits this, at most 2 e + u t away, takes its
place. One that is not a number leaves it, and the time goes on. So that an obstacle which is a
little too fast is seen as well, measurements must also fit an older one, the anchor.

A measurement that is farther away is a jump: either it is wrong, or what was measured before. Then
both places count, and each pair is apart by the lesser of the two distances. The place that is no
longer measured counts until

- the obstacle could have gone from there to where it is measured, or
- it has not been measured for as long as it had been measured before, at least `SHORTEST` and at
  most `LONGEST`,

whichever is first. So a single wrong measurement is soon forgotten, and a place that was measured
for long is not given up for it. At a further jump the ball round both takes their place.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...arrays.algebra import functions_of
from ...inputs.fields import Array
from ...robot.clearance import Flags
from ...robot.clearance.capsules import Solids
from ..law import Signals, State

#: Radius of the ball in which an obstacle is that was never measured [m].
ANYWHERE = 1e3
# Parts of the state, with the shape of each for one obstacle.
_PARTS: dict[str, tuple[int, ...]] = {
    "obstacle_p": (3,),
    "obstacle_radius": (),
    "obstacle_time": (),
    "other_p": (3,),
    "other_radius": (),
    "other_time": (),
    "anchor_p": (3,),
    "anchor_age": (),
    "jumps": (),
}
#: Their names.
TRACKS = tuple(_PARTS)
#: Time for which a place counts that is no longer measured, at least and at most [s].
SHORTEST, LONGEST = 0.1, 5.0
# Share of a way, and way [m], by which a measurement may be farther away, by rounding.
_SHARE, _ROUNDING = 1e-6, 1e-9
# Age of an anchor that there never was [s].
_NEVER = 1e9


class Places(NamedTuple):
    """Where obstacles may be.

    Attributes:
        p_WO: How far they have gone from where they are stated, shape (m, 3) [m].
        radii: How much farther off than its error each may be, shape (m,) [m]; None if none is.
        others: Other places where they may be as well, shape (m, 3) [m]; None without any.
        other_radii: How much farther off than its error each may be there, shape (m,) [m].
    """

    p_WO: Array
    radii: Array | None = None
    others: Array | None = None
    other_radii: Array | None = None


class Balls(NamedTuple):
    """Balls in which obstacles may be, but for the error of their measurement.

    Attributes:
        p: Their centres, shape (m, 3) [m].
        radius: Their radii, shape (m,) [m].
        time: For how long each obstacle was measured there or, if it no longer is, for how long it
            still counts, shape (m,) [s].
    """

    p: Array
    radius: Array
    time: Array

    def count_move(self) -> Balls:
        """Return what they are once the obstacles are measured elsewhere."""
        return self._replace(time=functions_of(self.time).maximum(self.time, SHORTEST))

    def with_others(self, others: Balls) -> Balls:
        """Return the least balls round each of these and another one."""
        xp, way = functions_of(self.p, others.p), others.p - self.p
        apart, time = _length(way), xp.maximum(self.time, others.time)
        radius = 0.5 * (apart + self.radius + others.radius)
        share = (radius - self.radius) / xp.where(apart > 0.0, apart, 1.0)
        both = Balls(self.p + share[:, None] * way, radius, time)
        both = both.where(apart + self.radius > others.radius, others._replace(time=time))
        return both.where(apart + others.radius > self.radius, self._replace(time=time))

    def where(self, flags: Flags, others: Balls) -> Balls:
        """Return these where a flag is set, and others where not, shape (m,)."""
        where = functions_of(self.p, others.p, flags).where
        return Balls(
            where(flags[:, None], self.p, others.p),
            where(flags, self.radius, others.radius),
            where(flags, self.time, others.time),
        )

    def beyond(self, p: Array) -> Array:
        """Return how far points, shape (m, 3), are outside, shape (m,) [m]."""
        return _length(p - self.p) - self.radius


@dataclass(frozen=True, eq=False)
class ObstacleTracks:
    """What is remembered of measured places of obstacles, in the state of a law.

    Attributes:
        solids: The obstacles.
    """

    solids: Solids

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of its parts of the state, by name; none if no obstacle may move."""
        m = len(self.solids.moving)
        return {name: (m, *shape) for name, shape in _PARTS.items()} if m else {}

    def init(self, u: Signals, rng: np.random.Generator) -> State:
        """Return its parts of the state for places ``p_WO`` as measured at first.

        See `Component.init`.
        """
        return self._first(u.get("p_WO"))

    def _first(self, p_WO: Array | None) -> State:
        """Return the parts of the state for places as measured at first, shape (m, 3) [m]."""
        state = {name: np.zeros(shape) for name, shape in self.shapes.items()}
        if not state:
            return state
        assert p_WO is not None
        sound = np.asarray(np.isfinite(p_WO).all(axis=1))
        state["obstacle_p"] = np.where(sound[:, None], p_WO, 0.0)
        state["obstacle_radius"] = np.where(sound, 0.0, ANYWHERE)
        state["anchor_p"], state["anchor_age"] = state["obstacle_p"], np.where(sound, 0.0, _NEVER)
        return state

    def unknown(self, state: State) -> State:
        """Return its parts of the state where nothing is known of the places any more."""
        if not self.shapes:
            return {}
        nowhere = np.full((len(self.solids.moving), 3), np.nan)
        return {**self._first(nowhere), "jumps": state["jumps"]}

    def later(self, state: State, time: float) -> State:
        """Return its parts of the state a time later [s], with nothing measured."""
        if not self.shapes:
            return {}
        way = self._speeds * time
        return {
            "obstacle_radius": np.minimum(state["obstacle_radius"] + way, ANYWHERE),
            "other_radius": np.minimum(state["other_radius"] + way, ANYWHERE),
            "anchor_age": state["anchor_age"] + time,
        }

    def step(self, state: State, u: Signals, time: float) -> tuple[Array | None, State]:
        """Return by how much nearer a jump brings each obstacle, shape (m,) [m].

        That is nearer than all that was known of it; None without a jump. See `Component.step`.

        Args:
            state: Its parts of the state, by name.
            u: Signals, with the places ``p_WO`` as measured now, shape (m, 3) [m].
            time: Time since the last measurement [s].
        """
        p_WO, way = u["p_WO"], self._speeds * time
        most = (1.0 + _SHARE) * (way + 2.0 * self._errors) + _ROUNDING
        age = state["anchor_age"] + time
        drift = _apart(p_WO, state["anchor_p"]) - self._speeds * age
        fits = drift <= _SHARE * self._speeds * age + most - way
        # Mostly all fit, and nothing else is known.
        if isinstance(fits, np.ndarray) and not (
            np.count_nonzero(state["obstacle_radius"]) or np.count_nonzero(state["other_time"])
        ):
            fits &= _apart(p_WO, state["obstacle_p"]) <= most
            if np.count_nonzero(fits) == fits.size:
                longer = np.minimum(state["obstacle_time"] + time, LONGEST)
                parts = {name: state[name] for name in TRACKS}
                parts |= {"obstacle_p": p_WO, "obstacle_time": longer, "anchor_age": age}
                if np.count_nonzero(age > LONGEST):
                    parts |= _anchor(state, p_WO, age, age > LONGEST)
                return None, parts
        xp = functions_of(p_WO)
        here, there, nearer, returns = self._moved(state, p_WO, time, way, most - way)
        parts = {
            f"{name}_{part}": value
            for name, balls in (("obstacle", here), ("other", there))
            for part, value in zip(Balls._fields, balls, strict=True)
        }
        # Nearer than all that was known of the last measurement, or of the anchor.
        sound = xp.isfinite(p_WO).all(axis=1)
        nearer = xp.maximum(nearer, xp.where(fits | returns | ~sound, 0.0, drift))
        jumps = nearer > 0.0
        parts["jumps"] = state["jumps"] + jumps
        parts |= _anchor(state, p_WO, age, sound & (jumps | returns | (age > LONGEST)))
        if xp is np and not np.count_nonzero(jumps):
            return None, parts
        return nearer, parts

    def places(self, state: State) -> Places | None:
        """Return where obstacles may be, by the parts of the state; None if none may move."""
        if not self.shapes:
            return None
        p_WO, radii = state["obstacle_p"], state["obstacle_radius"]
        counts = state["other_time"] > 0.0
        if not isinstance(counts, np.ndarray):
            where = functions_of(p_WO).where
            others = where(counts[:, None], state["other_p"], p_WO)
            return Places(p_WO, radii, others, where(counts, state["other_radius"], radii))
        known_radii = radii if np.count_nonzero(radii) else None
        if not np.count_nonzero(counts):
            return Places(p_WO, known_radii)
        others = np.where(counts[:, None], state["other_p"], p_WO)
        return Places(p_WO, known_radii, others, np.where(counts, state["other_radius"], radii))

    def _moved(
        self, state: State, p_WO: Array, time: float, way: Array, off: Array
    ) -> tuple[Balls, Balls, Array, Flags]:
        """Return where obstacles are measured, where else each may be, and how much nearer it is.

        And whether each is measured where it may have been as well before.

        Args:
            state: The parts of the state.
            p_WO: Their places as measured now, shape (m, 3) [m].
            time: Time since the last measurement [s].
            way: How far each can have gone since, shape (m,) [m].
            off: How much farther off a measurement may be that fits, shape (m,) [m].
        """
        xp = functions_of(p_WO)
        sound = xp.isfinite(p_WO).all(axis=1)
        p = xp.where(sound[:, None], p_WO, 0.0)
        here, there = (
            Balls(
                state[f"{name}_p"],
                xp.minimum(state[f"{name}_radius"] + way, ANYWHERE),
                state[f"{name}_time"],
            )
            for name in ("obstacle", "other")
        )
        counts = there.time > 0.0
        beyond, beyond_other = here.beyond(p), xp.where(counts, there.beyond(p), np.inf)
        fits, fits_other = beyond <= off, beyond_other <= off
        returns = sound & ~fits & fits_other
        none = 0.0 * beyond
        known = xp.where(fits, here.time, xp.where(fits_other, there.time, 0.0))
        measured = Balls(p, none, xp.minimum(known + time, LONGEST))
        left = xp.where(fits_other, 0.0, xp.maximum(there.time - time, 0.0))
        before = here.with_others(there).where(counts & ~fits_other, here).count_move()
        other = there._replace(time=left).where(fits, before)
        nearer = xp.where(sound & ~fits & ~fits_other, xp.minimum(beyond, beyond_other), 0.0)
        return measured.where(sound, here), other.where(sound, there), nearer, returns

    @cached_property
    def _speeds(self) -> Array:
        """Largest speed of each obstacle that may move, shape (m,) [m/s]."""
        return self.solids.speeds[self.solids.moving]

    @cached_property
    def _errors(self) -> Array:
        """Largest error of each one's measured place, shape (m,) [m]."""
        return self.solids.errors[self.solids.moving]


def _apart(p: Array, q: Array) -> Array:
    """Return the distances of points, shape (m, 3)."""
    return _length(p - q)


def _length(way: Array) -> Array:
    """Return the lengths of vectors, shape (m, 3)."""
    return functions_of(way).sqrt((way * way).sum(axis=1))


def _anchor(state: State, p_WO: Array, age: Array, anew: Flags) -> State:
    """Return the anchors, those of some obstacles moved to where these are measured now."""
    where = functions_of(p_WO, age).where
    p = where(anew[:, None], p_WO, state["anchor_p"])
    return {"anchor_p": p, "anchor_age": where(anew, 0.0, age)}

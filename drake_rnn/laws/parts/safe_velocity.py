r"""Choosing the velocity of the next sample without collisions, within bounds to the jerk.

The law may always brake as hard as it can, and what it certifies is that this stop is free. With
w_0 the first velocity of the full stop from v, that stop passes postures q_k. At five of them, each
pair whose distance d may matter gives the program a row, by its slope n with respect to the joints
and by D, how far a change of w moves them there,

.. math::
    n^T D (w - w_0) \ge -\gamma h \max(d(q_k) - d_0, 0),

which w_0 satisfies: with rows or without, the program has a solution. Rows are linear and local,
and promise nothing. What promises is the certificate behind them, that w held for a period and the
stop that follows are free (`drake_rnn.laws.parts.world`). If
it fails, w moves towards w_0, by halves, in the end all the way. w_0 needs no look: what is left of
a certified stop after its first sample is that stop, and was certified a sample ago. And it lies
within the box, which is convex, so a velocity on the way keeps every bound as well.

With the jerk bounded the same holds of the next acceleration, and rows are of the velocity z that
the program is solved for (`drake_rnn.laws.parts.bounded_velocity`).

An obstacle that moves is measured, p_WO, with an error of at most e, and is at most u fast: t
later a pair with it is apart by the distance from where it is measured less e + u t, which takes
the place of d. So what is certified holds whatever it does until the arm rests; and a stop that was
certified a sample ago holds whatever is measured now. To an arm that rests nothing is promised.
Where else an obstacle may be, and for how long, if it was measured where it cannot be, or was not
measured at all, is said in `drake_rnn.laws.parts.obstacle_tracks`.

The stop that was certified a sample ago does not hold after a jump of a measured place, after a
motion that was commanded without the law, and when the samples come late. For lateness there is an
allowance, ``tolerance``: obstacles count as going on for so long after each stop, so a stop that is
late by no more still holds. In all other cases w_0 is looked at like any other velocity. If it is
not free, the law commands it for want of a better one and counts that: the part ``uncertified``.

Rows alone leave the arm at their edge, where they come and go from sample to sample. So joints that
the task leaves free may be led away before (`drake_rnn.laws.parts.secondary`).

To look at distances takes longer than the rest of the law. So those of the last look are kept,
with the posture that they belong to: no pair can have come nearer since than the joints' way
allows. A pair is looked at only where that leaves too little room for the whole stop, for a row
that some velocity of the box could fail, or for making way; of all others what is known is less by
the way, which stays true. The full stop is looked at in more postures than rows need where its way
is long, so that what was seen certifies the velocity that is chosen as well: it differs little.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, NamedTuple

import numpy as np

from ...errors import InvalidInputError
from ...inputs.fields import Array, Gain, Length, validated
from ...inputs.keys import Meaning
from ...robot.clearance import Clearance, Flags, Indices
from ...robot.clearance.clearance import Neighbour
from ...robot.limits import JointLimits
from ..law import Signals, State
from .bounded_velocity import (
    Choice,
    Program,
    WithinAcceleration,
    WithinJerk,
    within_limits,
)
from .obstacle_tracks import ANYWHERE, ObstacleTracks
from .programs import Rows, within_box, within_rows
from .secondary import ObstacleRepulsion
from .world import Along, BothStop, Certificate, Stop, World

#: Parts of the stop at which rows are set up.
_PARTS = np.array([0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0])
# Share of the way of a stop that is gone until the first of them, and from each to the next; and
# into how many pieces these are divided at most.
_OF_WAY, _PIECES = (0.0, 0.6, 0.35, 0.12), 8
# Share of twice the way from the distance to the floor that a pair may come nearer in a piece.
_SURE = 0.6
# Shares of the way from the stop's first velocity to one that is not free that are tried.
_SHARES = (0.5, 0.25)
# Slope of a row that no joint changes [m].
_FLAT = 1e-9
_ALL = slice(None)
#: A delay of the stop that was certified last which says that none is certified [s].
NO_STOP = 1e3
# Times that differ by less are one [s].
_SOON = 1e-9


@validated
class Avoidance:
    """How near a law lets its arm come to itself and to obstacles."""

    floor: Annotated[
        Length,
        Meaning("Distance that no pair comes below: that is certified.", unit="m"),
    ] = 0.005
    distance: Annotated[
        Length,
        Meaning("Distance at which it comes to rest before an obstacle in its way.", unit="m"),
    ] = 0.01
    approach: Annotated[
        Gain,
        Meaning("Share of the distance left that may be used up in a second.", unit="1/s"),
    ] = 10.0

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
        p_WO: How far obstacles have moved, shape (m, 3) [m]; None if not at all. One whose place is
            not a number is not looked at.
    """
    gaps = clearance.gaps(q, p_WO) - clearance.errors
    gaps = np.where(np.isnan(gaps), np.inf, gaps)
    if gaps.min(initial=np.inf) < floor:
        one, other = clearance.names[int(gaps.argmin())]
        raise InvalidInputError(
            f"start: {one} and {other} are {gaps.min():.3g} m apart there, where "
            f"{floor:g} m are kept, avoidance.floor; clear the way or start elsewhere"
        )


class Sight(NamedTuple):
    """What there is to be chosen from, and what may be in the way, as far as it is known.

    Attributes:
        q: Where all are, shape (n,) [rad].
        choice: What the arm may choose from.
        stop: Where each choice leads all.
        world: What is in the way.
        left: How far pairs are apart at least, shape (p,) [m].
        least: How far they are during the full stop, at least, shape (p,) [m].
        k: After how many samples of that stop rows are set up, shape (s,).
        leverage: By how much a change of z moves the joints until then, shape (s, n) [s].
        widest: By how much z may differ from that of the stop, shape (n,) [rad/s].
        room: How much nearer than the stop z may bring each pair at least, shape (p,) [m].
        ahead: Whether a z of the box can fail a row of each pair, shape (p,).
        led: Whether joints may make way for it, shape (p,).
    """

    q: Array
    choice: Choice
    stop: Stop | BothStop
    world: World
    left: Array
    least: Array
    k: Array
    leverage: Array
    widest: Array
    room: Array
    ahead: Flags
    led: Flags


class DistanceScan(NamedTuple):
    """What was seen along the full stop, where the arm is first.

    Attributes:
        along: The distances.
        slopes: Derivatives of these with respect to the joints where the arm is and in the postures
            of rows, shape (1 + s, r, n) [m/rad].
        of_rows: Numbers of the postures of rows, shape (s,).
    """

    along: Along
    slopes: Array
    of_rows: Indices


@dataclass(frozen=True, eq=False)
class WithinClear:
    """Limits of the joints, and no collision.

    Attributes:
        within: What bounds the joints.
        clearance: The pairs that are to stay apart.
        avoidance: How near they may come.
        neighbour: The arm beside it; None without one.
        repulsion: How joints that the task leaves free make way; None if they do not.
        tolerance: Time by which samples may come late while a certified stop still holds [s].
    """

    within: WithinAcceleration | WithinJerk
    clearance: Clearance
    avoidance: Avoidance
    neighbour: Neighbour | None = None
    repulsion: ObstacleRepulsion | None = None
    tolerance: float = 0.0

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of its parts of the state, by name."""
        own = {"seen": (self.clearance.size,), "gaps": (self.clearance.count,), "held_back": (1,)}
        own |= {"stop_delay": (1,), "uncertified": (1,)}
        return self.within.shapes | own | self._tracks.shapes

    def init(self, u: Signals, rng: np.random.Generator) -> State:
        """Return its parts of the state in the posture of the start, as all begins to move.

        See `Component.init`.

        Raises:
            InvalidInputError: If the arm is nearer to something there than it may come.
        """
        tracks = self._tracks.init(u, rng)
        world = self._world(tracks, u, 0.0)
        whole = world.posture(u["position"])
        require_free(self.clearance, self.avoidance.floor, whole, u.get("p_WO"))
        own = {"seen": whole, "gaps": world.gaps_now(whole), "held_back": np.zeros(1)}
        own |= {"stop_delay": np.zeros(1), "uncertified": np.zeros(1)}
        return self.within.init(u, rng) | own | tracks

    def resumed(self, state: State, motion: State, elapsed: float | None) -> State:
        """Return its parts of the state, as `WithinAcceleration.resumed` does."""
        goes_on = all(np.array_equal(state[name], motion[name]) for name in motion if name in state)
        speeds, delay = self.clearance.speeds, state["stop_delay"]
        within = self.within.resumed(state, motion, elapsed)
        if elapsed is None:
            gaps = np.where(speeds > 0.0, -ANYWHERE, state["gaps"])
            own = {"gaps": gaps, "stop_delay": np.full(1, NO_STOP)}
            return within | own | self._tracks.unknown(state)
        if self.clearance.solids.moving.size:
            delay = delay + elapsed
        delay = np.minimum(delay, NO_STOP) if goes_on else np.full(1, NO_STOP)
        own = {"gaps": state["gaps"] - elapsed * speeds, "stop_delay": delay}
        return within | own | self._tracks.later(state, elapsed)

    def step(
        self, state: State, u: Signals, period: float, program: Program
    ) -> tuple[Array, State]:
        """Return the next velocity, as `WithinAcceleration.step` does."""
        J, b, _, g, softness = program
        choice = self.within.choice(state, period, program)
        state, tracks = self._track(state, u, period)
        sight = self._sight(state, choice, self._world(state, u, period))
        scan = None
        if np.count_nonzero(sight.led):
            scan = self._look(sight, sight.ahead | sight.led)
            g = g + self._preferred_velocity(scan)[: g.size]
        z = within_box(J, b, g, softness, *choice.box)
        if scan is None and self._may_bind(sight, z):
            scan = self._look(sight, sight.ahead)
        if scan is not None:
            rows = self._rows(sight, scan, z)
            if rows is not None and not rows.hold(z):
                solution = within_rows(state["v"], J, b, g, softness, *choice.box, rows)
                z = choice.first_z if solution is None else solution
        left = sight.left if scan is None else scan.along.lower_bounds(sight.left)
        surroundings = (sight.q, left, scan and scan.along, sight.stop, sight.world)
        v, own, counts = self._certify(choice, choice.variable_of(z), state, surroundings)
        if scan is None:
            parts = {"seen": state["seen"], "gaps": state["gaps"] - sight.world.nearer(1.0)}
        else:
            parts = {"seen": sight.q, "gaps": left}
        return v, own | parts | counts | tracks

    def _certify(
        self, choice: Choice, u: Array, state: State, surroundings: tuple[Any, ...]
    ) -> tuple[Array, State, State]:
        """Return the next velocity, its parts of the next state, and what is counted.

        Args:
            choice: What the arm may choose from.
            u: What it chooses, if that is free.
            state: The parts of the state.
            surroundings: What the certificate is asked with.
        """
        is_free = self._certificate.is_given
        held_back, delay, count_uncertain = (
            state[name] for name in ("held_back", "stop_delay", "uncertified")
        )
        certain: Array | None = u
        if not is_free(u, *surroundings):
            held_back, first = held_back + 1.0, choice.first
            way = (first + share * (u - first) for share in _SHARES)
            certain = next((x for x in way if is_free(x, *surroundings)), None)
            u = first if certain is None else certain
            # A stop that was certified, and is not too late, needs no look.
            if (
                certain is None
                and delay[0] > self.tolerance + _SOON
                and is_free(first, *surroundings)
            ):
                certain = first
        v, own = choice.apply(u)
        if certain is not None:
            delay = np.zeros(1)
        elif delay[0] > self.tolerance + _SOON and np.count_nonzero(v):
            count_uncertain = count_uncertain + 1.0
        counts = {"held_back": held_back, "stop_delay": delay, "uncertified": count_uncertain}
        return v, own, counts

    def _track(self, state: State, u: Signals, period: float) -> tuple[State, State]:
        """Return the parts of the state with places measured now, and those that are new."""
        if "p_WO" not in u:
            return state, {}
        nearer, tracks = self._tracks.step(state, u, period)
        if nearer is not None:
            # What was known of distances was known of the other places.
            state = state | {"gaps": state["gaps"] - self.clearance.of_moving(nearer)}
            state["stop_delay"] = np.full(1, NO_STOP)
        return state | tracks, tracks

    def _world(self, state: State, u: Signals, period: float) -> World:
        """Return what is in the way, by where obstacles may be now."""
        places = self._tracks.places(state)
        return World(self.clearance, self.neighbour, u, period, places, self.tolerance)

    @cached_property
    def _tracks(self) -> ObstacleTracks:
        return ObstacleTracks(self.clearance.solids)

    @cached_property
    def _certificate(self) -> Certificate:
        return Certificate(self.clearance, self.avoidance.floor)

    @cached_property
    def _reaches(self) -> Array:
        """How much nearer pairs come by the arm's own joints; see `Clearance.reaches`."""
        return np.ascontiguousarray(self.clearance.reaches[:, : self.within.limits.size])

    def _sight(self, state: State, choice: Choice, world: World) -> Sight:
        """Return what may be in the way of what may be chosen."""
        first, reaches = choice.first, self.clearance.reaches
        k = _of_rows(choice.stop.samples(first))
        leverage = choice.leverage(k)
        q, stop = world.posture(state["commanded"]), world.around(choice.stop)
        left = state["gaps"] - reaches @ np.abs(q - state["seen"]) - world.nearer(1.0)
        least = left - reaches @ stop.way(first) - world.nearer(k[-1])
        room = self.avoidance.approach * world.period * (least - self.avoidance.distance)
        (lower, upper), z = choice.box, choice.first_z
        widest = np.maximum(upper - z, z - lower)
        ahead = self._reaches @ (leverage[-1] * widest) > room
        leads = left < self._zones
        return Sight(q, choice, stop, world, left, least, k, leverage, widest, room, ahead, leads)

    @cached_property
    def _zones(self) -> Array:
        """Distance of each pair below which joints make way for it, shape (p,) [m]."""
        zones = np.full(self.clearance.count, -np.inf)
        if self.repulsion is not None:
            # The arm's own pairs, for which none do, come first.
            zones[len(self.clearance.own) :] = self.repulsion.zone
        return zones

    def _may_bind(self, sight: Sight, z: Array) -> bool:
        """Return whether a z can fail a row, as far as is known."""
        if not np.count_nonzero(sight.ahead):
            return False
        change = sight.leverage[-1] * np.abs(z - sight.choice.first_z)
        return bool(np.count_nonzero(self._reaches @ change > sight.room))

    def _look(self, sight: Sight, flags: Flags) -> DistanceScan:
        """Return distances of chosen pairs along the full stop, if rows may matter, and slopes."""
        q, _, stop, world, *_ = sight
        first, (pairs,) = sight.choice.first, flags.nonzero()
        if not np.count_nonzero(sight.ahead):
            k, path, ends = np.zeros(1), q[None], np.zeros(1, dtype=np.intp)
        else:
            k, ends = self._divide(sight)
            path = q + stop.travel(first, k)
        near = world.near(path, k, pairs, ends if len(ends) < len(k) else _ALL)
        return DistanceScan(Along(pairs, k, path, near.gaps), near.slopes, ends[1:])

    def _divide(self, sight: Sight) -> tuple[Array, Indices]:
        """Return numbers of samples: 0, those of rows, and some in between; and places of those.

        As many as should make sure that pairs stay free which the whole way of the stop leaves too
        near. More of the way is gone at its beginning; how much is said for braking joints.
        """
        k = [0.0, *sight.k.tolist()]
        near = sight.least < self.avoidance.floor
        if len(k) <= len(_PARTS) or not np.count_nonzero(near):
            return np.array(k), np.arange(len(k))
        nearer = float((sight.left - sight.least)[near].max())
        room = _SURE * 2.0 * (self.avoidance.distance - self.avoidance.floor)
        # Plain numbers: there are few of them.
        numbers, ends = [0.0], [0]
        for begin, end, share in zip(k[:-1], k[1:], _OF_WAY, strict=True):
            pieces = min(int(share * nearer / room) + 1, _PIECES)
            numbers += [round(begin + j / pieces * (end - begin)) for j in range(1, pieces)]
            numbers.append(end)
            ends.append(len(numbers) - 1)
        return np.array(numbers), np.array(ends)

    def _preferred_velocity(self, scan: DistanceScan) -> Array:
        """Return the velocities that joints prefer, to make way for obstacles, shape (n,)."""
        assert self.repulsion is not None
        pairs, gaps = scan.along.pairs, scan.along.gaps[0]
        (here,) = (gaps < self._zones[pairs]).nonzero()
        return self.repulsion.velocity(gaps[here], scan.slopes[0, here])

    def _rows(self, sight: Sight, scan: DistanceScan, z: Array) -> Rows | None:
        """Return the rows of the pairs that may matter; None without any that z may fail."""
        if not scan.of_rows.size:
            return None
        distance, rate = self.avoidance.distance, self.avoidance.approach * sight.world.period
        along, gaps = scan.along, scan.along.gaps[scan.of_rows]
        leverage = sight.leverage[: len(gaps)]
        reaches, first_z = self._reaches[along.pairs].T, sight.choice.first_z
        # A row allows what the slope could take of the room, and no slope is larger than reaches.
        travel = (leverage * np.abs(z - first_z)) @ reaches
        if not np.count_nonzero(travel > rate * np.maximum(gaps - distance, 0.0)):
            return None
        # Of a pair that is farther away no velocity of the box can fail the row.
        within = distance + (leverage * sight.widest) @ reaches / rate
        postures, places = np.nonzero(gaps < within)
        leverage = leverage[postures]
        A = scan.slopes[1:][postures, places, : leverage.shape[1]] * leverage
        size = np.sqrt((A * A).sum(axis=1))
        some = size > _FLAT
        if np.count_nonzero(some) < some.size:
            A, size, postures, places = A[some], size[some], postures[some], places[some]
        if not size.size:
            return None
        room = gaps[postures, places] - distance
        c = A @ first_z - rate * np.maximum(room, 0.0)
        return Rows(A / size[:, None], c / size)


def _of_rows(samples: float) -> Array:
    """Return after how many samples of a stop rows are set up, each once, shape (s,)."""
    k = np.rint(1.0 + _PARTS * (samples - 1.0))
    return k if samples >= len(_PARTS) else np.unique(k)


#: What chooses a velocity that keeps limits and, maybe, distances.
Within = WithinAcceleration | WithinJerk | WithinClear


def within_safe(
    limits: JointLimits,
    smoothing: Any,
    avoids: tuple[Clearance, Avoidance] | None,
    neighbour: Neighbour | None = None,
    repulsion: ObstacleRepulsion | None = None,
    tolerance: float = 0.0,
) -> Within:
    """Return what keeps limits, see `within_limits`, and, where anything is avoided, a distance.

    Args:
        limits: Limits of the joints, those of `drake_rnn.laws.parts.bounded_velocity`.
        smoothing: See `WithinJerk`.
        avoids: What the arm is to stay clear of, and how near it may come; None for nothing.
        neighbour: The arm beside it that ``avoids`` counts; None without one.
        repulsion: How joints that the task leaves free make way; None if they do not.
        tolerance: See `WithinClear`.
    """
    safe_set = within_limits(limits, smoothing)
    return (
        safe_set
        if avoids is None
        else WithinClear(safe_set, *avoids, neighbour, repulsion, tolerance)
    )

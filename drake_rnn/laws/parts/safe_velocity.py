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

Where an arm rests at the floor itself, a motion along a row is off it by what is of second order,
for which there is no room. So before w_0 the same way is tried lifted: turned away from pairs that
are nearer than d_0, until it leads off each by a share of the steepest. What it gains is of first
order, so that a small part of it is free.

Two arms that follow sources of their own have a share each. The certificate then tells of pairs of
one arm, of the other one and of both apart: an arm moves towards its w_0 where pairs of its own
fail, and only where none do, and pairs of both fail, the arm that gives way more readily does. An
arm on its w_0 is on the stop that was certified, so that of its own pairs no look is needed.

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
the way, which stays true. The full stop is looked at in more postures than rows need, so that what
was seen mostly certifies the velocity that is chosen as well: it differs little.

One robot's law is written in functions of its arrays, so that JAX traces it and C can be made of
it. JAX looks at all pairs, at those without need in vain: of these a mask leaves out what would be
seen. NumPy looks at the others alone, C too but for loops over small arrays; all decide the same.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...arrays.algebra import (
    Parts,
    clip,
    either,
    entries,
    functions_of,
    is_foreign,
    is_one,
    knows_branches,
    per_robot,
    repeat,
)
from ...errors import InvalidInputError
from ...inputs.fields import Array, Gain, Length, validated
from ...inputs.keys import Meaning
from ...inputs.messages import fields_of, replace_unchecked
from ...robot.clearance import Clearance, Flags, Indices
from ...robot.clearance.capsules import NUMBER_AXES
from ...robot.clearance.clearance import Needs, Neighbour
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
from .world import (
    OF_ROWS,
    Along,
    Alongs,
    BothStop,
    Certificate,
    Stop,
    World,
    samples_of,
    selection,
)

# Shares that are tried of the way from the stop's first velocity to the one that is wanted; from
# this try on of the same way, lifted off what is near; at last the first velocity itself.
_SHARES, _LIFTED = np.array([1.0, 0.5, 0.25, 0.5, 0.0625, 0.0078125, 0.0]), 3
# Least slope of a lifted way away from each near pair, as a share of the steepest; and how often
# the pair that it leaves least is lifted off.
_LIFT, _LIFTS = 0.1, 4
# A row that is met to this is in the way, and velocities that differ by less are the same [rad/s].
_MET, _SAME = 1e-6, 1e-8
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
        k: After how many samples of the full stop it may be looked at, shape (k,).
        leverage: By how much a change of z moves the joints until rows, shape (s, n) [s].
        widest: By how much z may differ from that of the stop, shape (n,) [rad/s].
        room: How much nearer than the stop z may bring each pair at least, shape (p,) [m].
        ahead: Whether a z of the box can fail a row of each pair, shape (p,).
        close: Whether one can be so near in the stop that the certificate has to look, shape (p,).
        in_zone: Whether it is so near that joints may make way for it, shape (p,).
    """

    q: Array
    choice: Choice
    stop: Stop | BothStop
    world: World
    left: Array
    k: Array
    leverage: Array
    widest: Array
    room: Array
    ahead: Flags
    close: Flags
    in_zone: Flags


class DistanceScan(NamedTuple):
    """What was seen along the full stop, where the arm is first.

    Attributes:
        along: The distances.
        slopes: Derivatives of these with respect to the joints where the arm is and in the postures
            of rows, shape (1 + s, r, n) [m/rad].
    """

    along: Along
    slopes: Array

    def of(self, function: Callable[[DistanceScan], Any]) -> Any:
        """Return what a function says of it."""
        return function(self)


class DistanceScans(NamedTuple):
    """What compiled code saw along the full stop, see `Alongs`."""

    are_few: Any
    few: DistanceScan
    every: DistanceScan

    @property
    def along(self) -> Alongs:
        """The distances."""
        return Alongs(self.are_few, self.few.along, self.every.along)

    def of(self, function: Callable[[DistanceScan], Any]) -> Any:
        """Return what a function says of that one."""
        return either(self.are_few, lambda: function(self.few), lambda: function(self.every))


class Sharing(NamedTuple):
    """Which joints have a share of their way in common: all, or those of each of two arms.

    Attributes:
        certificate: What is asked of each group of pairs: of all, or of those of one arm, of the
            other one, and of both.
        members: 1 for each joint of an arm, shape (a, n).
        moves: 1 for each arm that moves a group, shape (g, a).
    """

    certificate: Certificate
    members: Array
    moves: Array

    def is_given(self, u: Array, surroundings: tuple[Any, ...]) -> Any:
        """Return which groups are certified to be free, shape (g,); see `Certificate.is_given`."""
        xp = functions_of(u)
        return xp.reshape(xp.asarray(self.certificate.is_given(u, *surroundings)), -1)

    def look(
        self, u: Array, shares: Array, is_late: Any, surroundings: tuple[Any, ...]
    ) -> tuple[Any, Any]:
        """Return which groups need a look, and of which it says that they are free, (g,) each.

        Those need one of which an arm has a share of its way, or whose last stop is late.

        Args:
            u: See `Certificate.is_given`.
            shares: Share of each arm, shape (a,).
            is_late: Whether stops are late, shape (1,).
            surroundings: Other arguments of `Certificate.is_given`.
        """
        needed = (self.moves @ (1.0 * (shares > 0.0)) > 0.0) | is_late
        free = either(needed.any(), lambda: self.is_given(u, surroundings), lambda: needed)
        return needed, needed & free

    def steps(self, number: Array, fails: Any, compliance: Array | None) -> Array:
        """Return by how much the number of each arm's share grows, 0 or 1, shape (a,).

        It grows if pairs of this arm alone fail. If none do, it grows of the arm that gives way
        more readily, or of both alike, if pairs of both fail. After the last share it does not.

        Args:
            number: Numbers of the shares that were tried, shape (a,).
            fails: Which groups fail, shape (g,).
            compliance: See `drake_rnn.laws.guard.JointStreamReading`; None of all joints.
        """
        goes_on = number < _SHARES.size - 1.0
        if compliance is None:
            return 1.0 * (fails & goes_on)
        own = fails[:2] & goes_on
        readiness = functions_of(fails).where(
            goes_on, (self.members * compliance).max(axis=1), -1.0
        )
        is_first = goes_on & (readiness >= readiness.max())
        return 1.0 * (own | (fails[2] & ~own.any() & is_first))


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

    def choice(self, state: State, period: float, program: Program) -> Choice:
        """Return what the joints may choose from, as `WithinAcceleration.choice` does."""
        return self.within.choice(state, period, program)

    def step(
        self, state: State, u: Signals, period: float, program: Program
    ) -> tuple[Array, State]:
        """Return the next velocity, as `WithinAcceleration.step` does."""
        if is_one(state["v"]):
            return self._step(state, u, period, program)
        shapes = {"v": (n := self.within.limits.size,), "commanded": (n,)} | self.shapes
        seen = {name: axes for name, axes in SIGNAL_AXES.items() if name in u}
        outputs: list[str] = []

        def step(within: WithinClear, *operands: Array) -> Parts:
            rows = iter(operands)
            own = {name: next(rows) for name in shapes}
            around = {name: next(rows) for name in seen}
            v, after = within._step(own, around, period, Program(*rows))
            outputs[:] = after
            return v, *after.values()

        operands = [*(state[name] for name in shapes), *(u[name] for name in seen), *program]
        axes = [*map(len, shapes.values()), *seen.values(), 2, 1, 1, 1, 2]
        v, *after = per_robot_of(self, self.number_axes, step, operands, axes)
        return v, dict(zip(outputs, after, strict=True))

    @cached_property
    def number_axes(self) -> dict[tuple[str, ...], int]:
        """How many axes each number of one robot has, by its place in fields within fields."""
        solids = {("clearance", "solids", *key.split(".")): n for key, n in NUMBER_AXES.items()}
        other = None if self.neighbour is None else self.neighbour.limits
        return (
            solids
            | {("clearance", "arm", "poses", "bases"): 3}
            | {("neighbour", "limits", name): 1 for name in fields_of(other)}
            | {("within", *place): axes for place, axes in limit_axes(self.within).items()}
            | {("avoidance", name): 0 for name in fields_of(self.avoidance)}
            | {("repulsion", name): 0 for name in fields_of(self.repulsion)}
        )

    def _step(
        self, state: State, u: Signals, period: float, program: Program
    ) -> tuple[Array, State]:
        """Return the next velocity of one robot, as `step` does."""
        J, b, _, g, softness = program
        choice = self.within.choice(state, period, program)
        state, tracks = self._track(state, u, period)
        sight = self._sight(state, choice, self._world(state, u, period))
        if "detour" in u:
            # A plan has made way already.
            sight = sight._replace(in_zone=sight.in_zone & ~is_led(u["detour"]))
        leads, box = sight.in_zone.any(), choice.box

        def within(g: Array) -> Array:
            return within_box(J, b, g, softness, *box)

        z = either(leads, lambda: 0.0 * g, lambda: within(g))
        looks = leads | self._may_bind(sight, z)
        scan = either(looks, lambda: self._look(sight), lambda: self._nothing(sight))

        def away() -> tuple[Array, Array]:
            preferred = g + scan.of(self._preferred_velocity)[: g.size]
            return preferred, within(preferred)

        g, z = either(leads, away, lambda: (g, z))

        def beside_rows() -> Array:
            program = (state["v"], J, b, g, softness)
            return self._within_rows(sight, scan, z, program, u.get("compliance"))

        z = either(looks, beside_rows, lambda: z)

        def bounds() -> Array:
            return scan.of(lambda each: each.along.lower_bounds(sight.left))

        left = either(looks, bounds, lambda: sight.left)
        surroundings = (sight.q, left, scan and scan.along, sight.stop, sight.world)

        def lift(way: Array) -> Array:
            way = either(looks, lambda: scan.of(lambda each: self._lift(way, each)), lambda: way)
            return choice.clip(choice.first + way) - choice.first

        ease = u.get("compliance")
        v, own, counts = self._certify(
            choice, choice.variable_of(z), state, surroundings, lift, ease
        )
        nearer = sight.world.nearer(1.0)
        seen, gaps = either(
            looks,
            lambda: (sight.q, left),
            lambda: (state["seen"], state["gaps"] - nearer),
        )
        return v, own | {"seen": seen, "gaps": gaps} | counts | tracks

    def _within_rows(
        self,
        sight: Sight,
        scan: DistanceScan | DistanceScans,
        z: Array,
        program: Any,
        compliance: Array | None,
    ) -> Array:
        """Return z if it keeps all rows, else one that does, shape (n,) [rad/s]."""
        choice, xp = sight.choice, functions_of(z)
        if isinstance(scan, DistanceScan):
            rows = self._rows(sight, scan, z)
            if rows is None:
                return z
            holds = rows.hold(z)
        else:

            def hold(each: DistanceScan) -> Any:
                rows = self._rows(sight, each, z)
                return rows is None or rows.hold(z)

            holds = scan.of(hold)

        def solution() -> Array:
            rows = scan.of(lambda each: self._all_rows(sight, each, z))
            if compliance is None:
                v, J, b, g, softness = program
                found = within_rows(v, J, b, g, softness, *choice.box, rows)
            else:
                found = _with_compliance(program, choice.box, rows, compliance)
            return xp.where(xp.isfinite(found).all(), found, choice.first_z)

        return either(holds, lambda: z, solution)

    def _all_rows(self, sight: Sight, scan: DistanceScan, z: Array) -> Rows | None:
        """Return the rows of all pairs, where a compiler has those of few."""
        rows, flags, places = self._rows(sight, scan, z), scan.along.flags, scan.along.places
        if places is None or rows is None:
            return rows
        A, c = rows.A.reshape(len(OF_ROWS), -1, z.size), rows.c.reshape(len(OF_ROWS), -1)
        c = functions_of(c).where(flags, c[:, places], -np.inf)
        return Rows(A[:, places].reshape(-1, z.size), c.ravel())

    def pairs_in_the_way(
        self, state: State, u: Signals, period: float, program: Program, v: Array
    ) -> tuple[Indices, NDArray[np.bool_]]:
        """Return the pairs that kept one robot from what its limits allow, in NumPy.

        These are the pairs whose rows the choice meets and, where the certificate has taken the
        choice nearer to the stop, those of which it was not given.

        Args:
            state: That of `step`; nothing leads the joints away.
            u: See `step`.
            period: See `step`.
            program: See `step`.
            v: What `step` has returned, or a compiled step has, shape (n,) [rad/s].

        Returns:
            Their numbers, and which joints they have move otherwise, shape (n,).
        """
        J, b, _, g, softness = program
        choice, none = self.within.choice(state, period, program), np.zeros(0, dtype=np.intp)
        z = within_box(J, b, g, softness, *choice.box)
        is_moved = _differ(choice.apply(choice.variable_of(z))[0], v)
        if not is_moved.any():
            return none, is_moved
        left, sight, scan = self._look_around(state, u, period, choice)
        pairs, rows = none, self._rows(sight, scan, z)
        if rows is not None and not rows.hold(z):
            program_there = (state["v"], J, b, g, softness)
            z = self._within_rows(sight, scan, z, program_there, u.get("compliance"))
            pairs = np.flatnonzero(rows.A @ z <= rows.c + _MET) % self.clearance.count
        chosen = choice.variable_of(z)
        if _differ(choice.apply(chosen)[0], v).any():
            surroundings = sight.q, left, sight.stop, sight.world
            failures = self._sharing_of_all.certificate.failures(chosen, *surroundings)
            pairs = np.concatenate((pairs, failures))
        return np.unique(pairs), is_moved

    def pairs_against(
        self, state: State, u: Signals, period: float, program: Program, v: Array
    ) -> tuple[NDArray[np.bool_], Array]:
        """Return the pairs that would hold back velocities of one robot from here, in NumPy.

        Args:
            state: See `pairs_in_the_way`.
            u: See `step`.
            period: See `step`.
            program: See `step`.
            v: The velocities, shape (n,) [rad/s].

        Returns:
            Which pairs these are, and how near each may come along the stop, shape (p,) each [m].
        """
        choice = self.within.choice(state, period, program)
        *_, scan = self._look_around(state, u, period, choice)
        gaps = scan.along.gaps.min(axis=0)
        room = self.avoidance.approach * np.maximum(gaps - self.avoidance.distance, 0.0)
        return -scan.slopes[0] @ v > room + _MET, gaps

    def _look_around(
        self, state: State, u: Signals, period: float, choice: Choice
    ) -> tuple[Array, Sight, DistanceScan]:
        """Return distances of all pairs, what may be in the way, and distances along the stop."""
        state, _ = self._track(state, u, period)
        world = self._world(state, u, period)
        q = world.posture(state["commanded"])
        left = world.gaps_now(q)
        sight = self._sight({**state, "seen": q, "gaps": left}, choice, world)
        path = q + sight.stop.travel(choice.first, sight.k)
        near = world.near(path, sight.k, _ALL, _WITH_SLOPES)
        along = Along(None, sight.ahead, sight.k, path, near.gaps)
        return left, sight, DistanceScan(along, near.slopes)

    def _certify(
        self,
        choice: Choice,
        u: Array,
        state: State,
        surroundings: tuple[Any, ...],
        lift: Callable[[Array], Array],
        compliance: Array | None,
    ) -> tuple[Array, State, State]:
        """Return the next velocity, its parts of the next state, and what is counted.

        Args:
            choice: What the arm may choose from.
            u: What it chooses, if that is free.
            state: The parts of the state.
            surroundings: What the certificate is asked with.
            lift: Returns a way from the stop's first u, lifted off what is near.
            compliance: See `drake_rnn.laws.guard.JointStreamReading`; None for shares of all.
        """
        xp, first = functions_of(u), choice.first
        sharing = self._sharing_of_all if compliance is None else self._sharing_of_arms
        members, delay = sharing.members, state["stop_delay"]
        number, tried = np.zeros(len(members)), 0
        if isinstance(u, np.ndarray):
            # The first try, which mostly is the last; what follows would do the same.
            given = sharing.is_given(u, surroundings)
            if given.all():
                v, own = choice.apply(u)
                counts = {name: state[name] for name in ("held_back", "uncertified")}
                return v, own, counts | {"stop_delay": 0.0 * delay}
            number, tried = number + sharing.steps(number, ~given, compliance), 1
        # A stop that was certified, and is not too late, needs no look.
        is_late = delay > self.tolerance + _SOON

        def attempt(parts: Parts) -> Parts:
            number, way = parts[0], parts[1]
            shares = ((np.arange(_SHARES.size) == number[:, None]) * _SHARES).sum(axis=1)
            share = shares @ members
            x = first + share * way
            x = xp.where(number @ members == 0.0, u, xp.where(share == 0.0, first, x))
            needed, given = sharing.look(x, shares, is_late, surroundings)
            steps = sharing.steps(number, needed & ~given, compliance)
            number = number + steps
            lifts = (steps * (number == _LIFTED)) @ members > 0.0
            way = either(lifts.any(), lambda: xp.where(lifts, lift(way), way), lambda: way)
            return number, way, x, given.all(keepdims=True), steps == 0.0

        none = 0.0 * delay
        start = (none + number, u - first, u, none > 0.0, none + number < 0.0)
        most = len(members) * (_SHARES.size - 1) + 1 - tried
        number, _, u, is_certain, _ = repeat(attempt, start, most)
        v, own = choice.apply(u)
        is_uncertain = ~is_certain & is_late & (v != 0.0).any()
        counts = {
            "held_back": state["held_back"] + 1.0 * (number > 0.0).any(),
            "stop_delay": xp.where(is_certain, 0.0, delay),
            "uncertified": state["uncertified"] + 1.0 * is_uncertain,
        }
        return v, own, counts

    def _lift(self, way: Array, scan: DistanceScan) -> Array:
        """Return a way of the joints that leads off all pairs that are nearer than d_0, shape (n,).

        It is turned by as little as that takes, off one pair after the other.
        """
        xp, n = functions_of(way), way.size
        slopes, is_near = scan.slopes[0, :, :n], scan.along.gaps[0] < self.avoidance.distance
        if scan.along.pairs is None:
            is_near = is_near & scan.along.flags
        size = xp.sqrt((slopes * slopes).sum(axis=1))
        is_near = is_near & (size > _FLAT)
        normals = slopes / xp.where(is_near, size, 1.0)[:, None]
        least = _LIFT * xp.sqrt((way * way).sum())
        for _ in range(_LIFTS):
            lack = xp.where(is_near, xp.maximum(least - (normals * way).sum(axis=1), 0.0), 0.0)
            worst = (lack >= lack.max()) & (lack > 0.0)
            way = way + (worst * lack / xp.maximum((1.0 * worst).sum(), 1.0)) @ normals
        return way

    def _track(self, state: State, u: Signals, period: float) -> tuple[State, State]:
        """Return the parts of the state with places measured now, and those that are new."""
        if "p_WO" not in u:
            return state, {}
        nearer, tracks = self._tracks.step(state, u, period)
        if nearer is not None:
            # What was known of distances was known of the other places.
            jumps, delay = (nearer > 0.0).any(), state["stop_delay"]
            state = state | {"gaps": state["gaps"] - self.clearance.of_moving(nearer)}
            state["stop_delay"] = functions_of(nearer).where(jumps, NO_STOP, delay)
        return state | tracks, tracks

    def _world(self, state: State, u: Signals, period: float) -> World:
        """Return what is in the way, by where obstacles may be now."""
        places = self._tracks.places(state)
        return World(self.clearance, self.neighbour, u, period, places, self.tolerance)

    @cached_property
    def _tracks(self) -> ObstacleTracks:
        return ObstacleTracks(self.clearance.solids)

    @cached_property
    def _sharing_of_all(self) -> Sharing:
        certificate = Certificate(self.clearance, self.avoidance.floor)
        return Sharing(certificate, np.ones((1, self.within.limits.size)), np.ones((1, 1)))

    @cached_property
    def _sharing_of_arms(self) -> Sharing:
        n, begin = self.within.limits.size, self.clearance.arm.poses.begins[1]
        members = np.stack((np.arange(n) < begin, np.arange(n) >= begin))
        one, other = (self._reaches @ members.T).T > 0.0
        groups = np.stack((one & ~other, other & ~one, one == other))
        certificate = Certificate(self.clearance, self.avoidance.floor, groups)
        moves = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
        return Sharing(certificate, members.astype(float), moves)

    @cached_property
    def _reaches(self) -> Array:
        """How much nearer pairs come by the arm's own joints; see `Clearance.reaches`."""
        return np.ascontiguousarray(self.clearance.reaches[:, : self.within.limits.size])

    def _sight(self, state: State, choice: Choice, world: World) -> Sight:
        """Return what may be in the way of what may be chosen."""
        xp, first, reaches = functions_of(state["v"]), choice.first, self.clearance.reaches
        q, stop = world.posture(state["commanded"]), world.around(choice.stop)
        k = samples_of(stop.samples(first))
        rows = k[1:][OF_ROWS] if xp is np else xp.stack([k[1 + place] for place in OF_ROWS])
        leverage = choice.leverage(rows)
        left = state["gaps"] - reaches @ abs(q - state["seen"]) - world.nearer(1.0)
        least = left - reaches @ stop.way(first) - world.nearer(k[-1])
        spare, rate = least - self.avoidance.distance, self.avoidance.approach * world.period
        (lower, upper), z = choice.box, choice.first_z
        widest, room = xp.maximum(upper - z, z - lower), rate * spare
        nearer = self._reaches @ (leverage[-1] * widest)
        # A way may lead there and back.
        near = (nearer > room, 2.0 * nearer > spare, left < self._zones)
        return Sight(q, choice, stop, world, left, k, leverage, widest, room, *near)

    @cached_property
    def _zones(self) -> Array:
        """Distance of each pair below which joints make way for it, shape (p,) [m]."""
        # The arm's own pairs, for which none do, come first.
        is_outer = np.arange(self.clearance.count) >= len(self.clearance.own)
        zone = -np.inf if self.repulsion is None else self.repulsion.zone
        return functions_of(zone).where(is_outer, zone, -np.inf)

    def _may_bind(self, sight: Sight, z: Array) -> Any:
        """Return whether a z can fail a row, as far as is known."""
        change = sight.leverage[-1] * abs(z - sight.choice.first_z)
        return (sight.ahead & (self._reaches @ change > sight.room)).any()

    def _look(self, sight: Sight) -> DistanceScan | DistanceScans:
        """Return distances along the full stop of pairs that may matter, and slopes."""
        flags, path, k = sight.ahead | sight.in_zone, sight.q[None], sight.k
        if knows_branches(flags):
            return self._look_at_few_or_all(sight, flags)
        numbers, places = selection(flags), _WITH_SLOPES
        if isinstance(flags, np.ndarray) and not np.count_nonzero(sight.ahead):
            # What only joints that make way ask for is said of the posture.
            k, places = k[:1], _WITH_SLOPES[:1]
        else:
            path = sight.q + sight.stop.travel(sight.choice.first, k)
        near = sight.world.near(path, k, _ALL if numbers is None else numbers, places)
        return DistanceScan(Along(numbers, flags, k, path, near.gaps), near.slopes)

    def _look_at_few_or_all(self, sight: Sight, flags: Flags) -> DistanceScans:
        """Return what compiled code sees of those with a flag, if they are few, else of all."""
        k, nothing, where = sight.k, self._nothing(sight), functions_of(flags).where
        path = sight.q + sight.stop.travel(sight.choice.first, k)
        assert isinstance(nothing, DistanceScans)
        pairs, counts, places, are_few = self.clearance.few(flags)

        def few() -> DistanceScans:
            near = sight.world.near(path, k, pairs, _WITH_SLOPES)
            gaps = where(counts, near.gaps, np.inf)
            along = Along(pairs, flags, k, path, gaps, places)
            every = nothing.every._replace(along=nothing.every.along._replace(path=path))
            return DistanceScans(are_few, DistanceScan(along, near.slopes), every)

        def every() -> DistanceScans:
            needs = self._needs(sight, flags)
            near = sight.world.near(path, k, _ALL, _WITH_SLOPES, needs)
            along = Along(None, flags, k, path, near.gaps)
            return DistanceScans(are_few, nothing.few, DistanceScan(along, near.slopes))

        return either(are_few, few, every)

    def _needs(self, sight: Sight, flags: Flags) -> Needs:
        """Return what a look at all pairs has to tell of those with a flag, shape (p,)."""
        xp = functions_of(sight.q)
        # Of a pair that is not close, what only the certificate would look at is not needed.
        with_rows = np.isin(np.arange(len(sight.k)), _WITH_SLOPES)[:, None]
        # Here slopes are for joints that make way, and to be lifted off what is near.
        here = xp.maximum(self._zones, self.avoidance.distance)
        bounds = xp.concatenate((here[None], self._row_bounds(sight)))
        return Needs(flags & (with_rows | sight.close), bounds)

    def _row_bounds(self, sight: Sight, numbers: Indices | None = None) -> Array:
        """Return distances from which on no velocity of the box can fail a row, shape (s, r)."""
        rate = self.avoidance.approach * sight.world.period
        reaches = self._reaches if numbers is None else entries(self._reaches, numbers)
        return self.avoidance.distance + (sight.leverage * sight.widest) @ reaches.T / rate

    def _nothing(self, sight: Sight) -> DistanceScan | DistanceScans | None:
        """Return what takes the place of a look: None or, in JAX, arrays that say nothing."""
        if isinstance(sight.q, np.ndarray):
            return None
        xp, (p,), n = functions_of(sight.q), sight.left.shape, sight.q.size
        path, none = xp.zeros((len(sight.k), n)) + sight.q, np.zeros(p, dtype=bool)

        def scan(r: int, pairs: Any = None, places: Any = None) -> DistanceScan:
            along = Along(pairs, none, sight.k, path, np.full((len(sight.k), r), -np.inf), places)
            return DistanceScan(along, np.zeros((len(_WITH_SLOPES), r, n)))

        if not knows_branches(sight.in_zone):
            return scan(p)
        r = sum(self.clearance.lanes)
        of_few = scan(r, np.zeros(r, dtype=int), np.zeros(p, dtype=int))
        return DistanceScans(~none.any(), of_few, scan(p))

    def _preferred_velocity(self, scan: DistanceScan) -> Array:
        """Return the velocities that joints prefer, to make way for obstacles, shape (n,)."""
        if self.repulsion is None:
            return 0.0 * scan.slopes[0, 0]
        gaps, slopes, numbers = scan.along.gaps[0], scan.slopes[0], scan.along.pairs
        if numbers is None or scan.along.places is not None:
            is_here = gaps < (self._zones if numbers is None else entries(self._zones, numbers))
            is_here = is_here & scan.along.flags if numbers is None else is_here
            return self.repulsion.velocity(functions_of(gaps).where(is_here, gaps, np.inf), slopes)
        (here,) = (gaps < self._zones[numbers]).nonzero()
        return self.repulsion.velocity(gaps[here], slopes[here])

    def _rows(self, sight: Sight, scan: DistanceScan, z: Array) -> Rows | None:
        """Return the rows of the pairs that may matter; None without any that z may fail."""
        if len(scan.slopes) == 1:
            return None
        distance, rate = self.avoidance.distance, self.avoidance.approach * sight.world.period
        along, leverage, first_z = scan.along, sight.leverage, sight.choice.first_z
        xp, numbers = functions_of(z), along.pairs
        gaps = along.gaps[_WITH_SLOPES[1:]] if xp is np else _places(along.gaps)
        room = rate * xp.maximum(gaps - distance, 0.0)
        counts = gaps < self._row_bounds(sight, numbers)
        if numbers is None or along.places is not None:
            A = scan.slopes[1:, :, : z.size] * leverage[:, None]
            # Of few pairs those that do not count are infinitely far.
            counts = counts & along.flags if numbers is None else counts
            A, room, counts = A.reshape(-1, z.size), room.ravel(), counts.ravel()
            size = xp.sqrt((A * A).sum(axis=1))
            counts = counts & (size > _FLAT)
            A = A / xp.where(counts, size, 1.0)[:, None]
            c = A @ first_z - room / xp.where(counts, size, 1.0)
            return Rows(A, xp.where(counts, c, -np.inf))
        # A row allows what the slope could take of the room, and no slope is larger than reaches.
        reaches = self._reaches if numbers is None else entries(self._reaches, numbers)
        travel = (leverage * np.abs(z - first_z)) @ reaches.T
        if not np.count_nonzero(travel > room):
            return None
        postures, places = np.nonzero(counts)
        leverage = leverage[postures]
        A = scan.slopes[1:][postures, places, : leverage.shape[1]] * leverage
        size = np.sqrt((A * A).sum(axis=1))
        some = size > _FLAT
        if np.count_nonzero(some) < some.size:
            A, size, postures, places = A[some], size[some], postures[some], places[some]
        if not size.size:
            return None
        c = A @ first_z - room[postures, places]
        return Rows(A / size[:, None], c / size)


# Postures of a look in which slopes are computed: where the arm is, and those of rows.
_WITH_SLOPES = np.concatenate(([0], 1 + OF_ROWS))


#: Signals by which one robot sees what moves in its way, with their numbers of axes.
SIGNAL_AXES = {
    **{"p_WO": 2, "other_commanded": 1, "other_v": 1, "other_a": 1, "detour": 1},
    "compliance": 1,
}


def _with_compliance(
    program: Any, box: tuple[Array, Array], rows: Rows, compliance: Array
) -> Array:
    """Return what `within_rows` does where some joints leave what they prefer more readily.

    With z = z_0 + s d, where z_0 is what is preferred within the box and s the compliance, it is
    the program for d.

    Args:
        program: v, J, b, g and S of `within_rows`.
        box: Lower and upper bounds, shape (n,) each [rad/s].
        rows: Further bounds.
        compliance: See `drake_rnn.laws.guard.JointStreamReading`, shape (n,).
    """
    v, J, b, g, softness = program
    lower, upper = box
    xp, s = functions_of(g, lower, compliance), compliance
    z_0, gives_way = clip(g, lower, upper), s > 0.0
    per = xp.where(gives_way, 1.0 / xp.where(gives_way, s, 1.0), 0.0)
    # A joint that does not give way has a d of 0 within any bounds.
    low = xp.where(gives_way, per * (lower - z_0), -1.0)
    high = xp.where(gives_way, per * (upper - z_0), 1.0)
    scaled = Rows(rows.A * s, rows.c - rows.A @ z_0)
    if len(b):
        J, b = J * s, b - J @ z_0
    d = within_rows(per * (v - z_0), J, b, per * (g - z_0), softness, low, high, scaled)
    # A bound that is met stays met, up to rounding.
    return clip(z_0 + s * d, lower, upper)


def limit_axes(within: WithinAcceleration | WithinJerk) -> dict[tuple[str, ...], int]:
    """Return how many axes numbers of one robot have, see `WithinClear.number_axes`."""
    limits = {("limits", name): 1 for name in fields_of(within.limits)}
    return limits | ({("smoothing",): 0} if isinstance(within, WithinJerk) else {})


def per_robot_of(
    owner: Any,
    number_axes: Mapping[tuple[str, ...], int],
    function: Callable[..., Parts],
    operands: Sequence[Array],
    axes: Sequence[int],
) -> Parts:
    """Return what a function returns for one robot or many, as `per_robot` does.

    Args:
        owner: What has numbers that may differ from robot to robot.
        number_axes: Where its numbers are, and how many axes each has of one robot.
        function: Returns arrays, given the owner and the arrays of one robot.
        operands: Arguments, of which any may have a leading axis of robots.
        axes: How many axes each of these has without.
    """
    places = [
        place
        for place, of_one in number_axes.items()
        if np.ndim(value := _field(owner, place)) > of_one or is_foreign(value)
    ]
    if not places:
        return per_robot(lambda *rows: function(owner, *rows), operands, axes)

    def owner_with(rows: Sequence[Array]) -> Any:
        one = owner
        for place, number in zip(places, rows, strict=True):
            # A number that differs has shape (robots, 1), and (1,) of one robot.
            is_vector = number_axes[place] or not np.ndim(number)
            one = _with_field(one, place, number if is_vector else number[0])
        return one

    numbers = [_field(owner, place) for place in places]
    if all(isinstance(each, (np.ndarray, float)) for each in (*numbers, *operands)):
        # A memo of a pure function: what follows from the numbers of each is computed once.
        owners = owner.__dict__.setdefault("_of_each", [])
        if not owners:
            count = max(map(len, numbers))
            owners += (owner_with([each[k % len(each)] for each in numbers]) for k in range(count))
        each = np.arange(len(owners))
        return per_robot(lambda k, *rows: function(owners[k], *rows), [each, *operands], [0, *axes])
    number_rows = [max(1, number_axes[place]) for place in places]
    return per_robot(
        lambda *rows: function(owner_with(rows[: len(places)]), *rows[len(places) :]),
        [*numbers, *operands],
        [*number_rows, *axes],
    )


def _field(owner: Any, place: tuple[str, ...]) -> Any:
    """Return a field within fields; None if there is none."""
    for name in place:
        owner = fields_of(owner).get(name)
    return 0.0 if isinstance(owner, bool) else owner


def _with_field(owner: Any, place: tuple[str, ...], value: Any) -> Any:
    """Return a copy of an object with another value of a field within fields."""
    name, *rest = place
    if rest:
        value = _with_field(fields_of(owner)[name], tuple(rest), value)
    return replace_unchecked(owner, **{name: value})


def _differ(one: Array, other: Array) -> NDArray[np.bool_]:
    """Return which velocities differ by more than the rounding of a compiled step, shape (n,)."""
    differ: NDArray[np.bool_] = np.abs(one - other) > _SAME * (1.0 + np.abs(one))
    return differ


def _places(rows: Array) -> Array:
    """Return the rows of an array that belong to rows of the program, shape (s, ...)."""
    return functions_of(rows).stack([rows[place] for place in _WITH_SLOPES[1:]])


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


def is_led(detour: Array) -> Any:
    """Return whether velocities lead a law in the place of its task, shape (..., 1).

    Args:
        detour: The velocities, shape (..., n) [rad/s]; NaN if they do not.
    """
    return functions_of(detour).isfinite(detour).all(axis=-1, keepdims=True)


def lead(detour: Array, program: Program) -> Program:
    """Return a program that wants the velocities by which a law is led; itself if it is not.

    Args:
        detour: See `is_led`.
        program: What the law wants by itself.
    """
    xp, leads, (J, b, along, g, softness) = functions_of(detour), is_led(detour), program
    b, along = (xp.where(leads, 0.0, each) for each in (b, along))
    return Program(
        xp.where(leads[..., None], 0.0, J), b, along, xp.where(leads, detour, g), softness
    )

r"""Plans: joint paths round obstacles to a goal, timed within all bounds.

A law that follows joint targets is local: where something stands between the arm and its goal, it
waits. A plan leads round it. It is made in these steps:

1. postures of the goal, if that is a pose, by inverse kinematics from many postures;
2. waypoints, by RRT-Connect of OMPL, from the distances of the arm's own capsules. A way between
   two postures is free if no pair can come too near anywhere on it: it is halved until the travel
   of the joints proves that;
3. shorter ones, by straight ways between points of the path;
4. a curve q(u): a uniform cubic B-spline, of which points of the ways are the control points;
5. times u(t): the largest speed that the bounds allow, forwards and backwards, and a moving average
   of it, which bounds the jerk;
6. where a bound is passed, or where the stop that a law may have to make would not be free, this
   part of the way gets slower, until nothing is left.

What is made so is followed like any other source of targets: the law certifies each sample anew.

All is repeated bit for bit from a seed. The search ends after a number of its own steps; the limit
in seconds only refuses, and so changes no plan that is found.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated, Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ..errors import InvalidInputError
from ..inputs.fields import (
    Angles,
    Array,
    Finite,
    Length,
    NonNegative,
    Point,
    Positive,
    Vector,
    between,
    checked,
    instance,
    number,
    validated,
    vector,
    whole,
)
from ..inputs.keys import Meaning
from ..inputs.messages import metres_hint, plural
from ..inputs.packages import import_extra
from ..laws import Avoidance
from ..paths import JointTargets
from ..robot.arm import Arm
from ..robot.clearance import Clearance
from ..robot.jerk_stop import course
from ..robot.limits import JointLimits
from ..robot.postures import PoseAim, random_postures
from ..robot.rotation import rotation_of

# No postponed annotations: see `path`.

Flags = NDArray[np.bool_]


# Time for which an arm rests where something happens, if none is given [s].
_GRIP = 0.5
# Time for which it may rest for one reason [s].
_LONGEST = 3600.0


@validated
class Goal:
    """Where an arm is to come to rest, and how a way there is looked for."""

    q: Annotated[
        Vector | str | None,
        Meaning("Posture, shape (n,), or the name of a posture of the arm's files.", unit="rad"),
    ] = None
    p_WE: Annotated[
        Point | None,
        Meaning("Position of the end effector, shape (3,), in place of a posture.", unit="m"),
    ] = None
    rpy: Annotated[
        Angles | None,
        Meaning(
            "Roll, pitch and yaw of R_WE, shape (3,), beside the position; without them the end "
            "effector may turn.",
            unit="rad",
        ),
    ] = None
    margin: Annotated[
        Length,
        Meaning(
            "How much farther than ``avoidance.distance`` the plan stays away from everything, "
            "except from what is nearer at the start or at the goal.",
            unit="m",
        ),
    ] = 0.005
    seconds: Annotated[
        Positive,
        Meaning("Time after which the search ends in vain.", unit="s"),
    ] = 30.0
    steps: Annotated[
        int,
        Field(strict=True, gt=0),
        Meaning("Steps of the search after which it ends in vain."),
    ] = 20_000
    action: Annotated[
        Literal["attach", "release", "hand_over"] | None,
        Meaning(
            "What happens to ``arm.payload`` there, at one of ``goals``: ``attach``, the arm "
            "holds it from then on; ``release``, it stays where it is, and is an obstacle; "
            "``hand_over``, it is gone.",
        ),
    ] = None
    supports: Annotated[
        list[str],
        Meaning(
            "Names of obstacles that the payload rests on there: it is not kept apart from them on "
            "the way to where it is released, and from where it is attached to the next goal.",
        ),
    ] = Field(default_factory=list)
    opening: Annotated[
        dict[str, Finite] | None,
        Meaning(
            "Where joints of ``arm.gripper`` are moved there, at one of ``goals``, by their names "
            "in its file [rad or m], such as ``finger_joint1: 0.02``; joints that mimic them "
            "follow. They move before the payload is attached, or after it is released.",
        ),
    ] = None
    opening_time: Annotated[
        Annotated[Positive, between(0.0, _LONGEST)] | None,
        Meaning("Time in which they move, while the arm rests; by default 0.5 s.", unit="s"),
    ] = None
    wait: Annotated[
        Annotated[NonNegative, between(0.0, _LONGEST)] | None,
        Meaning(
            "Time for which the arm rests there before any of that happens, and before it goes on "
            "to the next of ``goals``; by default 0.5 s with ``action`` or ``opening``, else none.",
            unit="s",
        ),
    ] = None
    via: Annotated[
        list[Vector] | None,
        Meaning(
            "Postures of a plan that was found before, from the first one after the start to that "
            "of the goal; nothing is searched for then. The document of a result has them.",
            unit="rad",
        ),
    ] = None

    def __post_init__(self) -> None:
        if (self.q is None) == (self.p_WE is None):
            raise ValueError("give either q, a posture, or p_WE, a position of the end effector")
        if self.rpy is not None and self.p_WE is None:
            raise ValueError("rpy: only with p_WE")
        if self.via is not None and not self.via:
            raise ValueError("via: must have one posture or more")
        if self.via is not None and len({len(q) for q in self.via}) > 1:
            raise ValueError("via: must have rows of one length")
        self._require_action()

    def _require_action(self) -> None:
        """Raise a ValueError if what happens there cannot."""
        if self.action == "attach" and self.p_WE is not None and self.rpy is None:
            raise ValueError("rpy: must be given where it attaches, as what is held lies so")
        if self.supports and self.action is None:
            raise ValueError("supports: only with an action, what the payload rests on there")
        if self.opening is not None and not self.opening:
            raise ValueError("opening: must name joints of the gripper, each with a position")
        if self.opening_time is not None and self.opening is None:
            raise ValueError("opening_time: only with opening, the joints that move in that time")

    @property
    def alone(self) -> "Goal":
        """It without what happens there, which a plan does not depend on."""
        return replace(self, action=None, supports=[], wait=None, opening=None, opening_time=None)

    @property
    def acts(self) -> bool:
        """Whether something happens there."""
        return self.action is not None or self.opening is not None

    @property
    def rest(self) -> float:
        """Time for which the arm rests there before anything happens [s]."""
        if self.wait is not None:
            return self.wait
        return _GRIP if self.acts else 0.0

    @property
    def moving(self) -> float:
        """Time for which joints of the gripper move there [s]."""
        return 0.0 if self.opening is None else self.opening_time or _GRIP


@dataclass(frozen=True, eq=False)
class MotionPlan:
    """A joint path from rest to rest, as positions at the samples of a law.

    Attributes:
        waypoints: Postures that it was made of, start and goal included, shape (k, n) [rad].
        position: Joint positions at samples, shape (s, n) [rad].
        period: Time between two samples [s].
        lookahead: Time from which a deviation is corrected [s]: ``interval`` of a `JointStream`
            that ``pursues``.
        steps: Steps that the search took; 0 if a straight way is free, or nothing was searched.
        wall_time: Time that planning took [s].
        doubtful_stops: Number of samples at which the law may have to leave the plan, since its
            stop there is not free at the least speed.
    """

    waypoints: Array
    position: Array
    period: float
    lookahead: float
    steps: int
    wall_time: float
    doubtful_stops: int = 0

    @property
    def duration(self) -> float:
        """Time from rest to rest [s]."""
        return self.period * (len(self.position) - 1)

    @property
    def summary(self) -> str:
        """What it is, in a line."""
        count = plural(len(self.waypoints) - 2, "waypoint")
        return (
            f"{count} between start and goal, {self.duration:.3g} s from rest to rest; planned in "
            f"{self.wall_time:.2g} s, {plural(self.steps, 'step')} of a search"
        )

    @property
    def course(self) -> JointTargets:
        """Where the joints are to be at each sample."""
        times: Array = self.period * np.arange(len(self.position), dtype=np.float64)
        return JointTargets(times, self.position)

    @property
    def stream(self) -> dict[str, Any]:
        """Settings of a `drake_rnn.JointStream` that follows `targets`."""
        return {"interval": self.lookahead, "pursues": True, "timeout": 2.0 * self.lookahead}

    def targets(self, until: float) -> JointTargets:
        """Return the targets for a law that pursues them, one at each sample.

        Each is where the joints would be a lookahead later at the velocity of the plan. So a law
        that is on the plan stays on it exactly, and one that is off it comes back within about a
        lookahead. After the end the goal is repeated.

        Args:
            until: Time at which they end [s].
        """
        q = self.position
        rest = max(0, int(np.ceil(until / self.period)) + 1 - len(q))
        position = np.concatenate((q, np.repeat(q[-1:], rest, axis=0)))
        ahead = np.diff(position, axis=0, append=position[-1:]) / self.period
        times: Array = self.period * np.arange(len(position), dtype=np.float64)
        return JointTargets(times, position + self.lookahead * ahead)


#: Called with what planning does now, and whether that is its end.
Watch = Callable[[str, bool], None]
_WATCH: ContextVar[Watch | None] = ContextVar("planning", default=None)


@contextmanager
def watch_planning(watch: Watch) -> Iterator[None]:
    """Have a function called from time to time while something is planned in a with-block."""
    token = _WATCH.set(watch)
    try:
        yield
    finally:
        _WATCH.reset(token)


# What a plan may come nearer than its margin between two postures [m]; how often a way is halved.
_SLACK, _HALVINGS = 0.002, 14
# What is kept of a distance that a start or goal has itself [m].
_TINY = 1e-6


class Distances(Protocol):
    """Distances of pairs, as `Clearance` has them."""

    def gaps(self, q: Array, /) -> Array:
        """Return the distance of each pair, shape (..., p) [m]."""

    @property
    def reaches(self) -> Array:
        """How much nearer a pair comes at most for each unit of a joint, shape (p, n)."""


@dataclass(frozen=True, eq=False)
class FreeSpace:
    """Postures in which no pair is nearer than it may be.

    Attributes:
        clearance: The pairs; None if nothing is to be kept clear.
        margins: How far each is to be apart in postures that are looked at, shape (p,) [m].
        least: How far it is to be apart between these, shape (p,) [m].
    """

    clearance: Distances | None
    margins: Array
    least: Array

    @classmethod
    def between(
        cls, clearance: Distances | None, ends: Array, distance: float, floor: float
    ) -> "FreeSpace":
        """Return the free space of a plan.

        Args:
            clearance: The pairs.
            ends: Start and goals, shape (k, n) [rad]. What is nearer there may be so elsewhere.
            distance: How far pairs are to be apart [m].
            floor: How far they are to be apart whatever start and goal are [m].
        """
        if clearance is None:
            return cls(None, np.zeros(0), np.zeros(0))
        own = clearance.gaps(ends).min(axis=0) - _TINY
        margins = np.maximum(np.minimum(distance, own), floor)
        return cls(clearance, margins, np.maximum(margins - _SLACK, floor))

    @property
    def looser(self) -> "FreeSpace":
        """The same with what is left between postures everywhere."""
        least = np.maximum(self.least - 0.5 * _SLACK, np.minimum(self.margins, self.least))
        return FreeSpace(self.clearance, self.least, least)

    def holds(self, q: Array) -> bool:
        """Return whether a posture is free, shape (n,)."""
        if self.clearance is None:
            return True
        return bool((self.clearance.gaps(q) >= self.margins).all())

    def ways(self, q: Array) -> Flags:
        """Return which straight ways from each posture to the next are free, shape (k - 1,).

        Args:
            q: Postures, shape (k, n) [rad].
        """
        is_free = np.ones(len(q) - 1, dtype=bool)
        if self.clearance is None:
            return is_free
        over = self.clearance.gaps(q) - self.margins
        is_free[:] = (over[1:] >= 0.0).all(axis=1) & (over[:-1] >= 0.0).all(axis=1)
        owners = np.flatnonzero(is_free)
        begin, end, d_begin, d_end = q[owners], q[owners + 1], over[owners], over[owners + 1]
        least, reaches = self.least - self.margins, self.clearance.reaches.T
        for _ in range(_HALVINGS):
            way = np.abs(end - begin) @ reaches
            unsure = (0.5 * (d_begin + d_end - way) < least).any(axis=1) & is_free[owners]
            if not unsure.any():
                return is_free
            begin, end, owners = begin[unsure], end[unsure], owners[unsure]
            d_begin, d_end = d_begin[unsure], d_end[unsure]
            middle = 0.5 * (begin + end)
            d_middle = self.clearance.gaps(middle) - self.margins
            is_free[owners[(d_middle < 0.0).any(axis=1)]] = False
            begin, end = np.concatenate((begin, middle)), np.concatenate((middle, end))
            d_begin = np.concatenate((d_begin, d_middle))
            d_end = np.concatenate((d_middle, d_end))
            owners = np.concatenate((owners, owners))
        is_free[owners] = False
        return is_free

    def way(self, begin: Array, end: Array) -> bool:
        """Return whether the straight way between two postures is free, shape (n,) each."""
        return bool(self.ways(np.array([begin, end]))[0])


# Random postures from which a pose is sought, those that are tried as goals, and what a posture may
# miss a pose by [m, with the lever of a rotation].
_SEEDS, _GOALS, _MISS = 40, 6, 1e-6
# Postures of a goal that differ by less are one [rad].
_SAME = 1e-3


def goal_postures(arm: Arm, goal: Goal, start: Array, seed: int) -> Array:
    """Return postures that a goal may be reached in, the one nearest to the start first, (k, n).

    Args:
        arm: The arm, with its limits.
        goal: The goal.
        start: Start posture, shape (n,) [rad].
        seed: Seed of the postures from which a pose is sought.

    Raises:
        InvalidInputError: If there is none within the limits.
    """
    limits = arm.limits
    lower, upper = limits.resting
    if goal.p_WE is None:
        q = arm.named_posture("goal.q", goal.q) if isinstance(goal.q, str) else goal.q
        assert q is not None
        if len(q) != arm.n:
            raise InvalidInputError(f"goal.q: has {len(q)} entries for {arm.n} joints")
        q = limits.nearest_turn(np.asarray(q), start, arm.endless)
        if (q < lower).any() or (q > upper).any():
            raise InvalidInputError(f"goal.q: {limits.complaint(q, 0.0, arm.joints, arm.units)}")
        return np.array([q])
    R_WE = None if goal.rpy is None else rotation_of(goal.rpy)
    aim = PoseAim(arm.kinematics(), [0, 1, 2], R_WE)
    found, least = list[Array](), np.inf
    for q in (start, *random_postures(arm, _SEEDS, seed)):
        posture, miss = aim.descend(np.asarray(q), np.asarray(goal.p_WE))
        least = min(least, miss)
        if miss > _MISS:
            continue
        turns = np.where(np.abs(posture) > np.pi, np.round(posture / (2.0 * np.pi)), 0.0)
        is_out = (posture < lower) | (posture > upper)
        posture = np.where(is_out, posture - 2.0 * np.pi * turns, posture)
        posture = limits.nearest_turn(posture, start, arm.endless)
        is_new = all(np.abs(posture - other).max() > _SAME for other in found)
        if is_new and (posture >= lower).all() and (posture <= upper).all():
            found.append(posture)
    if not found:
        place = ", ".join(f"{x:.4g}" for x in goal.p_WE)
        fault = f"misses it by {least:.3g} m" if least > _MISS else "reaches it beyond its limits"
        turned = "" if R_WE is None else ", with its orientation,"
        raise InvalidInputError(
            f"goal.p_WE: ({place}) m{turned} is out of reach: {arm.name} {fault}"
            f"{metres_hint(least)}"
        )
    return np.array(sorted(found, key=lambda q: float(np.linalg.norm(q - start))))


def nearest_pair(clearance: Clearance, q: Array) -> tuple[str, str, float]:
    """Return the pair that is nearest in a posture, and its distance [m]."""
    gaps = clearance.gaps(q)
    return (*clearance.names[int(gaps.argmin())], float(gaps.min()))


def how_near(one: str, other: str, gap: float) -> str:
    """Return in words how near a pair is, whose distance is given [m]."""
    return (
        f"{one} and {other} overlap by {-gap:.3g} m"
        if gap < 0.0
        else f"{one} and {other} are {gap:.3g} m apart"
    )


def _free_goals(clearance: Clearance, postures: Array, goal: Goal, least: float) -> Array:
    """Return the postures that are free; an InvalidInputError says what blocks the others.

    If none of several is as far from everything as the margin asks, that is the freest alone: how
    near the plan may come then depends on the goal that it leads to, and on no other.
    """
    gaps = clearance.gaps(postures).min(axis=1)
    if (is_roomy := gaps >= least + goal.margin).any():
        return postures[is_roomy]
    if gaps.max() > least:
        return postures[[int(gaps.argmax())]]
    near = max((nearest_pair(clearance, q) for q in postures), key=lambda each: each[2])
    what = (
        "there"
        if goal.p_WE is None
        else (f"in the freest of {plural(len(postures), 'posture')} that reach it")
    )
    raise InvalidInputError(
        f"goal: {how_near(*near)} {what}; more than {least:g} m, avoidance.distance, are needed"
    )


# Longest step of the search, as the length of the vector of joints [rad].
_RANGE = 1.0
# Steps of the search after which its watch is told of it.
_NOW_AND_THEN = 5


def _space_information(
    base: Any, bounds: tuple[Array, Array], free: FreeSpace
) -> tuple[Any, Callable[[Any], Array], Callable[[Array], Any]]:
    """Return OMPL's idea of a free space, and what turns its states into postures and back.

    Args:
        base: The module `ompl.base`.
        bounds: Lower and upper positions, shape (n,) each [rad].
        free: The free space.
    """
    space = base.RealVectorStateSpace(len(bounds[0]))
    joints, box = range(len(bounds[0])), base.RealVectorBounds(len(bounds[0]))
    for joint, (lower, upper) in enumerate(zip(*bounds, strict=True)):
        box.setLow(joint, float(lower))
        box.setHigh(joint, float(upper))
    space.setBounds(box)
    information = base.SpaceInformation(space)

    def posture(state: Any) -> Array:
        return np.array([state[joint] for joint in joints])

    def state_of(q: Array) -> Any:
        state = information.allocState()
        for joint in joints:
            state[joint] = float(q[joint])
        return state

    class Ways(base.MotionValidator):
        """Straight ways that are free."""

        def checkMotion(self, one: Any, other: Any) -> bool:
            return free.way(posture(one), posture(other))

    information.setStateValidityChecker(lambda state: free.holds(posture(state)))
    ways = Ways(information)
    information.setMotionValidator(ways)
    information.setup()
    return information, posture, state_of


class Patience(Protocol):
    """Limits of a search."""

    @property
    def seconds(self) -> float:
        """Time after which it ends in vain [s]."""

    @property
    def steps(self) -> int:
        """Steps after which it ends in vain."""


def search(
    free: FreeSpace, ends: Array, bounds: tuple[Array, Array], goal: Patience, seed: int
) -> tuple[Array, int]:
    """Return waypoints from a start to one of some goals, and the steps that it took to find them.

    Args:
        free: The free space.
        ends: The start, and then the goals, shape (1 + k, n) [rad].
        bounds: Lower and upper positions, shape (n,) each [rad].
        goal: Limits of the search.
        seed: Seed of OMPL's random numbers.

    Raises:
        InvalidInputError: If none is found, or OMPL is not installed.
    """
    base, geometric, util = import_extra("goal", "plan", "ompl.base", "ompl.geometric", "ompl.util")
    util.setLogLevel(util.LogLevel.LOG_NONE)
    # Random numbers of what is made from here on follow from it.
    util.RNG.setSeed(seed + 1)
    information, posture, state_of = _space_information(base, _near_bounds(bounds, ends), free)
    setup, goals = geometric.SimpleSetup(information), base.GoalStates(information)
    setup.addStartState(state_of(ends[0]))
    for q in ends[1:]:
        goals.addState(state_of(q))
    setup.setGoal(goals)
    planner = geometric.RRTConnect(information)
    planner.setRange(_RANGE)
    setup.setPlanner(planner)
    setup.setup()
    effort = _Effort(goal)
    planner.solve(base.PlannerTerminationCondition(effort.is_over))
    if not setup.haveExactSolutionPath():
        raise InvalidInputError(
            f"goal: no path found within {effort.limit}; there may be none, or the search needs "
            "more"
        )
    path = setup.getSolutionPath().getStates()
    return np.array([posture(state) for state in path]), effort.steps


class _Effort:
    """How much a search has done.

    Args:
        goal: Its limits.

    Attributes:
        steps: Steps until now.
    """

    def __init__(self, goal: Patience) -> None:
        self._goal, self._began, self._watch = goal, time.perf_counter(), _WATCH.get()
        self.steps = 0

    def is_over(self) -> bool:
        """Count a step, and return whether there are to be no more."""
        self.steps += 1
        spent, goal = time.perf_counter() - self._began, self._goal
        if self._watch is not None and self.steps % _NOW_AND_THEN == 0:
            share = f"{self.steps} of {goal.steps} steps, {spent:.1f} of {goal.seconds:g} s"
            self._watch(f"searches: {share}", False)
        return self.steps > goal.steps or spent > goal.seconds

    @property
    def limit(self) -> str:
        """The limit that has ended it."""
        goal = self._goal
        if self.steps > goal.steps:
            return f"{plural(goal.steps, 'step')}, goal.steps"
        return f"{goal.seconds:g} s, goal.seconds"


def _near_bounds(bounds: tuple[Array, Array], ends: Array) -> tuple[Array, Array]:
    """Return bounds of a search: no joint turns by more than half a turn beyond start and goals."""
    lower, upper = bounds
    return (
        np.maximum(lower, ends.min(axis=0) - np.pi),
        np.minimum(upper, ends.max(axis=0) + np.pi),
    )


# Random straight ways that are tried, and those in vain after which no more are.
_SHORTCUTS, _IN_VAIN = 120, 40


def shorten(free: FreeSpace, waypoints: Array, seed: int) -> Array:
    """Return waypoints with straight ways between points of a path, wherever these are free."""
    rng, vain = np.random.default_rng(seed), 0
    path = list(_without_needless(free, list(waypoints)))
    for _ in range(_SHORTCUTS):
        if len(path) < 3 or vain >= _IN_VAIN:
            break
        lengths = np.linalg.norm(np.diff(path, axis=0), axis=1)
        at = np.concatenate(((0.0,), np.cumsum(lengths)))
        one, other = np.sort(rng.uniform(0.0, at[-1], 2))
        i, j = (int(k) for k in np.searchsorted(at, (one, other), side="right") - 1)
        vain += 1
        if i == j or j >= len(lengths):
            continue
        begin, end = (
            path[k] + (s - at[k]) / lengths[k] * (path[k + 1] - path[k])
            for k, s in ((i, one), (j, other))
        )
        saved = other - one - float(np.linalg.norm(end - begin))
        if saved > 0.01 * at[-1] and free.ways(np.array([path[i], begin, end, path[j + 1]])).all():
            path = [*path[: i + 1], begin, end, *path[j + 1 :]]
            vain = 0
    return np.array(_without_needless(free, path))


def _without_needless(free: FreeSpace, path: list[Array]) -> list[Array]:
    """Return waypoints of which none can be left out, the longest ways first."""
    kept, k = [path[0]], 0
    while k < len(path) - 1:
        k = next(j for j in range(len(path) - 1, k, -1) if j == k + 1 or free.way(path[k], path[j]))
        kept.append(path[k])
    return kept


# Distances between control points that are tried, the largest first [rad].
_SPACINGS = (0.4, 0.2, 0.1, 0.05, 0.025, 0.0125, 0.00625)
# Points of each span of a curve at which speeds are chosen, and ways looked at.
_POINTS = 8
# Rows of the powers of a span's parameter, for the four control points of a uniform cubic B-spline.
_BASIS = np.array([[1, -3, 3, -1], [4, 0, -6, 3], [1, 3, 3, -3], [0, 0, 0, 1]]) / 6.0


@dataclass(frozen=True, eq=False)
class BSpline:
    """A uniform cubic B-spline from its first control point to its last one.

    Attributes:
        control: Control points, shape (k, n), with one before the first and one after the last.
    """

    control: Array

    @classmethod
    def through(cls, waypoints: Array, spacing: float) -> "BSpline":
        """Return one whose control points are on the straight ways between waypoints.

        Args:
            waypoints: They, shape (k, n) [rad].
            spacing: Largest distance between two control points [rad].
        """
        points = [waypoints[:1]]
        for begin, end in pairwise(waypoints):
            count = max(1, int(np.ceil(np.linalg.norm(end - begin) / spacing)))
            shares = np.arange(1, count + 1)[:, None] / count
            points.append(begin + shares * (end - begin))
        inner = np.concatenate(points)
        before, after = 2.0 * inner[0] - inner[1], 2.0 * inner[-1] - inner[-2]
        return cls(np.concatenate((before[None], inner, after[None])))

    @property
    def end(self) -> float:
        """Largest value of its parameter, which begins at 0."""
        return float(len(self.control) - 3)

    def at(self, u: Array, order: int = 0) -> Array:
        """Return points, or derivatives with respect to the parameter, shape (k, n)."""
        span = np.clip(np.floor(u).astype(int), 0, len(self.control) - 4)
        x = (u - span)[:, None]
        powers = np.arange(4)
        factors = np.ones(4)
        for k in range(order):
            factors = factors * (powers - k)
        monomials = factors * x ** np.maximum(powers - order, 0)
        weights = monomials @ _BASIS.T
        return np.asarray(sum(weights[:, k : k + 1] * self.control[span + k] for k in range(4)))


def round_corners(free: FreeSpace, waypoints: Array) -> BSpline:
    """Return a curve near the straight ways between waypoints that is free as well.

    Raises:
        InvalidInputError: If none is.
    """
    looser = free.looser
    for spacing in _SPACINGS:
        curve = BSpline.through(waypoints, spacing)
        u = np.linspace(0.0, curve.end, _POINTS * int(curve.end) + 1)
        if looser.ways(curve.at(u)).all():
            return curve
    raise InvalidInputError(
        "goal: a path was found, but no curve near it is free; give a smaller margin, or another "
        "seed"
    )


# Shares of the bounds of acceleration and jerk that the bend of a curve may take up.
_OF_BEND, _OF_TWIST = 0.6, 0.4
# How often a plan is slowed, and the least share of the speed that is left then.
_SLOWINGS, _SLOWEST = 60, 0.01
# What part of the speed is left where a stop is not free, and how far a bound may be used.
_SLOWER, _FULL = 0.8, 1.0 - 1e-6
# Time between samples whose stop is looked at, and between postures of each [s].
_BETWEEN = 0.02
# What a stop may be nearer than a row counts with [m].
_CLOSE = 2e-4


@dataclass(frozen=True, eq=False)
class Bounds:
    """What a motion is to keep.

    Attributes:
        velocity, acceleration, jerk: Bounds, shape (n,) each [rad/s, rad/s^2, rad/s^3].
        period: Time between two samples [s].
    """

    velocity: Array
    acceleration: Array
    jerk: Array
    period: float

    @classmethod
    def of(cls, limits: JointLimits, period: float) -> "Bounds":
        """Return those of limits, of which the acceleration must be known.

        Raises:
            InvalidInputError: If a bound is missing.
        """
        # Within the bounds of both directions.
        velocity = limits.sides("velocity", "a plan has a time").least
        acceleration = limits.sides("acceleration", "a plan begins and ends at rest").least
        # From one largest acceleration to the other within a sample: more cannot be asked for.
        most = 2.0 * acceleration / period
        jerk = most if limits.jerk is None else np.minimum(limits.jerk, most)
        return cls(velocity, acceleration, jerk, period)

    @property
    def turn(self) -> float:
        """Time in which the jerk turns the acceleration round [s]."""
        return 2.0 * float((self.acceleration / self.jerk).max())

    @property
    def lookahead(self) -> float:
        """Time within which a deviation can be corrected [s]."""
        return max(0.05, self.turn, 2.0 * self.period)

    @property
    def window(self) -> int:
        """Samples of a moving average that bounds the jerk."""
        return max(1, round(self.turn / self.period))

    def use(self, q: Array) -> Array:
        """Return how much faster than the bounds a motion from rest to rest is, shape (s,)."""
        h = self.period
        rest = [np.repeat(q[k : k + 1], 3, axis=0) for k in (0, len(q) - 1)]
        v = np.diff(np.concatenate((rest[0], q, rest[1])), axis=0) / h
        a = np.diff(v, axis=0) / h
        j = np.diff(a, axis=0) / h
        shares = (
            (np.abs(v) / self.velocity).max(axis=1)[3 : 3 + len(q)],
            np.sqrt((np.abs(a) / self.acceleration).max(axis=1)[2 : 2 + len(q)]),
            np.cbrt((np.abs(j) / self.jerk).max(axis=1)[1 : 1 + len(q)]),
        )
        return np.maximum.reduce(shares)


class Timing:
    """When a curve is where: as fast as bounds allow, and slower where it is told to be.

    Args:
        curve: The curve.
        bounds: The bounds.
    """

    def __init__(self, curve: BSpline, bounds: Bounds) -> None:
        self._curve, self._bounds = curve, bounds
        self._u = np.linspace(0.0, curve.end, _POINTS * int(curve.end) + 1)
        first, second, third = (np.abs(curve.at(self._u, k)) + 1e-12 for k in (1, 2, 3))
        speeds = (
            (bounds.velocity / first).min(axis=1),
            np.sqrt((_OF_BEND * bounds.acceleration / second).min(axis=1)),
            np.cbrt((_OF_TWIST * bounds.jerk / third).min(axis=1)),
        )
        self._fastest = np.minimum.reduce(speeds)
        self._first, self._second = first, second
        #: Share of the speed that is left at each point.
        self.shares = np.ones(len(self._u))

    def places(self) -> Array:
        """Return the parameter at each sample, shape (s,)."""
        u, h = self._u, self._bounds.period
        squares, step = self._squares(), float(u[1])
        speeds = np.sqrt(squares)
        times = np.concatenate(((0.0,), np.cumsum(2.0 * step / (speeds[1:] + speeds[:-1]))))
        window = self._bounds.window
        count = int(np.ceil(times[-1] / h)) + 1
        # The average begins and ends at rest.
        at = np.clip(h * np.arange(-window, count + window), 0.0, times[-1])
        k = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(u) - 2)
        gain = (squares[k + 1] - squares[k]) / (2.0 * step)
        since = at - times[k]
        plain = np.clip(u[k] + speeds[k] * since + 0.5 * gain * since**2, 0.0, u[-1])
        sums = np.concatenate(((0.0,), np.cumsum(plain)))
        mean = (sums[window:] - sums[:-window]) / window
        mean[-1] = u[-1]
        return np.clip(mean, 0.0, u[-1])

    def slow(self, begin: Array, end: Array, shares: Array) -> bool:
        """Have parts of the curve passed more slowly; return whether any of them can be.

        Args:
            begin: Parameters from which on they are, shape (k,).
            end: Parameters until which they are, shape (k,).
            shares: What is left of their speeds, shape (k,).
        """
        factors, step = np.ones(len(self._u)), float(self._u[1])
        for one, other, share in zip(begin, end, shares, strict=True):
            first = max(0, int(np.floor(one / step)) - 1)
            last = int(np.ceil(other / step)) + 2
            factors[first:last] = np.minimum(factors[first:last], share)
        slower = np.maximum(self.shares * factors, _SLOWEST)
        changes = bool((slower < self.shares * (1.0 - 1e-9)).any())
        self.shares = slower
        return changes

    def _squares(self) -> Array:
        """Return the squared speeds of the parameter at each point, from rest to rest."""
        step = float(self._u[1])
        most = (self.shares * self._fastest) ** 2
        most[0] = most[-1] = 0.0
        limits = self._bounds.acceleration * (self.shares**2)[:, None]
        squares = most.copy()
        for order in (range(1, len(most)), range(len(most) - 2, -1, -1)):
            back = -1 if order.step > 0 else 1
            for k in order:
                before = squares[k + back]
                left = limits[k + back] - self._second[k + back] * before
                gain = float((np.maximum(left, 0.0) / self._first[k + back]).min())
                squares[k] = min(squares[k], before + 2.0 * step * gain)
        # A point of rest in between would never be left.
        least = (1e-3 * _SLOWEST * self._fastest) ** 2
        squares[1:-1] = np.maximum(squares[1:-1], least[1:-1])
        return squares


@dataclass(frozen=True, eq=False)
class Stops:
    """The stops that a law certifies, of a motion.

    Attributes:
        clearance: What the arm is to stay clear of.
        least: How far pairs are to be apart during a stop, shape (p,) [m].
        distance, approach: See `drake_rnn.Avoidance`.
        bounds: The bounds within which it stops.
    """

    clearance: Distances
    least: Array
    distance: float
    approach: float
    bounds: Bounds

    def faults(self, q: Array) -> NDArray[np.intp]:
        """Return samples whose stop is not free, or comes nearer sooner than a law lets it.

        Args:
            q: Positions at samples, shape (s, n) [rad].
        """
        bounds, h = self.bounds, self.bounds.period
        stride = max(1, round(_BETWEEN / h))
        v = np.diff(q, axis=0, prepend=q[:1]) / h
        a = np.diff(v, axis=0, prepend=v[:1]) / h
        samples = np.arange(1, len(q), stride)
        # A law whose stop is looked at has the velocity that has led to a sample.
        way = course(
            v[samples],
            np.clip(a[samples], -bounds.acceleration, bounds.acceleration),
            np.broadcast_to(bounds.acceleration, v[samples].shape),
            bounds.jerk,
            h,
        )
        count = int(np.ceil(way.samples.max() / stride)) + 1
        after: Array = float(stride) * np.arange(1.0, count + 1.0)[:, None, None]
        postures = q[samples] + way.travel(after)
        gaps = self.clearance.gaps(postures.reshape(-1, q.shape[1]))
        gaps = gaps.reshape(count, len(samples), -1)
        is_near: Flags = np.asarray((gaps < self.least).any(axis=(0, 2)))
        # The stop from the next sample is where this one's is at the same time, but for what the
        # law may use up until then.
        this, following = gaps[:, :-1], np.concatenate((gaps[:-1, 1:], gaps[-1:, 1:]))
        this = np.concatenate((this[1:], this[-1:]))
        room = np.maximum(this - self.distance, 0.0)
        nearer = this - following - self.approach * stride * h * room
        is_near[:-1] |= (nearer > _CLOSE).any(axis=(0, 2))
        return samples[is_near]


def time_curve(curve: BSpline, bounds: Bounds, stops: Stops | None) -> tuple[Array, int]:
    """Return positions at samples along a curve, from rest to rest, shape (s, n) [rad].

    Args:
        curve: The curve.
        bounds: What is kept.
        stops: What must be free besides; None for nothing.

    Returns:
        The positions, and how many of the stops looked at are not free at the least speed.
    """
    timing, window = Timing(curve, bounds), bounds.window
    stride = max(1, round(_BETWEEN / bounds.period))
    for _ in range(_SLOWINGS):
        u = timing.places()
        q = curve.at(u)
        use = bounds.use(q)
        bad, reach = np.flatnonzero(use > _FULL), window
        shares = np.maximum(0.998 * _FULL / use[bad], 0.5)
        if not bad.size and stops is not None:
            bad, reach = stops.faults(q), 2 * stride
            shares = np.full(len(bad), _SLOWER)
        if not bad.size:
            return q, 0
        begin, end = np.maximum(bad - reach, 0), np.minimum(bad + reach, len(u) - 1)
        if not timing.slow(u[begin], u[end], shares):
            break
    while (most := float(bounds.use(q).max())) > _FULL:
        timing.shares = timing.shares * (0.999 / most)
        q = curve.at(timing.places())
    return q, 0 if stops is None else len(stops.faults(q))


_USUAL = Avoidance()


@checked(
    arm=instance(Arm),
    goal=instance(Goal),
    start=vector,
    period=number(above=0.0),
    clearance=instance(Clearance, None),
    avoidance=instance(Avoidance),
    seed=whole(),
)
def plan_motion(
    arm: Arm,
    goal: Goal,
    start: Array,
    period: float,
    clearance: Clearance | None = None,
    *,
    avoidance: Avoidance = _USUAL,
    seed: int = 0,
) -> MotionPlan:
    """Return a plan from a posture to a goal, among obstacles that stand still.

    Args:
        arm: The arm, with the limits that are kept; that of the acceleration must be known.
        goal: The goal.
        start: Posture at the start, shape (n,) [rad].
        period: Time between two samples [s].
        clearance: What the arm is to stay clear of; None for nothing.
        avoidance: How near the law that follows lets it come.
        seed: Seed of all random numbers.

    Raises:
        InvalidInputError: If start or goal are blocked or out of reach, no path is found within the
            limits of the goal, a bound is missing, or OMPL is needed and not installed.
    """
    began = time.perf_counter()
    several = {"action": goal.action, "opening": goal.opening, "wait": goal.wait}
    if key := next((key for key, value in several.items() if value is not None), None):
        raise InvalidInputError(f"goal.{key}: is for several goals, the key goals of a document")
    start = np.asarray(start, dtype=float)
    arm.limits.require_size("start", start)
    bounds, distance, floor = Bounds.of(arm.limits, period), avoidance.distance, avoidance.floor
    if clearance is not None and (near := nearest_pair(clearance, start))[2] < floor:
        raise InvalidInputError(
            f"start: {how_near(*near)} there, where {floor:g} m are kept, avoidance.floor; clear "
            "the way or start elsewhere"
        )
    postures = _goals(arm, goal, start, seed)
    if clearance is not None and goal.via is None:
        postures = _free_goals(clearance, postures, goal, distance)[:_GOALS]
    ends = np.concatenate((start[None], postures))
    free = FreeSpace.between(clearance, ends, distance + goal.margin, floor)
    if goal.via is None:
        waypoints, steps = _waypoints(free, ends, arm.limits.resting, goal, seed)
    else:
        waypoints, steps = np.vstack((start, *goal.via)), 0
    stops = None
    if clearance is not None:
        least = np.minimum(0.5 * (floor + distance), free.least)
        stops = Stops(clearance, least, distance, avoidance.approach, bounds)
    if (watch := _WATCH.get()) is not None:
        watch("times what it found", False)
    position, doubtful = time_curve(round_corners(free, waypoints), bounds, stops)
    # The last sample is the goal, to the last digit.
    position[-1] = waypoints[-1]
    wall_time = time.perf_counter() - began
    plan = MotionPlan(waypoints, position, period, bounds.lookahead, steps, wall_time, doubtful)
    if watch is not None:
        watch(plan.summary, True)
    return plan


def _goals(arm: Arm, goal: Goal, start: Array, seed: int) -> Array:
    """Return the postures of a goal, that of its plan alone if it has one, shape (k, n) [rad]."""
    if goal.via is None:
        return goal_postures(arm, goal, start, seed)
    if any(len(q) != arm.n for q in goal.via):
        raise InvalidInputError(f"goal.via: must have {arm.n} entries in each row")
    return np.array(goal.via[-1:])


def _waypoints(
    free: FreeSpace, ends: Array, bounds: tuple[Array, Array], goal: Goal, seed: int
) -> tuple[Array, int]:
    """Return waypoints from a start to one of some goals, and the steps of a search, see `search`.

    A straight way, if one is free, needs none.
    """
    for q in ends[1:]:
        if free.way(ends[0], q):
            return np.array([ends[0], q]), 0
    path, steps = search(free, ends, bounds, goal, seed)
    return shorten(free, path, seed), steps

"""The section ``detour``: round what an arm is stuck before, back to its path.

A law that follows a path among obstacles is local: where its path leads behind an obstacle, it may
come to rest before it. An arm that is off its path by more than ``off``, and has not come nearer to
it for a time ``after``, is stuck. Then

1. the arm comes to rest;
2. a motion is planned from there to where the path will be at a later time, from the same distances
   as the law's, see `drake_rnn.features.planning`. The path goes on meanwhile. Of the times at
   which some posture on the path is free, and stays so for a while, the earliest is taken for which
   the arm comes in time; one that is free until the path rests comes before others. Where the path
   rests, of several ways the quickest is taken; and if none leads to a free posture there, one to
   where the arm is nearer to it, if there is any;
3. the arm follows the plan. The law goes on to choose every velocity: what it is led by takes the
   place of its task, and rows, bounds and certificate are the same. At the end it waits for the
   path;
4. the law follows its path again.

If no motion is found, the law goes on, and another one is sought after a time ``retry``, which
doubles from one search in vain to the next. Behind a detour the law prefers the posture in which it
has met its path, as it would that of the start.

Arms beside each other come to rest together, and their motions are planned as one.

All is in numbers of a state, so that a run can be stopped and go on; what follows from waypoints is
computed again. A search is bounded by its steps, not by time, and draws from the seed of the
document: it is repeated bit for bit.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from pydrake.geometry import Rgba, Sphere
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, DiagramBuilder, DiscreteValues, OutputPort

from .. import colours
from ..errors import InvalidInputError
from ..inputs.fields import (
    Array,
    Length,
    Positive,
    checked,
    choice,
    instance,
    number,
    validated,
    whole,
)
from ..inputs.keys import Meaning
from ..inputs.messages import plural
from ..inputs.packages import import_extra
from ..laws import Avoidance, Law
from ..laws.law import Layout
from ..measures import Metric, RunMetrics
from ..measures.metric import Last, Values
from ..paths import PlacedPath
from ..robot.arm import Arm
from ..robot.clearance import Clearance
from ..robot.load_arm import screws_of
from ..robot.postures import LEVER, random_postures
from ..robot.rotation import rotation_error
from ..robot.screws import PairScrews, Screws
from ..robot.task import named_task
from ..signals import DelayedPath
from ..systems.block import Block
from ..systems.controllers import Controller
from ..systems.sources import PathSource
from .feature import (
    SECOND_PREFIX,
    EvaluationSteps,
    Feature,
    Frames,
    LegendEntry,
    LoopPart,
    Ports,
    SceneItem,
    Span,
    Stage,
)
from .planning import (
    Bounds,
    FreeSpace,
    Stops,
    round_corners,
    search,
    shorten,
    time_curve,
)


@validated
class DetourSettings:
    """When an arm counts as stuck on its path, and how a way round is sought."""

    off: Annotated[
        Length,
        Meaning("How far off its path an arm may be stuck.", unit="m"),
    ] = 0.01
    after: Annotated[
        Positive,
        Meaning("Time after which an arm that comes no nearer to its path is stuck.", unit="s"),
    ] = 0.3
    horizon: Annotated[
        Positive,
        Meaning("How far ahead a free point of the path is looked for.", unit="s"),
    ] = 6.0
    retry: Annotated[
        Positive,
        Meaning(
            "Time after which another way is sought where none was found, and twice as long each "
            "time after that.",
            unit="s",
        ),
    ] = 1.0
    margin: Annotated[
        Length,
        Meaning(
            "How much farther than ``avoidance.distance`` the way stays away from everything.",
            unit="m",
        ),
    ] = 0.005
    steps: Annotated[
        int,
        Field(strict=True, gt=0),
        Meaning("Steps of the search after which it ends in vain."),
    ] = 2000

    @property
    def seconds(self) -> float:
        """Time after which a search ends, none, so that it is repeated [s]."""
        return np.inf


class DetourArm(NamedTuple):
    """An arm that may make a detour.

    Attributes:
        arm: The arm, with its limits.
        path: The path that it follows.
        home: Posture that its joints prefer, shape (n,) [rad].
        task: Its task.
    """

    arm: Arm
    path: PlacedPath | DelayedPath
    home: Array
    task: str = "xyz"


@dataclass(frozen=True, eq=False)
class BothClear:
    """The distances of two arms beside each other, of postures of both.

    Attributes:
        first: What the first arm is to stay clear of; its postures are followed by the other's.
        second: What the second arm is to stay clear of, likewise.
        n: Number of joints of the first arm.
    """

    first: Clearance
    second: Clearance
    n: int

    def gaps(self, q: Array) -> Array:
        """Return the distance of each pair, shape (..., p) [m]."""
        n = self.n
        other = np.concatenate((q[..., n:], q[..., :n]), axis=-1)
        return np.concatenate((self.first.gaps(q), self.second.gaps(other)), axis=-1)

    def alone(self, q: Array) -> tuple[Array, Array]:
        """Return the least distance of each arm from itself and obstacles, shape (k,) each [m]."""
        n = self.n
        other = np.concatenate((q[:, n:], q[:, :n]), axis=1)
        least = []
        for clearance, posture in ((self.first, q), (self.second, other)):
            assert clearance.alone is not None
            is_own = np.ones(clearance.count, dtype=bool)
            is_own[: len(clearance.own)] = (clearance.own < clearance.alone).all(axis=1)
            least.append(clearance.gaps(posture)[:, is_own].min(axis=1))
        return least[0], least[1]

    @cached_property
    def reaches(self) -> Array:
        """See `Clearance.reaches`, shape (p, n)."""
        second = self.second.reaches
        n = second.shape[1] - self.n
        return np.concatenate((self.first.reaches, np.roll(second, -n, axis=1)))


# What the arm does: it follows its path, comes to rest, or goes round.
FOLLOWS, STOPS, LED = 0.0, 1.0, 2.0
#: What is recorded of detours: what the arm does; how many it has made; how often it has sought one
#: in vain, and how often of these since no point of the path is free; for how long it has been led,
#: in all; for how long it has been stuck, 0 where it is back on its path [s]; and the length of the
#: last plan, as the sum of the joints' ways [rad].
STATUS = ("mode", "detours", "in_vain", "blocked", "led", "stuck", "length")
# What is remembered besides: when it has begun to do that, when it will meet its path [s], the
# number of waypoints, when it was stuck first [s], negative if it is not, and how often in a row a
# detour was sought in vain since the last one, or since it was back.
_NUMBERS = ("begun", "until", "count", "first", "row")
# Most waypoints that are kept.
_MOST = 40
# Time between two points of the path that are looked at [s]; what an arm has come nearer by, as a
# share, that is not stuck; how far it may go between two looks where it rests [rad], and the time
# for which that is awaited [s].
_STEP, _NEARER, _AT_REST, _PATIENCE = 0.1, 0.9, 1e-9, 3.0
# Searches for one detour, goals of each, and time that no motion is shorter than [s]; by what share
# another way must be able to be quicker to be sought.
_ROUNDS, _GOALS, _RAMP, _QUICKER = 6, 24, 0.1, 0.8
# Time off its path that an arm is taken to need where a track ends, and for which a track is taken
# to stay free that is so where its path rests [s].
_AGAIN, _FOR_GOOD = 1.0, 1e3
# Random postures that tracks begin with, steps of Newton's method at first and then, its damping
# [m^2], and what a posture may miss the path by [m].
_POOL, _DESCENT, _STEPS, _DAMPING, _MISS = 200, 60, 4, 1e-6, 1e-4
# Postures beside a path that are looked at at a time, how often, those that are kept of them, by
# what share they are then nearer to each other, what a goal may be farther off than the nearest,
# and how far joints are turned aside at first [rad].
_BESIDE, _LOOKS, _KEPT, _CLOSER, _AS_NEAR, _TURNED = 600, 10, 60, 0.65, 1.2, 0.3
# Pairs of postures of two arms that are looked at: once, and all along.
_TRIED, _COMBINATIONS = 3000, 200


@dataclass(frozen=True, eq=False)
class Detours:
    """The detours of an arm, or of arms beside each other.

    Attributes:
        arms: The arms.
        clearance: What they are to stay clear of, of postures of all.
        settings: See `DetourSettings`.
        avoidance: How near the laws let them come.
        period: Period of the laws [s].
        seed: Seed of all random numbers.
    """

    arms: Sequence[DetourArm]
    clearance: Clearance | BothClear
    settings: DetourSettings
    avoidance: Avoidance
    period: float
    seed: int = 0
    _memo: dict[bytes, Array] = field(default_factory=dict)

    @cached_property
    def n(self) -> int:
        """Number of all joints."""
        return sum(each.arm.n for each in self.arms)

    @cached_property
    def layout(self) -> Layout:
        """Parts of the state."""
        k = len(self.arms)
        numbers = dict.fromkeys((*STATUS, *_NUMBERS), (1,))
        return Layout(
            **numbers,
            best=(k,),
            since=(k,),
            seen=(self.n,),
            home=(self.n,),
            waypoints=(_MOST, self.n),
        )

    @cached_property
    def every(self) -> int:
        """Samples between two looks at the arm."""
        return max(1, round(0.01 / self.period))

    @cached_property
    def _kinematics(self) -> list[Any]:
        return [each.arm.kinematics() for each in self.arms]

    @cached_property
    def screws(self) -> list[Screws | PairScrews]:
        """Kinematics of the arms, for many postures at once."""
        return [screws_of(each.arm) for each in self.arms]

    @cached_property
    def parts(self) -> list[slice]:
        """Joints of each arm."""
        ends = np.cumsum([0, *(each.arm.n for each in self.arms)]).tolist()
        return [slice(a, b) for a, b in pairwise(ends)]

    @cached_property
    def bounds(self) -> Bounds:
        """What a plan keeps."""
        each = [Bounds.of(led.arm.limits, self.period) for led in self.arms]
        velocity, acceleration, jerk = (
            np.concatenate([vars(bounds)[name] for bounds in each])
            for name in ("velocity", "acceleration", "jerk")
        )
        return Bounds(velocity, acceleration, jerk, self.period)

    @cached_property
    def _resting(self) -> tuple[Array, Array]:
        ends = [led.arm.limits.resting for led in self.arms]
        return np.concatenate([e[0] for e in ends]), np.concatenate([e[1] for e in ends])

    def start(self, q: Array) -> Array:
        """Return the state of an arm that begins to follow its path."""
        k, zero = len(self.arms), np.zeros(1)
        return self.layout.from_parts(
            {
                **dict.fromkeys((*STATUS, *_NUMBERS), zero),
                "first": np.full(1, -1.0),
                "best": np.full(k, np.inf),
                "since": np.zeros(k),
                "seen": q,
                "home": np.concatenate([each.home for each in self.arms]),
                "waypoints": np.zeros((_MOST, self.n)),
            }
        )

    def errors(self, t: float, q: Array) -> Array:
        """Return how far each arm is off its path, shape (k,) [m]."""
        off = []
        for led, kinematics, part in zip(self.arms, self._kinematics, self.parts, strict=True):
            axes = list(named_task(led.task).axes)
            away = led.path.position(t)[0] - kinematics.p_WE(q[part])
            off.append(float(np.linalg.norm(away[axes])))
        return np.array(off)

    @property
    def near(self) -> float:
        """How far postures are to be apart where a path is met [m]."""
        return self.avoidance.distance + 0.5 * self.settings.margin

    def reached(
        self, postures: Array, t: float, steps: int, aside: Array
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Return postures beside the paths at a time, shape (k, n), and whether they are there.

        Args:
            postures: Those that Newton's method begins with, shape (k, n) [rad].
            t: The time [s].
            steps: Its steps.
            aside: How far beside its path each arm is to be, shape (k, arms, 3) [m].
        """
        ways, there = [], np.ones(len(postures), dtype=bool)
        for k, (led, part) in enumerate(zip(self.arms, self.parts, strict=True)):
            way, is_there = _reached(led, self.screws[k], postures[:, part], t, steps, aside[:, k])
            ways.append(way)
            there &= is_there & _is_within(led, way)
        return np.concatenate(ways, axis=1), there

    def velocity(self, x: Array, t: float, q: Array) -> Array:
        """Return what leads the arm in the place of its task, shape (n,) [rad/s]; NaN if nothing.

        Args:
            x: The state.
            t: Time [s].
            q: Joint positions that are commanded, shape (n,) [rad].
        """
        mode = x[0]
        if mode == FOLLOWS:
            return np.full(self.n, np.nan)
        if mode == STOPS:
            return np.zeros(self.n)
        position, h, ahead = self._motion(x), self.period, self.bounds.lookahead
        k = min(max(round((t - self.layout.part(x, "begun")[0]) / h), 0), len(position) - 1)
        after = position[min(k + 1, len(position) - 1)]
        target = position[k] + ahead / h * (after - position[k])
        return (target - q) / ahead

    def step(self, x: Array, t: float, q: Array) -> Array:
        """Return the state after a look at the arm; arguments are those of `velocity`."""
        parts = {name: np.array(value) for name, value in self.layout.by_name(x).items()}
        parts["seen"], mode = q, x[0]
        settings, lapse = self.settings, self.every * self.period
        if mode == FOLLOWS:
            off = self.errors(t, q)
            is_back = off < settings.off
            nearer = is_back | (off < _NEARER * parts["best"])
            best = np.where(is_back, np.inf, off)
            parts["best"] = np.where(nearer, best, parts["best"])
            parts["since"] = np.where(nearer, np.maximum(t, parts["since"]), parts["since"])
            if is_back.all():
                parts |= {"first": np.full(1, -1.0), "row": np.zeros(1)}
            if (t - parts["since"] >= settings.after - 1e-9).any():
                parts |= {"mode": np.full(1, STOPS), "begun": np.full(1, t)}
                if parts["first"][0] < 0.0:
                    parts["first"] = np.full(1, t)
        else:
            parts["led"] = parts["led"] + lapse
            is_at_rest = np.abs(q - self.layout.part(x, "seen")).max() < _AT_REST
            if mode == STOPS and (is_at_rest or t - parts["begun"][0] > _PATIENCE):
                parts |= self._sought(parts, t, q)
            elif mode == LED and t >= parts["until"][0] - 0.5 * self.period:
                parts |= self._following(t)
                parts["home"] = parts["waypoints"][int(parts["count"][0]) - 1]
        first = parts["first"]
        parts["stuck"] = np.where(first < 0.0, 0.0, t - first + settings.after)
        return self.layout.from_parts(parts)

    def status(self, x: Array) -> Array:
        """Return what is recorded of a state, see `STATUS`."""
        return x[: len(STATUS)]

    def _following(self, t: float) -> dict[str, Array]:
        k = len(self.arms)
        return {"mode": np.full(1, FOLLOWS), "best": np.full(k, np.inf), "since": np.full(k, t)}

    def _sought(self, parts: dict[str, Array], t: float, q: Array) -> dict[str, Array]:
        """Return the parts of the state that change where an arm rests and looks for a way."""
        found = self._plan(t, q, int(parts["detours"][0] + parts["in_vain"][0]))
        if isinstance(found, bool):
            # Each time twice as long.
            pause = self.settings.retry * 2.0 ** float(parts["row"][0])
            later = np.full(len(self.arms), t + pause - self.settings.after)
            names = ("row", "in_vain", "blocked")[: 2 + found]
            counts = {name: parts[name] + 1.0 for name in names}
            return {**self._following(t), "since": later, **counts}
        waypoints, until = found
        whole = np.zeros((_MOST, self.n))
        whole[: len(waypoints)] = waypoints
        return {
            "mode": np.full(1, LED),
            "begun": np.full(1, t + self.period * self.every),
            "until": np.full(1, until),
            "detours": parts["detours"] + 1.0,
            "row": np.zeros(1),
            "length": np.full(1, np.abs(np.diff(waypoints, axis=0)).sum()),
            "count": np.full(1, float(len(waypoints))),
            "waypoints": whole,
        }

    def _motion(self, x: Array) -> Array:
        """Return the positions of the plan in a state at samples, shape (s, n) [rad]."""
        count = int(self.layout.part(x, "count")[0])
        return self.timed(self.layout.part(x, "waypoints")[:count])

    def timed(self, waypoints: Array) -> Array:
        """Return the motion along waypoints, a pure function of them, shape (s, n) [rad]."""
        key = waypoints.tobytes()
        if key not in self._memo:
            free, avoidance = self._free(waypoints[[0, -1]]), self.avoidance
            least = np.minimum(0.5 * (avoidance.floor + avoidance.distance), free.least)
            stops = Stops(
                self.clearance, least, avoidance.distance, avoidance.approach, self.bounds
            )
            position, _ = time_curve(round_corners(free, waypoints), self.bounds, stops)
            position[-1] = waypoints[-1]
            self._memo.clear()
            self._memo[key] = position
        return self._memo[key]

    def _free(self, ends: Array) -> FreeSpace:
        near = self.avoidance.distance + self.settings.margin
        return FreeSpace.between(self.clearance, ends, near, self.avoidance.floor)

    def _plan(self, t: float, q: Array, call: int) -> tuple[Array, float] | bool:
        """Return waypoints, and the time at which the path is met at the last one.

        If there are none, return whether no point of the path is free.
        """
        seed = self.seed + 1000 * call
        meetings = Meetings.of(self, t, q, seed)
        found = self._way_to_meeting(meetings, t, q, seed)
        if found is None and meetings.rests(t):
            found = self._way_nearer(meetings, t, q, seed)
        return not meetings.lasts.any() if found is None else found

    def _way_to_meeting(
        self, meetings: Meetings, t: float, q: Array, seed: int
    ) -> tuple[Array, float] | None:
        """Return waypoints to a meeting, and its time; None if there are none."""
        quick = self.least_time(q, meetings.postures)
        in_time = quick <= (meetings.times - t)[:, None]
        # The share of time that it is on its path, if it is stuck again where the track ends.
        lasts = np.where(in_time, meetings.seconds, 0.0)
        shares = lasts / (meetings.times[:, None] - t + lasts + _AGAIN)
        tried = np.zeros(len(lasts), dtype=bool)
        for _ in range(_ROUNDS):
            best = np.where(tried, 0.0, shares.max(axis=1))
            k = int(best.argmax())
            if not best[k]:
                break
            until = float(meetings.times[k])
            good = np.flatnonzero(shares[k] >= 0.8 * best[k])
            goals = meetings.postures[k, good[np.argsort(quick[k, good])][:_GOALS]]
            path = self._way(q, goals, seed)
            if path is None:
                tried[max(0, k - 3) : k + 4] = True
                continue
            takes = self.takes(path)
            if t + takes <= until + 1e-9:
                return path, until
            if meetings.rests(until):
                path = self._quickest(q, path, meetings.postures[k, meetings.lasts[k] > 0], seed)
                return path, t + self.takes(path)
            tried[: int(np.searchsorted(meetings.times, t + takes))] = True
        return None

    def _way_nearer(
        self, meetings: Meetings, t: float, q: Array, seed: int
    ) -> tuple[Array, float] | None:
        """Return waypoints to where the arms are nearer to their paths, which rest, and the time.

        None if there are none, or nothing is much nearer.
        """
        now = float(self.errors(t, q).max())
        goals, off = meetings.beside(self, q, now, seed)
        if off.min(initial=np.inf) > min(_QUICKER * now, now - self.settings.off):
            return None
        # On its path is as good as any other place there.
        good = off <= max(_AS_NEAR * off.min(), min(self.settings.off, _QUICKER * now))
        goals = goals[good]
        goals = goals[np.argsort(self.least_time(q, goals), kind="stable")]
        path = self._way(q, goals[:_GOALS], seed)
        if path is None:
            return None
        path = self._quickest(q, path, goals, seed)
        takes = self.takes(path)
        return (path, t + takes) if takes <= self.settings.horizon else None

    def least_time(self, q: Array, postures: Array) -> Array:
        """Return the time that no motion from a posture to others, shape (..., n), is below [s]."""
        return (np.abs(postures - q) / self.bounds.velocity).max(axis=-1) + _RAMP

    def takes(self, path: Array) -> float:
        """Return how long it takes to go along waypoints [s]."""
        return self.period * (len(self.timed(path)) + self.every)

    def _quickest(self, q: Array, path: Array, goals: Array, seed: int) -> Array:
        """Return the waypoints of the quickest of some ways to goals, one of which is known."""
        quick, takes = self.least_time(q, goals), self.takes(path)
        order = np.argsort(quick, kind="stable")[:_GOALS]
        goals, quick = goals[order], quick[order]
        for k in range(1, _ROUNDS):
            near = goals[quick < _QUICKER * takes]
            if not near.size:
                break
            other = self._way(q, near, seed + k, straight=k == 1)
            if other is not None and self.takes(other) < takes:
                path, takes = other, self.takes(other)
        return path

    def _way(self, q: Array, goals: Array, seed: int, straight: bool = True) -> Array | None:
        """Return waypoints from a posture to one of others; None if none were found.

        Args:
            q: The posture, shape (n,) [rad].
            goals: The others, shape (k, n) [rad].
            seed: Seed of the search.
            straight: Whether a straight way will do.
        """
        ends = np.concatenate((q[None], goals))
        free = self._free(ends)
        if straight:
            path = next((np.array([q, goal]) for goal in goals if free.way(q, goal)), None)
            if path is not None:
                return path
        try:
            path, _ = search(free, ends, self._resting, self.settings, seed)
            path = shorten(free, path, seed)
            # There may be no curve round its corners.
            self.timed(path)
        except InvalidInputError:
            return None
        return path if len(path) <= _MOST else None


@dataclass(frozen=True, eq=False)
class Meetings:
    """Where and when paths can be met.

    Attributes:
        arms: The arms.
        times: Times that are looked at, shape (k,) [s].
        postures: Postures on the path then, those of one track one below the other, shape
            (k, tracks, n) [rad].
        lasts: For how many times from then on a track stays free, shape (k, tracks).
    """

    arms: Sequence[DetourArm]
    times: Array
    postures: Array
    lasts: Array

    @property
    def seconds(self) -> Array:
        """For how long from each time on a track stays free, shape (k, tracks) [s].

        One that is free until all paths rest is so for good: what ends before then is followed by
        another detour, and another time off the path.
        """
        count = len(self.times)
        until_the_end = self.lasts + np.arange(count)[:, None] >= count
        is_for_good = until_the_end & (self.lasts > 0) & self.rests(float(self.times[-1]))
        return np.where(is_for_good, _FOR_GOOD, _STEP * self.lasts)

    def beside(self, detours: Detours, q: Array, most: float, seed: int) -> tuple[Array, Array]:
        """Return free postures beside the paths where they end, and how far off each is.

        They are drawn about the postures on the paths, farther off at first.

        Args:
            detours: The arms.
            q: Where the arms rest, shape (n,) [rad].
            most: How far off they may be [m].
            seed: Seed of these.

        Returns:
            Postures, the nearest first, and of those that count as on the path the ones that are
            reached soonest, shape (k, n) [rad]; and the largest distance of an arm from its path in
            each, shape (k,) [m].
        """
        rng, t, size = np.random.default_rng(seed), float(self.times[-1]), most
        gaps = detours.clearance.gaps(self.postures[-1]).min(axis=1)
        pool = self.postures[-1][np.argsort(-gaps, kind="stable")[:_KEPT]]
        aside = np.zeros((len(pool), len(self.arms), 3))
        found, off = pool[:0], np.zeros(0)
        for _ in range(_LOOKS):
            picks = rng.integers(len(pool), size=_BESIDE)
            step = rng.normal(size=(_BESIDE, len(self.arms), 3))
            step /= np.linalg.norm(step, axis=-1, keepdims=True)
            step *= rng.uniform(size=(_BESIDE, len(self.arms), 1))
            trial = aside[picks] + size * step
            turned = pool[picks] + _TURNED * size / most * rng.normal(size=(_BESIDE, detours.n))
            postures, there = detours.reached(turned, t, 2 * _STEPS, trial)
            away = np.linalg.norm(trial, axis=-1).max(axis=1)
            some = np.flatnonzero(there & (away < most))
            some = some[detours.clearance.gaps(postures[some]).min(axis=1) >= detours.near]
            if not some.size:
                continue
            # Those found before, and these.
            found, off = np.concatenate((found, postures[some])), np.concatenate((off, away[some]))
            aside = np.concatenate((aside[: len(found) - len(some)], trial[some]))
            ranks = detours.least_time(q, found), np.maximum(off, detours.settings.off)
            best = np.lexsort(ranks)[:_KEPT]
            found, off, aside = found[best], off[best], aside[best]
            pool, size = found, _CLOSER * size
        return found, off

    @classmethod
    def of(cls, detours: Detours, t: float, q: Array, seed: int) -> Meetings:
        """Return where and when the paths of arms can be met.

        Args:
            detours: The arms.
            t: The time [s].
            q: Where they rest, shape (n,) [rad].
            seed: Seed of postures.
        """
        count = round(detours.settings.horizon / _STEP)
        times: Array = t + _STEP * np.arange(1.0, count + 1.0)
        ways, flags = [], []
        for k, (led, part) in enumerate(zip(detours.arms, detours.parts, strict=True)):
            way, is_there = _tracks(led, detours.screws[k], q[part], times, seed + k)
            ways.append(way)
            flags.append(is_there)
        if isinstance(detours.clearance, BothClear):
            picks = _combined(detours.clearance, [way[-1] for way in ways], flags, seed)
            ways = [way[:, pick] for way, pick in zip(ways, picks, strict=True)]
            flags = [flag[:, pick] for flag, pick in zip(flags, picks, strict=True)]
        postures, free = np.concatenate(ways, axis=-1), np.logical_and.reduce(flags)
        for k, each in enumerate(postures):
            some = np.flatnonzero(free[k])
            if some.size:
                free[k, some] = detours.clearance.gaps(each[some]).min(axis=1) >= detours.near
        lasts = np.zeros(free.shape, dtype=int)
        for k in range(count - 1, -1, -1):
            after = lasts[k + 1] if k + 1 < count else 0
            lasts[k] = np.where(free[k], after + 1, 0)
        return cls(detours.arms, times, postures, lasts)

    def rests(self, t: float) -> bool:
        """Return whether all paths rest from a time on."""
        for led in self.arms:
            ways = [led.path.position(t + s)[0] for s in (0.0, 0.1, 1.0, 5.0)]
            if np.abs(np.array(ways) - ways[0]).max() > 1e-9:
                return False
        return True


def _combined(
    clearance: BothClear, postures: Sequence[Array], flags: Sequence[NDArray[np.bool_]], seed: int
) -> tuple[NDArray[np.intp], ...]:
    """Return which tracks of two arms are looked at together, shape (tracks,) each.

    They are those of which each arm is free of itself and of obstacles in the end, and both of each
    other, as far as there are enough.

    Args:
        clearance: The distances of both.
        postures: Postures of each arm in the end, shape (tracks, n).
        flags: Whether these are on the path, shape (k, tracks).
        seed: Seed of the choice.
    """
    rng = np.random.default_rng(seed)
    alone = clearance.alone(np.concatenate(list(postures), axis=1))
    own = [np.flatnonzero(flag[-1] & (gap > 0.0)) for flag, gap in zip(flags, alone, strict=True)]
    if not all(map(len, own)):
        own = [np.arange(flag.shape[1]) for flag in flags]
    picks = [rng.choice(each, _TRIED) for each in own]
    whole = [each[pick] for each, pick in zip(postures, picks, strict=True)]
    gaps = clearance.gaps(np.concatenate(whole, axis=1)).min(axis=1)
    best = np.argsort(-gaps, kind="stable")[:_COMBINATIONS]
    return tuple(pick[best] for pick in picks)


def _tracks(
    led: DetourArm, screws: Screws | PairScrews, q: Array, times: Array, seed: int
) -> tuple[Array, NDArray[np.bool_]]:
    """Return postures on a path at times, shape (k, tracks, n), and whether they are there."""
    way = np.concatenate((q[None], led.home[None], random_postures(led.arm, _POOL, seed)))
    ways, flags = [], []
    for k, t in enumerate(times.tolist()):
        way, is_there = _reached(led, screws, way, t, _DESCENT if k == 0 else _STEPS, np.zeros(3))
        way = np.array([led.arm.limits.nearest_turn(each, q, led.arm.endless) for each in way])
        ways.append(way)
        flags.append(is_there & _is_within(led, way))
    return np.array(ways), np.array(flags)


def _reached(
    led: DetourArm, screws: Screws | PairScrews, way: Array, t: float, steps: int, aside: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Return postures of an arm beside its path at a time, and whether they are there.

    Arguments are those of `Detours.reached`, of one arm.
    """
    task = named_task(led.task)
    axes, target = list(task.axes), led.path.position(t)[0] + aside
    R = led.path.orientation(t)[0] if task.with_orientation else None
    for _ in range(steps):
        moved = screws.at(way)
        error, J = (target - moved.p_WE)[:, axes], moved.J[:, axes]
        if R is not None:
            error = np.concatenate((LEVER * rotation_error(moved.R_WE, R), error), axis=-1)
            J = np.concatenate((LEVER * moved.J_omega, J), axis=1)
        system = J @ np.swapaxes(J, 1, 2) + _DAMPING * np.eye(J.shape[1])
        dual = np.linalg.solve(system, error[..., None])[..., 0]
        step = np.einsum("kmn,km->kn", J, dual)
        longest = np.abs(step).max(axis=1, keepdims=True)
        way = way + step * np.minimum(1.0, 0.2 / np.maximum(longest, 1e-12))
    return way, np.linalg.norm(error, axis=1) < _MISS


def _is_within(led: DetourArm, way: Array) -> NDArray[np.bool_]:
    """Return which postures an arm can rest in, shape (k,)."""
    lower, upper = led.arm.limits.resting
    return np.asarray((way >= lower).all(axis=1) & (way <= upper).all(axis=1))


def _arm_of(experiment: Any) -> DetourArm:
    """Return the arm of an experiment, as its law goes on."""
    secondary = experiment.law.secondary
    home = experiment.law.home if secondary.target is None else secondary.target
    path, task = experiment.desired, experiment.document.task
    return DetourArm(experiment.arm, path, np.asarray(home), task)


def detours_of(experiment: Any) -> Detours | None:
    """Return the detours of an experiment's arms; None if they make none.

    Args:
        experiment: A `drake_rnn.Experiment`.
    """
    document, second = experiment.document, experiment.second
    if document.detour is None or experiment.clearance is None:
        return None
    clearance = experiment.clearance
    if second is not None:
        clearance = BothClear(clearance, second.clearance, experiment.arm.n)
    arms = [_arm_of(each) for each in (experiment, second) if each is not None]
    return Detours(
        arms,
        clearance,
        document.detour,
        experiment.law.avoidance,
        document.period,
        document.seed,
    )


class DetourBlock(Block, LoopPart):
    """What leads arms round what they are stuck before, as a Drake system.

    Its inputs are the joint positions that are commanded, ``position`` and, of an arm beside it,
    ``second_position``; its outputs ``detour`` and ``second_detour`` go to the inputs ``detour`` of
    the laws, and ``status`` has what is recorded, see `STATUS`.

    Args:
        detours: The detours.
        starts: Where the arms start, shape (n,) each [rad].
    """

    role = "reference"

    def __init__(self, detours: Detours, starts: Sequence[Array]) -> None:
        super().__init__()
        self._period = detours.period
        sizes = [each.arm.n for each in detours.arms]
        prefixes = ("", SECOND_PREFIX)[: len(sizes)]
        ports = [
            self.DeclareVectorInputPort(f"{prefix}position", n)
            for prefix, n in zip(prefixes, sizes, strict=True)
        ]
        begin = detours.start(np.concatenate(list(starts)))
        state = self.DeclareDiscreteState(begin)
        every = detours.every * detours.period

        def joints(context: Context) -> Array:
            return np.concatenate([port.Eval(context) for port in ports])

        def update(context: Context, values: DiscreteValues) -> None:
            x = context.get_discrete_state(state).value()
            values.set_value(0, detours.step(x, context.get_time(), joints(context)))

        for prefix, part, n in zip(prefixes, detours.parts, sizes, strict=True):

            def calc(context: Context, output: Any, part: slice = part) -> None:
                x = context.get_discrete_state(state).value()
                if x[0] == FOLLOWS:
                    output.set_value(np.full(part.stop - part.start, np.nan))
                    return
                output.set_value(detours.velocity(x, context.get_time(), joints(context))[part])

            tickets = {self.xd_ticket(), self.time_ticket(), *(port.ticket() for port in ports)}

            def home(context: Context, output: Any, part: slice = part) -> None:
                x = context.get_discrete_state(state).value()
                output.set_value(detours.layout.part(x, "home")[part])

            self.DeclareVectorOutputPort(f"{prefix}detour", n, calc, tickets)
            self.DeclareVectorOutputPort(f"{prefix}posture", n, home, {self.xd_ticket()})

        def status(context: Context, output: Any) -> None:
            output.set_value(detours.status(context.get_discrete_state(state).value()))

        self.DeclareVectorOutputPort("status", len(STATUS), status, {self.xd_ticket()})
        self.DeclarePeriodicDiscreteUpdateEvent(every, 0.0, update)

    def check(self, controller: Controller) -> None:
        """See `LoopPart.check`: a velocity that brings the arm to rest is for one period."""
        if controller.period != self._period:
            raise InvalidInputError(
                f"signals.detour: is for a period of {self._period:g} s, not the controller's, "
                f"{controller.period} s; give both the same"
            )

    @property
    def ways(self) -> tuple[Ports, ...]:
        """What the law of each arm sees, by name."""
        prefixes = ("", SECOND_PREFIX)[: self.num_input_ports()]
        names = ("detour", "posture")
        return tuple({n: self.GetOutputPort(f"{prefix}{n}") for n in names} for prefix in prefixes)

    def watch(self, builder: DiagramBuilder, positions: Sequence[OutputPort]) -> None:
        """Connect the joint positions that are commanded to each arm."""
        for k, port in enumerate(positions):
            builder.Connect(port, self.get_input_port(k))


@checked(
    arm=instance(Arm),
    law=instance(Law),
    path=instance(PathSource),
    period=number(above=0.0),
    settings=instance(DetourSettings, None),
    task=choice(("xyz", "pose")),
    seed=whole(0),
)
class DetourSource(DetourBlock):
    """What leads an arm round what it is stuck before, in a diagram of one's own.

    Its input ``position`` is the joint position that is commanded, shape (n,) [rad]. Its outputs
    ``detour``, shape (n,) [rad/s], NaN while nothing leads the arm, and ``posture``, shape (n,)
    [rad], are the inputs of that name of an `Adaptive` with ``detours``. ``status``, shape (7,), is
    what a run records: 0 while the arm follows its path, 1 while it comes to rest, 2 while it is
    led; the number of detours; of searches in vain; of those without a free point of the path; the
    time led and the time stuck [s]; the length of the last plan [rad].

    Args:
        arm: The arm.
        law: The law that follows the path, with ``detours``, ``clearance`` and bounds on the
            acceleration.
        path: The source of its path.
        period: Period of the law [s].
        settings: When the arm counts as stuck, and how a way is sought; see the section ``detour``
            of a document.
        task: What the law follows: ``xyz`` or ``pose``.
        seed: Seed of all random numbers.

    Raises:
        InvalidInputError: If the law makes no detours, has nothing to avoid, or is of another arm.
    """

    def __init__(
        self,
        arm: Arm,
        law: Law,
        path: PathSource,
        period: float,
        settings: DetourSettings | None = None,
        *,
        task: str = "xyz",
        seed: int = 0,
    ) -> None:
        able = _with_detours(law, arm)
        home = able.home if able.secondary.target is None else able.secondary.target
        follows = DelayedPath(path.placed, path.delay)
        led = DetourArm(arm.with_limits(able.limits), follows, np.asarray(home), task)
        way = settings or DetourSettings()
        detours = Detours([led], able.clearance, way, able.avoidance, period, seed)
        super().__init__(detours, [able.home])


def _with_detours(law: Any, arm: Arm) -> Any:
    """Return a law that can be led round what it is stuck before."""
    if not (law.makes_detours and law.detours):
        raise InvalidInputError(
            f"law: {type(law).__name__} makes no detours; give Adaptive with detours=True"
        )
    if law.clearance is None or isinstance(law.avoidance, str):
        raise InvalidInputError(
            "law: has nothing to go round; give it clearance=, of arm_clearance"
        )
    if law.other is not None:
        raise InvalidInputError(
            "law: has another arm beside it, other; detours of two arms are planned as one, those "
            "of documents alone"
        )
    if law.limits.size != arm.n:
        raise InvalidInputError(
            f"law: is of {plural(law.limits.size, 'joint')}; {arm.name} has {arm.n}"
        )
    kinematics, X = arm.kinematics(), law.clearance.arm.poses.at(law.home)[-1]
    moved = X[:3, :3] @ kinematics.p_WE(np.zeros(arm.n)) + X[:3, 3]
    if not np.allclose(moved, kinematics.p_WE(law.home), rtol=0.0, atol=1e-6):
        raise InvalidInputError(f"law: its clearance is of another arm than {arm.name}")
    law.limits.require("acceleration", "a detour begins and ends at rest")
    return law


def add_detours(builder: DiagramBuilder, experiment: Any) -> DetourBlock | None:
    """Add and return what leads the arms of an experiment; None if nothing does.

    Args:
        builder: Diagram builder that it is added to.
        experiment: A `drake_rnn.Experiment`.
    """
    detours, second = detours_of(experiment), experiment.second
    if detours is None:
        return None
    starts = [experiment.start, *([] if second is None else [second.start])]
    return builder.AddNamedSystem(_SYSTEM, DetourBlock(detours, starts))


def recorded_detours(builder: DiagramBuilder) -> Ports:
    """Return what is recorded of detours in a diagram, by name."""
    if not builder.HasSubsystemNamed(_SYSTEM):
        return {}
    return {_SYSTEM: builder.GetSubsystemByName(_SYSTEM).GetOutputPort("status")}


_SYSTEM = "detours"


def _column(name: str) -> Values:
    """Return the values of a number of `STATUS` at the steps of a motion; None without it."""
    k = STATUS.index(name)
    return lambda motion, against: (
        motion.features[_SYSTEM][..., k] if _SYSTEM in motion.features else None
    )


# Radius of the ball where an arm is stuck [m].
_RADIUS = 0.015


def _away(mode: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the first samples of detours, and the first ones after them, shape (d,) each.

    Args:
        mode: What the arm does at each sample, shape (k,).
    """
    changes = np.diff((mode > FOLLOWS).astype(int), prepend=0, append=0)
    return np.flatnonzero(changes > 0), np.flatnonzero(changes < 0)


class DrawnDetours(SceneItem):
    """A ball where the tool was as each detour began, seen as long as it lasts.

    Args:
        stage: Where it is drawn.
        mode: What the arm does at each sample, shape (k,).
    """

    legend = (LegendEntry("locked", "stuck, on a detour", colour=colours.BOUND),)

    def __init__(self, stage: Stage, mode: Array) -> None:
        self._stage = stage
        self._begins, self._ends = _away(mode)

    def draw(self) -> list[str]:
        """Draw the balls."""
        series, meshcat = self._stage.motion.result.series, self._stage.meshcat
        kinematics = self._stage.experiment.arm.kinematics()
        for which, k in enumerate(self._begins):
            place, ball = f"/detours/{which}", Rgba(*colours.components(colours.BOUND))
            meshcat.SetObject(place, Sphere(_RADIUS), ball)
            meshcat.SetTransform(place, RigidTransform(kinematics.p_WE(series["position"][k])))
        return []

    def record(self, frames: Frames) -> None:
        """Record when they are seen."""
        time = self._stage.motion.result.time - self._stage.begin
        for which, (begin, end) in enumerate(zip(self._begins, self._ends, strict=True)):
            until = None if end == len(time) else float(time[end])
            frames.show(f"/detours/{which}", float(time[begin]), until)


class DetourFeature(Feature):
    """The section ``detour``."""

    key = "detour"
    metrics = (
        Metric("detours", "number of detours that were made", of=_column("detours")),
        Metric(
            "detours_in_vain",
            "how often no detour was found",
            of=_column("in_vain"),
        ),
        Metric(
            "detours_blocked",
            "how often of these no point of the path was free",
            of=_column("blocked"),
        ),
        Metric("detour_time_s", "time for which detours led the arm", of=_column("led")),
        Metric(
            "stuck_in_the_end_s",
            "time since which an arm that may make detours is stuck, or on a detour, where the run "
            "ends; 0 if it is back on its path",
            of=_column("stuck"),
            by=Last(),
        ),
    )

    def doubts(self, experiment: Any) -> list[str]:
        """Return no warning; an arm's acceleration must be known, by which a plan is timed."""
        if experiment.document.detour is not None:
            experiment.limits.require("acceleration", "a detour begins and ends at rest")
            import_extra("detour", "plan", "ompl.base")
        return []

    def observe(self, experiment: Any, run: EvaluationSteps) -> Mapping[str, Any]:
        """Return what was recorded of detours."""
        if _SYSTEM not in run.steps.layout:
            return {}
        return {_SYSTEM: run.steps.series(_SYSTEM)}

    def caveats(
        self, experiment: Any, metrics: Mapping[str, float], run: RunMetrics
    ) -> Iterable[str]:
        if count := int(metrics.get("detours_in_vain", 0.0)):
            blocked, settings = int(metrics["detours_blocked"]), experiment.document.detour
            reasons = {
                f"no point of the path was free within {settings.horizon:g} s, detour.horizon": (
                    blocked
                ),
                f"no way to one was found within {settings.steps} steps, detour.steps": (
                    count - blocked
                ),
            }
            why = ", and ".join(f"{plural(n, 'time')} {text}" for text, n in reasons.items() if n)
            yield f"detour: none was found {plural(count, 'time')}: {why}"
        if (since := metrics.get("stuck_in_the_end_s", 0.0)) > 0.0:
            yield f"detour: in the end the arm is not back on its path, since {since:.3g} s"

    def spans(self, series: Mapping[str, Array], time: Array) -> Iterable[Span]:
        """Return when the arm was stuck, and led round."""
        if (status := series.get(_SYSTEM)) is None:
            return
        for begin, end in zip(*_away(status[:, 0]), strict=True):
            yield Span(float(time[begin]), float(time[min(end, len(time) - 1)]), "on a detour")

    def items(self, stage: Stage) -> Iterable[SceneItem]:
        status = stage.motion.result.series.get(_SYSTEM)
        if status is not None and (status[:, 0] > FOLLOWS).any():
            yield DrawnDetours(stage, status[:, 0])

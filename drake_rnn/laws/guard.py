"""A guard between a source of joint targets and a robot, as a plain object without a diagram.

Joint targets of any source, followed within every bound and without collisions.

Targets come when they come: ten or fifty times a second, with gaps, jumps, or numbers that are
none. At each sample each joint wants the largest velocity from which, within all of its bounds, it
can still stop at the newest target: the target counts as a position limit. That is the fastest way
there, and no way beyond it. With an ``interval`` between targets it wants to be at the newest by
the end of it, and need not be able to stop there: smoother, and sooner, where targets come
regularly. Of the velocities that are safe, see `drake_rnn.laws.safety`, one near that is commanded.
A target that is not a number is not looked at; after ``timeout`` without one the joints come to
rest within their bounds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import ceil
from typing import Annotated, Any, Literal, NamedTuple, Self
from warnings import warn

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, StrictBool

from ..arrays.algebra import acts, clip, functions_of, is_one, select
from ..errors import InvalidInputError
from ..inputs.fields import (
    Array,
    NonNegative,
    Positive,
    Vector,
    is_vector,
    number,
    validated,
    with_own_errors,
)
from ..inputs.keys import Meaning, Only
from ..inputs.messages import is_number, replace_unchecked, require_type, short
from ..inputs.packages import moved_name
from ..robot.clearance import Clearance
from ..robot.clearance.capsules import Displacements, Solids
from ..robot.jerk_stop import braking
from ..robot.limits import OUTSIDE, JointLimits
from .call_checks import FLOAT, without_checks
from .guarantee import Assumption, guard_assumptions
from .guard_command import SAME, GuardCommand
from .law import Law, Layout, SampledReading, Signals, State
from .limit_change import LimitChange, require_rest_within
from .parts.bounded_velocity import bounding_limits, reached_limits
from .parts.safe_velocity import NO_STOP, Avoidance, Within, WithinClear, within_safe
from .safety import Safety, nearest


@validated
class JointStream(Law):
    """A law that follows joint targets within every bound up to the jerk, without collisions.

    Its inputs are ``position``, which it reads once, at the start, and ``target``, shape (n,)
    [rad], NaN where there is none.
    """

    limits: Annotated[
        JointLimits,
        Meaning(
            "Limits of the joints; acceleration and jerk are bounded if their limits are given.",
        ),
    ]
    home: Annotated[Vector, Meaning("Posture at the start, shape (n,).", unit="rad")]
    kind: Literal["joint_stream"] = "joint_stream"
    summary = "Joint targets of any source, followed within every bound and without collisions."
    interval: Annotated[
        NonNegative,
        Meaning(
            "Time between two targets [s], in which a new one is to be reached; 0 where they "
            "come irregularly, to reach each as soon as the bounds allow.",
            unit="s",
        ),
    ] = 0.0
    pursues: Annotated[
        StrictBool,
        Meaning(
            "Whether each target, new or repeated, is to be reached in an interval from now on: "
            "for a source that gives, at every sample, where its way will be then.",
        ),
    ] = False
    timeout: Annotated[
        Positive,
        Meaning(
            "Time without a target after which the joints come to rest, wherever they are; a "
            "source repeats a target until it is reached.",
            unit="s",
        ),
    ] = 0.2
    endless: Annotated[
        list[StrictBool] | None,
        Meaning(
            "Which joints turn without end, (n,): of targets that are whole turns apart the one "
            "nearest to the last target is followed. By default the joints without position "
            "limits.",
        ),
    ] = None
    clearance: Annotated[
        Clearance | None,
        Meaning("What the arm is to stay clear of; None for nothing."),
    ] = None
    avoidance: Annotated[
        Avoidance,
        Meaning("How near it may come.", only=(Only("obstacles"),)),
    ] = Field(default_factory=Avoidance)

    follows_joint_targets = True
    keeps_each_direction = True
    takes_many = True

    def __post_init__(self) -> None:
        self.limits.require_size("home", self.home)
        if self.endless is not None and len(self.endless) != self.limits.size:
            raise ValueError(
                f"endless: must have {self.limits.size} entries, not {len(self.endless)}"
            )
        if self.pursues and not self.interval:
            raise ValueError("pursues: needs an interval, in which each target is to be reached")
        if not self.timeout > self.interval:
            raise ValueError(
                f"timeout: must be longer than interval, {self.interval:g} s, not {self.timeout:g}"
            )
        self.safety.check_start(self.home)

    @cached_property
    def turning(self) -> NDArray[np.bool_]:
        """Which joints turn without end, shape (n,)."""
        if self.endless is not None:
            return np.array(self.endless, dtype=bool)
        free = np.isinf(self.limits.position_lower) & np.isinf(self.limits.position_upper)
        return np.asarray(free)

    @cached_property
    def safety(self) -> Safety:
        """What is kept of the velocities that it wants."""
        return Safety(self.limits, self.clearance, self.avoidance)

    @property
    def keeps(self) -> tuple[str, ...]:
        """See `Law.keeps`; all limits that are known, up to the jerk."""
        return self.safety.keeps

    @property
    def keeps_distance(self) -> float | None:
        """See `Law.keeps_distance`."""
        return self.safety.keeps_distance

    @cached_property
    def state(self) -> Layout:
        return Layout(v=(self.limits.size,))

    @cached_property
    def inputs(self) -> Layout:
        n = self.limits.size
        return Layout(position=(n,), target=(n,), **self.safety.inputs)

    def sampled(self, period: float) -> JointStreamReading:
        """Return a `JointStreamReading`."""
        return JointStreamReading(self, period, reached_limits(self.limits, period))


class Causes(NamedTuple):
    """What kept a step from the velocities that were wanted.

    Attributes:
        limits: What keeps each joint, shape (n,): 1 + the number of the limit in `BOUNDING` where
            it keeps the joint from a larger velocity, -1 - that where from a smaller one; else 0.
        pairs: Pairs of the clearance that are in the way, by number, shape (r,).
    """

    limits: NDArray[np.intp]
    pairs: NDArray[np.intp]


# What exceeds a bound by less, as a share of it and of 1 rad/s, does not count.
_LEAST_EXCESS = 1e-6


@dataclass(frozen=True, eq=False)
class JointStreamReading(SampledReading):
    """The law at a period.

    The state holds v; the positions ``commanded``; the ``goal``, the last target; the ``pace``
    at which it is reached in the time ``left``; the time ``since`` a target was there [s];
    ``missed``, how many samples had none; and what the choice of a velocity is made with.

    Attributes:
        law: The law.
        period: Its period [s].
        limits: Limits that can be reached, of which the boxes are made.
        tolerance: Time by which samples may come late while a certified stop still holds [s].
        has_compliance: Whether an input ``compliance``, shape (n,), says how readily each joint
            leaves the velocity that it wants where bodies come near each other: the square of its
            difference is divided by that of the number. 0 is not at all, as far as its limits
            allow; without the input all joints have 1.
    """

    law: JointStream
    period: float
    limits: JointLimits
    tolerance: float = 0.0
    has_compliance: bool = False

    inputs_with_gaps = ("target", "p_WO")
    takes_many = True

    @cached_property
    def _within(self) -> Within:
        clearance = self.law.clearance
        avoids = None if clearance is None else (clearance, self.law.avoidance)
        return within_safe(self.limits, 1.0, avoids, tolerance=self.tolerance)

    @cached_property
    def state(self) -> Layout:
        n = self.law.limits.size
        own = {"v": (n,), "commanded": (n,), "goal": (n,), "pace": (n,)}
        times = {"left": (1,), "since": (1,), "missed": (1,)}
        return Layout(**own, **times, **self._within.shapes)

    @cached_property
    def inputs(self) -> Layout:
        more = {"compliance": (self.law.limits.size,)} if self.has_compliance else {}
        return Layout(**self.law.inputs.shapes, **more) if more else self.law.inputs

    def initial_state(self, rng: np.random.Generator, u: Signals) -> Array:
        q, none = u["position"], np.zeros(1)
        times = {"left": none, "since": none, "missed": none}
        none_yet = np.zeros(q.size)
        own = {"v": none_yet, "commanded": q, "goal": q, "pace": none_yet, **times}
        return self.state.from_parts(own | self._within.init(u, rng))

    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        parts = self.state.by_name(x)
        q, (goal, seen) = parts["commanded"], self._goal(parts, u["target"], period)
        wanted = self._wanted(q, goal, {**parts, **seen}, period)
        v, within = self._within.step(parts, u, period, nearest(wanted))
        own = {"v": v, "commanded": q + period * v, "goal": goal, **seen, **within}
        return self.state.from_parts(own)

    def _goal(self, parts: State, target: Array, period: float) -> tuple[Array, State]:
        """Return the newest target, shape (..., n) [rad], and the other parts that tell of it.

        Args:
            parts: The parts of the state.
            target: What is given, of which entries may be NaN or infinite.
            period: Time until the next sample [s].
        """
        xp, law, goal, q = functions_of(target), self.law, parts["goal"], parts["commanded"]
        left, pace = xp.maximum(parts["left"] - period, 0.0), parts["pace"]
        since, misses = parts["since"] + period, parts["missed"]
        is_there: Any = _all(xp.isfinite(target))
        target = law.limits.nearest_turn(xp.where(is_there, target, goal), goal, law.turning)
        target = xp.where(is_there, target, goal)
        if acts(law.interval):
            interval = xp.where(law.interval > 0.0, law.interval, 1.0)
            is_new = is_there if law.pursues else ~_all(target == goal)
            is_new = is_new & (law.interval > 0.0)
            # At most the fastest, which the quotient may be far beyond.
            most = law.limits.sides("velocity").map(lambda speed: speed * law.interval)
            left = xp.where(is_new, law.interval, left)
            pace = xp.where(is_new, most.clip(target - q) / interval, pace)
        since, misses = xp.where(is_there, 0.0, since), misses + 1.0 * ~is_there
        return target, {"pace": pace, "left": left, "since": since, "missed": misses}

    def _wanted(self, q: Array, goal: Array, parts: State, period: float) -> Array:
        """Return the velocities that are wanted, shape (..., n) [rad/s].

        Args:
            q: Where the joints are, shape (..., n) [rad].
            goal: The newest target, likewise.
            parts: The parts of the state, of which `_goal` has made some anew.
            period: Time until the next sample [s].
        """
        # Times that are sums of periods are compared half a period off.
        is_over: Any = parts["since"] > self.law.timeout + 0.5 * period
        has_pace: Any = parts["left"] > 0.5 * period
        if is_one(q):
            is_over, has_pace = bool(is_over[0]), bool(has_pace[0])

        def towards() -> Array:
            lower, upper = self.limits.position_lower, self.limits.position_upper
            return self._towards(clip(goal, lower, upper), q, parts)

        return select(
            is_over, lambda: 0.0 * q, lambda: select(has_pace, lambda: parts["pace"], towards)
        )

    def resumed(self, x: Array, q: Array, v: Array, a: Array, elapsed: float | None = 0.0) -> Array:
        parts, motion = self.state.by_name(x), {"commanded": q, "v": v, "a": a}
        own = {"commanded": q, "v": v, **self._within.resumed(parts, motion, elapsed)}
        if elapsed is not None:
            own["left"] = np.maximum(parts["left"] - elapsed, 0.0)
            own["since"] = parts["since"] + elapsed
        return self.state.with_parts(x, **own)

    def causes(self, x: Array, u: Signals, v: Array, *, chosen: bool = False) -> Causes:
        """Return what kept the velocities of a step from those that were wanted, in NumPy.

        Args:
            x: State before the step, shape (state.size,).
            u: Signals that it saw.
            v: Velocities that it has chosen, shape (n,) [rad/s]; a compiled step too.
            chosen: Whether what leads it has chosen its velocities within the same limits: then
                those that are at an end of what these allow are kept from more.
        """
        period, parts = self.period, self.state.by_name(x)
        goal, seen = self._goal(parts, u["target"], period)
        state = {**parts, **seen}
        wanted = self._wanted(parts["commanded"], goal, state, period)
        is_over = seen["since"][0] > self.law.timeout + 0.5 * period
        if is_over or seen["left"][0] > 0.5 * period:
            limits = self._limits_of_velocity(wanted, parts, chosen)
        else:
            limits = self._limits_of_goal(goal, parts)
        if not isinstance(self._within, WithinClear):
            return Causes(limits, np.zeros(0, dtype=np.intp))
        pairs, is_moved = self._within.pairs_in_the_way(state, u, period, nearest(wanted), v)
        # A joint that pairs move elsewhere is not where its limits have it.
        return Causes(np.where(is_moved, 0, limits), pairs)

    def pairs_against(self, x: Array, u: Signals, v: Array) -> tuple[NDArray[np.bool_], Array]:
        """Return the pairs that would hold back velocities, and how near they are, in NumPy.

        Args:
            x: State before a step, shape (state.size,).
            u: Signals that it saw.
            v: The velocities, shape (n,) [rad/s].

        Returns:
            See `WithinClear.pairs_against`.
        """
        if not isinstance(self._within, WithinClear):
            return np.zeros(0, dtype=np.bool_), np.zeros(0)
        period, parts = self.period, self.state.by_name(x)
        _, seen = self._goal(parts, u["target"], period)
        return self._within.pairs_against({**parts, **seen}, u, period, nearest(v), v)

    def _limits_of_velocity(self, wanted: Array, parts: State, chosen: bool) -> NDArray[np.intp]:
        """Return what keeps joints from velocities, shape (n,), as `Causes.limits` does."""
        q, v, a = parts["commanded"], parts["v"], parts.get("a")
        (lower, upper), numbers = bounding_limits(self.limits, q, v, a, self.period)
        # A pace that is the largest speed stands for what would be faster.
        fastest = self.limits.sides("velocity").toward(wanted > 0.0) * (1.0 - _LEAST_EXCESS)
        demand = np.where(np.abs(wanted) < fastest, wanted, np.copysign(np.inf, wanted))
        slack = (-1.0 if chosen else 1.0) * _LEAST_EXCESS * (1.0 + np.abs(wanted))
        below = np.where(demand < lower - slack, -1 - numbers[0], 0)
        return np.where(demand > upper + slack, 1 + numbers[1], below)

    def _limits_of_goal(self, goal: Array, parts: State) -> NDArray[np.intp]:
        """Return what keeps joints from a goal, shape (n,), as `Causes.limits` does.

        Nothing keeps a joint from it that is braking for it.
        """
        q, v, a = parts["commanded"], parts["v"], parts.get("a")
        least, most = self.limits.position_lower, self.limits.position_upper
        place, up = clip(goal, least, most), goal >= q
        ends = np.where(up, least, place), np.where(up, place, most)
        limits = replace_unchecked(self.limits, **_ending(*ends))
        _, (below, above) = bounding_limits(limits, q, v, a, self.period)
        is_of_goal = (place == goal) & (np.where(up, above, below) == 0)
        return np.where(is_of_goal, 0, np.where(up, 1 + above, -1 - below))

    def _towards(self, goal: Array, q: Array, limits_kept: State) -> Array:
        """Return the velocities that are wanted on the way to the goal, shape (..., n) [rad/s].

        The fastest that can still be stopped there: the goal counts as a position limit, to which
        no envelope belongs.

        Args:
            goal: Where the joints are to rest, shape (..., n) [rad].
            q: Where they are, shape (..., n) [rad].
            limits_kept: The parts of the state.
        """
        back, v, a = goal < q, limits_kept["v"], limits_kept.get("a")
        if is_one(q):
            lower = np.where(back, goal, self.limits.position_lower)
            upper = np.where(back, self.limits.position_upper, goal)
            return np.where(back, *self._box((lower, upper), q, v, a))
        # Of the box one end is asked for: the upper one, of joints that are mirrored if need be.
        # So the other end is not worked out, and C works out in a branch what a near goal needs.
        side = 1.0 - 2.0 * back
        ends = -np.inf + 0.0 * q, side * goal
        mirrored: Any = (side * q, side * v, None if a is None else side * a)
        return side * self._box(ends, *mirrored, **self.limits.mirrored(back))[1]

    def _box(
        self, ends: tuple[Array, Array], q: Array, v: Array, a: Array | None, **others: Array
    ) -> tuple[Array, Array]:
        """Return bounds of the velocities from which joints can stop within other position limits.

        Args:
            ends: The lower and the upper ones, shape (..., n) each [rad].
            q: Where the joints are, shape (..., n) [rad].
            v: Their velocities, likewise [rad/s].
            a: Their accelerations, likewise [rad/s^2], if the jerk is bounded.
            others: Other limits that are not those of the law, by name.
        """
        limits = replace_unchecked(self.limits, **_ending(*ends), **others)
        if a is None:
            return limits.held_velocity_box(q, v, self.period)
        down, up = limits.held_acceleration_box(q, v, a, self.period)
        return v + self.period * down, v + self.period * up


def _ending(lower: Array, upper: Array) -> dict[str, Any]:
    """Return fields of limits that end at other positions, to which no envelope belongs."""
    free = {"envelope_offset": None, "envelope_deceleration": None}
    return {"position_lower": lower, "position_upper": upper, **free}


def _all(flags: Any) -> Any:
    """Return whether all entries of vectors are true, shape (..., 1)."""
    return flags.all(axis=-1, keepdims=True)


# Share of the period by which calls may come late, if nothing else is given.
_TOLERANCE = 0.5
# The longest pause [s].
_DAY = 86400.0
# The shortest and the longest period [s]: no robot takes commands faster; longer ones are no
# seconds.
_SHORTEST_PERIOD, _LONGEST_PERIOD = 1e-5, 1.0
# Time without a measurement of an obstacle after which it is told [s].
_UNMEASURED = 1.0
# Samples after which any stop has ended.
_FOR_EVER = 10**9
#: What a robot does that gets no command in time: it holds the last one, or stops as certified.
LATE = ("hold", "stop")
Late = Literal["hold", "stop"]


@dataclass(frozen=True, eq=False)
class StepInPlace:
    """The step of a law, made in arrays that stay where they are.

    Attributes:
        x: The state, which each step overwrites, shape (state.size,).
        u: The signals that it sees, by name.
        make: Makes a step.
    """

    x: Array
    u: Mapping[str, Array]
    make: Callable[[], object]

    @classmethod
    def by(
        cls, step: Callable[[float, Array, Signals, float], Array], law: SampledReading, h: float
    ) -> StepInPlace:
        """Return that of a function like `SampledReading.step`.

        Args:
            step: The function.
            law: Reading of the law.
            h: Its period [s].
        """
        x = np.zeros(law.state.size)
        u = {name: np.zeros(shape) for name, shape in law.inputs.shapes.items()}

        def make() -> None:
            x[:] = step(0.0, x, u, h)

        return cls(x, u, make)


#: Returns the step of a reading at a period [s].
Bind = Callable[[SampledReading, float], StepInPlace]


class LastStep(NamedTuple):
    """A step of a guard.

    Attributes:
        reading: Reading of its law.
        x: State before it, shape (state.size,).
        u: Signals that it saw, by name.
        v: Velocities that it has chosen, shape (n,) [rad/s].
        chosen: See `JointStreamReading.causes`.
        block: The joints of which it tells; by default all.
    """

    reading: JointStreamReading
    x: Array
    u: Mapping[str, Array]
    v: Array
    chosen: bool = False
    block: slice = slice(None)

    @property
    def wanted(self) -> Array:
        """Velocities that it wanted, shape (n,) [rad/s]."""
        reading, parts = self.reading, self.reading.state.by_name(self.x)
        goal, seen = reading._goal(parts, self.u["target"], reading.period)
        wanted = reading._wanted(parts["commanded"], goal, {**parts, **seen}, reading.period)
        return wanted[self.block]

    @property
    def causes(self) -> Causes:
        """What kept it from what was wanted; found when it is asked for."""
        limits, pairs = self.reading.causes(self.x, self.u, self.v, chosen=self.chosen)
        clearance = self.reading.law.clearance
        if self.block != slice(None) and clearance is not None:
            # Of pairs those that one of the joints changes, if these do not what is wanted.
            differ = np.abs(self.wanted - self.v[self.block]).max() > _LEAST_EXCESS
            pairs = self._of_joints(pairs, clearance)[: None if differ else 0]
        return Causes(limits[self.block], pairs)

    def pairs_in_the_way(
        self, v: Array, known: Sequence[int] = (), within: float = 0.0
    ) -> NDArray[np.intp]:
        """Return the pairs that would hold back velocities of its joints, where they are now.

        Args:
            v: Velocities, shape (n,) [rad/s]; those of other joints are what they are.
            known: Further pairs, which are in the way while they are near.
            within: Distance below which they are [m].
        """
        wanted = self.v.copy()
        wanted[self.block] = v
        holds, gaps = self.reading.pairs_against(self.x, self.u, wanted)
        is_known = np.isin(np.arange(gaps.size), known)
        pairs = np.flatnonzero(holds | (is_known & (gaps < within)))
        clearance = self.reading.law.clearance
        return pairs if clearance is None else self._of_joints(pairs, clearance)

    def _of_joints(self, pairs: NDArray[np.intp], clearance: Clearance) -> NDArray[np.intp]:
        """Return those of some pairs that one of the joints changes."""
        return pairs[clearance.reaches[pairs, self.block].any(axis=1)]


def check_period(key: str, period: object) -> None:
    """Raise an InvalidInputError unless this is a time between two commands [s]."""
    number(above=0.0)(key, period)
    value = float(period)  # type: ignore[arg-type]
    if value > _LONGEST_PERIOD:
        hint = f"; {value:g} Hz would be {1.0 / value:g}" if value >= 10.0 else ""
        raise InvalidInputError(
            f"{key}: {value:g} s is long; must be the seconds between two commands, neither "
            f"milliseconds nor a rate{hint}"
        )
    if value < _SHORTEST_PERIOD:
        raise InvalidInputError(
            f"{key}: {value:g} s is short; must be the seconds between two commands, at least "
            f"{_SHORTEST_PERIOD:g}"
        )


@with_own_errors
class StreamGuard:
    """Turns joint targets, whenever they come, into commands within every bound.

    It runs a `JointStream` outside of any diagram; `drake_rnn.Guard` is one whose step may be
    compiled, and which may run in a process of its own. See there.

    Args:
        law: What is kept, and how targets are followed.
        period: Time between two calls of `command` [s].
        start: Posture that the robot rests in, shape (n,) [rad]; by default the law's ``home``. A
            joint that is up to 0.2 rad outside its position limits is brought back first, slowly.
        p_WO: How far the obstacles that may move have gone from where they are stated, as measured
            now, see `command`; None to begin with the measurement of the first command.
        t: Time now, on a clock that never goes back [s]; None if it is not known.
        tolerance: Time by which a call may come late, or early, while the robot keeps its velocity
            [s]; at most a period, by default half of it. Obstacles count as moving on for so long
            during each stop.
        late: What the robot does that gets no command in time: ``hold``, it stands at the last one,
            or ``stop``, it goes on along the certified stop, see `GuardCommand`.
        bind: Returns what makes the steps of the law's reading; by default NumPy does.
        has_compliance: See `JointStreamReading`; `compliance` is then 1 at first.

    Raises:
        InvalidInputError: If the law cannot be sampled at this period, or the robot starts beyond
            its limits or too near to something, or an argument is not as described.
    """

    def __init__(  # noqa: PLR0913  entry point: one argument per part of what it is told
        self,
        law: Any,
        period: float,
        start: Array | None = None,
        p_WO: Displacements | None = None,
        t: float | None = None,
        tolerance: float | None = None,
        *,
        late: Late = "hold",
        bind: Bind | None = None,
        has_compliance: bool = False,
    ) -> None:
        require_type("law", law, JointStream)
        reading = law.sampled(period)
        check_period("period", period)
        q = law.home if start is None else _finite("start", start, law.home.size)
        if (law.limits.violation(q) > OUTSIDE).any():
            raise InvalidInputError(f"start: {law.limits.complaint(q)}")
        self.law: JointStream = law
        self.period = float(period)
        self.tolerance, self.late = self._checked_tolerance(tolerance), checked_late(late)
        # A command that is made a tolerance before it holds may be made up to a period before.
        ahead = self.tolerance if self.late == "hold" else self.period
        self._reading: JointStreamReading = replace(
            reading, tolerance=ahead, has_compliance=has_compliance
        )
        self._change: LimitChange | None = None
        self._measured = law.safety.inputs
        self._solids = Solids.of([]) if law.clearance is None else law.clearance.solids
        self._moving = sum(shape[0] for shape in self._measured.values())
        self._late_stops = self._late_samples = 0
        self._use(self._step_of(self._reading, bind))
        self._q[:], self._target[:] = q, np.nan
        if has_compliance:
            self.compliance.fill(1.0)
        # How many commands there were. Of the last one that was not withdrawn: its number, that of
        # the one it goes on from, and when it begins to hold; and, to withdraw it, the same of that
        # one, with its motion and the delay of its stop.
        self._count = self._number = self._after = 0
        self._begins = -np.inf
        # When commands begin to hold that go on along a stop: so many periods after an origin.
        self._origin, self._slot = 0.0, 0
        self._one_before = self._place()
        #: Time that a call takes until its command is sent, if it is to be in time [s].
        self.call_time = 0.0
        # How often obstacles had jumped when that was told; for how long each was not measured [s].
        self._told, self._unmeasured = np.zeros((2, self._moving))
        # Whether calls tell the time, None before the first; that of the last call; and when the
        # next command is due.
        self._is_timed = None if t is None else True
        self._last = self._due = 0.0 if t is None else _time(t)
        # By how much a call may be late, and early [s].
        self._most_late = self.tolerance + SAME * self.period
        self._most_early = self._most_late
        if self.late == "stop":
            self._most_early = (1.0 + SAME) * self.period - self.tolerance
        p_first = np.full((self._moving, 3), np.nan) if p_WO is None else self.checked_places(p_WO)
        self._begin(p_first)
        self._has_begun = p_WO is not None or not self._moving

    def _step_of(self, reading: JointStreamReading, bind: Bind | None) -> StepInPlace:
        """Return the step of a reading, by NumPy unless something else makes it."""
        if bind is None:
            return StepInPlace.by(without_checks(reading.step), reading, self.period)
        return bind(reading, self.period)

    def _use(self, step: StepInPlace) -> None:
        """Make steps in these arrays, of which parts have names."""
        self._step, self._make_step = step, step.make
        self._x, u = step.x, step.u
        self._x_before = self._x.copy()
        self._target, self._q = u["target"], u["position"]
        self._shape = self._q.shape
        self._p_WO = [u[name] for name in self._measured]
        parts = self._reading.state.by_name(self._x)
        self._commanded, self._v, self._a = parts["commanded"], parts["v"], parts.get("a")
        self._left, self._since, self._delay = (
            parts["left"],
            parts["since"],
            parts.get("stop_delay"),
        )

    @classmethod
    def within(
        cls,
        limits: JointLimits,
        start: Array,
        period: float,
        clearance: Clearance | None = None,
        p_WO: Displacements | None = None,
        t: float | None = None,
    ) -> Self:
        """Return a guard with the defaults of `JointStream`.

        Args:
            limits: Limits of the joints.
            start: Posture that the robot rests in, shape (n,) [rad].
            period: Time between two calls of `command` [s].
            clearance: What the arm is to stay clear of; None for nothing.
            p_WO: How far obstacles have moved, as measured now, see `command`.
            t: Time now [s]; None if it is not known.
        """
        law = JointStream(limits=limits, home=start, clearance=clearance)
        return cls(law, period, p_WO=p_WO, t=t)

    @property
    def assumptions(self) -> tuple[Assumption, ...]:
        """What the limits and the distance rest on that its commands keep."""
        return guard_assumptions(self.tolerance, self.law.clearance)

    def command(
        self,
        target: Array | None = None,
        p_WO: Displacements | None = None,
        t: float | None = None,
    ) -> Array:
        """Return the positions to command for the next period, shape (n,) [rad].

        They are reached at its end, at the constant `velocity`.

        Args:
            target: A target that has come since the last call, shape (n,) [rad]; None, or with
                NaN or infinite entries, if there is none to follow.
            p_WO: How far the obstacles that may move have gone from where they are stated, as
                measured now; must be given if there are any. A row [m] for each of
                `moving_obstacles`, which have the order in which obstacles were given, shape
                (m, 3); or rows by name, ``{"cup": p}``. One that was not measured, NaN or
                left out by name, may be as far from where it was measured last as its speed lets
                it go.
            t: Time of this call [s], on the clock of the other calls; must be given in all calls of
                a guard or in none. Without it a call is one period after the one before.

        Raises:
            InvalidInputError: If an argument has another shape or is no number, obstacles are not
                given, the time is not after that of the last call, or is earlier than the period
                and the tolerance allow; the guard is then as before the call. At the first
                command also if an obstacle is too near.
        """
        self._read(target)
        if self._moving or p_WO is not None:
            self._measure(self.checked_places(p_WO))
            if self._moving:
                self._note_unmeasured()
        late = self._late(t, now=False)
        if not self._has_begun or late is None:
            self._begin(self._p_WO[0] if self._moving else np.zeros((0, 3)))
            self._has_begun, late = True, 0.0
        if self.late == "stop":
            self._one_before = self._place()
            self._go_on(t)
        elif late <= self._most_late:
            self._advance(late)
        else:
            self._stand(late)
        self._note_command(t)
        if self._moving and self.part("jumps").sum() > self._told.sum():
            self._warn()
        return self._commanded.copy()

    def _note_command(self, t: float | None) -> None:
        """Note when a command was called for [s], begins to hold, and the next one is due."""
        self._is_timed = t is not None
        if t is None:
            self._begins = self._count * self.period
        else:
            self._last = float(t)
            if self.late == "hold":
                self._begins = self._last
            self._due = self._begins + self.period
            if self.late == "stop":
                self._due -= self.tolerance
        self._count += 1
        self._after, self._number = self._number, self._count

    @property
    def due(self) -> float:
        """When the next call of `command` is due [s]."""
        return self._due

    def next_call(self, now: float) -> float:
        """Return when to call next, not before a time [s], with ``late="stop"``.

        That is when the next command is due. Later it is as soon as a command is made in time, and
        obstacles that are measured then have moved for a period at most when it begins to hold.

        Args:
            now: The time.

        Raises:
            InvalidInputError: If the time is no number.
        """
        now, begins = _time(now), self._begins + self.period
        if not self._number:
            return max(now, self._due)
        # No earlier than the last command begins to hold.
        t = max(now, min(self._due, begins - self.call_time), self._begins)
        ahead = max(self.period, self.call_time)
        missed = max(ceil((t + self.call_time - begins) / self.period - SAME), 0)
        return max(t, begins + missed * self.period - ahead)

    @property
    def newest(self) -> GuardCommand:
        """The last command, with the certified stop that follows it.

        Raises:
            InvalidInputError: If there was no command yet.
        """
        if not self._number:
            raise InvalidInputError("newest: there was no command yet")
        return self._command_of(self.accelerations[1])

    def _command_of(self, a: Array) -> GuardCommand:
        """Return the last command, which accelerations have led to, shape (n,) [rad/s^2]."""
        limits, age = self._reading.limits, float(self._since[0])
        most = braking(self._v, a, limits.sides("acceleration", "a stop"), limits.jerk, self.period)
        motion = self.position, self.velocity, age, self.period, a, most, limits.jerk
        return GuardCommand(self._number, self._begins, *motion, self._after)

    def change_limits(self, limits: JointLimits) -> None:
        """Keep other limits from now on, or as soon as they accept the motion of the arm.

        If a next velocity is within them, with a stop after it that is within them and free, they
        are in force from the next command on. Else the arm goes on along the stop that was
        certified within the old ones, until that is so; `limits_pending` tells. No command is ever
        beyond the limits in force, which are ``law.limits``.

        Args:
            limits: The limits.

        Raises:
            InvalidInputError: If they are of another number of joints, or the arm would come to
                rest outside of the new position limits; the guard is then as before.
        """
        require_type("limits", limits, JointLimits)
        self.change_law(replace_unchecked(self.law, limits=limits))

    def change_law(self, law: JointStream, bind: Bind | None = None) -> None:
        """Follow a law that differs in limits and times, as `change_limits` says.

        Args:
            law: The law, of the same arm and the same obstacles.
            bind: What makes its steps; by default NumPy.
        """
        stop = self._command_of(self.accelerations[1]).stop(_FOR_EVER)
        require_rest_within(law.limits, stop.position)
        self._change = self.change_to(law, bind)

    def change_to(self, law: JointStream, bind: Bind | None = None) -> LimitChange:
        """Return the change to a law, see `change_law`."""
        old, reading = self._reading, law.sampled(self.period)
        reading = replace(reading, tolerance=old.tolerance, has_compliance=old.has_compliance)
        return LimitChange(law, reading, self._step_of(reading, bind))

    @property
    def limits(self) -> JointLimits:
        """Limits in force, which no command is beyond."""
        return self.law.limits

    @property
    def next_limits(self) -> JointLimits:
        """Limits that were asked for last; those in force, unless others wait."""
        return (self.law if self._change is None else self._change.law).limits

    @property
    def limits_pending(self) -> bool:
        """Whether other limits wait until they accept the motion of the arm."""
        return self._change is not None

    @property
    def accelerations(self) -> tuple[Array, Array]:
        """Those that led to the velocities before the last step and after it, (n,) [rad/s^2]."""
        before = self._reading.state.by_name(self._x_before)
        if self._a is not None:
            return before["a"], self._a.copy()
        return np.zeros(self._shape), (self._v - before["v"]) / self.period

    def withdraw(self, *, unseen: bool = False) -> None:
        """Take back the last command, which has come too late: the arm is on the stop before it.

        Args:
            unseen: Whether nobody can have seen it: the next command then has its number.
        """
        self._count -= bool(unseen)
        self._number, self._after, (self._begins, self._slot), delay, motion = self._one_before
        self._set_motion(*motion)
        if self._delay is not None:
            self._delay[:] = delay
        self._due = self._begins + self.period - self.tolerance

    def resume(self, q: Array, v: Array, a: Array, t: float | None = None) -> None:
        """Go on from what was commanded without the guard, such as after a pause.

        The next call of `command` is due now. No stop from this motion was certified: if none is
        free, the guard stops as fast as its bounds allow, and counts it in ``uncertified``. From
        rest that cannot happen.

        Args:
            q: Positions commanded until now, shape (n,) [rad].
            v: Velocities that have led there, shape (n,) [rad/s].
            a: Accelerations that have led to these, shape (n,) [rad/s^2].
            t: Time now [s], see `command`. Without it the time since the last call is not known,
                and places of obstacles are taken from the next command as from a first one.

        Raises:
            InvalidInputError: If an argument has another shape or is not finite, or the time is
                before that of the last call.
        """
        q, v, a = (_finite(name, x, self._shape[0]) for name, x in (("q", q), ("v", v), ("a", a)))
        if self._change is not None:
            # A motion of others is within no limits, and no stop of it was certified.
            self._change.take_over(self._reading, self._x, a, self._step.u)
            self._adopt(self._change)
        time_since = self._late(t, now=True) if t is not None or self._is_timed else None
        self._go_on_from(q, v, a, time_since)
        self._q[:], self._has_begun, self._is_timed = q, True, t is not None
        if t is not None:
            self._last = self._due = float(t)
            self._origin, self._slot = self._due + self.tolerance, -1
            self._begins = self._origin - self.period

    def rest(self) -> None:
        """Have the arm come to rest within its bounds, as without a target for the timeout.

        It begins with the next command, and lasts until a target comes.
        """
        self._since[0] = max(self._since[0], self.law.timeout)

    @property
    def compliance(self) -> Array:
        """How readily joints give way from the next command on, shape (n,), see the reading.

        It may be written to.
        """
        return self._step.u["compliance"]

    def part(self, name: str) -> Array:
        """Return a part of the law's state.

        Such as ``missed``, the samples without a target; ``held_back``, those in which the velocity
        that was wanted was not free; and ``uncertified``, those in which the arm moved and no stop
        was, because of a measurement beyond what is stated or a motion of others.

        Raises:
            InvalidInputError: If the state has no such part.
        """
        if name not in (parts := self._reading.state.parts):
            raise InvalidInputError(f"name: no part {short(name)}; there are {', '.join(parts)}")
        return np.array(self._reading.state.part(self.state, name))

    @property
    def state(self) -> Array:
        """State of the law's reading, shape (state.size,)."""
        return self._x.copy()

    def adopt(self, before: Array, after: Array, target: Array, p_WO: Array | None) -> None:
        """Take over the last step of another guard of the same law, so as to tell of it.

        Args:
            before: State before it, shape (state.size,).
            after: State after it, likewise.
            target: The target that it was given, shape (n,) [rad]; NaN for none.
            p_WO: Places of obstacles that it was given, as in `command`.
        """
        self._x_before[:], self._x[:], self._target[:] = before, after, target
        if p_WO is not None:
            self._measure(p_WO)

    @property
    def moving(self) -> int:
        """How many obstacles may move."""
        return self._moving

    @property
    def moving_obstacles(self) -> tuple[str, ...]:
        """Names of the obstacles that may move, in the order of the rows of ``p_WO``."""
        return self._solids.moving_names

    @property
    def p_WO(self) -> Array:
        """Where they were measured at the last command, shape (m, 3) [m]; NaN where not."""
        return np.array(self._p_WO[0]) if self._moving else np.zeros((0, 3))

    @property
    def position(self) -> Array:
        """Positions commanded last, shape (n,) [rad]."""
        return self._commanded.copy()

    @property
    def velocity(self) -> Array:
        """Velocities commanded last, shape (n,) [rad/s]."""
        return self._v.copy()

    @property
    def acceleration(self) -> Array:
        """Accelerations commanded last, shape (n,) [rad/s^2]; 0 where no reachable jerk is kept."""
        return self.part("a") if "a" in self._reading.state else np.zeros(self._shape)

    @property
    def last_step(self) -> LastStep:
        """The last step, of which `LastStep.causes` says what kept it from what was wanted."""
        u = {name: signal.copy() for name, signal in self._step.u.items()}
        return LastStep(self._reading, self._x_before.copy(), u, self._v.copy())

    @property
    def late_stops(self) -> int:
        """How many calls came so late that an arm on its way had to stop at the last command."""
        return self._late_stops

    @property
    def late_samples(self) -> int:
        """For how many samples an arm on its way went along its stop, as no command was in time."""
        return self._late_samples

    @property
    def jumps(self) -> dict[str, int]:
        """How often each obstacle that may move was measured where it cannot have been, by name."""
        if not self._moving:
            return {}
        counts = zip(self.moving_obstacles, self.part("jumps"), strict=True)
        return {name: int(count) for name, count in counts}

    def _begin(self, p_measured: Array) -> None:
        """Begin at rest, with the first measurement, shape (m, 3) [m]."""
        q = np.array(self._q)
        self.law.safety.check_start(q, p_measured if self._moving else None)
        signals = {"position": q, "target": q, **dict.fromkeys(self._measured, p_measured)}
        self._x[:] = self._reading.initial_state(np.random.default_rng(0), signals)

    def _advance(self, late: float) -> None:
        """Make a step of the law, by how much the call may be late [s]."""
        delay = self._delay
        if delay is None:
            if late > 0.0:
                self._wait(late)
            self._sample()
            return
        before = self._x.copy()
        if late > 0.0:
            self._wait(late)
        self._sample()
        # A stop that goes on, but too late, holds no longer.
        delay = self._delay
        assert delay is not None
        if self._most_late < delay[0] < NO_STOP and np.count_nonzero(self._v):
            self._x[:] = before
            self._stand(late)

    def _go_on_from(self, q: Array, v: Array, a: Array, elapsed: float | None) -> None:
        """Go on from a motion that was not commanded, which nothing was wanted on the way to.

        Args:
            q: Positions, shape (n,) [rad].
            v: Velocities, likewise [rad/s].
            a: Accelerations, likewise [rad/s^2].
            elapsed: Time since the last call [s]; None if it is not known.
        """
        self._x[:] = self._reading.resumed(self._x, q, v, a, elapsed)
        if self._a is not None:
            # What was wanted before would count as wanted to change at once.
            path = {"v_path": v, "a_path": a}
            self._x[:] = self._reading.state.with_parts(self._x, **path)

    def _stand(self, late: float) -> None:
        """Make a step of the law from rest at the last command, by how much it is late [s]."""
        self._late_stops += int(np.count_nonzero(self._v) > 0)
        rest = np.zeros(self._shape)
        self._go_on_from(self._commanded, rest, rest, late)
        self._sample()

    def _go_on(self, t: float | None) -> None:
        """Make a step of the law from where the arm is on its stop when the command begins to hold.

        Args:
            t: Time of the call [s]; None if calls are a period apart.
        """
        h, begins = self.period, self._begins + self.period
        if t is None or begins == -np.inf:
            ahead = max(self.tolerance, self.call_time)
            self._begins = self._origin = 0.0 if t is None else t + ahead
            self._sample()
            return
        missed = max(ceil((t + self.call_time - begins) / h - SAME), 0)
        self._slot += 1 + missed
        self._begins = self._origin + self._slot * h
        if missed:
            self._late_samples += missed * bool(np.count_nonzero(self._v))
            motion = GuardCommand.stop(self.newest, missed)
            self._set_motion(motion.position, motion.velocity, motion.acceleration)
        # Of obstacles, all the time counts that has passed since the last call.
        elapsed = max(missed * h, t - self._last - h)
        if elapsed > 0.0:
            self._age(elapsed)
        self._sample()

    def _age(self, elapsed: float) -> None:
        """Let a time pass in which the arm went on as certified [s]."""
        if not self._moving:
            self._left[0] = max(self._left[0] - elapsed, 0.0)
            self._since[0] += elapsed
            return
        delay = np.array(self._delay)
        a = np.zeros(self._shape) if self._a is None else self._a
        self._x[:] = self._reading.resumed(self._x, self._commanded, self._v, a, elapsed)
        self._delay[:] = delay  # type: ignore[index]

    def _place(
        self,
    ) -> tuple[int, int, tuple[float, int], Array | None, tuple[Array, Array, Array]]:
        """Return what `withdraw` goes back to."""
        a = np.zeros(self._shape) if self._a is None else self._a.copy()
        delay = None if self._delay is None else self._delay.copy()
        motion = self._commanded.copy(), self._v.copy(), a
        return self._number, self._after, (self._begins, self._slot), delay, motion

    def _set_motion(self, q: Array, v: Array, a: Array) -> None:
        self._commanded[:], self._v[:] = q, v
        if self._a is not None:
            self._a[:] = a

    def _sample(self) -> None:
        """Make a step of the law."""
        if self._change is None:
            self._x_before[...] = self._x
            self._make_step()
            return
        a, change = self.accelerations[1], self._change
        before = change.try_step(self._reading, self._x, a, self._step.u)
        if before is None:
            self._stop_meanwhile(a)
            return
        self._adopt(change)
        self._x_before[:] = before

    def _adopt(self, change: LimitChange) -> None:
        """Have other limits in force, from the state and the signals of their step on."""
        self.law, self._reading, self._change = change.law, change.reading, None
        self._use(change.step)

    def _stop_meanwhile(self, a: Array) -> None:
        """Go on along the stop for a sample, after accelerations, shape (n,) [rad/s^2]."""
        self._x_before[:] = self._x
        parts = self._reading.state.by_name(self._x_before)
        goal, seen = self._reading._goal(parts, self._target, self.period)
        motion = self._command_of(a).stop(1)
        self._set_motion(motion.position, motion.velocity, motion.acceleration)
        self._age(self.period)
        # A target that has come meanwhile is followed afterwards.
        self._x[:] = self._reading.state.with_parts(self._x, goal=goal, **seen)
        if self._delay is not None and self._delay[0] >= NO_STOP and np.count_nonzero(self._v):
            self._reading.state.part(self._x, "uncertified")[:] += 1.0

    def _wait(self, late: float) -> None:
        """Let a time pass in which the arm went on, or waited where it was [s]."""
        if self._delay is not None:
            a = np.zeros(self._shape) if self._a is None else self._a
            self._x[:] = self._reading.resumed(self._x, self._commanded, self._v, a, late)
            return
        # The same where nothing is avoided.
        self._left[0] = max(self._left[0] - late, 0.0)
        self._since[0] += late

    def _read(self, target: Array | None) -> None:
        """Take over a target, shape (n,) [rad]; NaN for none."""
        # This is asked for at every call, and so in the quickest way.
        if target is None:
            self._target.fill(np.nan)
        elif type(target) is np.ndarray and target.dtype is FLOAT and target.shape == self._shape:
            self._target[...] = target
        else:
            self._target[:] = _numbers("target", target, self._shape[0])

    def checked_places(self, p_WO: Displacements | None) -> Array:
        """Return what is measured of obstacles, shape (m, 3) [m], NaN where it is not."""
        return self._solids.places(p_WO)

    def _measure(self, p_WO: Array) -> None:
        for places in self._p_WO:
            places[:] = p_WO

    def _late(self, t: float | None, *, now: bool) -> float | None:
        """Return by how much a call is late [s]; None if that is not known.

        Args:
            t: Time of the call [s].
            now: Whether it may come at any time after the last call.
        """
        if t is None and not self._is_timed:
            return 0.0
        if type(t) is float and self._is_timed:
            late = t - self._due
            if late >= -self._most_early and 0.0 < t - self._last <= _DAY:
                return late if late > 0.0 else 0.0
        return self._checked_lateness(t, now=now)

    def _checked_lateness(self, t: float | None, *, now: bool) -> float | None:
        """Return what `_late` does, or raise an InvalidInputError."""
        if self._is_timed is not None and self._is_timed != (t is not None):
            raise InvalidInputError("t: must be given in all calls of a guard or in none")
        t = _time(t)
        if self._is_timed is None:
            return None
        elapsed_time, late = t - self._last, t - self._due
        if elapsed_time < 0.0 or (elapsed_time == 0.0 and self._due > self._last and not now):
            raise InvalidInputError(
                f"t: must be after that of the last call, {self._last:.9g} s, not {t:.9g}"
            )
        if elapsed_time > _DAY:
            raise InvalidInputError(
                f"t: is {elapsed_time:.3g} s after the last call, more than a day; must be in "
                "seconds, on the clock of the other calls"
            )
        if late < -self._most_early and not now:
            early = self._most_early - SAME * self.period
            due = f"must be a period of {self.period:g} s after it, or at most {early:g} s earlier"
            if self.late == "stop":
                # Further commands would be more than one ahead of what the robot does.
                due = f"must be {-late - early:g} s later, when the last command begins to hold"
            raise InvalidInputError(f"t: is {elapsed_time:.3g} s after the last call; {due}")
        return max(late, 0.0)

    def _note_unmeasured(self) -> None:
        """Warn of obstacles that have not been measured for long, or at the first command."""
        is_unknown = np.isnan(self._p_WO[0][:, 0])
        self._unmeasured = np.where(is_unknown, self._unmeasured + self.period, 0.0)
        is_new = self._unmeasured > (_UNMEASURED if self._has_begun else 0.0)
        if is_new.any():
            # It is told once each time.
            self._unmeasured[is_new] = -np.inf
            names = ", ".join(self.moving_obstacles[k] for k in np.flatnonzero(is_new))
            since = f"for {_UNMEASURED:g} s" if self._has_begun else "yet"
            warn(
                f"p_WO: {names} has not been measured {since}, its place is NaN or missing; it "
                "may be wherever its speed has let it go, and the arm stands where that is",
                stacklevel=3,
            )

    def _warn(self) -> None:
        """Warn of obstacles that were measured for the first time where they cannot be."""
        before, self._told = self._told, self.part("jumps")
        for (name, count), count_before in zip(self.jumps.items(), before, strict=True):
            if count and not count_before:
                warn(
                    f"p_WO: {name} was measured farther away than its speed and its error allow; "
                    "the places before and after both count for a while",
                    stacklevel=3,
                )

    def _checked_tolerance(self, tolerance: float | None) -> float:
        if tolerance is None:
            return _TOLERANCE * self.period
        if not is_number(tolerance) or not 0.0 <= tolerance <= self.period:
            raise InvalidInputError(
                f"tolerance: must be a time from 0 to the period, {self.period:g} s, not "
                f"{short(tolerance)}"
            )
        return float(tolerance)


def checked_late(late: object) -> Late:
    """Return what a robot does that gets no command in time.

    Raises:
        InvalidInputError: If it is none of `LATE`.
    """
    if not isinstance(late, str) or late not in LATE:
        raise InvalidInputError(f"late: may be hold or stop, not {short(late)}")
    return late  # type: ignore[return-value]


def _time(t: object) -> float:
    """Return a time [s], checked."""
    if not is_number(t):
        raise InvalidInputError(f"t: must be a finite time [s], not {short(t)}")
    return float(t)  # type: ignore[arg-type]


def _finite(name: str, value: object, size: int) -> Array:
    """Return as many finite numbers as there are joints."""
    vector = _numbers(name, value, size)
    if not np.isfinite(vector).all():
        raise InvalidInputError(f"{name}: must be finite, not {short(vector)}")
    return vector


def _numbers(name: str, value: object, size: int) -> Array:
    """Return as many numbers as there are joints; NaN is one of them."""
    vector = np.asarray(value, dtype=float) if is_vector(value) else np.zeros(0)
    if vector.shape != (size,):
        raise InvalidInputError(
            f"{name}: must be {size} numbers, one per joint, not {short(value)}"
        )
    return vector


def __getattr__(name: str) -> Any:
    return moved_name(__name__, name, {"Guard": "drive.guard"})

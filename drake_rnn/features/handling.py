"""The section ``goals``: what an arm attaches and releases on its way, what is kept apart then.

A gripper may move its joints at a goal, where the arm rests. While they move, shapes that contain
its bodies on all of their way are kept apart; then those of the new places.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from math import ceil
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from pydrake.geometry import Rgba
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, Joint
from pydrake.systems.framework import Context

from ..errors import InvalidInputError
from ..inputs.fields import Array
from ..inputs.messages import nearest, replace_unchecked
from ..laws import Avoidance, Law
from ..laws.call_checks import without_checks
from ..laws.checks import sampled_reading
from ..laws.law import Layout, ReadingWrapper, SampledReading, Signals
from ..robot.arm import Arm
from ..robot.arm_description import GRIPPER, PayloadDescription
from ..robot.clearance import Clearance, Flags
from ..robot.clearance.arm_clearance import clearance_between, clearance_of
from ..robot.clearance.obstacles import (
    OBSTACLES,
    Obstacle,
)
from ..robot.kinematics import joints_to
from ..robot.rotation import rotation_of
from .feature import (
    EvaluationSteps,
    Feature,
    Frames,
    Moment,
    SceneItem,
    Stage,
)
from .planning import Goal, MotionPlan, goal_postures, how_near, nearest_pair, plan_motion

# An arm is at rest at a goal if no joint is farther off or faster than this [rad, rad/s].
_AT_REST = 1e-6
# Parts of the state of a law that go on where other pairs are kept apart.
_GOES_ON = ("goal", "pace", "left", "since", "missed", "held_back", "uncertified")
# A payload where it lies, as pale as one that an arm holds is drawn.
_PAYLOAD = Rgba(0.85, 0.8, 0.76)
# What happens to a payload, as figures say it.
_EVENTS = {"attach": "attaches", "release": "releases", "hand_over": "hands over"}


@dataclass(frozen=True, eq=False)
class Phase:
    """A part of a run during which the same pairs are kept apart.

    Attributes:
        begin: Time at which it begins [s].
        posture: Where the arm rests then, shape (n,) [rad].
        clearance: What the arm is to stay clear of.
        key: Key of the goal at which it begins.
        event: What happens to the payload then, as a goal's ``action``; None for nothing.
    """

    begin: float
    posture: Array
    clearance: Clearance
    key: str
    event: str | None = None


class Opening(NamedTuple):
    """A motion of the joints of a gripper.

    Attributes:
        begin, end: Times at which it begins and ends [s].
        first, last: Where they are then, by their names in the gripper's file [rad or m].
    """

    begin: float
    end: float
    first: Mapping[str, float]
    last: Mapping[str, float]

    @property
    def ends(self) -> str:
        """Where the joints go that move, in words; only the first of many."""
        moved = [name for name in sorted(self.last) if self.last[name] != self.first[name]]
        shown = ", ".join(f"{name} to {self.last[name]:.4g}" for name in moved[:2])
        return f"{shown}, ..." if len(moved) > 2 else shown or "holds"


@dataclass(frozen=True, eq=False)
class Handling(ReadingWrapper):
    """What an arm holds, attached or released during a run, and how its gripper moves.

    Attributes:
        phases: Parts of the run, in order.
        law: The law, in the first of them.
        period: Its period [s].
        payload: What is held; None for nothing.
        openings: Motions of the gripper's joints, in order.
        before, after: Pose of the frame that holds it where it lies before it is attached, and
            after it was released; None where it does not lie anywhere.
    """

    phases: tuple[Phase, ...]
    law: Law
    period: float
    payload: PayloadDescription | None
    before: RigidTransform | None
    after: RigidTransform | None
    openings: tuple[Opening, ...] = ()

    def around(self, reading: SampledReading) -> SampledReading:
        """See `ReadingWrapper.around`."""
        laws = [
            replace_unchecked(self.law, clearance=each.clearance, home=each.posture)
            for each in self.phases[1:]
        ]
        readings = (reading, *(sampled_reading(law, self.period) for law in laws))
        return PhasedReading(readings, self.phases)

    def time_of(self, *events: str) -> float | None:
        """Return when one of some events happens [s]; None if none does."""
        return next((each.begin for each in self.phases if each.event in events), None)

    def least_along(self, position: Array, time: Array) -> Array:
        """Return the least distance since the step before of what is to be apart then, (k,) [m].

        Args:
            position: Joint positions, shape (k, n) [rad].
            time: Times of the steps, shape (k,) [s].
        """
        least, half = np.full(len(time), np.inf), 0.5 * self.period
        ends = [each.begin for each in self.phases[1:]] + [np.inf]
        for phase, end in zip(self.phases, ends, strict=True):
            first = max(0, int(np.searchsorted(time, phase.begin + half)) - 1)
            last = int(np.searchsorted(time, end + half))
            if last > first and time[last - 1] > phase.begin - half:
                own = phase.clearance.least_along(position[first:last])
                least[first:last] = np.minimum(least[first:last], own)
        return least

    def obstacles_at(self, X_WH: RigidTransform | None) -> list[Obstacle]:
        """Return what is held as obstacles where it lies, none if that is nowhere."""
        if X_WH is None or self.payload is None:
            return []
        return payload_obstacles(self.payload, X_WH)

    def opening_at(self, t: float) -> dict[str, float]:
        """Return where joints of the gripper that move are at a time [s], by name [rad or m]."""
        now = dict(self.openings[0].first) if self.openings else {}
        for each in self.openings:
            share = float(np.clip((t - each.begin) / (each.end - each.begin), 0.0, 1.0))
            if share > 0.0:
                now = {n: (1.0 - share) * q + share * each.last[n] for n, q in each.first.items()}
        return now


def payload_obstacles(payload: PayloadDescription, X_WH: RigidTransform) -> list[Obstacle]:
    """Return the parts of a payload as obstacles.

    Args:
        payload: The payload.
        X_WH: Pose of the frame in which it is stated.
    """
    parts: list[Obstacle] = []
    for number, solid in enumerate(payload.shapes, start=1):
        X = X_WH @ solid.X_HG
        own: dict[str, Any] = {"name": f"{payload.name} {number}", "center": X.translation()}
        sizes = {"size": solid.size, "radius": solid.radius, "length": solid.length}
        own |= {key: value for key, value in sizes.items() if value is not None}
        if solid.kind == "capsule":
            half = 0.5 * own.pop("length") * X.rotation().col(2)
            center = own.pop("center")
            own["ends"] = (center - half, center + half)
        elif solid.kind != "ball":
            own["rpy"] = RollPitchYaw(X.rotation()).vector()
        parts.append(OBSTACLES[solid.kind](**own))
    return parts


@dataclass(frozen=True, eq=False)
class PhasedReading(SampledReading):
    """Readings of a law, of which one is stepped after the other.

    Its state holds that of the one that is stepped, each part at the front of a place for the
    longest of its name, and the number of its ``phase``.

    Attributes:
        readings: One for each phase.
        phases: The phases.
    """

    readings: tuple[SampledReading, ...]
    phases: tuple[Phase, ...]

    @cached_property
    def state(self) -> Layout:
        shapes: dict[str, tuple[int, ...]] = {}
        for reading in self.readings:
            for name, shape in reading.state.shapes.items():
                shapes[name] = max(shape, shapes.get(name, shape))
        return Layout(**shapes, phase=(1,))

    @property
    def inputs(self) -> Layout:
        return self.readings[0].inputs

    @property
    def inputs_with_gaps(self) -> tuple[str, ...]:  # type: ignore[override]
        """See `Reading.inputs_with_gaps`."""
        return self.readings[0].inputs_with_gaps

    def initial_state(self, rng: np.random.Generator, u: Signals) -> Array:
        return self._widen(0, self.readings[0].initial_state(rng, u))

    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        number = int(np.searchsorted(self._begins, t + 0.5 * period, side="right")) - 1
        now = int(self.state.part(x, "phase")[0])
        own = self._narrow(now, x)
        if number > now:
            own = self._begin(number, self.readings[now].state.by_name(own), u)
        return self._widen(number, self._steps[number](t, own, u, period))

    def _begin(self, number: int, parts: Signals, u: Signals) -> Array:
        """Return the state of a reading with which it begins, where the one before has ended.

        Args:
            number: Number of the reading.
            parts: The state of the one before, by name.
            u: Signals.

        Raises:
            InvalidInputError: If the arm is not at rest at the goal.
        """
        phase, reading, q = self.phases[number], self.readings[number], parts["commanded"]
        off, speed = float(np.abs(q - phase.posture).max()), float(np.abs(parts["v"]).max())
        if max(off, speed) > _AT_REST:
            raise InvalidInputError(
                f"{phase.key}: the arm is not at rest there at {phase.begin:.4g} s, but {off:.3g} "
                f"rad off and moves at {speed:.3g} rad/s: it was held back on its way; give a "
                "longer wait, or more room"
            )
        # A stop from rest moves nothing, whatever is kept apart from now on.
        fresh = reading.state.by_name(
            reading.initial_state(np.random.default_rng(0), {**u, "position": q})
        )
        return reading.state.from_parts(
            {**fresh, **{name: parts[name] for name in _GOES_ON if name in fresh}}
        )

    def diagnostics(self, t: float | Array, x: Array, u: Signals) -> Signals:
        return {}

    def caveats(self, metrics: Mapping[str, float]) -> list[str]:
        return self.readings[0].caveats(metrics)

    @cached_property
    def _begins(self) -> Array:
        return np.array([each.begin for each in self.phases])

    @cached_property
    def _steps(self) -> list[Any]:
        return [without_checks(reading.step) for reading in self.readings]

    def _narrow(self, number: int, x: Array) -> Array:
        """Return the state of a reading out of the whole one."""
        layout = self.readings[number].state
        parts = {n: self.state.part(x, n)[: shape[0]] for n, shape in layout.shapes.items()}
        return layout.from_parts(parts)

    def _widen(self, number: int, own: Array) -> Array:
        """Return the whole state with that of a reading."""
        parts = {name: np.zeros(shape) for name, shape in self.state.shapes.items()}
        for name, part in self.readings[number].state.by_name(own).items():
            parts[name][: len(part)] = part
        parts["phase"][0] = number
        return self.state.from_parts(parts)


@dataclass(frozen=True, eq=False)
class PlannedGoals:
    """Plans from a start to goals, one after the other.

    Attributes:
        legs: The plan to each goal.
        whole: What they are together, with the times of rest.
        phases: Parts of the run in which different pairs are kept apart; none if they are the same
            all along.
        places: Pose of the frame that holds the payload where it lies before and after it is held.
        openings: Motions of the gripper's joints, in order.
        doubts: What is not kept apart with the gripper as it was put, in sentences.
    """

    legs: tuple[MotionPlan, ...]
    whole: MotionPlan
    phases: tuple[Phase, ...] = ()
    places: tuple[RigidTransform | None, RigidTransform | None] = (None, None)
    openings: tuple[Opening, ...] = ()
    doubts: tuple[str, ...] = ()


# What happens to a payload that is not held any more.
_GIVES = ("release", "hand_over")


@contextmanager
def _naming(number: int) -> Iterator[None]:
    """Have errors of a plan begin with the number of its goal, or of that where it starts."""
    try:
        yield
    except InvalidInputError as error:
        where = f"goals.{number - 1}" if number else "start"
        text = re.sub(r"^start\b", where, re.sub(r"^goal\b", f"goals.{number}", str(error)))
        raise InvalidInputError(text) from None


def plan_goals(
    arm: Arm,
    goals: Sequence[Goal],
    start: Array,
    period: float,
    scene: PayloadScene,
    *,
    avoidance: Avoidance,
    seed: int,
) -> PlannedGoals:
    """Return plans from a goal to the next, what they are together, and the phases of the run.

    Args:
        arm: The arm, with what it holds.
        goals: The goals.
        start: Posture at the start, shape (n,) [rad].
        period: Time between two samples [s].
        scene: What the arm is to stay clear of.
        avoidance: How near the law that follows lets it come.
        seed: Seed of all random numbers.

    Raises:
        InvalidInputError: As `plan_motion` does, with the number of the goal; if something is
            attached or released that cannot be.
    """
    _require_order(arm, [goal.action for goal in goals])
    _require_supports(goals, [each.name for each in scene.obstacles])
    tour = _Tour(arm, goals, start, period, scene, avoidance, seed)
    for number in range(len(goals)):
        tour.go(number)
        tour.act(number)
    return tour.plans()


def _require_supports(goals: Sequence[Goal], known: list[str]) -> None:
    """Raise an InvalidInputError where a goal names a support that is no obstacle."""
    for number, goal in enumerate(goals):
        for each in sorted(set(goal.supports) - set(known)):
            hint = nearest(each, known) if known else "there are no obstacles"
            raise InvalidInputError(f"goals.{number}.supports: no obstacle {each!r}; {hint}")


class _Tour:
    """Plans from a goal to the next, as far as they are made; see `plan_goals`."""

    def __init__(
        self,
        arm: Arm,
        goals: Sequence[Goal],
        start: Array,
        period: float,
        scene: PayloadScene,
        avoidance: Avoidance,
        seed: int,
    ) -> None:
        self._arm, self._goals, self._scene, self._period = arm, goals, scene, period
        self._avoidance, self._seed = avoidance, seed
        self._events = [goal.action for goal in goals]
        self._before, self._after = _place_before(goals, scene, start), None
        self._is_held, self._opening = "attach" not in self._events, scene.opening_of(goals)
        self._q, self._legs = start, list[MotionPlan]()
        self._ways = list[Array]()
        self._phases, self._openings = list[Phase](), list[Opening]()
        # The goal where the next phase begins, and what happens there.
        self._last = "goals.0"
        self._event: str | None = None

    @property
    def _now(self) -> float:
        """Time up to which it is planned [s]."""
        return max(sum(map(len, self._ways)) - 1, 0) * self._period

    def _begin(self, clearance: Clearance | None, event: str | None) -> None:
        """Begin a phase with an event, if other pairs are kept apart from now on."""
        if clearance is None or (self._phases and clearance is self._phases[-1].clearance):
            return
        self._phases.append(Phase(self._now, self._q, clearance, self._last, event))

    def _rest(self, time: float) -> None:
        """Rest for a time, in whole samples that are not shorter [s]."""
        samples = ceil(time / self._period - 1e-9)
        self._ways.append(np.repeat(self._q[None], samples, axis=0))

    def _where(self, number: int) -> dict[str, Any]:
        """Return where the payload is on the way to a goal, or while a gripper moves there."""
        place = self._before if "attach" in self._events[number:] else self._after
        return {"place": place, "held": self._is_held}

    def go(self, number: int) -> None:
        """Plan the way to a goal."""
        goal, event = self._goals[number], self._events[number - 1] if number else None
        supports = self._goals[number - 1].supports if event == "attach" else []
        supports = supports + (goal.supports if goal.action in _GIVES else [])
        near = goal.action == "attach" or event == "release"
        what = {**self._where(number), "near": near, "supports": supports}
        with _naming(number):
            clearance = self._scene.clearance(**what, opening=self._opening)
        self._begin(clearance, self._event)
        with _naming(number):
            aim = (self._arm, goal.alone, self._q, self._period, clearance)
            plan = plan_motion(*aim, avoidance=self._avoidance, seed=self._seed)
        self._legs.append(plan)
        self._ways.append(plan.position if not self._ways else plan.position[1:])
        self._q, self._last, self._event = plan.position[-1], f"goals.{number}", goal.action
        self._rest(goal.rest)

    def act(self, number: int) -> None:
        """Let happen what happens at a goal."""
        goal = self._goals[number]
        if goal.action in _GIVES:
            self._is_held = False
            self._after = self._scene.place(self._q) if goal.action == "release" else None
        if goal.opening is not None:
            self._move_gripper(number, goal, goal.opening)
        if goal.action == "attach":
            self._is_held = True

    def _move_gripper(self, number: int, goal: Goal, opening: Mapping[str, float]) -> None:
        first, last = self._opening, {**self._opening, **opening}
        # What closes round a payload, or opens, may touch it.
        near = goal.action in ("attach", "release")
        what = {**self._where(number), "near": near, "supports": goal.supports}
        with _naming(number):
            moving = self._scene.moving(first, last, goal.moving, **what)
            _require_apart(moving, self._q, self._avoidance.floor)
        begin, gives = self._now, goal.action in _GIVES
        self._begin(moving, goal.action if gives else None)
        self._rest(goal.moving)
        if gives:
            self._event = None
        self._openings.append(Opening(begin, self._now, first, last))
        self._opening = last

    def plans(self) -> PlannedGoals:
        """Return the plans, what they are together, and the phases of the run."""
        goal = self._goals[-1]
        if goal.acts:
            near = goal.action == "release"
            what = {**self._where(len(self._goals)), "near": near, "supports": goal.supports}
            self._begin(self._scene.clearance(**what, opening=self._opening), self._event)
        if not any(self._events) and not self._openings:
            self._phases.clear()
        return PlannedGoals(
            tuple(self._legs),
            _one_plan(self._legs, self._ways),
            tuple(self._phases),
            (self._before, self._after),
            tuple(self._openings),
            tuple(self._scene.doubts),
        )


def _require_apart(clearance: Clearance | None, q: Array, floor: float) -> None:
    """Raise an InvalidInputError if something is too near a gripper that moves in a posture."""
    if clearance is None:
        return
    if (near := nearest_pair(clearance, q))[2] < floor:
        raise InvalidInputError(
            f"goal.opening: {how_near(*near)} on the gripper's way there, where {floor:g} m are "
            "kept, avoidance.floor"
        )


def _place_before(goals: Sequence[Goal], scene: PayloadScene, start: Array) -> Any:
    """Return where the payload lies before it is attached; None if it never is."""
    for number, goal in enumerate(goals):
        if goal.action == "attach":
            with _naming(number):
                return scene.place_at(goal, start)
    return None


def _one_plan(plans: Sequence[MotionPlan], ways: Sequence[Array]) -> MotionPlan:
    """Return plans that follow one another as one, with their positions and pauses."""
    return replace(
        plans[0],
        waypoints=np.concatenate([each.waypoints for each in plans]),
        position=np.concatenate(ways),
        steps=sum(each.steps for each in plans),
        wall_time=sum(each.wall_time for each in plans),
        doubtful_stops=sum(each.doubtful_stops for each in plans),
    )


class PayloadScene:
    """What an arm is to stay clear of while it holds something, and while that lies somewhere.

    Args:
        arm: The arm, with what it holds.
        obstacles: The obstacles.
        clearance: What the arm is to stay clear of while it holds it; None for nothing.
        posture: Posture in which the arm does not touch itself, shape (n,) [rad].
    """

    def __init__(
        self,
        arm: Arm,
        obstacles: Sequence[Obstacle],
        clearance: Clearance | None,
        posture: Array,
    ) -> None:
        self.arm, self.obstacles, self.posture = arm, obstacles, posture
        self._whole, self._free = clearance, dict[tuple[Any, ...], Clearance]()
        self._arms = dict[tuple[Any, ...], Arm]()
        #: What is not kept apart with the gripper as it was put, in sentences.
        self.doubts = list[str]()

    def clearance(
        self,
        place: RigidTransform | None,
        *,
        held: bool,
        near: bool,
        supports: Collection[str],
        opening: Mapping[str, float],
    ) -> Clearance | None:
        """Return what the arm is to stay clear of, the same object for the same.

        Args:
            place: Pose of the frame that holds the payload, where that lies; None if it is gone.
            held: Whether the arm holds it.
            near: Whether what all joints move may touch it, as a gripper does.
            supports: Names of obstacles that it may touch while it is held.
            opening: Where joints of the gripper are that move, by name [rad or m].
        """
        if self._whole is None:
            return None
        payload = self.arm.description.payload
        if held or payload is None:
            touching = frozenset(supports) if payload is not None else frozenset[str]()
            return self._clearance_with("" if payload is None else payload.name, touching, opening)
        left = [] if place is None else payload_obstacles(payload, place)
        key = (near, *_key(opening), *(each.corners.tobytes() for each in left))
        if key not in self._free:
            known = {each.name for each in self.obstacles}
            if twice := sorted(known & {each.name for each in left}):
                raise InvalidInputError(
                    f"obstacles: {twice[0]!r} is the name of a part of the payload where it lies; "
                    "give another one, or arm.payload.name"
                )
            bare = self._arm(opening, held=False)
            clearance = self._clearance_of(bare, [*self.obstacles, *left])
            if near:
                links = clearance.arm.links
                names = {each.name for each in left}
                clearance = _touching(clearance, links == links.max(), names)
            self._free[key] = clearance
        return self._free[key]

    def _clearance_with(
        self, name: str, supports: frozenset[str], opening: Mapping[str, float]
    ) -> Clearance:
        """Return what the arm is to stay clear of while it holds something on supports."""
        assert self._whole is not None
        whole = self._whole
        if _key(opening) != _key(self._opening(opening)):
            key: tuple[Any, ...] = ("whole", *_key(opening))
            if key not in self._free:
                arm = self._arm(opening, held=True)
                self._free[key] = self._clearance_of(arm, self.obstacles)
            whole = self._free[key]
        if not supports:
            return whole
        if (key := ("held", supports, *_key(opening))) not in self._free:
            is_payload = np.array([body == name for body in whole.arm.bodies])
            self._free[key] = _touching(whole, is_payload, supports)
        return self._free[key]

    def _clearance_of(self, arm: Arm, obstacles: Sequence[Obstacle]) -> Clearance:
        clearance, doubts = clearance_of(arm, obstacles, self.posture)
        # That fingers close on each other is what they are for.
        self.doubts += [each for each in doubts if each.count(GRIPPER) < 2]
        return clearance

    def moving(
        self,
        first: Mapping[str, float],
        last: Mapping[str, float],
        takes: float,
        place: RigidTransform | None,
        *,
        held: bool,
        near: bool,
        supports: Collection[str],
    ) -> Clearance | None:
        """Return what the arm is to stay clear of while its gripper moves.

        Args:
            first: Where joints of the gripper are before that, by name [rad or m].
            last: Where they are after it.
            takes: Time in which they move [s].
            place: Pose of the frame that holds the payload, as for `clearance`.
            held: Whether the arm holds it.
            near: Whether what all joints move may touch it.
            supports: Names of obstacles that it may touch while it is held.

        Raises:
            InvalidInputError: If they cannot move so.
        """
        self._require_motion(first, last, takes)
        what: dict[str, Any] = {"held": held, "near": near, "supports": supports}
        one, other = (self.clearance(place, opening=each, **what) for each in (first, last))
        if one is None or other is None:
            return None
        return clearance_between(self._arm(first, held=held), one, other, (first, last))

    def opening_of(self, goals: Sequence[Goal]) -> dict[str, float]:
        """Return where joints that move at goals are at the start, by name [rad or m]."""
        names = list[str]()
        for number, goal in enumerate(goals):
            with _naming(number):
                self._require_joints(goal.opening or {})
            names += goal.opening or {}
        return self._opening(names)

    def _opening(self, names: Iterable[str]) -> dict[str, float]:
        """Return where joints of the gripper are held in the arm's model."""
        return {name: self._joints[name].GetOnePosition(self._lock_context) for name in names}

    @cached_property
    def _lock_context(self) -> Context:
        return self.arm.gripper_contexts([{}])[0]

    @cached_property
    def _joints(self) -> dict[str, Joint]:
        """The joints of the gripper that turn or slide, by their names in its file."""
        plant = self.arm.gripper_plant
        return {
            joint.name().removeprefix(GRIPPER): joint
            for joint in map(plant.get_joint, plant.GetJointIndices())
            if joint.name().startswith(GRIPPER) and joint.num_positions() == 1
        }

    def _require_joints(self, names: Iterable[str]) -> None:
        """Raise an InvalidInputError if the gripper does not have joints of these names."""
        gripper = self.arm.description.gripper
        for name in names:
            if gripper is None:
                raise InvalidInputError("goal.opening: needs arm.gripper, whose joints move")
            if name not in self._joints:
                known = list(self._joints)
                raise InvalidInputError(
                    f"goal.opening: no joint {name!r} in {Path(gripper.model).name} that turns or "
                    f"slides; {nearest(name, known) if known else 'it has none'}"
                )

    def _arm(self, opening: Mapping[str, float], *, held: bool) -> Arm:
        """Return the arm with its gripper as it is then, with or without what it holds."""
        arm = self.arm if held else self._bare
        if _key(opening) == _key(self._opening(opening)):
            return arm
        if (key := (held, *_key(opening))) not in self._arms:
            try:
                self._arms[key] = arm.with_gripper_at(opening)
            except InvalidInputError as error:
                text = re.sub(r"^arm\.gripper\.lock\.", "goal.opening.", str(error))
                raise InvalidInputError(text) from None
        return self._arms[key]

    def _require_motion(
        self, first: Mapping[str, float], last: Mapping[str, float], takes: float
    ) -> None:
        """Raise an InvalidInputError if joints of the gripper cannot move so."""
        self._arm(last, held=False)
        one, other = self.arm.gripper_contexts((first, last))
        for name, joint in self._joints.items():
            way = abs(joint.GetOnePosition(other) - joint.GetOnePosition(one))
            most = float(joint.velocity_upper_limits()[0])
            if way > most * takes * (1.0 + 1e-9):
                raise InvalidInputError(
                    f"goal.opening_time: {name} takes at least {way / most:.3g} s for {way:.3g}, "
                    f"at its limit of {most:g} a second; not {takes:g} s"
                )
        self._require_still(one, other)

    def _require_still(self, one: Context, other: Context) -> None:
        """Raise an InvalidInputError if the gripper moves what the arm's motion is stated of."""
        plant, payload, frame = self.arm.gripper_plant, self.arm.description.payload, self.arm.frame
        held_by = frame if payload is None else payload.frame or frame
        for name, what in ((frame, "the task frame"), (held_by, "arm.payload.frame")):
            if not name.startswith(GRIPPER) or not plant.HasFrameNamed(name):
                continue
            between = {each.name() for each in joints_to(plant, plant.GetFrameByName(name).body())}
            if any(
                joint.GetOnePosition(one) != joint.GetOnePosition(other)
                for joint in self._joints.values()
                if joint.name() in between
            ):
                raise InvalidInputError(
                    f"goal.opening: moves {name.removeprefix(GRIPPER)!r}, {what}, which must stay "
                    "where it is on the arm"
                )

    def place(self, q: Array) -> RigidTransform:
        """Return the pose of the frame that holds the payload in a posture, shape (n,) [rad]."""
        return self._poses(q)[1]

    def place_at(self, goal: Goal, start: Array) -> RigidTransform:
        """Return that pose at a goal, of which the plan is not known yet.

        Args:
            goal: The goal, a posture, or a pose with an orientation.
            start: Posture at the start, shape (n,) [rad].
        """
        if goal.p_WE is None or goal.rpy is None:
            return self.place(goal_postures(self.arm, goal, start, seed=0)[0])
        ways = (X_WE.inverse() @ X_WH for X_WE, X_WH in map(self._poses, (start, start + 0.1)))
        X_EH, other = ways
        if not X_EH.IsNearlyEqualTo(other, 1e-9):
            raise InvalidInputError(
                "goal.action: must be at a posture, goal.q; arm.payload.frame moves beside the "
                "task frame, of which a pose is given"
            )
        return RigidTransform(RotationMatrix(rotation_of(goal.rpy)), goal.p_WE) @ X_EH

    def _poses(self, q: Array) -> tuple[RigidTransform, RigidTransform]:
        """Return the poses of the task frame and of the frame that holds the payload."""
        context, payload = self._plant.CreateDefaultContext(), self.arm.description.payload
        self._plant.SetPositions(context, self.arm.posture(self._plant, q))
        held_by = None if payload is None else payload.frame
        X_WE, X_WH = (
            self._plant.GetFrameByName(name).CalcPoseInWorld(context)
            for name in (self.arm.frame, held_by or self.arm.frame)
        )
        return X_WE, X_WH

    @cached_property
    def _plant(self) -> MultibodyPlant:
        return self.arm.plant()

    @cached_property
    def _bare(self) -> Arm:
        return self.arm.replace(payload=None)


def _key(opening: Mapping[str, float]) -> tuple[tuple[str, float], ...]:
    return tuple(sorted((name, float(position)) for name, position in opening.items()))


def _touching(clearance: Clearance, flags: Flags, names: Collection[str]) -> Clearance:
    """Return what an arm is to stay clear of, if some of its capsules may touch some obstacles.

    Args:
        clearance: What it is to stay clear of otherwise.
        flags: Which of its capsules may, shape (c,).
        names: Names of the obstacles.
    """
    numbers = [k for k, name in enumerate(clearance.solids.names) if name in names]
    pairs = frozenset((int(a), k) for a in np.flatnonzero(flags) for k in numbers)
    return replace(clearance, touching=clearance.touching | pairs)


def _require_order(arm: Arm, events: Sequence[str | None]) -> None:
    """Raise an InvalidInputError if things are attached or released that cannot be."""
    ends = [number for number, event in enumerate(events) if event is not None]
    if not ends:
        return
    first, *others = ends
    if arm.description.payload is None:
        raise InvalidInputError(
            f"goals.{first}.action: {events[first]} needs arm.payload, what the arm holds"
        )
    second = others[0] if others else first
    if len(ends) > 2 or (others and (events[first] != "attach" or events[second] == "attach")):
        raise InvalidInputError(
            f"goals.{ends[min(len(ends) - 1, 2)]}.action: a payload is attached once, and then "
            f"released or handed over once, not {', '.join(str(events[k]) for k in ends)}"
        )


class DrawnHandling(SceneItem):
    """A payload where it lies before it is attached and after it was released; else on the arm.

    Args:
        stage: Where it is drawn.
        handling: When it is held, and where it lies.
    """

    def __init__(self, stage: Stage, handling: Handling) -> None:
        self._stage, self._handling = stage, handling

    @property
    def _lying(self) -> dict[str, RigidTransform]:
        """Where it lies, by scene path."""
        places = {"/payload/before": self._handling.before, "/payload/after": self._handling.after}
        return {place: X_WH for place, X_WH in places.items() if X_WH is not None}

    @property
    def corners(self) -> Array:
        """Corners of boxes round it where it lies, shape (k, 3) [m]."""
        left = [part for X in self._lying.values() for part in self._handling.obstacles_at(X)]
        return np.concatenate([np.zeros((0, 3)), *(each.corners for each in left)])

    def draw(self) -> list[str]:
        """Draw it where it lies."""
        payload, meshcat = self._handling.payload, self._stage.meshcat
        for place, X_WH in self._lying.items():
            for number, solid in enumerate(() if payload is None else payload.shapes):
                meshcat.SetObject(f"{place}/{number}", solid.shape, _PAYLOAD)
                meshcat.SetTransform(f"{place}/{number}", X_WH @ solid.X_HG)
        return []

    def record(self, frames: Frames) -> None:
        """Record where it is seen."""
        arm, begin = self._stage.arm, self._stage.begin
        if self._handling.payload is None:
            return
        times = (
            self._handling.time_of("attach"),
            self._handling.time_of("release", "hand_over"),
        )
        attached, released = (None if t is None else t - begin for t in times)
        body = arm.plant.GetBodyByName(self._handling.payload.name)
        frames.show(arm.place(body), attached, released)
        if self._handling.before is not None:
            frames.show("/payload/before", None, attached)
        if self._handling.after is not None:
            frames.show("/payload/after", released)


class DrawnGripper(SceneItem):
    """The joints of a gripper that move.

    Args:
        stage: Where it is drawn.
        handling: When they move.
    """

    def __init__(self, stage: Stage, handling: Handling) -> None:
        self._stage, self._handling = stage, handling

    def record(self, frames: Frames) -> None:
        """Record where its bodies are in the frames."""
        motion, drawn = self._stage.motion, self._stage.arm
        arm = self._stage.experiment.arm
        times = (frames.time + self._stage.begin).tolist()
        openings = [self._handling.opening_at(t) for t in times]
        plant, contexts = arm.gripper_plant, arm.gripper_contexts(openings)
        base = plant.GetFrameByName(str(arm.description.gripper.mount))
        carrier = drawn.plant.GetBodyByName(base.body().name())
        bodies = [
            body
            for body in map(plant.get_body, map(BodyIndex, range(plant.num_bodies())))
            if body.name().startswith(GRIPPER)
        ]
        for frame, q in enumerate(motion.at(frames.time, motion.position)):
            drawn.set_posture(q)
            X_WM = drawn.X_WB(carrier)
            for body in bodies:
                X_MB = body.body_frame().CalcPose(contexts[frame], base)
                place = drawn.place(drawn.plant.GetBodyByName(body.name()))
                frames.recording.SetTransform(frame, place, X_WM @ X_MB)


class GoalsFeature(Feature):
    """The section ``goals``: what an arm attaches and releases on its way."""

    key = "goals"

    def moments(self, experiment: Any) -> Iterable[Moment]:
        handling = experiment.handling
        if handling is None:
            return []
        name = "" if handling.payload is None else handling.payload.name
        return [
            Moment(each.begin, f"{_EVENTS[each.event]} {name}")
            for each in handling.phases
            if each.event
        ] + [Moment(each.begin, f"moves its gripper: {each.ends}") for each in handling.openings]

    def observe(self, experiment: Any, run: EvaluationSteps) -> Mapping[str, Any]:
        """Return where joints of the gripper are that move, in the order of their names."""
        handling = experiment.handling
        if handling is None or not handling.openings:
            return {}
        names = sorted(handling.openings[0].first)
        openings = map(handling.opening_at, run.steps.time.tolist())
        return {"gripper_position": np.array([[now[n] for n in names] for now in openings])}

    def items(self, stage: Stage) -> Iterable[SceneItem]:
        if (handling := stage.experiment.handling) is not None:
            yield DrawnHandling(stage, handling)
            if handling.openings:
                yield DrawnGripper(stage, handling)

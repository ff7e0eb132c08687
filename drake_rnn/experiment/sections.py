"""What the sections of a document describe, each right by itself; no plant is built for it.

- Whether a target posture can be reached while the end effector stays.
- The joint targets that an experiment's document describes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from typing import Any

import numpy as np
from pydrake.math import RigidTransform
from pydrake.trajectories import Trajectory

from ..errors import InvalidInputError
from ..features.base import implied_limits
from ..features.contact import Contact, described_contact, pressed_solids
from ..features.handling import Handling, Opening, PayloadScene, Phase, PlannedGoals, plan_goals
from ..features.locks import JointLocks
from ..features.obstacles import MakePath, ObstacleMotions, make_safety, obstacle_motions
from ..features.pairs import refuse
from ..features.planning import plan_motion
from ..inputs.documents import construct
from ..inputs.fields import Array
from ..inputs.kinds import Modules
from ..inputs.messages import field_names, fields_of, nearest, plural
from ..laws import LAWS, Avoidance, Law, PostureLaw, Safety
from ..paths import JointTargets, Path, Rest, TargetPath
from ..robot.arm import Arm
from ..robot.clearance import Clearance
from ..robot.clearance.arm_clearance import clearance_of
from ..robot.clearance.model_obstacle import all_obstacles
from ..robot.clearance.obstacles import Obstacle
from ..robot.limits import OUTSIDE, JointLimits, degree_hint
from ..robot.load_arm import named_limits
from ..robot.postures import SelfMotion
from ..robot.task import Task, TaskSection, named_task
from ..systems import BODIES, Feedback, start_posture
from .components import Arms, described_path, make_law, path_of
from .document import ExperimentDocument, combination_of


def followed_targets(
    document: ExperimentDocument, kind: type[Law], arm: Arm, start: Array
) -> tuple[JointTargets | None, list[str]]:
    """Return the joint targets that a law follows, and warnings; None for a law of another kind.

    Args:
        document: Document of the experiment.
        kind: Class of its law.
        arm: The arm, with the limits of the experiment.
        start: Start posture, shape (n,) [rad].

    Raises:
        InvalidInputError: If targets are not those of the arm, or none comes during the run.
    """
    if not kind.follows_joint_targets or document.targets is None:
        return None, []
    targets = document.targets.of_arm(arm.joints, arm.units, start)
    if not targets.followed_targets.time.size:
        raise InvalidInputError(
            f"targets: none can be followed: each of {targets.time.size} has an entry that is no "
            "number"
        )
    if not (targets.followed_targets.time < document.duration).any():
        first, last = targets.time[[0, -1]]
        raise InvalidInputError(
            f"targets: none that is followed comes within the duration, {document.duration:g} s; "
            f"their times are {first:.10g} to {last:.10g} s; targets.begin: {first:.10g} begins "
            "there"
        )
    nearest_targets = targets.turned(start, arm.endless, arm.limits)
    doubts = [*_late(targets, document.duration), *_beyond_limits(nearest_targets, arm)]
    return nearest_targets, [*targets.notes, *_shorter_ways(targets, nearest_targets, arm), *doubts]


def _shorter_ways(targets: JointTargets, nearest_targets: JointTargets, arm: Arm) -> list[str]:
    """Return a warning about targets that jump by more than half a turn."""
    turns = nearest_targets.followed_targets.position - targets.followed_targets.position
    jumps = (np.abs(np.diff(turns, axis=0)) > np.pi).sum(axis=0)
    return [
        f"targets: {name} jumps by more than half a turn ({plural(count, 'time')}), and "
        "turns without end: it takes the shorter way"
        for name, count in zip(arm.joints, jumps, strict=True)
        if count
    ]


def _late(targets: JointTargets, duration: float, what: str = "targets: end") -> list[str]:
    """Return a warning about targets that come after the run."""
    if targets.time[-1] <= duration:
        return []
    return [f"{what} at {targets.time[-1]:g} s, and the run at {duration:g} s"]


def _beyond_limits(targets: JointTargets, arm: Arm) -> list[str]:
    """Return a warning about targets beyond the position limits."""
    targets_followed = targets.followed_targets
    beyond = arm.limits.violation(targets_followed.position)
    count = int((beyond > 0.0).any(axis=1).sum())
    if not count:
        return []
    k, joint = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
    in_degrees = arm.units[joint] == "rad" and beyond[k, joint] > np.pi
    hint = (
        "; for degrees give targets.angles: degrees, or [deg] in columns' names"
        if in_degrees
        else ""
    )
    return [
        f"targets: {count} of {len(beyond)} are beyond the position limits, {arm.joints[joint]} by "
        f"{beyond[k, joint]:.3g} {arm.units[joint]} at t = {targets_followed.time[k]:.4g} s; the "
        f"arm goes to its limits{hint}"
    ]


@dataclass(frozen=True)
class Sections:
    """The objects that the sections of a document describe.

    Each section is right by itself; whether they fit together, and whether the path is in reach, is
    not checked.

    Attributes:
        document: The document, with the plan that was found if it has a goal.
        task: What is asked of the end effector.
        feedback: Arm that the law sees.
        arm: The arm, with the limits of the experiment.
        start: Start posture, shape (n,) [rad].
        path: The path.
        targets: Joint targets that are followed; None for a law that follows none.
        law: The law.
        obstacles: What stands in the arm's way.
        clearance: What the arm is to stay clear of; None if distances are not looked at.
        safety: What is kept of the law's command; None if it is taken as it is.
        motions: How obstacles that may move do; None without any.
        contact: Contact of the tool with a surface; None without one.
        locks: When joints lock; None if none does.
        handling: What the arm attaches and releases on its way; None if it does not.
        warnings: Warnings about arm, limits, path and start.
    """

    document: ExperimentDocument
    task: Task
    feedback: Feedback
    arm: Arm
    start: Array
    path: Path
    targets: JointTargets | None
    law: Law
    obstacles: tuple[Obstacle, ...]
    clearance: Clearance | None
    motions: ObstacleMotions | None
    safety: Safety | None
    contact: Contact | None
    locks: JointLocks | None
    handling: Handling | None
    warnings: tuple[str, ...]


def read_sections(
    document: ExperimentDocument,
    arms: Arms,
    path: Path | Trajectory | None = None,
    modules: Modules = True,
    law: Law | None = None,
) -> Sections:
    """Return what the sections of a document describe; those that documents share are made once.

    Args:
        document: The document.
        arms: Arms that were loaded for other documents, with what else documents share.
        path: Path in place of the document's; see `make_experiment`, also for what follows.
        modules: Modules that may be imported.
        law: Law in place of the document's.

    Raises:
        InvalidInputError: If a key is wrong; the message names it, its value and what it may be.
    """
    task = named_task(document.task, modules)
    kind = type(law) if law is not None else _kind(document, arms, modules)
    feedback = _level(document)
    if law is None:
        refuse(combination_of(document, kind, task=task))
    described = [document.arm, document.limits]
    arm, joint_names = arms.share("arm", described, lambda: _limited_arm(document, arms))
    start = _start(document, arm)
    targets, followed, doubts = _followed(document, kind, arms, arm, start, path, modules)
    obstacles, notes = _obstacles(document, arms, arm)
    paths = partial(described_path, modules=modules)
    contact = _contact(document, modules, paths)
    clearance, unseen = _clearance(document, arms, arm, start, obstacles, contact)
    settings, plans, first_clearance = document, None, clearance
    if document.goals is not None or document.goal is not None:
        plans = _plan(document, arms, arm, start, obstacles, clearance)
        document, settings, (targets, followed, doubts) = plans.document, plans.settings, plans.aim
        first_clearance = plans.phases[0].clearance if plans.phases else clearance
    law = law or make_law(settings, kind, arm, start, first_clearance, task, modules)
    safety = make_safety(document.safety, law, arm.limits, document.period, start, clearance)
    _require_return(arm, start, law, safety is not None)
    return Sections(
        document=document,
        task=task,
        feedback=feedback,
        arm=implied_limits(arm),
        start=start,
        path=followed,
        targets=targets,
        law=law,
        obstacles=obstacles,
        clearance=clearance,
        safety=safety,
        motions=obstacle_motions(obstacles, clearance, document.duration, paths),
        contact=contact,
        locks=JointLocks.of_run(arm.joints, document.faults, document.duration),
        handling=None if plans is None else _handling(document, arm, law, plans),
        warnings=_once(joint_names, doubts, notes, unseen, _outside(arm, start)),
    )


def _obstacles(
    document: ExperimentDocument, arms: Arms, arm: Arm
) -> tuple[tuple[Obstacle, ...], list[str]]:
    """Return what stands in an arm's way, and notes; a scene may be in a frame of the arm."""
    section = document.obstacles or []
    has_scene = any(isinstance(one, Mapping) and one.get("kind") == "scene" for one in section)
    description = [section, document.arm if has_scene else None]
    return arms.share("obstacles", description, partial(all_obstacles, section, arm.pose_in_base))


def _once(*told: Iterable[str]) -> tuple[str, ...]:
    """Return sentences in their order, each once."""
    return tuple(dict.fromkeys(chain.from_iterable(told)))


def _contact(document: ExperimentDocument, modules: Modules, make_path: MakePath) -> Contact | None:
    """Return the contact of a document; None without one."""
    sections = document.environment, document.force, document.sensor
    level = BODIES[document.level]
    return described_contact(*sections, level, modules, document.duration, make_path)


def _start(document: ExperimentDocument, arm: Arm) -> Array:
    """Return the start posture, which may be given by its name, shape (n,) [rad].

    Whether it may lie outside the position limits depends on the law, see `_require_return`. Under
    an envelope of the velocity it may not: there is no stop outside.
    """
    section = document.start
    posture = arm.named_posture("start", section) if isinstance(section, str) else section
    try:
        return start_posture(arm, posture, OUTSIDE if arm.limits.envelope is None else 0.0)
    except InvalidInputError:
        # The message is to state the limits themselves.
        return start_posture(arm, posture)


def _require_return(arm: Arm, start: Array, law: Law, safe: bool) -> None:
    """Raise an InvalidInputError if a start is outside and nothing brings the arm back."""
    if not (isinstance(law, PostureLaw) or law.returns_inside or safe):
        start_posture(arm, start)


def _kind(document: ExperimentDocument, arms: Arms, modules: Modules) -> type[Law]:
    """Return the class of the law."""
    # Searching the installed packages for it takes longer than everything else here.
    kind = document.law.get("kind")
    return arms.share("kind", kind, lambda: LAWS.named_by(document.law, modules))


def _clearance(
    document: ExperimentDocument,
    arms: Arms,
    arm: Arm,
    start: Array,
    obstacles: tuple[Obstacle, ...],
    contact: Contact | None,
) -> tuple[Clearance | None, tuple[str, ...]]:
    """Return what the arm is to stay clear of, and warnings about it."""
    if document.obstacles is None and not (document.safety and document.safety.collisions):
        return None, ()
    # Of an arm without a home, what touches at the start is not looked at.
    posture = start if arm.home is None else arm.home
    contact_place = None if contact is None else [document.environment, start.tolist()]

    def made() -> tuple[Clearance, tuple[str, ...]]:
        pressed_names, unseen = pressed_solids(contact, arm, start)
        clearance, doubts = clearance_of(arm, obstacles, posture, pressed_names)
        return clearance, (*doubts, *unseen)

    description = [document.arm, posture.tolist(), document.obstacles, contact_place]
    return arms.share("clearance", description, made)


_Aim = tuple[JointTargets | None, Path, list[str]]


def _followed(
    document: ExperimentDocument,
    kind: type[Law],
    arms: Arms,
    arm: Arm,
    start: Array,
    path: Path | Trajectory | None,
    modules: Modules,
) -> _Aim:
    """Return joint targets and path of a document, which a goal makes later, and doubts of them."""
    targets, doubts = followed_targets(document, kind, arm, start)
    if targets is not None:
        return targets, TargetPath(targets), doubts
    if document.goal is not None or document.goals is not None:
        return None, Rest(), doubts
    return None, *path_of(document, arms, issubclass(kind, PostureLaw), path, modules)


@dataclass(frozen=True, eq=False)
class _Plans:
    """What follows from the goals of a document.

    Attributes:
        document: The document with the plans.
        settings: That of the law which follows.
        aim: What is followed.
        phases: Parts of the run in which different pairs are kept apart; none if they are the same
            all along.
        places: Where a payload lies before and after it is held.
        openings: Motions of the gripper's joints.
    """

    document: ExperimentDocument
    settings: ExperimentDocument
    aim: _Aim
    phases: tuple[Phase, ...]
    places: tuple[RigidTransform | None, ...]
    openings: tuple[Opening, ...]


def _plan(
    document: ExperimentDocument,
    arms: Arms,
    arm: Arm,
    start: Array,
    obstacles: tuple[Obstacle, ...],
    clearance: Clearance | None,
) -> _Plans:
    """Return a document with the plans to its goals, and what follows from them.

    A plan is made once for all that ask for the same.
    """
    several = document.goals is not None
    goals = document.goals or ([] if document.goal is None else [document.goal])
    period, seed = document.period, document.seed
    assert period is not None
    for name in ("interval", "pursues", "timeout"):
        if name in document.law:
            raise InvalidInputError(f"law.{name}: follows from the goal; leave it out")
    avoidance = construct(Avoidance, document.law.get("avoidance", {}), "law.avoidance")
    place = [document.arm, document.limits, start.tolist(), document.obstacles]
    sought = [several, *map(fields_of, goals)]
    description = [*place, sought, period, fields_of(avoidance), document.environment, seed]

    def make() -> PlannedGoals:
        if not several:
            aim = (arm, goals[0], start, period, clearance)
            plan = plan_motion(*aim, avoidance=avoidance, seed=seed)
            return PlannedGoals((plan,), plan)
        posture = start if arm.home is None else arm.home
        scene = PayloadScene(arm, obstacles, clearance, posture)
        return plan_goals(arm, goals, start, period, scene, avoidance=avoidance, seed=seed)

    plans = arms.share("plan", description, make)
    key, plan = "goals" if several else "goal", plans.whole
    doubts = _late(plan.course, document.duration, f"{key}: the plan ends")
    doubts += plans.doubts
    if count := plan.doubtful_stops:
        doubts.append(
            f"{key}: at {plural(count, 'sample')} a stop from the plan is not free, however slow "
            "it is; the law may leave the plan, or wait there"
        )
    known = [
        replace(goal, via=list(each.waypoints[1:]))
        for goal, each in zip(goals, plans.legs, strict=True)
    ]
    return _Plans(
        replace(document, **({"goals": known} if several else {"goal": known[0]})),
        replace(document, law={**document.law, **plan.stream}),
        (plan.targets(document.duration), TargetPath(plan.course), doubts),
        plans.phases,
        plans.places,
        plans.openings,
    )


def _handling(document: ExperimentDocument, arm: Arm, law: Law, plans: _Plans) -> Handling | None:
    """Return what an arm attaches and releases on its way; None if it does not."""
    payload, period = arm.description.payload, document.period
    if period is None or not plans.phases:
        return None
    before, after = plans.places
    return Handling(plans.phases, law, period, payload, before, after, plans.openings)


def _level(document: ExperimentDocument) -> Feedback:
    """Return the arm that the law sees; the plant is checked against the level."""
    body = BODIES[document.level]
    body.check_plant(document.plant, document.period)
    return body.chosen_feedback(document.feedback, has_sensing=document.sensing is not None)


def _limited_arm(document: ExperimentDocument, arms: Arms) -> tuple[Arm, tuple[str, ...]]:
    """Return the arm with the limits of the experiment, and warnings about both."""
    own_arm = arms.of(document.arm)
    limits = _limits(own_arm, document.limits)
    arm = own_arm.with_limits(limits)
    doubts = (*_warn_of_wider_limits(own_arm, limits), *_list_faster_limits(own_arm, limits))
    return arm, (*arm.warnings, *doubts)


def _limits(arm: Arm, bounds: Mapping[str, Any] | str) -> JointLimits:
    if isinstance(bounds, str):
        return JointLimits.unlimited(arm.n) if bounds == "none" else named_limits(bounds, arm)
    names = list(field_names(JointLimits))
    for name, entries in bounds.items():
        if name not in names:
            raise InvalidInputError(f"limits.{name}: no such key; " + nearest(name, names))
        if isinstance(entries, (list, np.ndarray)) and len(entries) != arm.n:
            raise InvalidInputError(
                f"limits.{name}: must have {arm.n} entries, one per joint of {arm.name}, not "
                f"{len(entries)}"
            )
    return construct(JointLimits, arm.limits.merge(bounds), "limits")


def _warn_of_wider_limits(arm: Arm, limits: JointLimits) -> list[str]:
    """Return a warning if the position limits exceed what the arm itself can do."""
    if not np.isfinite(limits.position_upper - limits.position_lower).any():
        return []
    lower, upper = arm.limits.position_lower, arm.limits.position_upper
    # Where neither has a limit, infinity is taken from infinity.
    with np.errstate(invalid="ignore"):
        beyond = np.maximum(lower - limits.position_lower, limits.position_upper - upper)
    beyond[np.isnan(beyond)] = 0.0
    worst = int(np.argmax(beyond))
    if beyond[worst] <= 1e-3:
        return []
    hint = degree_hint((*limits.position_lower, *limits.position_upper), arm.units[worst])
    return [
        f"limits: {arm.joints[worst]} may go {beyond[worst]:.3g} {arm.units[worst]} beyond the "
        f"limits of {arm.name}, {lower[worst]:.4g} to {upper[worst]:.4g} {arm.units[worst]}{hint}"
    ]


# How much faster than its maker says an arm may be before a warning.
_FASTER = 10.0


def _list_faster_limits(arm: Arm, limits: JointLimits) -> list[str]:
    """Return a warning if velocities are far beyond those of the arm itself."""
    both = arm.limits.sides("velocity").largest, limits.sides("velocity").largest
    own, requested = np.broadcast_arrays(*both)
    finite = np.isfinite(own) & np.isfinite(requested)
    ratio = np.divide(requested, own, out=np.zeros(own.shape), where=finite)
    worst = int(np.argmax(ratio))
    if ratio[worst] <= _FASTER:
        return []
    return [
        f"limits: {arm.joints[worst]} may be {ratio[worst]:.3g} times as fast as {arm.name} says, "
        f"{own[worst]:.4g} {arm.units[worst]}/s{degree_hint(requested, arm.units[worst])}"
    ]


def _outside(arm: Arm, start: Array) -> list[str]:
    """Return a warning for each joint that starts outside its limits."""
    return [
        f"start: {name} is at {q:.6g} {unit}, {excess:.3g} {unit} outside its limits; it is "
        "brought back"
        for name, unit, q, excess in zip(
            arm.joints, arm.units, start, arm.limits.violation(start), strict=True
        )
        if excess > 0
    ]


# Largest displacement [m] and rotation [rad] of the end effector in a target posture, and largest
# distance of a joint from where the self-motion towards the target ends [rad]. With a larger miss
# the law would trade one error for the other.
_MISS, _TURN, _SHORT = 1e-4, 1e-3, 0.01


def with_reachable_target(parts: Sections) -> tuple[Law, list[str]]:
    """Return the law with a target posture that can be reached, if it has one, and warnings.

    Args:
        parts: What the sections of the experiment's document describe.

    Raises:
        InvalidInputError: If no self-motion leads to it and ``on_unreachable`` is ``refuse``.
    """
    if not isinstance(parts.law, PostureLaw):
        return parts.law, []
    arm, own_target = parts.arm, parts.law.target
    goal = arm.limits.nearest_turn(own_target, parts.start, arm.endless)
    shorter = [
        f"law.target: {name} turns without end and takes the shorter way, to {to:.6g} rad in place "
        f"of {value:.6g} rad"
        for name, to, value in zip(arm.joints, goal, own_target, strict=True)
        if to != value
    ]
    target, changes = _reachable(parts.document, arm, parts.start, goal)
    return replace(parts.law, target=target), [*shorter, *changes]


def _reachable(
    document: ExperimentDocument, arm: Arm, start: Array, target: Array
) -> tuple[Array, list[str]]:
    """Return the target posture to seek, shape (n,) [rad], and warnings about it."""
    motion = SelfMotion(arm, start, document.task)
    if motion.free_dimensions == 0:
        raise InvalidInputError(
            f"task: {document.task} leaves {arm.name} no self-motion at its start: with its "
            f"{arm.n} joints, 0 free dimensions remain"
        )
    closest = motion.towards(target)
    _require_plane(document.task, arm, start, closest)
    short = np.abs(closest - target)
    distance, angle = motion.distance(target), motion.angle(target)
    if distance <= _MISS and angle <= _TURN and short.max() <= _SHORT:
        return target, _detours(arm, start, target)
    faults = []
    if distance > _MISS:
        faults.append(f"moves the end effector {distance:.3g} m from where it starts")
    if angle > _TURN:
        faults.append(f"turns it by {angle:.3g} rad")
    if not faults:
        faults.append("is not reached by the self-motion from the start, which gets stuck")
    worst = int(np.argmax(short))
    lower, upper = arm.limits.position_lower, arm.limits.position_upper
    what = (
        f"law.target: {' and '.join(faults)}; the nearest posture that can be reached is "
        f"[{', '.join(map(_format_position, closest, lower, upper))}], {short[worst]:.3g} rad off "
        f"in {arm.joints[worst]}"
    )
    if arm.limits.violation(closest).any():
        raise InvalidInputError(f"{what}, which is outside its limits; start nearer to them")
    if document.on_unreachable == "refuse":
        raise InvalidInputError(f"{what}; give that, or on_unreachable: project")
    return closest, [f"{what}; that one is used instead", *_detours(arm, start, closest)]


def _require_plane(task: TaskSection, arm: Arm, start: Array, target: Array) -> None:
    """Raise an InvalidInputError if the end effector leaves the plane of a planar task."""
    kinematics = arm.kinematics()
    displacement = np.abs(kinematics.p_WE(target) - kinematics.p_WE(start))
    displacement[list(named_task(task).axes)] = 0.0
    if displacement.max() > _MISS:
        raise InvalidInputError(
            f"task: {task} leaves the end effector free along "
            f"{'xyz'[int(np.argmax(displacement))]}, by {displacement.max():.3g} m on the way to "
            "law.target; hold it with task: xyz"
        )


def _format_position(q: float, lower: float, upper: float) -> str:
    """Return a joint position to six decimals, or exactly if rounding would break its limits."""
    text = f"{q:.6f}"
    return text if lower <= float(text) <= upper else repr(float(q))


def _detours(arm: Arm, start: Array, target: Array) -> list[str]:
    """Return warnings for joints that turn by more than pi although a shorter way exists."""
    other = target - 2 * np.pi * np.round((target - start) / (2 * np.pi))
    lower, upper = arm.limits.position_lower, arm.limits.position_upper
    detour = (np.abs(target - start) > np.pi) & (lower <= other) & (other <= upper)
    return [
        f"law.target: {name} has to turn by {abs(to - begin):.3g} rad; at {near:.6g} rad the "
        "posture is the same, and nearer"
        for name, begin, to, near, so in zip(arm.joints, start, target, other, detour, strict=True)
        if so
    ]

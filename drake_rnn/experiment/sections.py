"""What the sections of a document describe, each right by itself; no plant is built for it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.trajectories import Trajectory

from ..errors import InvalidInputError
from ..features.locks import JointLocks
from ..features.pairs import refuse
from ..inputs.complaints import nearest
from ..inputs.dataclass_fields import field_names
from ..inputs.documents import construct
from ..inputs.fields import Array
from ..inputs.modules import Modules
from ..laws import LAWS, Law, PostureLaw, Safety
from ..paths import JointTargets, Path, TargetPath
from ..robot.arm import Arm
from ..robot.clearance import Clearance
from ..robot.clearance.arm_clearance import arm_clearance
from ..robot.clearance.described_obstacles import make_obstacles
from ..robot.clearance.obstacles import Obstacle
from ..robot.limits import JointLimits
from ..robot.load_arm import named_limits
from ..systems import BODIES, Contact, Feedback, ObstacleMotions, start_posture
from .arms import Arms
from .document import ExperimentDocument, combination_of
from .law import make_law
from .moving import obstacle_motions
from .path import path_of
from .pressed import described_contact, pressed_solids
from .safety import make_safety
from .targets import followed_targets

#: How far the start may lie outside the position limits for a law that brings it back [rad].
OUTSIDE = 0.1


@dataclass(frozen=True)
class Sections:
    """The objects that the sections of a document describe.

    Each section is right by itself; whether they fit together, and whether the path is in reach, is
    not checked.

    Attributes:
        document: The document.
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
        warnings: Warnings about arm, limits, path and start.
    """

    document: ExperimentDocument
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
    warnings: tuple[str, ...]


def read_sections(
    document: ExperimentDocument,
    arms: Arms,
    path: Path | Trajectory | None = None,
    modules: Modules = True,
) -> Sections:
    """Return what the sections of a document describe; those that documents share are made once.

    Args:
        document: The document.
        arms: Arms that were loaded for other documents, with what else documents share.
        path: Path in place of the document's; see `make_experiment`.
        modules: Modules that may be imported; see `make_experiment`.

    Raises:
        InvalidInputError: If a key is wrong; the message names it, its value and what it may be.
    """
    # Searching the installed packages for a law takes longer than everything else here.
    kind = arms.shared(
        "kind", document.law.get("kind"), lambda: LAWS.named_by(document.law, modules)
    )
    feedback = _level(document)
    refuse(combination_of(document, kind))
    arm, known = arms.shared(
        "arm", [document.arm, document.limits], lambda: _limited_arm(document, arms)
    )
    seeks_posture = issubclass(kind, PostureLaw)
    start = start_posture(arm, document.start, OUTSIDE if seeks_posture else 0.0)
    targets, doubts = followed_targets(document, kind, arm)
    if targets is None:
        path, doubts = path_of(document, arms, seeks_posture, path, modules)
    else:
        path = TargetPath(targets)
    given = document.obstacles or []
    obstacles = arms.shared("obstacles", given, lambda: tuple(make_obstacles(given)))
    contact = described_contact(document, modules)
    clearance, unseen = _clearance(document, arms, arm, start, obstacles, contact)
    law = make_law(document, kind, arm.limits, start, clearance)
    safety = make_safety(document.safety, law, arm.limits, document.period, start, clearance)
    motions = _motions(document, obstacles, clearance, modules)
    warnings = (*known, *doubts, *unseen, *_outside(arm, start))
    return Sections(
        document=document,
        feedback=feedback,
        arm=arm,
        start=start,
        path=path,
        targets=targets,
        law=law,
        obstacles=obstacles,
        clearance=clearance,
        safety=safety,
        motions=motions,
        contact=contact,
        locks=JointLocks.of_run(arm.joints, document.faults, document.duration),
        warnings=warnings,
    )


def _motions(
    document: ExperimentDocument,
    obstacles: tuple[Obstacle, ...],
    clearance: Clearance | None,
    modules: Modules,
) -> ObstacleMotions | None:
    """Return how the obstacles move that may, in the order of the law's signal; None without."""
    if clearance is None or not clearance.solids.moving.size:
        return None
    numbers = {obstacle.name: k for k, obstacle in enumerate(obstacles)}
    found = [numbers[clearance.solids.names[k]] for k in clearance.solids.moving]
    return obstacle_motions([(k, obstacles[k]) for k in found], document.duration, modules)


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
    placed = None if contact is None else [document.environment, start.tolist()]

    def made() -> tuple[Clearance, tuple[str, ...]]:
        pressed, unseen = pressed_solids(contact, arm, start)
        found, doubts = arm_clearance(arm, obstacles, posture, pressed)
        return found, (*doubts, *unseen)

    said = [document.arm, posture.tolist(), document.obstacles, placed]
    return arms.shared("clearance", said, made)


def _level(document: ExperimentDocument) -> Feedback:
    """Return the arm that the law sees; feedback and plant are checked against the level."""
    body, sensed = BODIES[document.level], document.sensing is not None
    feedback = body.chosen_feedback(document.feedback, sensed=sensed)
    body.check_loop(document.period, feedback, sensed=sensed)
    body.check_plant(document.plant, document.period)
    return feedback


def _limited_arm(document: ExperimentDocument, arms: Arms) -> tuple[Arm, tuple[str, ...]]:
    """Return the arm with the limits of the experiment, and warnings about both."""
    published = arms.of(document.arm)
    limits = _limits(published, document.limits)
    arm = published.with_limits(limits)
    return arm, (*arm.warnings, *_widened(published, limits))


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
    return construct(JointLimits, arm.limits.merged(bounds), "limits")


def _widened(arm: Arm, limits: JointLimits) -> list[str]:
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
    return [
        f"limits: {arm.joints[worst]} may go {beyond[worst]:.3g} {arm.units[worst]} beyond the "
        f"limits of {arm.name}, {lower[worst]:.4g} to {upper[worst]:.4g} {arm.units[worst]}"
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

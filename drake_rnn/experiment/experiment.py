"""An experiment: the objects made from a document, checked as a whole."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pydrake.trajectories import Trajectory

from ..diagrams import check_sensing
from ..errors import InvalidInputError
from ..inputs.complaints import nearest
from ..inputs.dataclass_fields import field_names
from ..inputs.documents import construct
from ..inputs.fields import Array
from ..inputs.modules import Modules
from ..laws import LAWS, Circumstances, Law, PostureLaw
from ..laws.checks import warnings_of
from ..paths import Path, PlacedPath, as_path
from ..robot.arm import Arm
from ..robot.kinematics import ArmKinematics
from ..robot.limits import JointLimits
from ..robot.task import Task, named_task
from ..systems import BODIES, Body, Contact, Feedback, PlantSettings, start_posture
from .arms import Arms
from .contact import make_contact
from .document import ExperimentDocument
from .filter import FilterDelay, filter_delay, kept_limits, loop_delay_doubts
from .law import make_law
from .path import GIVEN, doubts_of_path, path_of
from .target import reachable_target

#: How far the start may lie outside the position limits for a law that brings it back [rad].
OUTSIDE = 0.1


@dataclass(frozen=True, eq=False)
class Experiment:
    """The objects that an experiment consists of.

    Attributes:
        document: The document as it was written.
        arm: The arm, with the limits of the experiment.
        law: The law.
        path: The path.
        desired: The path placed at the start: the desired motion of the end effector.
        start: Start posture, shape (n,) [rad].
        p_WE_start: Position of the end effector at the start, shape (3,) [m].
        R_WE_start: Orientation of the end effector at the start, shape (3, 3).
        contact: Contact of the tool with a surface; None without one.
        feedback: Arm that the law sees.
        path_delay: Delay with which the arm follows the path [s].
        warnings: Warnings about the document and the objects.
    """

    document: ExperimentDocument
    arm: Arm
    law: Law
    path: Path
    desired: PlacedPath
    start: Array
    p_WE_start: Array
    R_WE_start: Array
    contact: Contact | None
    feedback: Feedback
    path_delay: float
    warnings: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Name of the experiment."""
        return self.document.name

    def last_lap(self, until: float, delay: float | None = None) -> float | None:
        """Return the time at which the last whole lap of a run began [s]; None without one.

        Args:
            until: Time at which the run ends [s].
            delay: Delay with which the path is followed [s]; by default ``path_delay``.
        """
        delay = self.path_delay if delay is None else delay
        began = self.desired.last_lap(until - delay)
        # The first lap begins with the run, whatever the delay.
        return began + delay if began is not None and began > 0.0 else began

    @property
    def limits(self) -> JointLimits:
        """Joint limits of the experiment, those of its arm."""
        return self.arm.limits

    def with_path(self, path: Path | Trajectory) -> Experiment:
        """Return the same experiment along another path, made in Python or a Drake trajectory.

        Raises:
            InvalidInputError: As `make_experiment` does.
        """
        return make_experiment(self.document, path)

    @property
    def kept_limits(self) -> tuple[str, ...]:
        """Names of the limits of the arm that the law or a filter behind it keeps by construction.

        None of an arm that does not move as it is told, because of its motors or of a noise.
        """
        dither = self.document.dither
        if self.level.has_motors or (dither is not None and dither.model == "actuated"):
            return ()
        return kept_limits(self.document, self.feedback, self.limits, self.law)

    @property
    def target(self) -> Array | None:
        """Target posture of the law, shape (n,) [rad]; None without one."""
        return self.law.target if isinstance(self.law, PostureLaw) else None

    @property
    def holds_orientation(self) -> bool:
        """Whether the end effector is to keep its orientation, or to turn along with its path."""
        return self.task.with_orientation or "R_WE_desired" in self.law.inputs

    @property
    def task(self) -> Task:
        """Task of the end effector."""
        return named_task(self.document.task)

    @property
    def level(self) -> type[Body]:
        """Class of the body that simulates the arm."""
        return BODIES[self.document.level]


def make_experiment(
    document: Mapping[str, Any] | ExperimentDocument,
    path: Path | Trajectory | None = None,
    *,
    modules: Modules = True,
    arms: Arms | None = None,
) -> Experiment:
    """Return the experiment that a document describes, checked as a whole.

    Args:
        document: The document, or its contents as plain data.
        path: Path made in Python, or a trajectory of Drake's, in place of the document's; the
            experiment's document then only says that one was given.
        modules: Modules that may be imported for a ``kind`` of the form ``module:Class``: True for
            any, False for none, or their names. What has been imported already may be used.
        arms: Arms that were loaded for other experiments, with what else they share; what is
            missing is added.

    Raises:
        InvalidInputError: If a key is wrong; the message names it, its value and what it may be.
    """
    document = _checked(document, path is not None)
    arms = Arms() if arms is None else arms
    feedback = _feedback(document)
    _require_plant(document)
    arm, known = limited_arm(document, arms)
    warnings = list(known)
    kind = arms.shared(
        "kind", document.law.get("kind"), lambda: LAWS.named_by(document.law, modules)
    )
    seeks_posture = issubclass(kind, PostureLaw)
    start = start_posture(arm, document.start, OUTSIDE if seeks_posture else 0.0)
    path = _path(document, seeks_posture, as_path(path), modules, arms)
    law = make_law(document, kind, arm.limits, start)
    check_sensing(document.sensing, law)
    delay = filter_delay(document, feedback, arm.limits, law)
    warnings += doubts_of_path(path, document.duration)
    warnings += [*_outside(arm, start), *loop_delay_doubts(document, law, delay.loop)]
    law, changes = _with_reachable_target(document, arm, start, law)
    warnings += changes
    kinematics = arms.shared("kinematics", document.arm, arm.kinematics)
    desired = path.placed_by(kinematics, start)
    _require_orientation_seen(law, desired)
    contact, doubts = make_contact(document, law, desired, arm, start, modules)
    found = Experiment(
        document=document,
        arm=arm,
        law=law,
        path=path,
        desired=desired,
        start=start,
        p_WE_start=kinematics.p_WE(start),
        R_WE_start=kinematics.R_WE(start),
        contact=contact,
        feedback=feedback,
        path_delay=delay.path,
    )
    circumstances = _circumstances(found, delay, kinematics)
    unsure = warnings_of(law, "doubts", lambda: law.doubts(circumstances))
    return replace(found, warnings=(*warnings, *unsure, *doubts))


def _path(
    document: ExperimentDocument,
    seeks_posture: bool,
    given: Path | None,
    modules: Modules,
    arms: Arms,
) -> Path:
    """Return the path of an experiment, the same for all that describe the same one."""
    if given is not None:
        return path_of(document, seeks_posture, given, modules)
    return arms.shared(
        "path",
        [document.path, document.on_unreachable, seeks_posture],
        lambda: path_of(document, seeks_posture, None, modules),
    )


def _circumstances(
    experiment: Experiment, delay: FilterDelay, kinematics: ArmKinematics
) -> Circumstances:
    """Return what a law may have doubts about."""
    desired, contact = experiment.desired, experiment.contact
    offset = J = None
    if experiment.target is None:
        position = experiment.task.position
        offset = position(desired.position(0.0)[0] - experiment.p_WE_start)
        J = position(kinematics.J(experiment.start))
    return Circumstances(
        loop_delay=delay.loop,
        reference_is_delayed=delay.path > 0.0,
        pressing_force=None if contact is None else contact.force.value,
        path_turns=desired.turns,
        start_offset=offset,
        J=J,
        task_J=lambda q: experiment.task.J(kinematics, q),
    )


def _checked(
    document: Mapping[str, Any] | ExperimentDocument, path_is_given: bool
) -> ExperimentDocument:
    """Return a document whose keys were checked; with a path made in Python it only says so."""
    if not isinstance(document, ExperimentDocument):
        document = construct(ExperimentDocument, document, "")
    return replace(document, path=GIVEN) if path_is_given else document


def _with_reachable_target(
    document: ExperimentDocument, arm: Arm, start: Array, law: Law
) -> tuple[Law, list[str]]:
    """Return the law with a target posture that can be reached, if it has one, and warnings."""
    if not isinstance(law, PostureLaw):
        return law, []
    target, changes = reachable_target(document, arm, start, law.target)
    return replace(law, target=target), changes


def _feedback(document: ExperimentDocument) -> Feedback:
    """Return the arm that the law sees, checked against the level."""
    body = BODIES[document.level]
    sensed = document.sensing is not None
    feedback = body.chosen_feedback(document.feedback, sensed=sensed)
    body.check_loop(document.period, feedback, sensed=sensed)
    return feedback


def _require_plant(document: ExperimentDocument) -> None:
    """Raise an InvalidInputError if the level has no plant, or the plant is too slow."""
    if BODIES[document.level].has_motors:
        (document.plant or PlantSettings()).check_period(document.period)
    elif document.plant is not None:
        raise InvalidInputError("plant: only at level: dynamic")


def _require_orientation_seen(law: Law, desired: PlacedPath) -> None:
    """Raise an InvalidInputError for an orientation along the path that the law does not see."""
    if desired.turns and "R_WE_desired" not in law.inputs:
        raise InvalidInputError(
            "path: carries an orientation, which this law does not see; give task: pose, or a law "
            "with the input R_WE_desired, or leave the orientation out"
        )


def _widened(arm: Arm, limits: JointLimits) -> list[str]:
    """Return a warning if the position limits exceed what the arm itself can do."""
    if not np.isfinite(limits.position_upper - limits.position_lower).any():
        return []
    # Where neither has a limit, infinity is taken from infinity.
    with np.errstate(invalid="ignore"):
        beyond = np.maximum(
            arm.limits.position_lower - limits.position_lower,
            limits.position_upper - arm.limits.position_upper,
        )
    beyond[np.isnan(beyond)] = 0.0
    worst = int(np.argmax(beyond))
    if beyond[worst] <= 1e-3:
        return []
    return [
        f"limits: {arm.joints[worst]} may go {beyond[worst]:.3g} {arm.units[worst]} beyond the "
        f"limits of {arm.name}, {arm.limits.position_lower[worst]:.4g} to "
        f"{arm.limits.position_upper[worst]:.4g} {arm.units[worst]}"
    ]


def _outside(arm: Arm, start: Array) -> list[str]:
    return [
        f"start: {name} is at {q:.6g} {unit}, {excess:.3g} {unit} outside its limits; it is "
        "brought back"
        for name, unit, q, excess in zip(
            arm.joints, arm.units, start, arm.limits.violation(start), strict=True
        )
        if excess > 0
    ]


def limited_arm(document: ExperimentDocument, arms: Arms) -> tuple[Arm, tuple[str, ...]]:
    """Return the arm with the limits of the experiment, and warnings about both.

    Documents that say the same of arm and limits share it.

    Args:
        document: Document of the experiment.
        arms: Arms that were loaded before.

    Raises:
        InvalidInputError: If a key of arm or limits is wrong.
    """

    def made() -> tuple[Arm, tuple[str, ...]]:
        published = arms.of(document.arm)
        limits = _limits(published, document.limits)
        arm = published.with_limits(limits)
        return arm, (*arm.warnings, *_widened(published, limits))

    return arms.shared("arm", [document.arm, document.limits], made)


def _limits(arm: Arm, bounds: Mapping[str, Any] | str) -> JointLimits:
    if isinstance(bounds, str):
        return JointLimits.unlimited(arm.n)
    names = list(field_names(JointLimits))
    for name in bounds:
        if name not in names:
            raise InvalidInputError(f"limits.{name}: no such key; " + nearest(name, names))
        entries = bounds[name]
        if isinstance(entries, (list, np.ndarray)) and len(entries) != arm.n:
            raise InvalidInputError(
                f"limits.{name}: must have {arm.n} entries, one per joint of {arm.name}, not "
                f"{len(entries)}"
            )
    return construct(JointLimits, arm.limits.merged(bounds), "limits")

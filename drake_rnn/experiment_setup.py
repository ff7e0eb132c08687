"""The objects that an experiment's document describes, made and checked as a whole."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from .arms import Arm, load_arm
from .complaints import nearest
from .contact_setup import make_contact
from .diagrams.contact import Contact
from .diagrams.loop import check_filter, start_posture
from .documents import construct, kind_of, without_kind
from .errors import InvalidInputError
from .fields import Array
from .laws import LAWS, Law
from .laws.posture_law import PostureLaw
from .limits import JointLimits
from .paths import PATHS, Path, Rest
from .reachable_target import reachable_target
from .systems.moving_average import averaging_delay, averaging_windows
from .task import TASKS

if TYPE_CHECKING:
    from .experiment import Experiment

#: How far a start may lie outside the position limits if the law is there to mend it [rad].
OUTSIDE = 0.1


@dataclass(frozen=True)
class Setup:
    """The objects an experiment consists of.

    Attributes:
        arm: The arm.
        limits: Bounds that hold in this experiment.
        law: The law.
        path: The path, placed by ``p_WE_start``.
        start: Posture to start from, shape (n,) [rad].
        p_WE_start: Where the end effector is then, shape (3,) [m].
        R_WE_start: Its orientation, shape (3, 3).
        target: Posture that the law seeks, shape (n,) [rad], or None.
        holds_orientation: Whether the end effector is to keep the orientation of the start.
        contact: What the tool presses against, or None.
        path_delay: How long ago the point was desired that the arm is to be at now [s].
        warnings: What the user should know of how they were made.
    """

    arm: Arm
    limits: JointLimits
    law: Law
    path: Path
    start: Array
    p_WE_start: Array
    R_WE_start: Array
    target: Array | None
    holds_orientation: bool
    contact: Contact | None
    path_delay: float
    warnings: tuple[str, ...]


def make_setup(experiment: Experiment) -> Setup:
    """What `Experiment.setup` holds.

    Raises:
        InvalidInputError: Naming the key, its value and what it may be.
    """
    published = _arm(experiment.arm)
    limits = _limits(published, experiment.limits)
    arm = published.with_limits(limits)
    law_class: Any = kind_of(experiment.law, LAWS, "law")
    fields = law_class.__dataclass_fields__
    seeks_posture = issubclass(law_class, PostureLaw)
    start = start_posture(arm, experiment.start, OUTSIDE if seeks_posture else 0.0)
    path = _path(experiment, seeks_posture)
    known = {
        "limits": limits,
        "home": start,
        "task_size": TASKS[experiment.task].size,
    }
    filled = {name: value for name, value in known.items() if name in fields}
    for name in filled.keys() & experiment.law.keys():
        raise InvalidInputError(f"law.{name}: follows from {_ORIGINS[name]}; leave it out")
    _require_task(experiment.task, law_class)
    law: Law = construct(law_class, {**filled, **without_kind(experiment.law)}, "law")
    _require_rows(experiment.task, law)
    if experiment.integrator is not None and not hasattr(law, "derivatives"):
        raise InvalidInputError(
            f"integrator: {experiment.law['kind']} is no differential equation; give a period"
        )
    if experiment.feedback == "measured" and experiment.level == "kinematic":
        raise InvalidInputError(
            "feedback: measured is for level: dynamic; here the arm is where it is commanded to be"
        )
    if experiment.dither is not None and "velocity" not in law.inputs:
        raise InvalidInputError("dither: this law does not learn; it has nothing to excite")
    if experiment.period is not None and hasattr(law, "check_period"):
        law.check_period(experiment.period)
    warnings = [*_widened(published, limits), *_outside(arm, start)]
    path_delay, doubts = _filter(experiment, limits, law)
    warnings += doubts
    target = None
    if isinstance(law, PostureLaw):
        target, changes = reachable_target(experiment, arm, start, law.target)
        law = replace(law, target=target)
        warnings += changes
    contact, doubts = make_contact(experiment, law, path, arm, start)
    warnings += doubts
    kinematics = arm.kinematics()
    return Setup(
        arm=arm,
        limits=limits,
        law=law,
        path=path,
        start=start,
        p_WE_start=kinematics.p_WE(start),
        R_WE_start=kinematics.R_WE(start),
        target=target,
        holds_orientation=TASKS[experiment.task].with_orientation or "R_WE_desired" in law.inputs,
        contact=contact,
        path_delay=path_delay,
        warnings=tuple(warnings),
    )


# The field of a law that feeds the position error back, which a delay in its loop limits [1/s].
_GAINS = {"simultaneous_learning": "kappa", "pseudoinverse": "feedback"}


def _filter(experiment: Experiment, limits: JointLimits, law: Law) -> tuple[float, list[str]]:
    """The delay at which the arm follows its path [s], and what is doubtful about the filter."""
    settings, feedback = experiment.filter, experiment.feedback
    check_filter(settings is not None, feedback, experiment.dither)
    if settings is None:
        return 0.0, []
    if experiment.period is None:
        raise InvalidInputError("filter: is sampled like the law; give a period, no integrator")
    delay = averaging_delay(averaging_windows(limits, experiment.period), experiment.period)
    if delay >= experiment.duration:
        raise InvalidInputError(
            f"filter: these limits make its delay {delay:.4g} s; the duration must be more than "
            f"that, not {experiment.duration:g}"
        )
    if feedback == "unfiltered":
        if settings.delay_desired:
            raise InvalidInputError("filter.delay_desired: only with feedback: commanded")
        return delay, []
    if settings.precompensate:
        raise InvalidInputError("filter.precompensate: only with feedback: unfiltered")
    if settings.delay_desired and not {"p_WE_desired", "v_WE_desired"} <= law.inputs.parts.keys():
        raise InvalidInputError(
            "filter.delay_desired: only for a law that sees p_WE_desired and v_WE_desired"
        )
    kind, doubts = experiment.law["kind"], []
    if kind not in _GAINS:
        doubts.append(
            f"filter: delays the law's loop by {delay:.4g} s; nothing is known of whether "
            f"{kind} stays stable with it: see feedback: unfiltered"
        )
    elif (gain := float(getattr(law, _GAINS[kind]))) * delay >= 1.0:
        raise InvalidInputError(
            f"law.{_GAINS[kind]}: must be below {1.0 / delay:.4g} /s with the filter's delay of "
            f"{delay:.4g} s in its loop, not {gain:g}; or give feedback: unfiltered"
        )
    if getattr(law, "acceleration_bound", "none") != "none" and not settings.delay_desired:
        doubts.append(
            "law.acceleration_bound: slows the law's loop beside the filter, which holds the "
            "bound; both together may lose the path: see acceleration_bound: none"
        )
    return delay * settings.delay_desired, doubts


def _path(experiment: Experiment, seeks_posture: bool) -> Path:
    document = experiment.path
    if seeks_posture:
        if document is not None:
            raise InvalidInputError(
                "path: this law holds the end effector where it is; leave the path out"
            )
        return Rest()
    if experiment.on_unreachable != "refuse":
        raise InvalidInputError("on_unreachable: only for a law that seeks a target posture")
    if document is None:
        raise InvalidInputError("path: must be given")
    path: Path = construct(kind_of(document, PATHS, "path"), without_kind(document), "path")
    return path


def _require_task(task: str, law_class: Any) -> None:
    field = law_class.__pydantic_fields__.get("task_size")
    sizes = get_args(field.annotation) if field is not None else ()
    if sizes and TASKS[task].size not in sizes:
        able = ", ".join(name for name, known in TASKS.items() if known.size in sizes)
        raise InvalidInputError(f"task: may be {able} for this law, not {task}")


def _require_rows(task: str, law: Law) -> None:
    """Of a law that does not ask for the size of its task, and knows one."""
    sizes = {name: shape[0] for name, (_, shape) in law.inputs.parts.items()}

    def suits(name: str) -> bool:
        known = TASKS[name]
        axes = len(known.axes)
        return sizes.get("p_WE", axes) == axes and sizes.get("J", known.size) == known.size

    if not suits(task):
        able = ", ".join(filter(suits, TASKS))
        raise InvalidInputError(f"task: may be {able} for this law, not {task}")


def _widened(arm: Arm, limits: JointLimits) -> list[str]:
    """Where the experiment lets a joint go although the arm itself cannot."""
    if not np.isfinite(limits.position_upper - limits.position_lower).any():
        return []
    beyond = np.maximum(
        arm.limits.position_lower - limits.position_lower,
        limits.position_upper - arm.limits.position_upper,
    )
    worst = int(np.argmax(beyond))
    if beyond[worst] <= 1e-3:
        return []
    return [
        f"limits: {arm.joints[worst]} may go {beyond[worst]:.3g} rad beyond what {arm.name} can, "
        f"{arm.limits.position_lower[worst]:.4g} to {arm.limits.position_upper[worst]:.4g} rad"
    ]


def _outside(arm: Arm, start: Array) -> list[str]:
    return [
        f"start: {name} is at {q:.6g} rad, {excess:.3g} rad outside its limits; it is brought back"
        for name, q, excess in zip(arm.joints, start, arm.limits.violation(start), strict=True)
        if excess > 0
    ]


# Where the fields of a law come from that a document does not give.
_ORIGINS = {"limits": "arm and limits", "home": "start", "task_size": "task"}


def _arm(description: str | Mapping[str, Any]) -> Arm:
    if isinstance(description, str):
        return load_arm(description)
    fields = dict(description)
    if not isinstance(model := fields.pop("model", None), str):
        raise InvalidInputError("arm.model: must be given: a shipped arm or a model file")
    return load_arm(model, **fields)


def _limits(arm: Arm, bounds: Mapping[str, Any] | str) -> JointLimits:
    if isinstance(bounds, str):
        return JointLimits.unlimited(arm.n)
    names = list(JointLimits.__dataclass_fields__)
    for name in bounds:
        if name not in names:
            raise InvalidInputError(f"limits.{name}: no such key; " + nearest(name, names))
        entries = bounds[name]
        if isinstance(entries, (list, np.ndarray)) and len(entries) != arm.n:
            raise InvalidInputError(
                f"limits.{name}: must have {arm.n} entries, one a joint of {arm.name}, not "
                f"{len(entries)}"
            )
    return construct(JointLimits, arm.limits.merged(bounds), "limits")

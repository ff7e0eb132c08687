"""The objects that an experiment's document describes, made and checked as a whole."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from .arms import Arm, load_arm
from .complaints import nearest
from .diagrams.kinematic import start_posture
from .documents import construct
from .errors import InvalidInputError
from .fields import Array
from .laws import LAWS, Law
from .limits import JointLimits
from .paths import PATHS, Path, Rest
from .self_motion import SelfMotion
from .task import TASKS

if TYPE_CHECKING:
    from .experiment import Experiment


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
    warnings: tuple[str, ...]


def make_setup(experiment: Experiment) -> Setup:
    """What `Experiment.setup` holds.

    Raises:
        InvalidInputError: Naming the key, its value and what it may be.
    """
    arm = _arm(experiment.arm)
    limits = _limits(arm, experiment.limits)
    arm = arm.with_limits(limits)
    law_class: Any = _kind(experiment.law, LAWS, "law")
    fields = law_class.__dataclass_fields__
    seeks_posture = "target" in fields
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
    law: Law = construct(law_class, {**filled, **_rest(experiment.law)}, "law")
    if experiment.integrator is not None and not hasattr(law, "derivatives"):
        raise InvalidInputError(
            f"integrator: {experiment.law['kind']} is no differential equation; give a period"
        )
    if experiment.dither is not None and "velocity" not in law.inputs:
        raise InvalidInputError("dither: this law does not learn; it has nothing to excite")
    longest = getattr(law, "longest_period", np.inf)
    if experiment.period is not None and experiment.period >= longest:
        raise InvalidInputError(
            f"period: must be below {longest:g} s for this law's feedback, not "
            f"{experiment.period:g}"
        )
    warnings = _return_warnings(arm, start)
    target = None
    if seeks_posture:
        made: Any = law
        target, changes = _reachable_target(experiment, arm, start, made.target)
        law = replace(made, target=target)
        warnings += changes
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
        warnings=tuple(warnings),
    )


#: How far a start may lie outside the position limits if the law is there to mend it [rad].
OUTSIDE = 0.1
# The end effector may be this far from its place in a target posture, and the target from where
# the self-motion towards it ends: further, and the law would trade one for the other.
_MISS, _TURN, _SHORT = 1e-4, 1e-3, 0.01


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
    path: Path = construct(_kind(document, PATHS, "path"), _rest(document), "path")
    return path


def _require_task(task: str, law_class: Any) -> None:
    field = law_class.__pydantic_fields__.get("task_size")
    sizes = get_args(field.annotation) if field is not None else ()
    if sizes and TASKS[task].size not in sizes:
        able = ", ".join(name for name, known in TASKS.items() if known.size in sizes)
        raise InvalidInputError(f"task: may be {able} for this law, not {task}")


def _return_warnings(arm: Arm, start: Array) -> list[str]:
    return [
        f"start: {name} is at {q:.6g} rad, {excess:.3g} rad outside its limits; it is brought back"
        for name, q, excess in zip(arm.joints, start, arm.limits.violation(start), strict=True)
        if excess > 0
    ]


def _reachable_target(
    experiment: Experiment, arm: Arm, start: Array, target: Array
) -> tuple[Array, list[str]]:
    """The target to seek, and what there is to say about it."""
    motion = SelfMotion(arm, start, experiment.task)
    if motion.free_dimensions == 0:
        raise InvalidInputError(
            f"task: {experiment.task} leaves {arm.name} no self-motion at its start: of its "
            f"{arm.n} joints 0 free dimensions remain"
        )
    nearest = motion.towards(target)
    short = np.abs(nearest - target)
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
        f"[{', '.join(map(_typed, nearest, lower, upper))}], {short[worst]:.3g} rad off in "
        f"{arm.joints[worst]}"
    )
    if arm.limits.violation(nearest).any():
        raise InvalidInputError(f"{what}, which is outside its limits; start nearer to them")
    if experiment.on_unreachable == "refuse":
        raise InvalidInputError(f"{what}; give that, or on_unreachable: project")
    return nearest, [f"{what}: taken in its place", *_detours(arm, start, nearest)]


def _typed(q: float, lower: float, upper: float) -> str:
    """A joint position to six decimals, or more where it would be rounded out of its limits."""
    text = f"{q:.6f}"
    return text if lower <= float(text) <= upper else repr(float(q))


def _detours(arm: Arm, start: Array, target: Array) -> list[str]:
    """Joints that go more than half a turn although the same posture is nearer."""
    other = target - np.copysign(2 * np.pi, target - start)
    lower, upper = arm.limits.position_lower, arm.limits.position_upper
    detour = (np.abs(target - start) > np.pi) & (lower <= other) & (other <= upper)
    return [
        f"law.target: {name} has {abs(to - begin):.3g} rad to go; at {near:.6g} rad the posture "
        "is the same, and nearer"
        for name, begin, to, near, so in zip(arm.joints, start, target, other, detour, strict=True)
        if so
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
    return construct(JointLimits, arm.limits.merged(bounds), "limits")


def _kind(document: Mapping[str, Any], kinds: Mapping[str, type], key: str) -> type:
    kind = document.get("kind")
    if kind is None:
        raise InvalidInputError(f"{key}.kind: must be given; it may be {', '.join(kinds)}")
    if not isinstance(kind, str) or kind not in kinds:
        raise InvalidInputError(
            f"{key}.kind: no {key} {kind!r}; " + nearest(str(kind), list(kinds))
        )
    return kinds[kind]


def _rest(document: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in document.items() if name != "kind"}

"""The law that an experiment's document describes."""

from __future__ import annotations

import math
from typing import Any, get_args

import numpy as np

from ..errors import InvalidInputError
from ..features.pairs import refuse
from ..inputs.dataclass_fields import field_names
from ..inputs.documents import construct, without_kind
from ..inputs.fields import Array
from ..laws import Law
from ..laws.checks import check_declared, continuous_reading, sampled_reading
from ..laws.parts.measurement import LEVER, REACH, Measurement
from ..robot.clearance import Clearance
from ..robot.limits import JointLimits
from ..robot.task import TASKS, tasks_suiting
from .document import ExperimentDocument, combination_of

#: Sections that determine the fields of a law which a document must not give.
ORIGINS = {
    "limits": "arm and limits",
    "home": "start",
    "task_size": "task",
    "measurement": "sensing",
    "clearance": "arm and obstacles",
    "other": "second",
    "points": "camera",
    "pixel_size": "camera",
}


def make_law(
    document: ExperimentDocument,
    kind: type[Law],
    limits: JointLimits,
    start: Array,
    clearance: Clearance | None,
) -> Law:
    """Return the law, including the fields that follow from limits, start and task.

    Args:
        document: Document of the experiment.
        kind: Class of the law.
        limits: Limits of the joints in the experiment.
        start: Start posture, shape (n,) [rad].
        clearance: What the arm is to stay clear of; None for nothing.

    Raises:
        InvalidInputError: If a field is wrong, or given although it follows from something else;
            if the law does not fit the task or a feature; or if it cannot be sampled at this
            period, or not be integrated.
    """
    task, camera = document.task, document.camera
    size = TASKS[task].size if camera is None else camera.size
    known = {"limits": limits, "home": start, "task_size": size}
    known |= {"measurement": _measurement(document), "clearance": clearance}
    known |= {"other": None}
    if camera is not None:
        known |= {"points": len(camera.points), "pixel_size": camera.pixel_size}
    fields = field_names(kind)
    filled = {name: value for name, value in known.items() if name in fields}
    for name in ORIGINS:
        if name in fields and name in document.law:
            raise InvalidInputError(f"law.{name}: follows from {ORIGINS[name]}; leave it out")
    _require_size(task, kind)
    law: Law = construct(kind, {**filled, **without_kind(document.law)}, "law")
    check_declared(law)
    refuse(combination_of(document, kind, law))
    parts = {**law.state.parts, **law.inputs.parts}
    able = tasks_suiting({name: shape for name, (_, shape) in parts.items()})
    if task not in able and camera is None:
        raise InvalidInputError(f"task: may be {', '.join(able)} for this law, not {task}")
    if document.period is not None:
        sampled_reading(law, document.period)
    else:
        continuous_reading(law)
    return law


def _measurement(document: ExperimentDocument) -> Measurement:
    """Return the quality of the measurements that the law sees."""
    sensing, camera = document.sensing, document.camera
    seen = 0.0 if camera is None else camera.noise * camera.pixel_size
    if sensing is None:
        return Measurement(error=seen)
    steps = 0.0 if sensing.resolution is None else float(np.max(sensing.resolution))
    if sensing.encoder_bits is not None:
        steps = 2.0 * math.pi / 2.0**sensing.encoder_bits
    # The mean square error of rounding to steps is a twelfth of the step squared.
    joints = math.hypot(float(np.max(sensing.position_noise)), steps / math.sqrt(12.0))
    turned = LEVER * (sensing.R_WE_noise or 0.0) if document.task == "pose" else 0.0
    error = math.hypot(sensing.p_WE_noise or 0.0, seen, REACH * joints, turned)
    samples = sensing.secant_samples or None
    return Measurement(error=error, delay=sensing.delay, secant_samples=samples)


def _require_size(task: str, kind: Any) -> None:
    """Raise an InvalidInputError if the law's field ``task_size`` does not allow the task."""
    if "task_size" not in field_names(kind):
        return
    sizes = get_args(kind.__pydantic_fields__["task_size"].annotation)
    if sizes and TASKS[task].size not in sizes:
        able = ", ".join(name for name, known in TASKS.items() if known.size in sizes)
        raise InvalidInputError(f"task: may be {able} for this law, not {task}")

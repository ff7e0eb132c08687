"""What a loop refuses, before anything of it is connected or run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import NoneType

from pydrake.systems.framework import DiagramBuilder, OutputPort, System

from ..errors import InvalidInputError
from ..features.feature import LoopPart, Ports
from ..features.pairs import Combination, refuse
from ..inputs.fields import require_seed
from ..inputs.messages import (
    field_names,
    nearest,
    require_type,
)
from ..robot.kinematics import (
    TASKS,
    tasks_suiting,
)
from ..signals import HINTS
from ..systems.body import Body, Feedback, Kinematics
from ..systems.controllers import Controller
from ..systems.sources import JointReference, PreviewSource


def check_arguments(
    builder: DiagramBuilder,
    reference: System | None,
    signals: Mapping[str, OutputPort] | None,
    seed: int,
    prefix: str,
) -> None:
    """Raise an InvalidInputError if an argument of `AddLoop` has the wrong type."""
    require_type("builder", builder, DiagramBuilder)
    require_type("reference", reference, System, NoneType)
    require_type("signals", signals, Mapping, NoneType)
    for name, port in (signals or {}).items():
        require_type(f"signals.{name}", port, OutputPort)
        _require_added(f"signals.{name}", port.get_system(), builder)
    if reference is not None:
        _require_added("reference", reference, builder)
    require_seed(seed)
    require_type("prefix", prefix, str)


def _require_added(key: str, system: System, builder: DiagramBuilder) -> None:
    if not any(system is known for known in builder.GetSystems()):
        raise InvalidInputError(
            f"{key}: {system.get_name() or type(system).__name__} is not in this diagram; add it "
            "to the builder first"
        )


def check_parts(
    body: Body,
    controller: Controller,
    task: str,
    feedback: Feedback,
    parts: Sequence[LoopPart],
) -> None:
    """Raise an InvalidInputError if the parts of a loop do not fit together.

    Args:
        body: The arm.
        controller: Controller that runs the law.
        task: Task of the loop.
        feedback: Arm that the law sees.
        parts: Its other parts.
    """
    require_type("controller", controller, Controller)
    _require_joints(controller, body)
    body.check_feedback(feedback)
    traits = {name: value for part in parts for name, value in part.traits().items()}
    law, period = controller.law, controller.period
    refuse(
        Combination(
            documented=False,
            level=type(body),
            task=task,
            feedback=feedback,
            period=period,
            kind=type(law),
            law=law,
            **traits,
        )
    )
    body.check_task(task)
    body.check_plant(body.settings, period)
    for part in parts:
        part.check(controller)


# What the loop itself sees of a contact, beside the law.
_OF_THE_CONTACT = ("normal_WE", "normal_force")


def given_signals(signals: Mapping[str, OutputPort] | None, controller: Controller) -> Ports:
    """Return the signals in place of those offered; ones that nothing asks for are refused."""
    given = dict(signals or {})
    asked = [*controller.reading.inputs.parts, *_OF_THE_CONTACT]
    for name in given:
        if name not in asked:
            raise InvalidInputError(
                f"signals.{name}: nothing in this loop asks for it; {nearest(name, asked)}"
            )
    return given


def check_offers(
    controller: Controller, offered: Mapping[str, OutputPort], kinematics: Kinematics, task: str
) -> None:
    """Raise an InvalidInputError if what is offered is not what the law needs.

    Args:
        controller: Controller that runs the law.
        offered: Output ports by name.
        kinematics: Kinematics of the arm that the law sees.
        task: Task of the loop.
    """
    _require_ahead(controller, offered)
    for name in controller.reading.inputs.parts:
        if name not in offered:
            raise InvalidInputError(
                f"{controller.get_name()}: nothing in this diagram offers {name!r}; "
                f"available: {', '.join(sorted(offered))}{HINTS.get(name, '')}"
            )
    _require_task(controller, kinematics, task, offered)


def _require_joints(controller: Controller, body: Body) -> None:
    joints = controller.GetOutputPort("commanded_velocity").size()
    if joints != body.arm.n:
        raise InvalidInputError(
            f"limits: those of {type(controller.law).__name__} must be for {body.arm.n} joints, "
            f"like {body.arm.name}, not for {joints}"
        )


def _require_ahead(controller: Controller, offered: Mapping[str, OutputPort]) -> None:
    """Raise an InvalidInputError if a preview shows another time than the law plans for."""
    period = controller.period
    for name in ("p_preview", "pixels_preview"):
        if name not in controller.reading.inputs or name not in offered:
            continue
        source = offered[name].get_system()
        if isinstance(source, PreviewSource) and period is not None and source.preview != period:
            raise InvalidInputError(
                f"preview: must be the controller's period, {period}, not {source.preview}"
            )
    asked = controller.law.joint_preview
    if asked is None or "position_preview" not in offered:
        return
    ahead = offered["position_preview"].get_system()
    if isinstance(ahead, JointReference) and ahead.interval != asked.interval:
        raise InvalidInputError(
            f"interval: must be the law's, {asked.interval}, not {ahead.interval}"
        )


def _require_task(
    controller: Controller, kinematics: Kinematics, task: str, offered: Mapping[str, OutputPort]
) -> None:
    """Raise an InvalidInputError if the law is made for another task than the kinematics."""
    inputs = controller.reading.inputs.parts.items()
    able = tasks_suiting(
        {name: shape for name, (_, shape) in inputs if offered[name].get_system() is kinematics}
    )
    # Where the law fits no task, connecting the ports will name the one of the wrong size.
    if task in able or not able:
        return
    law = type(controller.law)
    takes_size = "task_size" in field_names(law)
    hint = f"; or give the law task_size={TASKS[task].size}" if takes_size else ""
    raise InvalidInputError(
        f"task: may be {', '.join(able)} for this {law.__name__}, not {task}{hint}"
    )

"""The loop of a controller and an arm, whatever the arm is: joined by the names of ports."""

from __future__ import annotations

from collections.abc import Mapping
from types import NoneType
from typing import Literal, NamedTuple, get_args

import numpy as np
from pydrake.systems.framework import Diagram, DiagramBuilder, InputPort, OutputPort, System
from pydrake.systems.primitives import Adder, Integrator, MatrixGain

from drake_rnn.arm_kinematics import ArmKinematics
from drake_rnn.arms import Arm
from drake_rnn.complaints import require_type
from drake_rnn.errors import InvalidInputError
from drake_rnn.fields import Array
from drake_rnn.systems.contact_reference import ContactReference
from drake_rnn.systems.controllers import ContinuousController, SampledController
from drake_rnn.systems.dither import Dither, DitherSettings
from drake_rnn.systems.dynamics import Dynamics
from drake_rnn.systems.force_sensor import ForceSensor
from drake_rnn.systems.force_watch import ForceWatch
from drake_rnn.systems.kinematics import Kinematics
from drake_rnn.systems.mirror import Mirror
from drake_rnn.systems.moving_average import MovingAverage
from drake_rnn.systems.normal_force import NormalForce
from drake_rnn.systems.spring_contact import SpringContact
from drake_rnn.task import TASKS

from .contact import Contact

Controller = SampledController | ContinuousController
Feedback = Literal["commanded", "measured", "unfiltered"]


class Loop(NamedTuple):
    """The systems that `AddKinematicLoop` or `AddDynamicLoop` has added.

    The arm is the one that moves; with ``feedback: unfiltered`` the law sees ``virtual_arm``.
    ``forces`` are the ports, by name, of what the tool feels: ``contact_force``,
    ``tool_force`` and ``normal_force``.
    """

    controller: Controller
    kinematics: Kinematics
    joint_command: Integrator
    arm: Diagram
    filter: MovingAverage | None = None
    virtual_arm: Diagram | None = None
    forces: Mapping[str, OutputPort] = {}


def add_loop(
    builder: DiagramBuilder,
    arm: Arm,
    controller: Controller,
    reference: System | None,
    body: Diagram,
    *,
    start: Array,
    task: str,
    dither: DitherSettings | None,
    filter: MovingAverage | None,
    feedback: Feedback,
    contact: Contact | None,
    signals: Mapping[str, OutputPort] | None,
    seed: int,
    prefix: str,
    spring: SpringContact | None = None,
    kinematics: ArmKinematics | None = None,
) -> Loop:
    """Add a controller, an arm round it, and join both to a reference.

    Args:
        builder: Takes the systems.
        arm: The arm.
        controller: A law as a system, not yet in ``builder``.
        reference: Any system in ``builder`` with the desired signals among its output ports.
        body: The arm as a system, with the ports of a `Mirror`, not yet in ``builder``.
        start: Posture to start from, shape (n,) [rad].
        task: See `AddKinematicLoop`, as for all that follow.
        dither: Excitation, or None.
        filter: Of the command, or None.
        feedback: Which arm the law sees.
        contact: What the tool presses against, or None.
        signals: What the law sees in place of what is offered here.
        seed: Of dither and sensor.
        prefix: Of the systems' names.
        spring: What the contact is felt by, not yet in ``builder``; None if ``body`` itself
            has the ports ``contact_force`` and ``tool_force``.
        kinematics: Of the arm, where ``body`` makes use of it too.

    Raises:
        InvalidInputError: If the law wants what nothing here offers, or in another size, or the
            filter does not go with controller, feedback or noise, or is of another class.
    """
    signals = dict(signals or {})
    require_type("controller", controller, SampledController, ContinuousController)
    require_type("dither", dither, DitherSettings, NoneType)
    require_type("filter", filter, MovingAverage, NoneType)
    _require_joints(controller, arm)
    check_filter(filter is not None, feedback, dither)
    period = getattr(controller, "period", None)
    if filter is not None and period is not None and filter.period != period:
        raise InvalidInputError(
            f"filter: its period, {filter.period:g} s, must be the controller's, {period:g} s"
        )
    virtual = feedback == "unfiltered"
    builder.AddNamedSystem(f"{prefix}controller", controller)
    if virtual:
        seen = _add_body(builder, arm, start, task, Mirror(arm.n), f"{prefix}virtual_", None)
    else:
        seen = _add_body(builder, arm, start, task, body, prefix, kinematics)

    asked = controller.GetOutputPort("commanded_velocity")
    if filter is not None:
        builder.AddNamedSystem(f"{prefix}filter", filter)
        if not virtual:
            _connect(builder, asked, filter.get_input_port())
            asked = filter.get_output_port()
    if dither is None:
        moved = measured = shown = asked
    else:
        noise = Dither(arm.n, dither.sigma, dither.hold, seed)
        source = builder.AddNamedSystem(f"{prefix}dither", noise)
        adder = builder.AddNamedSystem(f"{prefix}dithered_velocity", Adder(2, arm.n))
        _connect(builder, asked, adder.get_input_port(0))
        _connect(builder, source.get_output_port(), adder.get_input_port(1))
        dithered = adder.get_output_port()
        # What moves the arm, what v_WE belongs to, and what the law is shown.
        moved, measured, shown = {
            "actuated": (dithered, dithered, dithered),
            "virtual": (asked, dithered, dithered),
            "printed": (asked, asked, dithered),
        }[dither.model]

    _move(builder, seen, moved)
    position = seen.joint_command.get_output_port()
    if feedback == "measured":
        position = seen.arm.GetOutputPort("position")
        measured = shown = seen.arm.GetOutputPort("velocity")
    _connect(builder, position, seen.kinematics.GetInputPort("position"))
    _connect(builder, measured, seen.kinematics.GetInputPort("velocity"))

    offered = {"position": position, "velocity": shown}
    systems: list[System] = [seen.kinematics]
    if reference is not None:
        systems.append(reference)
    if _DYNAMICS & controller.law.inputs.parts.keys():
        dynamics = builder.AddNamedSystem(f"{prefix}dynamics", Dynamics(arm))
        _connect(builder, position, dynamics.GetInputPort("position"))
        _connect(builder, measured, dynamics.GetInputPort("velocity"))
        systems.append(dynamics)
    for system in systems:
        offered |= {port.get_name(): port for port in _outputs(system)}

    last = seen
    if virtual and filter is not None:
        _connect(builder, moved, filter.get_input_port())
        last = _add_body(builder, arm, start, task, body, prefix, kinematics)
        _move(builder, last, filter.get_output_port())
        _connect(
            builder, last.joint_command.get_output_port(), last.kinematics.GetInputPort("position")
        )
        _connect(builder, filter.get_output_port(), last.kinematics.GetInputPort("velocity"))
    forces: dict[str, OutputPort] = {}
    if contact is not None:
        forces = _add_felt(builder, last, spring, prefix)
        normal = signals.get("normal_WE")
        told = _add_contact(builder, contact, forces["tool_force"], normal, period, seed, prefix)
        offered |= told
        forces["normal_force"] = signals.get("normal_force", told["normal_force"])
        if period is not None:
            _add_watch(builder, last, forces["normal_force"], period, prefix)
    offered |= signals
    if "position_preview" in controller.law.inputs and "position_preview" in offered:
        _require_same_interval(controller, offered["position_preview"].get_system())
    _require_one_period_ahead(controller, reference)
    for name in controller.law.inputs.parts:
        if name not in offered:
            raise InvalidInputError(
                f"{controller.get_name()}: nothing in this diagram offers {name!r}; "
                f"there are {', '.join(sorted(offered))}{_HINTS.get(name, '')}"
            )
    _require_task(controller, seen.kinematics, task, offered)
    for name in controller.law.inputs.parts:
        _connect(builder, offered[name], controller.GetInputPort(name))
    return Loop(controller, *last, filter, seen.arm if virtual else None, forces)


class _Body(NamedTuple):
    kinematics: Kinematics
    joint_command: Integrator
    arm: Diagram


def _add_body(
    builder: DiagramBuilder,
    arm: Arm,
    start: Array,
    task: str,
    body: Diagram,
    prefix: str,
    kinematics: ArmKinematics | None,
) -> _Body:
    return _Body(
        builder.AddNamedSystem(f"{prefix}kinematics", Kinematics(arm, task, kinematics)),
        builder.AddNamedSystem(f"{prefix}joint_command", Integrator(start)),
        builder.AddNamedSystem(f"{prefix}arm", body),
    )


def _move(builder: DiagramBuilder, body: _Body, moved: OutputPort) -> None:
    """Let the velocity ``moved`` move a body."""
    position = body.joint_command.get_output_port()
    _connect(builder, moved, body.joint_command.get_input_port())
    _connect(builder, position, body.arm.GetInputPort("position_commanded"))
    _connect(builder, moved, body.arm.GetInputPort("velocity_commanded"))


def _add_felt(
    builder: DiagramBuilder, body: _Body, spring: SpringContact | None, prefix: str
) -> dict[str, OutputPort]:
    """What the tool feels, by name: of a spring, or of the body's own contact."""
    if spring is None:
        return {name: body.arm.GetOutputPort(name) for name in ("contact_force", "tool_force")}
    builder.AddNamedSystem(f"{prefix}contact", spring)
    _connect(builder, body.kinematics.GetOutputPort("p_WE"), spring.get_input_port())
    force = spring.get_output_port()
    return {"contact_force": force, "tool_force": force}


def _add_watch(
    builder: DiagramBuilder, body: _Body, normal_force: OutputPort, period: float, prefix: str
) -> None:
    position = body.arm.GetOutputPort("position")
    # Rarely: each look costs, and a sensor that is stuck stays so.
    watch = builder.AddNamedSystem(f"{prefix}force_watch", ForceWatch(position.size(), 10 * period))
    _connect(builder, normal_force, watch.GetInputPort("normal_force"))
    _connect(builder, position, watch.GetInputPort("position"))


def _add_contact(
    builder: DiagramBuilder,
    contact: Contact,
    tool_force: OutputPort,
    normal_WE: OutputPort | None,
    period: float | None,
    seed: int,
    prefix: str,
) -> dict[str, OutputPort]:
    """What the law may know of the contact, by name; its normal may be another's."""
    reference = ContactReference(contact.surface.believed_normal_W, contact.force)
    builder.AddNamedSystem(f"{prefix}contact_reference", reference)
    pressing: System
    if normal_WE is None:
        normal_WE = reference.GetOutputPort("normal_WE")
        # A constant one is left to Drake, which is faster.
        row = contact.surface.believed_normal_W[np.newaxis, :]
        pressing = builder.AddNamedSystem(f"{prefix}normal_force", MatrixGain(row))
    else:
        pressing = builder.AddNamedSystem(f"{prefix}normal_force", NormalForce())
        _connect(builder, normal_WE, pressing.GetInputPort("normal_WE"))
    _connect(builder, tool_force, pressing.get_input_port(0))
    normal_force = pressing.get_output_port()
    if contact.sensor is not None:
        if period is None:
            raise InvalidInputError("sensor: is sampled like the law; give a period")
        sensor = builder.AddNamedSystem(
            f"{prefix}force_sensor", ForceSensor(contact.sensor, period, seed)
        )
        _connect(builder, normal_force, sensor.get_input_port())
        normal_force = sensor.get_output_port()
    return {
        "normal_WE": normal_WE,
        "normal_force_desired": reference.GetOutputPort("normal_force_desired"),
        "normal_force": normal_force,
    }


def _require_joints(controller: Controller, arm: Arm) -> None:
    joints = controller.GetOutputPort("commanded_velocity").size()
    if joints != arm.n:
        raise InvalidInputError(
            f"limits: those of {type(controller.law).__name__} must be of {arm.n} joints, as "
            f"{arm.name} has, not of {joints}"
        )


def _require_task(
    controller: Controller, kinematics: Kinematics, task: str, offered: Mapping[str, OutputPort]
) -> None:
    """Raise an InvalidInputError if the law is for another task than the kinematics' own."""
    names = [n for n in controller.law.inputs.parts if offered[n].get_system() is kinematics]

    def fits(offering: Kinematics) -> bool:
        return all(
            offering.GetOutputPort(name).size() == controller.GetInputPort(name).size()
            for name in names
        )

    if fits(kinematics):
        return
    able = [name for name in TASKS if fits(Kinematics(kinematics.arm, name))]
    if not able:
        return  # nothing to advise: the port that does not fit is named when it is connected
    law = controller.law
    hint = f"; or give the law task_size={TASKS[task].size}" if hasattr(law, "task_size") else ""
    raise InvalidInputError(
        f"task: may be {', '.join(able)} for {type(law).__name__} as it is made, not {task}{hint}"
    )


def _require_one_period_ahead(controller: Controller, reference: System | None) -> None:
    ahead, period = getattr(reference, "preview", None), getattr(controller, "period", None)
    if "p_preview" in controller.law.inputs and None not in (ahead, period) and ahead != period:
        raise InvalidInputError(f"preview: must be the controller's period, {period}, not {ahead}")


def _require_same_interval(controller: Controller, reference: System) -> None:
    asked = getattr(controller.law, "interval", None)
    given = getattr(reference, "interval", None)
    if None not in (asked, given) and asked != given:
        raise InvalidInputError(f"interval: must be the law's, {asked}, not {given}")


_HINTS = {
    "R_WE_desired": "; give the PathSource R_WE",
    "normal_WE": "; give the loop a contact",
    "position_preview": "; give a JointReference",
    "p_preview": "; give the PathSource a preview of one period",
}

# What is computed only for a law that asks for it.
_DYNAMICS = {"M", "bias", "gravity"}


def check_filter(filtered: bool, feedback: Feedback, dither: DitherSettings | None) -> None:
    """Raise an InvalidInputError if feedback or noise do not go with the filter, or its absence."""
    if feedback not in get_args(Feedback):
        may_be = ", ".join(get_args(Feedback))
        raise InvalidInputError(f"feedback: may be {may_be}, not {feedback!r}")
    if feedback == "unfiltered" and not filtered:
        raise InvalidInputError("feedback: unfiltered is for a loop with a filter; give one")
    if filtered and feedback != "unfiltered" and dither is not None and dither.model == "actuated":
        raise InvalidInputError(
            "dither.model: actuated would move the arm behind the filter, beyond its bounds; "
            "it may be virtual"
        )
    if feedback == "measured" and dither is not None and dither.model != "actuated":
        raise InvalidInputError(
            f"dither.model: must be actuated with feedback: measured, not {dither.model}"
        )


def start_posture(arm: Arm, start: Array | None, outside: float = 0.0) -> Array:
    """The posture to start from, shape (n,) [rad]: ``start``, else the arm's home posture.

    Raises:
        InvalidInputError: If there is none, or it is not one of this arm's, or lies outside
            its position limits by more than ``outside`` [rad]; or ``arm`` is none.
    """
    require_type("arm", arm, Arm)
    if start is None:
        start = arm.home
    if start is None:
        raise InvalidInputError(f"start: must be given; {arm.name} has no home posture")
    try:
        start = np.asarray(start, dtype=float)
    except (TypeError, ValueError):
        raise InvalidInputError(f"start: must be {arm.n} numbers, not {start!r}") from None
    if start.shape != (arm.n,):
        raise InvalidInputError(f"start: has {start.size} entries for {arm.n} joints")
    if not np.isfinite(start).all() or (arm.limits.violation(start) > outside).any():
        raise InvalidInputError(f"start: {arm.limits.complaint(start, outside, arm.joints)}")
    return start


def _connect(builder: DiagramBuilder, output: OutputPort, port: InputPort) -> None:
    if output.size() != port.size():
        raise InvalidInputError(
            f"{_place(output)}: must have {port.size()} entries, as {_place(port)}, not "
            f"{output.size()}; is it made for another task or arm?"
        )
    builder.Connect(output, port)


def _place(port: InputPort | OutputPort) -> str:
    return f"{port.get_system().get_name()}.{port.get_name()}"


def _outputs(system: System) -> list[OutputPort]:
    return [system.get_output_port(index) for index in range(system.num_output_ports())]

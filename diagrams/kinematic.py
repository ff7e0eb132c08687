"""The kinematic diagram: an arm that does what it is told, and a law round it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, NamedTuple, get_args

import numpy as np
from pydrake.systems.framework import DiagramBuilder, InputPort, OutputPort, System
from pydrake.systems.primitives import Adder, Integrator

from drake_rnn.arms import Arm
from drake_rnn.errors import InvalidInputError
from drake_rnn.fields import Array
from drake_rnn.systems.controllers import ContinuousController, SampledController
from drake_rnn.systems.dither import Dither, DitherSettings
from drake_rnn.systems.dynamics import Dynamics
from drake_rnn.systems.kinematics import Kinematics
from drake_rnn.systems.mirror import Mirror
from drake_rnn.systems.moving_average import MovingAverage

Controller = SampledController | ContinuousController
Feedback = Literal["commanded", "unfiltered"]


class KinematicLoop(NamedTuple):
    """The systems that `AddKinematicLoop` has added.

    The arm is the one that moves; with ``feedback: unfiltered`` the law sees ``virtual_arm``.
    """

    controller: Controller
    kinematics: Kinematics
    joint_command: Integrator
    arm: Mirror
    filter: MovingAverage | None = None
    virtual_arm: Mirror | None = None


def AddKinematicLoop(
    builder: DiagramBuilder,
    arm: Arm,
    controller: Controller,
    reference: System | None = None,
    *,
    start: Array | None = None,
    task: str = "xyz",
    dither: DitherSettings | None = None,
    filter: MovingAverage | None = None,
    feedback: Feedback = "commanded",
    signals: Mapping[str, OutputPort] | None = None,
    seed: int = 0,
    outside: float = 0.0,
    prefix: str = "",
) -> KinematicLoop:
    """Add a controller with an ideal arm round it, and join both to a reference.

    Ports are joined by their names: whatever the law wants to see and the kinematics, the
    joints or the reference offer. A law that does not ask for ``J`` is not given it.

    Args:
        builder: Takes the systems.
        arm: The arm.
        controller: A law as a system, not yet in ``builder``.
        reference: Any system in ``builder`` with the desired signals among its output ports,
            e.g. a `PathSource`; None for a law that asks for none.
        start: Posture to start from, shape (n,) [rad]; by default the arm's home posture.
        task: Rows of the task, a key of `drake_rnn.task.TASKS`.
        dither: Excitation of the joints, if any.
        filter: What the command goes through on its way to the arm, not yet in ``builder``.
        feedback: ``commanded``: the law sees the arm that the filtered command moves.
            ``unfiltered``: it sees a virtual arm that its own command moves, so that no loop
            runs through the filter's delay, and the arm does later what the virtual one did.
        signals: Output ports in ``builder`` that the law sees in place of those offered here
            by the same names.
        seed: Of the dither.
        outside: How far the start may lie outside the position limits [rad].
        prefix: Of the systems' names, for more than one loop in a diagram.

    Raises:
        InvalidInputError: If the law wants what nothing here offers, or in another size; or
            the start posture is missing, of the wrong size or outside the position limits; or
            the filter does not go with controller, feedback or noise.
    """
    start = start_posture(arm, start, outside)
    check_filter(filter is not None, feedback, dither)
    period = getattr(controller, "period", None)
    if filter is not None and period is not None and filter.period != period:
        raise InvalidInputError(
            f"filter: its period, {filter.period:g} s, must be the controller's, {period:g} s"
        )
    builder.AddNamedSystem(f"{prefix}controller", controller)
    virtual = feedback == "unfiltered"
    seen = _add_body(builder, arm, start, task, f"{prefix}virtual_" if virtual else prefix)

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

    _move(builder, seen, moved, measured)
    position = seen.joint_command.get_output_port()
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
    offered |= signals or {}
    if "position_preview" in controller.law.inputs and "position_preview" in offered:
        _require_same_interval(controller, offered["position_preview"].get_system())
    _require_one_period_ahead(controller, reference)
    for name in controller.law.inputs.parts:
        if name not in offered:
            raise InvalidInputError(
                f"{controller.get_name()}: nothing in this diagram offers {name!r}; "
                f"there are {', '.join(sorted(offered))}{_HINTS.get(name, '')}"
            )
        _connect(builder, offered[name], controller.GetInputPort(name))
    if filter is None or not virtual:
        return KinematicLoop(controller, *seen, filter)
    _connect(builder, moved, filter.get_input_port())
    body = _add_body(builder, arm, start, task, prefix)
    _move(builder, body, filter.get_output_port(), filter.get_output_port())
    return KinematicLoop(controller, *body, filter, seen.arm)


class _Body(NamedTuple):
    kinematics: Kinematics
    joint_command: Integrator
    arm: Mirror


def _add_body(builder: DiagramBuilder, arm: Arm, start: Array, task: str, prefix: str) -> _Body:
    return _Body(
        builder.AddNamedSystem(f"{prefix}kinematics", Kinematics(arm, task)),
        builder.AddNamedSystem(f"{prefix}joint_command", Integrator(start)),
        builder.AddNamedSystem(f"{prefix}arm", Mirror(arm.n)),
    )


def _move(builder: DiagramBuilder, body: _Body, moved: OutputPort, measured: OutputPort) -> None:
    """Let the velocity ``moved`` move a body, of which ``measured`` is seen."""
    position = body.joint_command.get_output_port()
    _connect(builder, moved, body.joint_command.get_input_port())
    _connect(builder, position, body.arm.GetInputPort("position_commanded"))
    _connect(builder, moved, body.arm.GetInputPort("velocity_commanded"))
    _connect(builder, position, body.kinematics.GetInputPort("position"))
    _connect(builder, measured, body.kinematics.GetInputPort("velocity"))


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
    "position_preview": "; give a JointReference",
    "p_preview": "; give the PathSource a preview of one period",
}

# What is computed only for a law that asks for it.
_DYNAMICS = {"M", "bias", "gravity"}


def check_filter(filtered: bool, feedback: Feedback, dither: DitherSettings | None) -> None:
    """Raise an InvalidInputError if feedback or noise do not go with the filter, or its absence."""
    if feedback not in get_args(Feedback):
        raise InvalidInputError(f"feedback: may be commanded or unfiltered, not {feedback!r}")
    if feedback == "unfiltered" and not filtered:
        raise InvalidInputError("feedback: unfiltered is for a loop with a filter; give one")
    if filtered and feedback == "commanded" and dither is not None and dither.model == "actuated":
        raise InvalidInputError(
            "dither.model: actuated would move the arm behind the filter, beyond its bounds; "
            "it may be virtual"
        )


def start_posture(arm: Arm, start: Array | None, outside: float = 0.0) -> Array:
    """The posture to start from, shape (n,) [rad]: ``start``, else the arm's home posture.

    Raises:
        InvalidInputError: If there is none, or it is not one of this arm's, or lies outside
            its position limits by more than ``outside`` [rad].
    """
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
            f"{_place(port)} has {port.size()} entries, {_place(output)} has {output.size()}; "
            "the law's task_size and number of joints must be those of task and arm"
        )
    builder.Connect(output, port)


def _place(port: InputPort | OutputPort) -> str:
    return f"{port.get_system().get_name()}.{port.get_name()}"


def _outputs(system: System) -> list[OutputPort]:
    return [system.get_output_port(index) for index in range(system.num_output_ports())]

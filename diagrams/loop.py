"""The closed loop of a controller, a body and a reference, connected by port names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import NoneType
from typing import NamedTuple

from pydrake.systems.framework import DiagramBuilder, OutputPort, System
from pydrake.systems.primitives import Integrator

from ..errors import InvalidInputError
from ..features.base import DifferentialDrive, drive_of
from ..features.camera import ToolCamera
from ..features.feature import JointVelocity, LoopBuild, LoopPart, Ports, Wiring, ports_of
from ..features.filter import MovingAverage
from ..features.joint_noise import JointNoise
from ..features.locks import JointLocks
from ..features.pairs import LISTED, Combination, refuse
from ..features.sensing import SensingSettings
from ..inputs.fields import require_seed
from ..inputs.messages import field_names, nearest, require_several, require_type
from ..robot.task import Task, TaskSection, named_task, suits, tasks_suiting
from ..signals import HINTS
from ..systems.body import (
    DYNAMICS_SIGNALS,
    Body,
    Dynamics,
    Feedback,
    IdealArm,
    Kinematics,
)
from ..systems.controllers import Controller
from ..systems.sources import JointReference, PreviewSource


@dataclass(frozen=True)
class Loop:
    """Systems added by `AddLoop`.

    Attributes:
        controller: Controller that runs the law.
        kinematics: Kinematics of ``arm``.
        joint_command: Integrator of the commanded velocity; its output is the commanded joint
            position.
        arm: The body.
        filter: Filter between the command and the arm, or None.
        virtual_arm: Arm that the law sees with ``feedback: unfiltered``; None otherwise.
        measured: Output ports of what sensors say of joints, end effector and pixels, by name; of
            these only without ``sensing``.
        forces: Output ports of the forces on the tool, by name: ``contact_force``, ``tool_force``
            and ``normal_force``; empty without a contact.
        recorded: Further output ports that a run records, by name.
        systems: All added systems, by name without the prefix.
    """

    controller: Controller
    kinematics: Kinematics
    joint_command: Integrator
    arm: Body
    filter: MovingAverage | None
    virtual_arm: Body | None
    measured: Mapping[str, OutputPort]
    forces: Mapping[str, OutputPort]
    recorded: Mapping[str, OutputPort]
    systems: Mapping[str, System]


def AddLoop(  # noqa: PLR0913  entry point: one argument per part of a loop
    builder: DiagramBuilder,
    body: Body,
    controller: Controller,
    reference: System | None = None,
    *,
    task: TaskSection = "xyz",
    dither: JointNoise | None = None,
    filter: MovingAverage | None = None,
    feedback: Feedback | None = None,
    sensing: SensingSettings | None = None,
    signals: Mapping[str, OutputPort] | None = None,
    locks: JointLocks | None = None,
    camera: ToolCamera | None = None,
    parts: Sequence[LoopPart] = (),
    seed: int = 0,
    prefix: str = "",
) -> Loop:
    """Add the closed loop of a controller and a body, and connect it to a reference.

    Ports are connected by name: each input of the law to the output of the same name that the
    kinematics, the body, the contact or the reference offers. A law without the input ``J`` never
    sees the Jacobian.

    Args:
        builder: Diagram builder that the systems are added to.
        body: The arm, not yet in ``builder``: an `IdealArm` at the kinematic level, a `PlantArm`
            with full dynamics.
        controller: Controller that runs the law, not yet in ``builder``.
        reference: System in ``builder`` that offers the desired signals as output ports, e.g. a
            `PathSource`; None for a law that needs none.
        task: A key of `drake_rnn.robot.task.TASKS`, a list of objectives as a document has it, or
            the `drake_rnn.robot.task.Task` of one.
        dither: Excitation or disturbance of the joints; None for none.
        filter: Filter between the command and the arm, not yet in ``builder``; None for none.
        feedback: Arm that the law sees: ``commanded``, the arm that the filtered command moves;
            ``measured``, the body itself; or ``unfiltered``, a virtual arm that the unfiltered
            command moves. With ``unfiltered`` the filter's delay lies outside the loop, and the
            body repeats the virtual arm's motion with that delay. By default the body's own
            ``default_feedback``, and ``measured`` with ``sensing``.
        sensing: Imperfections of the measured joints, and of all kinematics that follow from
            them, or of a pose that is measured from outside; None for the true joints.
        signals: Output ports in ``builder`` that replace, by name, those offered here.
        locks: When joints lock, whatever is commanded; None for sound joints. A law is told of it
            by the same argument of its `SampledController`.
        camera: Camera that sees points on the tool, for a law with the input ``pixels``; its
            reference is an `ImageSource`.
        parts: Further parts of the loop, of features of your own.
        seed: Seed of dither and sensors.
        prefix: Prefix of the systems' names, for several loops in one diagram.

    Raises:
        InvalidInputError: If the law needs an input that nothing offers, or of another size; if
            the filter does not fit controller, feedback or dither; if the body cannot run in this
            loop; if ``sensing``, ``locks`` or ``camera`` do not fit controller, feedback, dither or
            arm; or if an argument has the wrong type.
    """
    _check_arguments(builder, reference, signals, seed, prefix)
    require_type("body", body, Body)
    if drive_of(body.arm) is not None and not isinstance(controller.wrapper, DifferentialDrive):
        raise InvalidInputError(
            "controller: must lead the differential drive of the arm's base; give "
            "SampledController locks: DifferentialDrive() of drake_rnn.features.base"
        )
    if not isinstance(task, str):
        task = _task_at(task, body)
    feedback = body.chosen_feedback(feedback, has_sensing=sensing is not None)
    contact = body.contact if isinstance(body.contact, LoopPart) else None
    features = {"dither": dither, "filter": filter, "sensing": sensing, "locks": locks}
    every = _parts({**features, "camera": camera}, contact, parts)
    _check_parts(body, controller, task, feedback, every)
    given = _given_signals(signals, controller)
    wiring = Wiring(builder, prefix)
    wiring.add("controller", controller)
    # The law sees the arm itself, or a virtual arm ahead of the filter.
    virtual = _virtual_arm(body) if feedback == "unfiltered" else None
    seen = moved = _add_moved(
        wiring, virtual or body, task, "" if virtual is None else "virtual_", shares=sensing is None
    )
    command = controller.GetOutputPort("commanded_velocity")
    loop = LoopBuild(
        wiring,
        body,
        task,
        controller.period,
        seed,
        virtual=virtual is not None,
        parts=every,
        given=given,
        velocity=JointVelocity(command, command, command),
        reference={} if reference is None else ports_of(reference),
    )
    for part in loop.parts:
        part.change_command(loop)
    _move(wiring, seen, loop.velocity.moved)
    if not body.follows_command:
        _exert(wiring, controller, body)
    if virtual is not None and filter is not None:
        wiring.connect(loop.velocity.moved, filter.get_input_port())
        moved = _add_behind_filter(wiring, body, task, filter)
    for part in loop.parts:
        part.add_sensors(loop)
    offered = _offered(loop, seen, feedback, controller, reference)
    _check_offers(controller, offered, seen.kinematics, task)
    for name in controller.reading.inputs.parts:
        wiring.connect(offered[name], controller.GetInputPort(name))
    measured = loop.joints | loop.outside
    return Loop(
        controller, *moved, filter, virtual, measured, loop.forces, loop.recorded, wiring.systems
    )


# Arguments of `AddLoop` that are features, with their types, in the order in which they act.
_FEATURES: dict[str, type[LoopPart]] = {
    "filter": MovingAverage,
    "dither": JointNoise,
    "locks": JointLocks,
    "camera": ToolCamera,
    "sensing": SensingSettings,
}


def _parts(
    features: Mapping[str, LoopPart | None],
    contact: LoopPart | None,
    others: Sequence[LoopPart],
) -> list[LoopPart]:
    """Return the parts of a loop that are given, in the order in which they act."""
    for name, kind in _FEATURES.items():
        require_type(name, features[name], kind, NoneType)
    require_several("parts", others)
    for number, part in enumerate(others):
        require_type(f"parts[{number}]", part, LoopPart)
    every = (*(features[name] for name in _FEATURES), contact, *others)
    return [part for part in every if part is not None]


def _offered(
    loop: LoopBuild,
    seen: _Moved,
    feedback: Feedback,
    controller: Controller,
    reference: System | None,
) -> Ports:
    """Return the signals that a law may see, by name; dynamics are added if it does."""
    position, measured, shown = _joints_seen(seen, loop.velocity, feedback, loop.joints)
    offered = {"position": position, "velocity": shown}
    offered |= _evaluate(loop.wiring, seen.kinematics, position, measured) | loop.outside
    if reference is not None:
        offered |= ports_of(reference)
    if controller.reading.inputs.parts.keys() & set(DYNAMICS_SIGNALS):
        dynamics = loop.wiring.add("dynamics", Dynamics(loop.body.arm))
        offered |= _evaluate(loop.wiring, dynamics, position, measured)
    return offered | loop.offered | dict(loop.given)


class _Moved(NamedTuple):
    """A body with the integrator of its command and its kinematics."""

    kinematics: Kinematics
    joint_command: Integrator
    body: Body


def _virtual_arm(body: Body) -> IdealArm:
    # The body has already checked how far the start lies outside the limits.
    outside = float(body.arm.limits.violation(body.start).max())
    return IdealArm(body.arm, body.start, outside=outside)


def _add_moved(
    wiring: Wiring, body: Body, task: TaskSection, name: str = "", *, shares: bool = True
) -> _Moved:
    """Add a body with what moves it; kinematics of another posture than its own share nothing."""
    kinematics = Kinematics(body.arm, task, body.kinematics if shares else None)
    return _Moved(
        wiring.add(f"{name}kinematics", kinematics),
        wiring.add(f"{name}joint_command", Integrator(body.start)),
        wiring.add(f"{name}arm", body),
    )


def _move(wiring: Wiring, moved: _Moved, velocity: OutputPort) -> None:
    """Connect a joint velocity and its integral to a body as its command."""
    wiring.connect(velocity, moved.joint_command.get_input_port())
    position = moved.joint_command.get_output_port()
    wiring.connect(position, moved.body.GetInputPort("position_commanded"))
    wiring.connect(velocity, moved.body.GetInputPort("velocity_commanded"))


def _exert(wiring: Wiring, controller: Controller, body: Body) -> None:
    """Connect the torques of a law to a body that they move."""
    wiring.connect(controller.GetOutputPort("torque"), body.GetInputPort("torque_commanded"))


def _add_behind_filter(
    wiring: Wiring, body: Body, task: TaskSection, filter: MovingAverage
) -> _Moved:
    """Add the arm behind the filter, which repeats the virtual arm's motion with a delay."""
    moved, velocity = _add_moved(wiring, body, task), filter.get_output_port()
    _move(wiring, moved, velocity)
    _evaluate(wiring, moved.kinematics, moved.joint_command.get_output_port(), velocity)
    return moved


def _joints_seen(
    seen: _Moved, velocity: JointVelocity, feedback: Feedback, joints: Ports
) -> tuple[OutputPort, OutputPort, OutputPort]:
    """Return joint position, velocity that ``v_WE`` is computed from, velocity the law sees."""
    if joints:
        return joints["position"], joints["velocity"], joints["velocity"]
    if feedback == "measured":
        measured = seen.body.GetOutputPort("velocity")
        return seen.body.GetOutputPort("position"), measured, measured
    return seen.joint_command.get_output_port(), velocity.measured, velocity.shown


def _evaluate(wiring: Wiring, system: System, position: OutputPort, velocity: OutputPort) -> Ports:
    """Connect joint position and velocity to a system and return its output ports."""
    wiring.connect(position, system.GetInputPort("position"))
    wiring.connect(velocity, system.GetInputPort("velocity"))
    return ports_of(system)


# What a loop refuses, before anything of it is connected or run.


def _check_arguments(
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


def _task_at(task: TaskSection, body: Body) -> Task:
    """Return the task of an arm at its start."""
    kinematics, start = body.kinematics, body.start
    return named_task(task).at(kinematics.R_WE(start), kinematics, start)


def _check_parts(
    body: Body,
    controller: Controller,
    task: TaskSection,
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
    asked = named_task(task)
    refuse(
        Combination(
            documented=False,
            level=type(body),
            task=task if isinstance(task, str) else LISTED,
            ranges=asked.has_ranges,
            weights=asked.has_weights,
            frames=bool(asked.frames),
            pair=body.arm.description.pair is not None,
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


def _given_signals(signals: Mapping[str, OutputPort] | None, controller: Controller) -> Ports:
    """Return the signals in place of those offered; ones that nothing asks for are refused."""
    given = dict(signals or {})
    asked = [*controller.reading.inputs.parts, *_OF_THE_CONTACT]
    for name, port in given.items():
        if isinstance(part := port.get_system(), LoopPart):
            part.check(controller)
        if name not in asked:
            raise InvalidInputError(
                f"signals.{name}: nothing in this loop asks for it; {nearest(name, asked)}"
            )
    return given


def _check_offers(
    controller: Controller,
    offered: Mapping[str, OutputPort],
    kinematics: Kinematics,
    task: TaskSection,
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
    controller: Controller,
    kinematics: Kinematics,
    task: TaskSection,
    offered: Mapping[str, OutputPort],
) -> None:
    """Raise an InvalidInputError if the law is made for another task than the kinematics."""
    inputs = controller.reading.inputs.parts.items()
    shapes = {
        name: shape for name, (_, shape) in inputs if offered[name].get_system() is kinematics
    }
    if not isinstance(task, str):
        if suits(named_task(task), shapes):
            return
        raise InvalidInputError(
            f"task: its objectives have {named_task(task).size} rows, and this "
            f"{type(controller.law).__name__} is for another number"
        )
    able = tasks_suiting(shapes)
    # Where the law fits no task, connecting the ports will name the one of the wrong size.
    if task in able or not able:
        return
    law = type(controller.law)
    takes_size = "task_size" in field_names(law)
    hint = f"; or give the law task_size={named_task(task).size}" if takes_size else ""
    raise InvalidInputError(
        f"task: may be {', '.join(able)} for this {law.__name__}, not {task}{hint}"
    )

"""The closed loop of a controller, a body and a reference, connected by port names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort, System
from pydrake.systems.primitives import Adder, Integrator, MatrixGain

from ..features.camera import Camera, ToolCamera
from ..features.contact import Contact, ContactReference, ForceSensor, ForceWatch, NormalForce
from ..features.filter import MovingAverage
from ..features.joint_noise import HeldNoise, JointNoise
from ..features.locks import JointBrakes, JointLocks
from ..features.sensing import JointSensor, PoseSensor, SensingSettings
from ..inputs.messages import require_type
from ..systems.body import (
    DYNAMICS_SIGNALS,
    Body,
    Dynamics,
    Feedback,
    IdealArm,
    Kinematics,
)
from ..systems.controllers import Controller
from .checks import check_arguments, check_offers, check_parts, given_signals
from .wiring import Ports, Wiring, ports_of

#: Samples from one check of the force sensor to the next: each costs time, and a stuck sensor stays
#: stuck.
WATCHED = 10


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
    systems: Mapping[str, System]


def AddLoop(  # noqa: PLR0913  entry point: one argument per part of a loop
    builder: DiagramBuilder,
    body: Body,
    controller: Controller,
    reference: System | None = None,
    *,
    task: str = "xyz",
    dither: JointNoise | None = None,
    filter: MovingAverage | None = None,
    feedback: Feedback | None = None,
    sensing: SensingSettings | None = None,
    signals: Mapping[str, OutputPort] | None = None,
    locks: JointLocks | None = None,
    camera: ToolCamera | None = None,
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
        task: Task: a key of `drake_rnn.robot.kinematics.TASKS`.
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
        seed: Seed of dither and sensors.
        prefix: Prefix of the systems' names, for several loops in one diagram.

    Raises:
        InvalidInputError: If the law needs an input that nothing offers, or of another size; if
            the filter does not fit controller, feedback or dither; if the body cannot run in this
            loop; if ``sensing``, ``locks`` or ``camera`` do not fit controller, feedback, dither or
            arm; or if an argument has the wrong type.
    """
    check_arguments(builder, reference, signals, seed, prefix)
    require_type("body", body, Body)
    feedback = body.chosen_feedback(feedback, sensed=sensing is not None)
    features = {"dither": dither, "filter": filter, "sensing": sensing, "locks": locks}
    check_parts(body, controller, task, feedback, {**features, "camera": camera})
    given = given_signals(signals, controller)
    wiring = Wiring(builder, prefix)
    wiring.add("controller", controller)
    # The law sees the arm itself, or a virtual arm ahead of the filter.
    virtual = _virtual_arm(body) if feedback == "unfiltered" else None
    seen = _add_moved(
        wiring, virtual or body, task, "" if virtual is None else "virtual_", shares=sensing is None
    )
    command = controller.GetOutputPort("commanded_velocity")
    if filter is not None:
        wiring.add("filter", filter)
        if virtual is None:
            wiring.connect(command, filter.get_input_port())
            command = filter.get_output_port()
    velocity = _add_dither(wiring, dither, command, seed)
    velocity = _add_brakes(wiring, body, locks, velocity, controller.period)
    _move(wiring, seen, velocity.moved)
    joints, outside = _add_sensors(wiring, body, task, sensing, camera, controller.period, seed)
    position, measured, shown = _joints_seen(seen, velocity, feedback, joints)
    offered = {"position": position, "velocity": shown}
    offered |= _evaluate(wiring, seen.kinematics, position, measured) | outside
    if reference is not None:
        offered |= ports_of(reference)
    if controller.reading.inputs.parts.keys() & set(DYNAMICS_SIGNALS):
        dynamics = wiring.add("dynamics", Dynamics(body.arm))
        offered |= _evaluate(wiring, dynamics, position, measured)

    moved = seen
    if virtual is not None and filter is not None:
        wiring.connect(velocity.moved, filter.get_input_port())
        moved = _add_behind_filter(wiring, body, task, filter)
    forces: Ports = {}
    if body.contact is not None:
        told, forces = _offer_contact(wiring, body, body.contact, controller.period, given, seed)
        offered |= told
    offered |= given
    check_offers(controller, offered, seen.kinematics, task)
    for name in controller.reading.inputs.parts:
        wiring.connect(offered[name], controller.GetInputPort(name))
    return Loop(controller, *moved, filter, virtual, joints | outside, forces, wiring.systems)


class _Moved(NamedTuple):
    """A body with the integrator of its command and its kinematics."""

    kinematics: Kinematics
    joint_command: Integrator
    body: Body


class _Velocity(NamedTuple):
    """Joint velocities in the loop, shape (n,) [rad/s].

    Attributes:
        moved: Velocity that moves the arm.
        measured: Velocity that ``v_WE`` is computed from.
        shown: Velocity that the law sees.
    """

    moved: OutputPort
    measured: OutputPort
    shown: OutputPort


def _virtual_arm(body: Body) -> IdealArm:
    # The body has already checked how far the start lies outside the limits.
    outside = float(body.arm.limits.violation(body.start).max())
    return IdealArm(body.arm, body.start, outside=outside)


def _add_moved(
    wiring: Wiring, body: Body, task: str, name: str = "", *, shares: bool = True
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


def _add_behind_filter(wiring: Wiring, body: Body, task: str, filter: MovingAverage) -> _Moved:
    """Add the arm behind the filter, which repeats the virtual arm's motion with a delay."""
    moved, velocity = _add_moved(wiring, body, task), filter.get_output_port()
    _move(wiring, moved, velocity)
    _evaluate(wiring, moved.kinematics, moved.joint_command.get_output_port(), velocity)
    return moved


def _add_dither(
    wiring: Wiring, dither: JointNoise | None, command: OutputPort, seed: int
) -> _Velocity:
    if dither is None:
        return _Velocity(command, command, command)
    n = command.size()
    noise = wiring.add(dither.section, HeldNoise(n, dither, seed))
    adder = wiring.add("dithered_velocity", Adder(2, n))
    wiring.connect(command, adder.get_input_port(0))
    wiring.connect(noise.get_output_port(), adder.get_input_port(1))
    dithered = adder.get_output_port()
    return {
        "actuated": _Velocity(dithered, dithered, dithered),
        "virtual": _Velocity(command, dithered, dithered),
        "printed": _Velocity(command, command, dithered),
    }[dither.model]


def _add_brakes(
    wiring: Wiring,
    body: Body,
    locks: JointLocks | None,
    velocity: _Velocity,
    period: float | None,
) -> _Velocity:
    """Return what brakes leave of the velocities, which are one; without brakes, as they are."""
    if locks is None or period is None:
        return velocity
    brakes = wiring.add("brakes", JointBrakes(locks, body.arm.limits, period))
    wiring.connect(velocity.moved, brakes.get_input_port())
    braked = brakes.get_output_port()
    return _Velocity(braked, braked, braked)


def _add_sensors(
    wiring: Wiring,
    body: Body,
    task: str,
    sensing: SensingSettings | None,
    camera: ToolCamera | None,
    period: float | None,
    seed: int,
) -> tuple[Ports, Ports]:
    """Return what sensors say of the body's joints, and from outside of its tool."""
    pixels = _add_camera(wiring, body, camera, sensing, period, seed)
    if sensing is None or period is None:
        return {}, pixels
    joints = wiring.add("joint_sensor", JointSensor(sensing, body.arm, body.start, period, seed))
    for name in ("position", "velocity"):
        wiring.connect(body.GetOutputPort(name), joints.GetInputPort(f"{name}_true"))
    if not sensing.from_outside:
        return ports_of(joints), pixels
    sensor = PoseSensor(sensing, body.kinematics, task, body.start, period, seed)
    pose = wiring.add("pose_sensor", sensor)
    wiring.connect(body.GetOutputPort("position"), pose.GetInputPort("position_true"))
    return ports_of(joints), ports_of(pose) | pixels


def _add_camera(
    wiring: Wiring,
    body: Body,
    camera: ToolCamera | None,
    sensing: SensingSettings | None,
    period: float | None,
    seed: int,
) -> Ports:
    """Return what a camera says of the true body; nothing without one."""
    if camera is None or period is None:
        return {}
    settings = SensingSettings() if sensing is None else sensing
    seeing = Camera(camera, settings, body.kinematics, body.start, period, seed)
    wiring.add("camera", seeing)
    wiring.connect(body.GetOutputPort("position"), seeing.GetInputPort("position_true"))
    return ports_of(seeing)


def _joints_seen(
    seen: _Moved, velocity: _Velocity, feedback: Feedback, joints: Ports
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


def _offer_contact(
    wiring: Wiring,
    body: Body,
    contact: Contact,
    period: float | None,
    given: Mapping[str, OutputPort],
    seed: int,
) -> tuple[Ports, Ports]:
    """Add the contact's signals; return those the law may see and the forces on the tool."""
    reference = ContactReference(contact.surface.believed_normal_W, contact.force)
    wiring.add("contact_reference", reference)
    told = ports_of(reference)
    tool_force = body.GetOutputPort("tool_force")
    if (normal := given.get("normal_WE")) is None:
        # For a constant normal Drake's own block is faster.
        row = contact.surface.believed_normal_W[np.newaxis, :]
        pressing: System = wiring.add("normal_force", MatrixGain(row))
    else:
        pressing = wiring.add("normal_force", NormalForce())
        wiring.connect(normal, pressing.GetInputPort("normal_WE"))
    wiring.connect(tool_force, pressing.get_input_port(0))
    normal_force = pressing.get_output_port()
    if contact.sensor is not None and period is not None:
        sensor = wiring.add("force_sensor", ForceSensor(contact.sensor, period, seed))
        wiring.connect(normal_force, sensor.get_input_port())
        normal_force = sensor.get_output_port()
    told["normal_force"] = normal_force
    shown = given.get("normal_force", normal_force)
    if period is not None:
        position = body.GetOutputPort("position")
        watch = wiring.add("force_watch", ForceWatch(position.size(), WATCHED * period))
        wiring.connect(shown, watch.GetInputPort("normal_force"))
        wiring.connect(position, watch.GetInputPort("position"))
    contact_force = body.GetOutputPort("contact_force")
    felt = {"contact_force": contact_force, "tool_force": tool_force, "normal_force": shown}
    return told, felt

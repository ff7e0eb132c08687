"""The dynamic diagram: an arm with mass, motors and contact, and the same laws round it."""

from __future__ import annotations

from collections.abc import Mapping
from types import NoneType

from pydrake.systems.framework import DiagramBuilder, OutputPort, System

from drake_rnn.arms import Arm
from drake_rnn.complaints import require_type
from drake_rnn.environments import ContactModel
from drake_rnn.errors import InvalidInputError
from drake_rnn.fields import Array
from drake_rnn.systems.dither import DitherSettings
from drake_rnn.systems.moving_average import MovingAverage
from drake_rnn.systems.plant import PlantSettings
from drake_rnn.systems.plant_arm import PlantArm

from .contact import Contact
from .loop import Controller, Feedback, Loop, add_loop, start_posture


def AddDynamicLoop(
    builder: DiagramBuilder,
    arm: Arm,
    controller: Controller,
    reference: System | None = None,
    *,
    start: Array | None = None,
    task: str = "xyz",
    plant: PlantSettings | None = None,
    dither: DitherSettings | None = None,
    filter: MovingAverage | None = None,
    feedback: Feedback = "measured",
    contact: Contact | None = None,
    signals: Mapping[str, OutputPort] | None = None,
    seed: int = 0,
    outside: float = 0.0,
    prefix: str = "",
) -> Loop:
    """Add a controller with a `PlantArm` round it, and join both to a reference.

    The drawing is that of `AddKinematicLoop` with another arm, so that any law runs in it.

    Args:
        builder: Takes the systems.
        arm: The arm.
        controller: A law as a system, sampled, not yet in ``builder``.
        reference: What is desired, in ``builder``; see `AddKinematicLoop`.
        start: Posture to start from, shape (n,) [rad]; by default the arm's home posture.
        task: Rows of the task, a key of `drake_rnn.task.TASKS`.
        plant: How the arm is simulated and driven.
        dither: Excitation of the joints, if any.
        filter: What the command goes through on its way to the arm, not yet in ``builder``.
        feedback: ``measured``: the law sees where the arm is; ``commanded``, where it is told
            to be; ``unfiltered``, see `AddKinematicLoop`.
        contact: What the tool presses against: a `ContactModel` such as a `Plate`, or one of
            the user's own; None for an arm in free space.
        signals: Output ports in ``builder`` that the law sees in place of those offered here
            by the same names.
        seed: Of dither and sensor.
        outside: How far the start may lie outside the position limits [rad].
        prefix: Of the systems' names, for more than one loop in a diagram.

    Raises:
        InvalidInputError: As `AddKinematicLoop` and `PlantArm` do, or if the controller is not
            sampled, or the surface is not made of bodies.
    """
    start = start_posture(arm, start, outside)
    if getattr(controller, "period", None) is None:
        raise InvalidInputError(
            "controller: at the dynamic level it must be sampled; give a period, no integrator"
        )
    require_type("plant", plant, PlantSettings, NoneType)
    require_type("contact", contact, Contact, NoneType)
    environment: ContactModel | None = None
    p_WS = None
    if contact is not None:
        surface = contact.surface
        if not isinstance(surface, ContactModel):
            raise InvalidInputError(
                "environment: at the dynamic level it must be made of bodies, as a plate is, not "
                f"{type(surface).__name__}"
            )
        environment = surface
        p_WS = contact.place(arm, start)
    # The law is shown, and the sensor turned by, the same posture.
    shared = arm.kinematics()
    body = PlantArm(arm, start, environment, p_WS, plant, shared)

    return add_loop(
        builder,
        arm,
        controller,
        reference,
        body,
        start=start,
        task=task,
        dither=dither,
        filter=filter,
        feedback=feedback,
        contact=contact,
        signals=signals,
        seed=seed,
        prefix=prefix,
        kinematics=shared,
    )

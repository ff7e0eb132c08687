"""The kinematic diagram: an arm that does what it is told, and a law round it."""

from __future__ import annotations

from collections.abc import Mapping
from types import NoneType

from pydrake.systems.framework import DiagramBuilder, OutputPort, System

from drake_rnn.arms import Arm
from drake_rnn.complaints import require_type
from drake_rnn.environments import ElasticSurface
from drake_rnn.errors import InvalidInputError
from drake_rnn.fields import Array
from drake_rnn.systems.dither import DitherSettings
from drake_rnn.systems.mirror import Mirror
from drake_rnn.systems.moving_average import MovingAverage
from drake_rnn.systems.spring_contact import SpringContact
from drake_rnn.task import named_task

from .contact import Contact
from .loop import Controller, Feedback, Loop, add_loop, start_posture


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
    contact: Contact | None = None,
    signals: Mapping[str, OutputPort] | None = None,
    seed: int = 0,
    outside: float = 0.0,
    prefix: str = "",
) -> Loop:
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
        contact: What the end effector presses against: an `ElasticSurface`.
        signals: Output ports in ``builder`` that the law sees in place of those offered here
            by the same names.
        seed: Of dither and sensor.
        outside: How far the start may lie outside the position limits [rad].
        prefix: Of the systems' names, for more than one loop in a diagram.

    Raises:
        InvalidInputError: If the law wants what nothing here offers, or in another size; or
            the start posture is missing, of the wrong size or outside the position limits; or
            the filter does not go with controller, feedback or noise; or the surface is made
            of bodies; or an argument is of another class.
    """
    start = start_posture(arm, start, outside)
    if feedback == "measured":
        raise InvalidInputError(
            "feedback: this arm is where it is commanded to be; measured is for the dynamic level"
        )

    require_type("contact", contact, Contact, NoneType)
    spring = None
    if contact is not None:
        if not isinstance(contact.surface, ElasticSurface):
            raise InvalidInputError(
                "environment: at the kinematic level it must be an elastic_surface, not "
                f"{type(contact.surface).__name__}"
            )
        if len(named_task(task).axes) != 3:
            raise InvalidInputError(f"task: must be xyz or pose with a contact, not {task}")
        spring = SpringContact(contact.surface, contact.place(arm, start))
    return add_loop(
        builder,
        arm,
        controller,
        reference,
        Mirror(arm.n),
        start=start,
        task=task,
        dither=dither,
        filter=filter,
        feedback=feedback,
        contact=contact,
        signals=signals,
        seed=seed,
        prefix=prefix,
        spring=spring,
    )

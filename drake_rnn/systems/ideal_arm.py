"""The arm at the kinematic level, which follows its command exactly."""

from __future__ import annotations

from typing import ClassVar

from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import PassThrough

from ..environments import ElasticSurface, Surface
from ..errors import InvalidInputError
from ..inputs.fields import Array
from ..robot.arm import Arm
from .body import Body, Feedback
from .contact import Contact
from .spring_contact import SpringContact


class IdealArm(Body):
    """An arm without mass that follows its command exactly; surfaces act on it as springs.

    Ports are those of `Body`; the outputs ``position`` and ``velocity`` are the commanded ones.

    Args:
        arm: The arm.
        start: Start posture, shape (n,) [rad]; by default the arm's home posture.
        contact: Contact with an `ElasticSurface`; None for an arm in free space.
        outside: How far the start may lie outside the position limits [rad].

    Raises:
        InvalidInputError: In the same cases as `Body`.
    """

    level = "kinematic"
    default_feedback: ClassVar[Feedback] = "commanded"
    surfaces: ClassVar[type[Surface]] = ElasticSurface
    has_motors = False

    def __init__(
        self,
        arm: Arm,
        start: Array | None = None,
        contact: Contact | None = None,
        *,
        outside: float = 0.0,
    ) -> None:
        super().__init__(arm, start, contact, outside=outside)
        builder = DiagramBuilder()
        for name in ("position", "velocity"):
            block = builder.AddNamedSystem(name, PassThrough(arm.n))
            builder.ExportInput(block.get_input_port(), f"{name}_commanded")
            builder.ExportOutput(block.get_output_port(), name)
        if contact is not None and isinstance(contact.surface, ElasticSurface):
            p_WS = contact.place(arm, self.start)
            spring = SpringContact(contact.surface, p_WS, arm.n, self.kinematics)
            builder.AddNamedSystem("contact", spring)
            position = builder.GetSubsystemByName("position").get_output_port()
            builder.Connect(position, spring.get_input_port())
            for name in ("contact_force", "tool_force"):
                builder.ExportOutput(spring.get_output_port(), name)
        builder.BuildInto(self)

    @classmethod
    def check_loop(cls, period: float | None, feedback: Feedback, *, sensed: bool = False) -> None:
        """Raise an InvalidInputError if ``feedback`` is measured, but nothing is sensed here."""
        super().check_loop(period, feedback, sensed=sensed)
        if feedback == "measured" and not sensed:
            raise InvalidInputError(
                "feedback: measured needs level: dynamic; at level: kinematic the arm is exactly "
                "where it is commanded to be, unless sensing is given"
            )

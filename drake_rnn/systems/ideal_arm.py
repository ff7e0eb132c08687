"""The arm at the kinematic level, which follows its command exactly."""

from __future__ import annotations

from typing import ClassVar

from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import PassThrough

from ..environments import ElasticSurface, Surface
from ..errors import InvalidInputError
from .body import Body, Feedback
from .spring_contact import SpringContact


class IdealArm(Body):
    """An arm without mass that follows its command exactly; surfaces act on it as springs.

    Arguments, errors and ports are those of `Body`; the outputs ``position`` and ``velocity`` are
    the commanded ones. A contact is with an `ElasticSurface`.
    """

    level = "kinematic"
    default_feedback: ClassVar[Feedback] = "commanded"
    surfaces: ClassVar[type[Surface]] = ElasticSurface
    has_motors = False

    def _build(self, builder: DiagramBuilder) -> None:
        arm, contact = self.arm, self.contact
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

    @classmethod
    def check_loop(cls, period: float | None, feedback: Feedback, *, sensed: bool = False) -> None:
        """Raise an InvalidInputError if ``feedback`` is measured, but nothing is sensed here."""
        super().check_loop(period, feedback, sensed=sensed)
        if feedback == "measured" and not sensed:
            raise InvalidInputError(
                "feedback: measured needs level: dynamic; at level: kinematic the arm is exactly "
                "where it is commanded to be, unless sensing is given"
            )

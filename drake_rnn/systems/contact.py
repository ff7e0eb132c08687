"""What the tool of an arm presses against, how hard, and how that is measured."""

from __future__ import annotations

from dataclasses import dataclass
from types import NoneType

from ..environments import ContactModel, ElasticSurface, Surface
from ..errors import InvalidInputError
from ..inputs.complaints import require_type
from ..inputs.fields import Array
from ..robot.arm import Arm
from ..robot.tool import standoff
from .contact_reference import ForceProfile
from .force_sensor import SensorSettings


@dataclass(frozen=True)
class Contact:
    """A surface and a force.

    Attributes:
        surface: For an `IdealArm` an `ElasticSurface`, for a `PlantArm` a `ContactModel`.
        force: To press with.
        sensor: Of the force; None for one that says what is.

    Raises:
        InvalidInputError: If one of them is something else.
    """

    surface: Surface
    force: ForceProfile
    sensor: SensorSettings | None = None

    def __post_init__(self) -> None:
        require_type("Contact.surface", self.surface, ElasticSurface, ContactModel)
        require_type("Contact.force", self.force, ForceProfile)
        require_type("Contact.sensor", self.sensor, SensorSettings, NoneType)

    def check_period(self, period: float | None) -> None:
        """Raise an InvalidInputError if there is a sensor and nothing to sample it by.

        Args:
            period: Of the controller [s]; None for one that Drake integrates.
        """
        if self.sensor is not None and period is None:
            raise InvalidInputError("sensor: is sampled like the law; give a period, no integrator")

    def place(self, arm: Arm, start: Array) -> Array:
        """The point of the surface below the tool at the start, shape (3,) [m].

        Raises:
            InvalidInputError: If the arm's frame has no tool, or how far it reaches is not known.
        """
        n = self.surface.normal_W
        reach = 0.0
        if isinstance(self.surface, ContactModel):
            given = self.surface.standoff
            reach = standoff(arm, start, n) if given is None else given
        return arm.kinematics().p_WE(start) - (self.surface.gap + reach) * n

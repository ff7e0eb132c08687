"""Contact of an arm's tool with a surface: the surface, the force and the force sensor."""

from __future__ import annotations

from dataclasses import dataclass
from types import NoneType

import numpy as np

from ..environments import ContactModel, ElasticSurface, Surface
from ..errors import InvalidInputError
from ..inputs.complaints import require_type, short
from ..inputs.fields import Array
from ..inputs.own_code import naming
from ..robot.arm import Arm
from ..robot.tool import standoff
from .contact_reference import ForceProfile
from .force_sensor import SensorSettings


@dataclass(frozen=True)
class Contact:
    """A surface, the force to press on it with, and the sensor of that force.

    Attributes:
        surface: An `ElasticSurface` for an `IdealArm`, a `ContactModel` for a `PlantArm`.
        force: Desired pressing force.
        sensor: Force sensor; None for an ideal one.

    Raises:
        InvalidInputError: If one of them has the wrong type, or the surface's normal is none.
    """

    surface: Surface
    force: ForceProfile
    sensor: SensorSettings | None = None

    def __post_init__(self) -> None:
        require_type("Contact.surface", self.surface, ElasticSurface, ContactModel)
        require_type("Contact.force", self.force, ForceProfile)
        require_type("Contact.sensor", self.sensor, SensorSettings, NoneType)
        _check_own(self.surface)

    def place(self, arm: Arm, start: Array) -> Array:
        """Return the point of the surface below the tool at the start, shape (3,) [m].

        Raises:
            InvalidInputError: If the arm's frame carries no tool, or the distance from the frame to
                the end of the tool is not known.
        """
        n = self.surface.normal_W
        reach = 0.0
        if isinstance(self.surface, ContactModel):
            given = self.surface.standoff
            reach = standoff(arm, start, n) if given is None else given
        return arm.kinematics().p_WE(start) - (self.surface.gap + reach) * n


def _check_own(surface: Surface) -> None:
    """Raise an InvalidInputError if what a user's own surface says of itself is wrong."""
    name = type(surface).__name__
    with naming(f"{name}.normal_W"):
        normals = {"normal_W": surface.normal_W, "believed_normal_W": surface.believed_normal_W}
    for key, normal in normals.items():
        if np.shape(normal) != (3,) or not abs(np.linalg.norm(normal) - 1.0) < 1e-9:
            raise InvalidInputError(
                f"{name}.{key}: must be an array of shape (3,) and of length 1, not {short(normal)}"
            )
    require_type(f"{name}.is_plane", surface.is_plane, bool)

"""A rigid plate."""

# No postponed annotations: see `surface`.
from typing import Annotated, Literal

import numpy as np
from pydantic import Field
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    Box,
    ProximityProperties,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant

from ..inputs.fields import Array, NonNegative, Point, Positive, validated, zeros
from .contact_model import ContactModel


@validated
class Plate(ContactModel):
    """A plate with its middle below the tool, its upper face the surface.

    Args:
        normal, gap, believed_normal: See `Surface`.
        standoff, tip: See `ContactModel`.
        friction: Of ball and plate.
        size: Length of its edges [m].
        thickness: [m].
        offset: Of its middle from below the tool, in the base frame [m].
        hydroelastic_modulus: Of a compliant plate [Pa]; None for a rigid one.
    """

    kind: Literal["plate"] = "plate"
    friction: NonNegative = 0.3
    size: Positive = 0.4
    thickness: Annotated[float, Field(strict=True, ge=0.005, allow_inf_nan=False)] = 0.04
    offset: Point = Field(default_factory=zeros)
    hydroelastic_modulus: Positive | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if abs(off := float(self.normal_W.dot(self.offset))) > 1e-9:
            raise ValueError(f"offset: must be along the plate; {off:.3g} m of it is a gap")

    def pose(self, p_WS: Array) -> RigidTransform:
        """Of its middle, z along the normal, for a surface through ``p_WS``, shape (3,) [m]."""
        n = self.normal_W
        R = RotationMatrix.MakeFromOneVector(n, 2)
        # Edges along the base's axes where the plate is level.
        if abs(n[2]) > 1.0 - 1e-12:
            R = RotationMatrix() if n[2] > 0.0 else RotationMatrix.MakeXRotation(np.pi)
        return RigidTransform(R, p_WS + self.offset - self.thickness / 2.0 * n)

    def add_to(self, plant: MultibodyPlant, p_WS: Array) -> None:
        """See `ContactModel.add_to`."""
        properties = ProximityProperties()
        if self.hydroelastic_modulus is None:
            AddRigidHydroelasticProperties(self.size, properties)
        else:
            AddCompliantHydroelasticProperties(self.size, self.hydroelastic_modulus, properties)
        AddContactMaterial(
            friction=CoulombFriction(self.friction, self.friction), properties=properties
        )
        plant.RegisterCollisionGeometry(
            plant.world_body(),
            self.pose(p_WS),
            Box(self.size, self.size, self.thickness),
            "plate",
            properties,
        )

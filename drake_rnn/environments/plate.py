"""A rigid or compliant plate."""

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

from ..inputs.fields import Array, Friction, Length, Modulus, Point, validated, zeros
from ..inputs.keys import Meaning
from .contact_model import ContactModel


@validated
class Plate(ContactModel):
    """A square plate centred below the tool; its face towards the tool is the surface."""

    kind: Literal["plate"] = "plate"
    friction: Annotated[Friction, Meaning("Friction coefficient of ball and plate.")] = 0.3
    size: Annotated[Length, Meaning("Edge length.", unit="m")] = 0.4
    thickness: Annotated[
        float,
        Field(strict=True, ge=0.005, le=1e3, allow_inf_nan=False),
        Meaning("Thickness.", unit="m"),
    ] = 0.04
    offset: Annotated[
        Point,
        Meaning("Offset of the centre along the plate, in the base frame, shape (3,).", unit="m"),
    ] = Field(default_factory=zeros)
    hydroelastic_modulus: Annotated[
        Modulus | None,
        Meaning("Hydroelastic modulus of a compliant plate [Pa]; None for a rigid one."),
    ] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if abs(off := float(self.normal_W.dot(self.offset))) > 1e-9:
            raise ValueError(
                f"offset: must be parallel to the plate, not {off:.3g} m along its normal; "
                "use gap for that"
            )

    def overhang(self, points: Array, p_WS: Array) -> float:
        """See `Surface.overhang`."""
        inside = self.pose(p_WS).inverse().multiply(points.T)
        return max(0.0, float(np.abs(inside[:2]).max()) - self.size / 2.0)

    def pose(self, p_WS: Array) -> RigidTransform:
        """Return the pose of the plate's centre in the base frame, z along the normal.

        Args:
            p_WS: Point of the surface below the tool at the start, shape (3,) [m].
        """
        n = self.normal_W
        R = RotationMatrix.MakeFromOneVector(n, 2)
        # The edges of a level plate lie along the base's axes.
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

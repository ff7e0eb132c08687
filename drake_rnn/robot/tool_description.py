"""A tool that is added to an arm's model: a ball at the end of a shaft, at any frame."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from pydantic import Field
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    Cylinder,
    ProximityProperties,
    Shape,
    Sphere,
)
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    Frame,
    ModelInstanceIndex,
    RigidBody,
    RotationalInertia,
    SpatialInertia,
    UnitInertia,
    WeldJoint,
)

from ..errors import InvalidInputError
from ..inputs.fields import (
    Angles,
    Array,
    Friction,
    Mass,
    Modulus,
    NonNegative,
    Point,
    Positive,
    between,
    validated,
    zeros,
)
from ..inputs.keys import Meaning
from .contact_mesh import require_coarse
from .structure import nearest_frame

# Colours of the drawn parts.
_BLACK = (0.18, 0.18, 0.2, 1.0)
_ALUMINIUM = (0.75, 0.76, 0.78, 1.0)
_RED = (0.85, 0.12, 0.1, 1.0)
# Proportions of what is drawn: the mounting plate's share of the length, and its radius over the
# shaft's; the shaft's radius over the ball's.
_PLATE, _FLARE, _SLENDER = 0.2, 3.5, 2.0 / 3.0
# The ball's radius over the edge length of its mesh, by default.
_FINENESS = 2.4


@validated
class ToolDescription:
    """A compliant ball at the end of a shaft: a rigid body, welded to a frame of an arm.

    The tool's frame T has its origin where the shaft begins; the shaft is T's z axis. Only the
    ball makes contact. At its centre is a frame with T's axes, named ``tip``.
    """

    mount: Annotated[
        str | None,
        Meaning(
            "Frame of the arm's model that carries the tool. By default the arm's ``frame``, and "
            "the task frame E is then the ball's centre.",
        ),
    ] = None
    ball: Annotated[
        Positive,
        between(1e-4, 1.0),
        Meaning("Radius of the ball.", unit="m"),
    ] = 0.012
    length: Annotated[
        Positive,
        between(1e-4, 10.0),
        Meaning("Distance from the shaft's beginning to the ball's centre.", unit="m"),
    ] = 0.1
    mass: Annotated[Mass, Meaning("Mass of the whole tool.", unit="kg")] = 0.1
    axis: Annotated[
        Point | None,
        Meaning(
            "Direction of the shaft in the mount's frame, of any length, shape (3,); T is turned "
            "to it the shortest way. By default z.",
        ),
    ] = None
    rpy: Annotated[
        Angles | None,
        Meaning(
            "Roll, pitch and yaw of T in the mount's frame, in place of ``axis``, shape (3,).",
            unit="rad",
        ),
    ] = None
    offset: Annotated[
        Point,
        Meaning("Origin of T in the mount's frame, shape (3,).", unit="m"),
    ] = Field(default_factory=zeros)
    centre_of_mass: Annotated[
        Point | None,
        Meaning("Centre of mass in T, shape (3,); by default the middle of the shaft.", unit="m"),
    ] = None
    inertia: Annotated[
        Point | None,
        Meaning(
            "Moments of inertia about T's axes through the centre of mass, shape (3,); by "
            "default those of a solid cylinder with the ball's radius and the length.",
            unit="kg m^2",
        ),
    ] = None
    friction: Annotated[
        Friction,
        Meaning("Friction coefficient of the ball; an environment may give another one."),
    ] = 0.3
    hydroelastic_modulus: Annotated[
        Modulus,
        Meaning("Pressure in the ball at full depth [Pa]."),
    ] = 1e6
    mesh_resolution: Annotated[
        Positive | None,
        Meaning("Edge length of the ball's mesh; by default 1 / 2.4 of its radius.", unit="m"),
    ] = None
    dissipation: Annotated[
        NonNegative,
        Meaning("Hunt-Crossley dissipation of the ball.", unit="s/m"),
    ] = 1.5
    shaft: Annotated[
        NonNegative | None,
        Meaning(
            "Radius of the drawn shaft [m], 0 to draw only the ball; by default 2/3 of the ball's.",
            unit="m",
        ),
    ] = None
    name: Annotated[str, Meaning("Name of the tool's body.")] = "tool"
    tip: Annotated[str, Meaning("Name of the frame at the ball's centre.")] = "tip"

    def __post_init__(self) -> None:
        if self.axis is not None and self.rpy is not None:
            raise ValueError("rpy: cannot be combined with axis; give one of them")
        if self.axis is not None and not self.axis.any():
            raise ValueError("axis: must be a direction, not zero")
        if self.inertia is not None:
            _require_inertia(self.inertia)
        if self.mesh_resolution is not None:
            require_coarse("mesh_resolution", self.mesh_resolution, self.ball)
        for key, name in (("name", self.name), ("tip", self.tip)):
            if not name.strip():
                raise ValueError(f"{key}: must be a name, not {name!r}")
        if self.name == self.tip:
            raise ValueError(f"tip: must differ from name, which is {self.name!r} as well")

    @property
    def X_MT(self) -> RigidTransform:
        """Pose of T in the frame M that carries the tool."""
        R_MT = RotationMatrix() if self.axis is None else _shortest_turn(self.axis)
        if self.rpy is not None:
            R_MT = RotationMatrix(RollPitchYaw(self.rpy))
        return RigidTransform(R_MT, self.offset)

    @property
    def spatial_inertia(self) -> SpatialInertia:
        """Spatial inertia of the tool about T's origin, in T."""
        centre = np.array([0.0, 0.0, self.length / 2.0])
        if self.centre_of_mass is not None:
            centre = self.centre_of_mass
        if self.inertia is not None:
            central = RotationalInertia(*self.inertia)
        else:
            unit = UnitInertia.SolidCylinder(self.ball, self.length, [0.0, 0.0, 1.0])
            central = RotationalInertia(*(self.mass * unit.get_moments()))
        return SpatialInertia.MakeFromCentralInertia(self.mass, centre, central)

    def add_to(self, plant: MultibodyPlant, instance: ModelInstanceIndex, model: str) -> None:
        """Add the tool to a plant with the arm, before it is finalized.

        Args:
            plant: Plant with the arm.
            instance: Model instance of the arm.
            model: Name of the arm's model file, for messages.

        Raises:
            InvalidInputError: If the model has no frame to carry the tool, or has a frame with the
                name of one of the tool's.
        """
        mount = self._mount(plant, instance, model)
        body = plant.AddRigidBody(self.name, instance, self.spatial_inertia)
        weld = WeldJoint(f"{self.name}_joint", mount, body.body_frame(), self.X_MT)
        plant.AddJoint(weld)
        X_TE = RigidTransform([0.0, 0.0, self.length])
        plant.AddFrame(FixedOffsetFrame(self.tip, body.body_frame(), X_TE, instance))
        if plant.geometry_source_is_registered():
            self._add_ball(plant, body, X_TE)
            for name, z, shape, colour in self._drawn_parts():
                X_TG = RigidTransform([0.0, 0.0, z])
                plant.RegisterVisualGeometry(body, X_TG, shape, name, colour)

    def _mount(self, plant: MultibodyPlant, instance: ModelInstanceIndex, model: str) -> Frame:
        for key, name in (("name", self.name), ("tip", self.tip)):
            if plant.HasFrameNamed(name, instance):
                raise InvalidInputError(
                    f"arm.tool.{key}: {model} has a frame {name!r} already; give another name"
                )
        mount = str(self.mount)
        if not plant.HasFrameNamed(mount, instance):
            raise InvalidInputError(
                f"arm.tool: no frame {mount!r} in {model} that could carry it; "
                + nearest_frame(plant, mount, instance)
            )
        return plant.GetFrameByName(mount, instance)

    def _add_ball(self, plant: MultibodyPlant, body: RigidBody, X_TE: RigidTransform) -> None:
        resolution = self.mesh_resolution
        properties = ProximityProperties()
        AddCompliantHydroelasticProperties(
            self.ball / _FINENESS if resolution is None else resolution,
            self.hydroelastic_modulus,
            properties,
        )
        AddContactMaterial(
            dissipation=self.dissipation,
            friction=CoulombFriction(self.friction, self.friction),
            properties=properties,
        )
        plant.RegisterCollisionGeometry(body, X_TE, Sphere(self.ball), "ball", properties)

    def _drawn_parts(self) -> list[tuple[str, float, Shape, Any]]:
        """Return name, place along the axis [m], shape and colour of each drawn part."""
        radius = _SLENDER * self.ball if self.shaft is None else self.shaft
        parts: list[tuple[str, float, Shape, Any]] = []
        plate = _PLATE * self.length
        stem = self.length - self.ball - plate
        if radius > 0.0:
            parts.append(("plate", plate / 2.0, Cylinder(_FLARE * radius, plate), _BLACK))
            if stem > 0.0:
                parts.append(("stem", plate + stem / 2.0, Cylinder(radius, stem), _ALUMINIUM))
        parts.append(("ball", self.length, Sphere(self.ball), _RED))
        return parts


def _require_inertia(moments: Array) -> None:
    """Raise a ValueError for moments of inertia that no body has."""
    if not (moments > 0.0).all() or 2.0 * moments.max() > moments.sum():
        raise ValueError(
            "inertia: must be three positive numbers, none above the sum of the other two, not "
            f"{moments.tolist()}"
        )


def _shortest_turn(axis: Array) -> RotationMatrix:
    """Return the rotation by the smallest angle that turns z to ``axis``; about x from z to -z."""
    x, y, z = axis / np.linalg.norm(axis)
    across = float(np.hypot(x, y))
    if across == 0.0:
        return RotationMatrix() if z > 0.0 else RotationMatrix.MakeXRotation(np.pi)
    turn = np.array([-y, x, 0.0]) / across
    return RotationMatrix(AngleAxis(float(np.arctan2(across, z)), turn))

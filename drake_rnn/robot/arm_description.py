"""The description of an arm: its model file and how it is used.

- A tool that is added to an arm's model: a ball at the end of a shaft, at any frame.
- A gripper that is added to it, a model of its own.
- A payload, an object that the arm holds, which moves with its task frame.
- A mobile base that carries an arm: three joints, and a body of primitives.
- Errors of an arm's links, drawn from a seed, as a document describes them.
- The model file whose links are drawn in place of an arm's own.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    Box,
    Capsule,
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
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    RotationalInertia,
    SpatialInertia,
    UnitInertia,
    WeldJoint,
)

from ..errors import InvalidInputError, OldName
from ..inputs.documents import construct, read_yaml
from ..inputs.fields import (
    Angles,
    Array,
    Count,
    Finite,
    Friction,
    Length,
    Mass,
    Modulus,
    NonNegative,
    Point,
    Positive,
    Seed,
    Vector,
    between,
    is_name,
    validated,
    zeros,
)
from ..inputs.files import is_file
from ..inputs.keys import Meaning, Only
from ..inputs.messages import fields_of, metres_hint, nearest
from ..inputs.packages import not_installed
from ..models import MODELS
from .kinematics import nearest_frame
from .model.mjcf import shortest_turn
from .model.model import require_coarse
from .rotation import rotation_of
from .screws import LinkErrors
from .task_frame import ToolFrame

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
    believed_mass: Annotated[
        Mass | None,
        Meaning(
            "The same in the dynamics that a law is given, such as of an arm with a payload that "
            "is not known; by default ``mass``.",
            unit="kg",
        ),
    ] = None
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
            if not is_name(name):
                raise ValueError(f"{key}: must be a name, not {name!r}")
        if self.name == self.tip:
            raise ValueError(f"tip: must differ from name, which is {self.name!r} as well")

    @property
    def X_MT(self) -> RigidTransform:
        """Pose of T in the frame M that carries the tool."""
        R_MT = RotationMatrix() if self.axis is None else shortest_turn(self.axis)
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


# Colour of a payload, and the lengths that its shapes need.
_WOOD = (0.76, 0.6, 0.42, 1.0)
_NEEDS = {
    "ball": ("radius",),
    "box": ("size",),
    "capsule": ("radius", "length"),
    "cylinder": ("radius", "length"),
}


_GRIPPER_FILE = "gripper.yaml"


def shipped_grippers() -> list[str]:
    """Return the names of the grippers that come with this package."""
    return sorted(path.parent.name for path in MODELS.glob(f"*/{_GRIPPER_FILE}"))


@validated
class GripperDescription:
    """A gripper, or another tool, with a model file of its own, welded to a frame of an arm.

    Names of its links, joints and frames begin with ``gripper_`` in the arm. Its joints are held.
    """

    model: Annotated[
        str,
        Meaning("URDF, SDF, MJCF or xacro file of one base; or a shipped gripper."),
    ]
    mount: Annotated[
        str | None,
        Meaning(
            "Link of the arm's model that carries it. By default the arm's ``frame``, and the task "
            "frame E is then ``frame`` of the gripper.",
        ),
    ] = None
    frame: Annotated[
        str | None,
        Meaning(
            "Link of the gripper whose frame is the task frame E, by its name in the gripper's "
            "file; by default E stays where the arm has it.",
        ),
    ] = None
    translation: Annotated[
        Point,
        Meaning("Position of its base link in that of the arm, shape (3,).", unit="m"),
    ] = Field(default_factory=zeros)
    rpy: Annotated[
        Angles,
        Meaning("Roll, pitch and yaw of its base link in that of the arm, shape (3,).", unit="rad"),
    ] = Field(default_factory=zeros)
    lock: Annotated[
        dict[str, Finite],
        Meaning(
            "Where its joints are held, by their names in its file [rad or m]; those that mimic "
            "others follow them, the rest are held at zero.",
        ),
    ] = Field(default_factory=dict)
    capsules: Annotated[
        str | None,
        Meaning(
            "File of the capsules round its bodies, by their names in its file, in the format of "
            "``arm.capsules``; by default one is fitted to each body.",
        ),
    ] = None
    packages: Annotated[
        dict[str, str],
        Meaning("Folders of the packages that ``package://`` names in its model refer to."),
    ] = Field(default_factory=dict)
    xacro_arguments: Annotated[
        dict[str, str | bool | float],
        Meaning("Arguments of the macros of a xacro file, by name."),
    ] = Field(default_factory=dict)

    def __post_init__(self) -> None:
        far = float(np.abs(self.translation).max())
        if hint := metres_hint(far):
            raise ValueError(f"translation: must be within 10 m of its mount, not {far:g} m{hint}")

    def complete(self) -> GripperDescription:
        """Return it with the files of a shipped gripper in place of its name."""
        if self.model not in shipped_grippers():
            return self
        folder = MODELS / self.model
        file = dict(read_yaml(folder / _GRIPPER_FILE))
        capsules = self.capsules or str(folder / file["capsules"])
        return replace(self, model=str(folder / file["model"]), capsules=capsules)

    @property
    def X_MG(self) -> RigidTransform:
        """Pose of its base link in the link M that carries it."""
        return RigidTransform(RollPitchYaw(self.rpy), self.translation)


@validated
class PayloadShape:
    """A part of a payload, in the frame that holds it."""

    kind: Annotated[Literal["ball", "box", "capsule", "cylinder"], Meaning("Its shape.")]
    center: Annotated[Point, Meaning("Its centre, shape (3,).", unit="m")]
    rpy: Annotated[
        Angles,
        Meaning("Roll, pitch and yaw of its frame, shape (3,).", unit="rad"),
    ] = Field(default_factory=zeros)
    size: Annotated[Point | None, Meaning("Edges of a box, shape (3,).", unit="m")] = None
    radius: Annotated[Length | None, Meaning("Radius of any other.", unit="m")] = None
    length: Annotated[
        Length | None,
        Meaning("Length along z of a cylinder, or of a capsule between its balls.", unit="m"),
    ] = None

    def __post_init__(self) -> None:
        values = {"size": self.size, "radius": self.radius, "length": self.length}
        for key, value in values.items():
            is_given = value is not None
            if is_given != (key in _NEEDS[self.kind]):
                raise ValueError(
                    f"{key}: {'is not one' if is_given else 'must be given'} of a {self.kind}"
                )
        if self.size is not None and not (self.size > 0.0).all():
            raise ValueError(f"size: must be three edges above 0, not {self.size.tolist()}")
        far = float(np.abs(self.corners).max())
        if hint := metres_hint(far):
            raise ValueError(f"must be within 10 m of the frame that holds it, not {far:g} m{hint}")

    @property
    def X_HG(self) -> RigidTransform:
        """Its pose in the frame that holds it."""
        return RigidTransform(RollPitchYaw(self.rpy), self.center)

    @property
    def shape(self) -> Shape:
        """It as Drake's shape."""
        if self.size is not None:
            return Box(*self.size)
        radius, length = float(self.radius or 0.0), self.length
        if length is None:
            return Sphere(radius)
        return (Capsule if self.kind == "capsule" else Cylinder)(radius, length)

    @property
    def corners(self) -> Array:
        """Two corners of a box round it, shape (2, 3) [m]."""
        half = np.full(3, float(self.radius or 0.0)) if self.size is None else 0.5 * self.size
        if self.length is not None:
            half[2] = 0.5 * self.length + (half[2] if self.kind == "capsule" else 0.0)
        reach = np.abs(self.X_HG.rotation().matrix()) @ half
        return np.array([self.center - reach, self.center + reach])


@validated
class PayloadDescription:
    """An object that the arm holds: a rigid body, welded to a frame of the arm.

    It is kept clear as the arm's links are, and its mass is one of the arm's. It makes no contact.
    """

    shapes: Annotated[
        list[PayloadShape],
        Meaning("What it consists of, in the frame that holds it."),
    ]
    frame: Annotated[
        str | None,
        Meaning("Frame of the arm that holds it; by default the task frame E."),
    ] = None
    mass: Annotated[
        Mass,
        Meaning("Its mass, spread over the box round it.", unit="kg"),
    ] = 0.1
    name: Annotated[str, Meaning("Name of its body.")] = "payload"

    def __post_init__(self) -> None:
        if not self.shapes:
            raise ValueError("shapes: must have at least one shape")
        if not is_name(self.name):
            raise ValueError(f"name: must be a name, not {self.name!r}")

    def add_to(self, plant: MultibodyPlant, instance: ModelInstanceIndex, frame: Frame) -> None:
        """Add it to a plant with the arm, before it is finalized.

        Args:
            plant: Plant with the arm.
            instance: Model instance of the arm.
            frame: Frame that holds it.

        Raises:
            InvalidInputError: If the model has a body of its name.
        """
        if plant.HasBodyNamed(self.name, instance):
            raise InvalidInputError(
                f"arm.payload.name: the arm has a body {self.name!r} already; give another name"
            )
        corners = np.concatenate([solid.corners for solid in self.shapes])
        low, high = corners.min(axis=0), corners.max(axis=0)
        moments = self.mass * UnitInertia.SolidBox(*(high - low)).get_moments()
        inertia = SpatialInertia.MakeFromCentralInertia(
            self.mass, 0.5 * (low + high), RotationalInertia(*moments)
        )
        body = plant.AddRigidBody(self.name, instance, inertia)
        weld = WeldJoint(f"{self.name}_joint", frame, body.body_frame(), RigidTransform())
        plant.AddJoint(weld)
        if plant.geometry_source_is_registered():
            for number, solid in enumerate(self.shapes):
                name = f"{self.name} {number + 1}"
                plant.RegisterVisualGeometry(body, solid.X_HG, solid.shape, name, _WOOD)


#: Joints of a mobile base, floor to deck: the names of their parts, and what moves there.
BASE_JOINTS = ("x", "y", "yaw")
_BASE_FILE = "base.yaml"
_STEEL = (0.45, 0.48, 0.52, 1.0)
_NO_MASS = SpatialInertia.Zero()


def shipped_bases() -> list[str]:
    """Return the names of the mobile bases that come with this package."""
    return sorted(path.parent.name for path in MODELS.glob(f"*/{_BASE_FILE}"))


@validated
class BaseDescription:
    """A mobile base that carries the whole model: on a plane floor, by three joints more.

    The joints are ``NAME_x`` and ``NAME_y``, which slide along the axes of the world, and
    ``NAME_yaw``, which turns about z. They are the first joints of the arm. The floor is the plane
    z = 0 of the world; the base frame, whose x axis points forward, is on it.
    """

    model: Annotated[
        str | None,
        Meaning("Name of a shipped base, whose fields stand for those that are not given."),
    ] = None
    drive: Annotated[
        Literal["holonomic", "differential"] | None,
        Meaning(
            "``holonomic``, which moves in any direction; ``differential``, which moves forward, "
            "backward and turns, and never sideways. By default the base's, else holonomic.",
        ),
    ] = None
    shapes: Annotated[
        list[PayloadShape] | None,
        Meaning("What it looks like, in the base frame."),
    ] = None
    bounds: Annotated[
        list[PayloadShape] | None,
        Meaning(
            "What is kept clear of obstacles and of the arm in place of ``shapes``, in the base "
            "frame; capsules and balls count as they are, others by a capsule round each.",
        ),
    ] = None
    mount: Annotated[
        Point | None,
        Meaning("Where the world frame of the arm's model is in the base frame.", unit="m"),
    ] = None
    rpy: Annotated[
        Angles | None,
        Meaning("Roll, pitch and yaw of that frame there.", unit="rad"),
    ] = None
    area: Annotated[
        list[Vector] | None,
        Meaning(
            "Two corners of the rectangle of the floor where the base frame may be; by default 10 "
            "m in each direction. A differential drive keeps none.",
            unit="m",
        ),
    ] = None
    start: Annotated[
        Point | None,
        Meaning("Positions of its joints in the home posture: x, y [m] and yaw [rad]."),
    ] = None
    velocity: Annotated[
        Point | None,
        Meaning(
            "Largest speeds of its joints [m/s, m/s, rad/s]; of a differential drive those "
            "forward, of nothing, and of turning.",
        ),
    ] = None
    acceleration: Annotated[
        Point | None,
        Meaning("Largest accelerations, likewise [m/s^2, m/s^2, rad/s^2]."),
    ] = None
    jerk: Annotated[
        Point | None,
        Meaning("Largest jerks, likewise [m/s^3, m/s^3, rad/s^3]; by default not bounded."),
    ] = None
    mass: Annotated[
        Mass | None,
        Meaning("Its mass, spread over the box round it; 50 kg by default.", unit="kg"),
    ] = None
    name: Annotated[str, Meaning("Name of its body, which begins the names of its joints.")] = (
        "base"
    )

    def __post_init__(self) -> None:
        if not is_name(self.name):
            raise ValueError(f"name: must be a name, not {self.name!r}")
        if self.model is not None and self.model not in shipped_bases():
            raise ValueError(
                f"model: no base {self.model!r}; {nearest(self.model, shipped_bases())}"
            )
        for key, value in self._rates.items():
            if value is not None and not (value > 0.0).all():
                raise ValueError(f"{key}: must be three numbers above 0, not {value.tolist()}")
        if self.area is not None:
            if self.drive == "differential":
                raise ValueError("area: must be left out of a differential drive, which keeps none")
            low, high = self.area if len(self.area) == 2 else (zeros(), zeros())
            if low.size != 2 or high.size != 2 or not (low < high).all():
                raise ValueError(
                    "area: must be two corners, the lower ones first, not "
                    f"{[corner.tolist() for corner in self.area]}"
                )

    @property
    def _rates(self) -> dict[str, Array | None]:
        return {"velocity": self.velocity, "acceleration": self.acceleration, "jerk": self.jerk}

    def complete(self) -> BaseDescription:
        """Return it with the fields of its model, and with defaults where there are none.

        Raises:
            InvalidInputError: If the file of the base is wrong.
        """
        own = {key: value for key, value in fields_of(self).items() if value is not None}
        model = {}
        if self.model is not None:
            file = MODELS / self.model / _BASE_FILE
            model = dict(read_yaml(file))
            if own.get("drive", model.get("drive")) == "differential":
                model.pop("area", None)
        far = np.array([_FAR_OUT, _FAR_OUT])
        defaults = {
            "drive": "holonomic",
            "shapes": [],
            "mount": np.zeros(3),
            "rpy": np.zeros(3),
            "start": np.zeros(3),
            "mass": _BASE_MASS,
        }
        fields = defaults | model | own
        if fields["drive"] == "holonomic":
            fields.setdefault("area", [-far, far])
        fields.setdefault("bounds", fields["shapes"])
        return construct(BaseDescription, fields, "arm.base")

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of its joints, floor to deck."""
        return tuple(f"{self.name}_{part}" for part in BASE_JOINTS)

    @property
    def position(self) -> tuple[Array, Array]:
        """Position limits of its joints, lower and upper, shape (3,) each [m, m, rad]."""
        if self.area is None:
            return np.full(3, -np.inf), np.full(3, np.inf)
        lower, upper = self.area
        return np.append(lower, -np.inf), np.append(upper, np.inf)

    @property
    def rates(self) -> dict[str, Array]:
        """Limits of the derivatives of its joints that are known, by name, shape (3,) each."""
        return {key: value for key, value in self._rates.items() if value is not None}

    def add_to(
        self, plant: MultibodyPlant, instance: ModelInstanceIndex, X_WF: RigidTransform
    ) -> Frame:
        """Add a complete one to a plant, before it is finalized, and return where the arm stands.

        Args:
            plant: Plant with the model that it carries.
            instance: Model instance of that.
            X_WF: Pose of the floor's frame in the world.

        Raises:
            InvalidInputError: If the model has a body or a joint of one of its names.
        """
        for name in (self.name, *self.joints):
            if plant.HasBodyNamed(name, instance) or plant.HasJointNamed(name, instance):
                raise InvalidInputError(
                    f"arm.base.name: the arm has {name!r} already; give another name"
                )
        floor = FixedOffsetFrame(f"{self.name}_floor", plant.world_frame(), X_WF, instance)
        parent = plant.AddFrame(floor)
        sides = [plant.AddRigidBody(name, instance, _NO_MASS) for name in self.joints[:2]]
        body = plant.AddRigidBody(self.name, instance, self._inertia)
        kinds = (PrismaticJoint, PrismaticJoint, RevoluteJoint)
        lower, upper = self.position
        for k, (name, kind, child) in enumerate(
            zip(self.joints, kinds, (*sides, body), strict=True)
        ):
            axis = np.eye(3)[(0, 1, 2)[k]]
            joint = plant.AddJoint(
                kind(name, parent, child.body_frame(), axis, lower[k], upper[k], 0.0)
            )
            if self.velocity is not None:
                joint.set_velocity_limits([-self.velocity[k]], [self.velocity[k]])
            if self.acceleration is not None:
                joint.set_acceleration_limits([-self.acceleration[k]], [self.acceleration[k]])
            parent = child.body_frame()
        if plant.geometry_source_is_registered():
            for number, solid in enumerate(self.shapes or ()):
                colour = _BLACK if solid.kind == "cylinder" else _STEEL
                name = f"{self.name} {number + 1}"
                plant.RegisterVisualGeometry(body, solid.X_HG, solid.shape, name, colour)
        X_BM = RigidTransform(RollPitchYaw(self.rpy), self.mount)
        deck = FixedOffsetFrame(f"{self.name}_deck", body.body_frame(), X_BM, instance)
        return plant.AddFrame(deck)

    @property
    def _inertia(self) -> SpatialInertia:
        if not self.shapes:
            size, middle = np.full(3, _BASE_SIZE), np.zeros(3)
        else:
            corners = np.concatenate([solid.corners for solid in self.shapes])
            low, high = corners.min(axis=0), corners.max(axis=0)
            size, middle = high - low, 0.5 * (low + high)
        mass = float(self.mass or _BASE_MASS)
        moments = mass * UnitInertia.SolidBox(*size).get_moments()
        return SpatialInertia.MakeFromCentralInertia(mass, middle, RotationalInertia(*moments))


def drive_named(arm: object) -> str:
    """Return the drive of the base in the section ``arm`` of a document; empty without a base.

    Raises:
        InvalidInputError: If the base is described wrongly.
    """
    section = arm.get("base") if isinstance(arm, Mapping) else None
    if section is None:
        return ""
    return str(construct(BaseDescription, section, "arm.base").complete().drive)


# Corner of the area of a base, mass, and edge of the box round one without shapes [m, kg, m].
_FAR_OUT, _BASE_MASS, _BASE_SIZE = 10.0, 50.0, 0.5


def _require_inertia(moments: Array) -> None:
    """Raise a ValueError for moments of inertia that no body has."""
    if not (moments > 0.0).all() or 2.0 * moments.max() > moments.sum():
        raise ValueError(
            "inertia: must be three positive numbers, none above the sum of the other two, not "
            f"{moments.tolist()}"
        )


# Stream of the random numbers, different from the streams of runs.
_STREAM = 7
_DEGREE = np.pi / 180.0


@validated
class LinkErrorSettings:
    """Errors in the dimensions of an arm, uniform and independent in each coordinate of each joint.

    The arm that moves has these errors, and all kinematics are those of that arm. Each joint frame
    is displaced in its own axes, together with all links after it; the task frame keeps its place
    on the last link.
    """

    seed: Annotated[Seed, Meaning("Seed of the errors.")] = 0
    translation: Annotated[
        NonNegative,
        between(0.0, 0.2),
        Meaning("Largest error of each coordinate of a joint's position.", unit="m"),
    ] = 0.02
    rotation: Annotated[
        NonNegative,
        between(0.0, 0.5),
        Meaning("Largest error about each axis.", unit="rad"),
    ] = 2.0 * _DEGREE

    def draw(self, joints: int) -> LinkErrors:
        """Return the errors of a number of joints and, in a last row of zeros, of the task frame.

        The errors of a joint do not depend on the number of joints.
        """
        draws = np.random.default_rng([self.seed, _STREAM]).uniform(-1.0, 1.0, (joints, 2, 3))
        rows = np.concatenate((draws, np.zeros((1, 2, 3))))
        return LinkErrors(self.translation * rows[:, 0], self.rotation * rows[:, 1])


# Farthest base of a second arm, as far as an obstacle may be [m].
_FARTHEST_BASE = 100.0


@validated
class Base:
    """Where the base of a second arm stands, in the base frame of the first one."""

    translation: Annotated[
        Point,
        Meaning("Position, shape (3,).", unit="m"),
    ] = Field(default_factory=zeros)
    rpy: Annotated[
        Angles,
        Meaning("Roll, pitch and yaw, shape (3,).", unit="rad"),
    ] = Field(default_factory=zeros)

    def __post_init__(self) -> None:
        if (far := float(np.abs(self.translation).max())) > _FARTHEST_BASE:
            raise ValueError(
                f"translation: must be within {_FARTHEST_BASE:g} m of the first arm's base, not "
                f"{far:g} m{metres_hint(far)}"
            )

    @property
    def R(self) -> Array:
        """Orientation, shape (3, 3)."""
        return rotation_of(self.rpy)


@validated
class PairDescription:
    """A second tool, which the same law moves: of a second arm, or of the same model.

    The joints of both are those of one arm, the first one's before the second one's. Links, joints
    and frames of a second arm have names that begin with ``second_``.
    """

    arm: Annotated[
        str | dict[str, Any] | None,
        Meaning(
            "The second arm, as in ``arm``: a shipped one or its description. By default the "
            "second tool is one of the same model.",
        ),
    ] = None
    base: Annotated[
        Base | None,
        Meaning("Where that arm stands, in the base frame of the first one; must be given."),
    ] = None
    frame: Annotated[
        str | None,
        Meaning("Frame of the second tool, or the one that carries it, of the same model."),
    ] = None
    tool: Annotated[
        ToolDescription | None,
        Meaning("Second tool to add to the same model."),
    ] = None
    task_frame: Annotated[
        ToolFrame,
        Meaning(
            "The task frame E: the ``centre`` of both tools, half way between them; the second "
            "tool as seen from the first one, ``relative``; or one of the tools.",
        ),
    ] = "centre"

    def __post_init__(self) -> None:
        if (self.arm is None) == (self.frame is None):
            raise ValueError(
                "arm: must be given, the second arm, or frame, that of the second tool of the same "
                "model; not both"
            )
        if (self.arm is None) != (self.base is None):
            raise ValueError("base: must be given with a second arm, and with nothing else")
        if self.tool is not None and self.frame is None:
            raise ValueError("tool: is one of the same model; give that of a second arm in its arm")


#: What the names of links, joints and frames of a gripper begin with.
GRIPPER = "gripper_"
_EARTH = (0.0, 0.0, -9.81)
# On the Sun it is 274 m/s^2.
_MOST_GRAVITY = 300.0
Scale = Annotated[Positive, between(1e-3, 1e3)]


@validated
class ArmDescription:
    """Description of an arm: its model file and how it is used; the contents of an ``arm.yaml``."""

    model: Annotated[str, Meaning("URDF, SDF or MJCF file.")]
    frame: Annotated[
        str,
        Meaning(
            "Name of the task frame E. If there is a ``tool`` that names no ``mount``, it is the "
            "frame that carries the tool, and E is the centre of the tool's ball.",
        ),
    ]
    tip: Annotated[
        str | None,
        Meaning("Name of the frame at the tool's contact point, if there is one in the model."),
    ] = None
    tool: Annotated[ToolDescription | None, Meaning("Tool to add to the model.")] = None
    gripper: Annotated[
        GripperDescription | None,
        Meaning("Gripper with a model of its own, which is added to the model, a URDF file."),
    ] = None
    payload: Annotated[
        PayloadDescription | None,
        Meaning("Object that the arm holds, which moves with it."),
    ] = None
    base: Annotated[
        BaseDescription | None,
        Meaning("Mobile base that carries the model; its joints come before the arm's."),
    ] = None
    joints: Annotated[
        list[str] | None,
        Meaning(
            "Names of the controlled joints, base to tip; by default all between base and "
            "``frame``.",
        ),
    ] = None
    lock: Annotated[
        dict[str, Finite],
        Meaning(
            "Positions of joints held still, by name [rad or m]. Joints that mimic a held joint "
            "are held where they follow it; other joints that are not controlled are held at the "
            "model's default.",
        ),
    ] = Field(default_factory=dict)
    endless: Annotated[
        list[str] | None,
        Meaning(
            "Joints that turn without end: of targets that are whole turns apart the nearest is "
            "followed, within the position limits if there are any. By default all that turn "
            "without limits.",
        ),
    ] = None
    packages: Annotated[
        dict[str, str],
        Meaning("Folders of the packages that ``package://`` names in the model refer to."),
    ] = Field(default_factory=dict)
    xacro_arguments: Annotated[
        dict[str, str | bool | float],
        Meaning("Arguments of the macros of a xacro file, by name."),
    ] = Field(default_factory=dict)
    srdf: Annotated[
        str | None,
        Meaning(
            "SRDF file of the robot. Its named postures may be given wherever a posture is; pairs "
            "of bodies that it disables are not kept apart from each other, which is told.",
        ),
    ] = None
    home: Annotated[
        Vector | str | None,
        Meaning(
            "Home posture, from which the arm starts by default, shape (n,); or the name of a "
            "posture of the SRDF file or, in MJCF, of a keyframe.",
            unit="rad",
        ),
    ] = None
    gravity: Annotated[
        Point,
        Meaning("Gravitational acceleration in the base frame, shape (3,).", unit="m/s^2"),
    ] = Field(default_factory=lambda: np.array(_EARTH))
    mass_scale: Annotated[
        Scale,
        Meaning("Factor on all masses and inertias of the model and the tool."),
    ] = 1.0
    believed_mass_scale: Annotated[
        Scale | None,
        Meaning(
            "The same factor in the dynamics that a law is given, to give it wrong masses; by "
            "default ``mass_scale``.",
        ),
    ] = None
    limits: Annotated[
        str | None,
        Meaning(
            "File of joint limits, see `drake_rnn.robot.limits_file`; limits that the file does "
            "not state are those of the model.",
        ),
    ] = None
    capsules: Annotated[
        str | None,
        Meaning(
            "File of the capsules round the links, for distances from obstacles, see "
            "`drake_rnn.robot.clearance.arm_capsules.CapsulesFile`; by default they are fitted "
            "to the model.",
        ),
    ] = None
    shapes: Annotated[
        Literal["coarse", "fine"],
        Meaning(
            "Capsules round the links: ``coarse``, one or a few for each; or ``fine``, which "
            "contain them more closely; more pairs are then looked at in each step."
        ),
    ] = "coarse"
    message_period: Annotated[
        Positive | None,
        Meaning(
            "Time between two messages of the robot's own controller [s], for ``level: robot``; "
            "None if nothing drives the robot.",
            unit="s",
        ),
    ] = None
    looks: Annotated[
        str | None,
        Meaning(
            "URDF file of the same arm, whose meshes are drawn in place of this model's shapes "
            "in playbacks; ``example-robot-data`` for that of the package of this name, of a "
            "shipped arm. Nothing but the looks depends on it.",
        ),
    ] = None
    triangles: Annotated[
        Count,
        between(100, 2_000_000),
        Meaning(
            "Number of triangles to which these meshes are simplified, in all.",
            only=(Only("looks"),),
        ),
    ] = 20_000
    link_errors: Annotated[
        LinkErrorSettings | None,
        Meaning("Errors in the dimensions of the model, a URDF file."),
    ] = None
    pair: Annotated[
        PairDescription | None,
        Meaning("Second tool, which the same law moves."),
    ] = None

    def __post_init__(self) -> None:
        if self.tip is not None and self.tool is not None:
            raise ValueError(
                f"tip: cannot be combined with a tool, whose tip is tool.tip, {self.tool.tip!r}"
            )
        if self.base is not None and self.link_errors is not None:
            raise ValueError("link_errors: must be left out with a mobile base")
        if self.base is not None and self.pair is not None:
            raise ValueError("pair: must be left out with a mobile base, which carries one arm")
        if np.linalg.norm(self.gravity) > _MOST_GRAVITY:
            raise ValueError(
                f"gravity: may be at most {_MOST_GRAVITY:g} m/s^2, not {self.gravity.tolist()}"
            )

    def with_named_mount(self) -> ArmDescription:
        """Return the same description with all mounts named, and ``frame`` that of E.

        A shipped gripper is named by its files.
        """
        named, gripper = self, self.gripper
        if gripper is not None:
            gripper = gripper.complete()
            named = replace(self, gripper=gripper)
        if gripper is not None and gripper.mount is None:
            frame = self.frame if gripper.frame is None else GRIPPER + gripper.frame
            named = replace(self, frame=frame, gripper=replace(gripper, mount=self.frame))
        if named.tool is None or named.tool.mount is not None:
            return named
        return replace(named, frame=named.tool.tip, tool=replace(named.tool, mount=named.frame))

    def with_changes(self, changes: Mapping[str, Any]) -> ArmDescription:
        """Return the description with some fields changed; a new tool goes where the old one was.

        A gripper takes the place of a tool, unless another is given.

        Raises:
            InvalidInputError: If a field is invalid.
        """
        if changes.get("gripper") is not None:
            changes = {"tool": None, **changes}
        elif "gripper" in changes and self.gripper is not None:
            is_its = self.frame.startswith(GRIPPER) and self.gripper.mount is not None
            changes = {**({"frame": self.gripper.mount} if is_its else {}), **changes}
        # A tool has a tip of its own, in place of the model's.
        values = fields_of(self) | ({"tip": None} if changes.get("tool") is not None else {})
        new = construct(ArmDescription, values | dict(changes), "arm")
        if "tool" not in changes or self.tool is None or new.frame != self.tool.tip:
            return new
        # E was the tip of the former tool.
        leaves = "frame" not in changes if new.tool is None else new.tool.mount is None
        return replace(new, frame=str(self.tool.mount)) if leaves else new

    mounted = OldName("with_named_mount")
    changed = OldName("with_changes")


#: Name of the package of robot models, and the files in it of shipped arms, by the arm's model.
PACKAGE = "example-robot-data"
_FILES = {
    "panda": "panda_description/urdf/panda.urdf",
    "ur5": "ur_description/urdf/ur5_robot.urdf",
}
# Where the package lies in a folder of installed packages.
_ROBOTS = Path("cmeel.prefix/share/example-robot-data/robots")
# What simplifies meshes.
_SIMPLIFIER = "fast_simplification"


def looks_file(looks: str | None, model: Path) -> tuple[Path | None, str]:
    """Return the model file that ``arm.looks`` names, and a warning if it cannot be used.

    Args:
        looks: Name of a model file or of the package; None for the arm's own looks.
        model: The arm's own model file.

    Returns:
        The file, or None for the arm's own looks; and the warning, empty if there is none.

    Raises:
        InvalidInputError: If there is no such file, or the package has no such arm.
    """
    if looks is None:
        return None, ""
    if looks != PACKAGE:
        if not is_file(looks):
            raise InvalidInputError(
                f"arm.looks: no file {looks!r}; it may be {PACKAGE}, or a URDF file of the arm"
            )
        looks_path: Path | None = Path(looks)
    elif model.stem not in _FILES:
        hint = nearest(model.stem, sorted(_FILES))
        raise InvalidInputError(
            f"arm.looks: {PACKAGE} has no {model.stem}; {hint}, or give a URDF file of the arm"
        )
    else:
        places = (Path(folder) / _ROBOTS / _FILES[model.stem] for folder in sys.path)
        looks_path = next((file for file in places if file.is_file()), None)
    missing = (
        PACKAGE if looks_path is None else _SIMPLIFIER if find_spec(_SIMPLIFIER) is None else ""
    )
    if missing:
        return None, (
            not_installed("arm.looks", "looks", missing)
            + "; the arm is drawn as its own model says"
        )
    return looks_path, ""

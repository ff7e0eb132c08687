"""Surfaces that a tool is pressed against, modelled as a spring or as bodies in contact.

- The base class of all surfaces that a tool can be pressed against.
- A surface that acts like a spring.
- The base class of surfaces made of bodies, for arms with full dynamics.
- A rigid or compliant plate.
- A surface from a model file.
- A surface and where it is, below the tool of an arm.
- What a surface is to the bodies of an arm that do not press on it: solids that are in the way.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, cast

import numpy as np
from pydantic import Field
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    Box,
    GeometryId,
    ProximityProperties,
    Role,
    SceneGraph,
)
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import RigidBody

from .errors import InvalidInputError
from .inputs.fields import (
    Angles,
    Array,
    Finite,
    Friction,
    Length,
    Modulus,
    NonNegative,
    Point,
    Positive,
    Stiffness,
    validated,
    zeros,
)
from .inputs.files import content_of, is_file
from .inputs.keys import Meaning
from .inputs.kinds import Kinds, naming
from .inputs.messages import require_type, short
from .robot.arm import Arm
from .robot.clearance.model_obstacle import solid_round
from .robot.clearance.obstacles import MOST, Obstacle
from .robot.model.formats import resolve_includes
from .robot.model.model import require_coarse_balls, require_finite_meshes, require_sizes
from .robot.model.ros_packages import MOST_BYTES, Packages, parse_xml
from .robot.tool import standoff

# What was a module in this one until 0.3 is found under its name, see `moved_modules`.
__path__: list[str] = []


def _up() -> Array:
    up = np.array([0.0, 0.0, 1.0])
    up.setflags(write=False)
    return up


@validated
class Surface:
    """A plane below the tool."""

    normal: Annotated[
        Point,
        Meaning(
            "Normal out of the surface, towards the tool, in the base frame, shape (3,); of any "
            "length.",
        ),
    ] = Field(default_factory=_up)
    gap: Annotated[
        Finite,
        Meaning(
            "Distance of the tool from the surface at the start, along the normal; negative for "
            "a tool that is pressed in.",
            unit="m",
        ),
    ] = 0.0
    believed_normal: Annotated[
        Point | None,
        Meaning("Normal that the law assumes, shape (3,); by default the true one."),
    ] = None
    moves: Annotated[
        dict[str, Any] | None,
        Meaning(
            "Its motion, a path with its ``kind`` and fields that begins where the surface is; "
            "without it, it stands still.",
        ),
    ] = None

    #: Whether it is a plane, on which a path must lie.
    is_plane = True
    #: Whether the law is told the normal of its nearest point, in place of that at the start.
    is_local = False

    def __post_init__(self) -> None:
        for name, vector in (("normal", self.normal), ("believed_normal", self.believed_normal)):
            if vector is not None and not np.linalg.norm(vector) > 0.0:
                raise ValueError(f"{name}: must not be zero")
        if not self.believed_normal_W.dot(self.normal_W) > 0.0:
            # A law that presses in the opposite direction would measure no force and keep moving.
            raise ValueError(
                "believed_normal: must be less than a right angle from the normal, "
                f"{self.normal.tolist()}, not {np.asarray(self.believed_normal).tolist()}"
            )

    @property
    def normal_W(self) -> Array:
        """Unit normal in the base frame, shape (3,)."""
        return np.asarray(self.normal / np.linalg.norm(self.normal))

    @property
    def believed_normal_W(self) -> Array:
        """Unit normal that the law assumes, in the base frame, shape (3,)."""
        if self.believed_normal is None:
            return self.normal_W
        return np.asarray(self.believed_normal / np.linalg.norm(self.believed_normal))

    @property
    def normal_error(self) -> float | None:
        """Angle between the believed normal and the true one [rad]; None if it is not known."""
        n, believed = self.normal_W, self.believed_normal_W
        if not self.is_plane:
            return None
        return float(np.arctan2(np.linalg.norm(np.cross(n, believed)), n.dot(believed)))

    def overhang(self, points: Array, p_WS: Array) -> float:
        """Return how far ``points`` lie beyond its edges [m]; 0 for a surface without edges.

        Args:
            points: Points in the base frame, shape (k, 3) [m].
            p_WS: Point of the surface below the tool at the start, shape (3,) [m].
        """
        return 0.0


@validated
class ElasticSurface(Surface):
    """A spring for the kinematic level: the force on E's origin is proportional to its depth."""

    kind: Literal["elastic_surface"] = "elastic_surface"
    stiffness: Annotated[Stiffness, Meaning("Force per depth.", unit="N/m")]


@validated
class TipMaterial:
    """Material of the tool's compliant ball; None keeps the value of the arm's model."""

    hydroelastic_modulus: Annotated[
        Positive | None,
        Meaning(
            "Pressure at full depth [Pa]. It is not a stiffness, which depends on radius, depth "
            "and mesh as well and has to be measured.",
        ),
    ] = None
    mesh_resolution: Annotated[
        Positive | None,
        Meaning("Edge length of the ball's mesh.", unit="m"),
    ] = None
    dissipation: Annotated[
        NonNegative | None,
        Meaning("Hunt-Crossley dissipation.", unit="s/m"),
    ] = None


@validated
class ContactModel(Surface, ABC):
    """A surface made of bodies."""

    standoff: Annotated[
        NonNegative | None,
        Meaning(
            "Distance from E's origin to the tool's outermost point towards the surface; by "
            "default that of the ball in the arm's model.",
            unit="m",
        ),
    ] = None
    tip: Annotated[TipMaterial | None, Meaning("Material of the tool's ball.")] = None
    friction: Annotated[
        Friction | None,
        Meaning("Friction coefficient of ball and surface; None keeps the values of their models."),
    ] = None

    #: Whether `add_to` takes a body that carries the surface, as one that moves.
    is_carried = False

    @abstractmethod
    def add_to(self, plant: MultibodyPlant, p_WS: Array) -> None:
        """Add the surface's bodies and geometry to a plant that is not yet finalized.

        With ``is_carried`` there is a further argument, ``carrier``: the body that carries it, at
        the origin of the world where it begins; by default the world's.

        Args:
            plant: Plant, registered with a SceneGraph.
            p_WS: Point of the surface below the tool at the start, shape (3,) [m].
        """


@validated
class Plate(ContactModel):
    """A square plate centred below the tool; its face towards the tool is the surface."""

    is_carried = True

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

    def add_to(self, plant: MultibodyPlant, p_WS: Array, carrier: RigidBody | None = None) -> None:
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
            plant.world_body() if carrier is None else carrier,
            self.pose(p_WS),
            Box(self.size, self.size, self.thickness),
            "plate",
            properties,
        )


@validated
class ModelSurface(ContactModel):
    """A surface given by a model file; the model's origin lies on it, below the tool."""

    # The file may contain any shape.
    is_plane = False

    is_carried = True

    @property
    def is_local(self) -> bool:  # type: ignore[override]
        """See `Surface.is_local`."""
        return self.normals == "local"

    kind: Literal["model"] = "model"
    model: Annotated[
        str,
        Meaning(
            "URDF, SDF or MJCF file. Its first body is welded to the world, so the file must "
            "leave it free; its collision geometry needs hydroelastic properties.",
        ),
    ]
    rotation: Annotated[
        Angles,
        Meaning("Roll, pitch and yaw of the model in the base frame.", unit="rad"),
    ] = Field(default_factory=zeros)
    offset: Annotated[
        Point,
        Meaning("Offset of the model's origin, in the base frame, shape (3,).", unit="m"),
    ] = Field(default_factory=zeros)
    normals: Annotated[
        Literal["start", "local"],
        Meaning(
            "Normal that the law is told and forces are measured along: ``start``, the one of "
            "``normal`` all along; ``local``, that of the point of the model nearest to the tool.",
        ),
    ] = "start"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.is_local and self.believed_normal is not None:
            raise ValueError("believed_normal: must be left out with normals: local")
        if not is_file(self.model):
            raise ValueError(f"model: no file {self.model!r}")
        root = parse_xml(content_of(self.model, MOST_BYTES))
        if root is not None:
            if root.tag == "sdf":
                packages = Packages({}, Path(self.model))
                resolve_includes("environment.model", root, (packages,), [])
            require_sizes("model", root)
            require_coarse_balls("model", root)
            require_finite_meshes("model", root, Path(self.model))

    def add_to(self, plant: MultibodyPlant, p_WS: Array, carrier: RigidBody | None = None) -> None:
        """See `ContactModel.add_to`.

        Raises:
            InvalidInputError: If the file cannot be read, does not hold exactly one model, or the
                model has no body that can be welded.
        """
        parser = Parser(plant)
        parser.SetAutoRenaming(True)
        try:
            instances = parser.AddModels(self.model)
            bodies = [body for instance in instances for body in plant.GetBodyIndices(instance)]
            if len(instances) != 1 or not bodies:
                raise InvalidInputError(
                    f"environment.model: {self.model} holds {len(instances)} models with "
                    f"{len(bodies)} bodies of their own; it must hold one model with a body to weld"
                )
            base = plant.get_body(bodies[0])
            X_WM = RigidTransform(RollPitchYaw(*self.rotation), p_WS + self.offset)
            parent = plant.world_frame() if carrier is None else carrier.body_frame()
            plant.WeldFrames(parent, base.body_frame(), X_WM)
        except RuntimeError as error:
            raise InvalidInputError(
                f"environment.model: {self.model}: {' '.join(str(error).split())}"
            ) from None


#: Environments by their ``kind``.
ENVIRONMENTS: Kinds[Surface] = Kinds(
    "environment",
    Surface,
    {
        "elastic_surface": ElasticSurface,
        "plate": Plate,
        "model": ModelSurface,
    },
)


@dataclass(frozen=True)
class TouchedSurface:
    """A surface and where it is, below the tool of an arm.

    Attributes:
        surface: The surface.

    Raises:
        InvalidInputError: If what the surface says of itself is wrong.
    """

    surface: Surface

    #: Path of the surface from where it begins, a `drake_rnn.paths.PlacedPath`; None for one that
    #: stands still.
    motion = cast(Any, None)

    def __post_init__(self) -> None:
        _check_own(self.surface)

    def shift(self, t: float) -> tuple[Array, Array]:
        """Return how far the surface has gone, and its velocity, shape (3,) each [m, m/s].

        Args:
            t: Time [s].
        """
        if self.motion is None:
            return np.zeros(3), np.zeros(3)
        p, v, _ = self.motion.position(t)
        return p - self.motion.position(0.0)[0], v

    def place(self, arm: Arm, start: Array) -> Array:
        """Return the point of the surface below the tool at the start, shape (3,) [m].

        Raises:
            InvalidInputError: If the arm's frame carries no tool, or the distance from the frame to
                the end of the tool is not known.
        """
        n = self.surface.normal_W
        reach = 0.0
        if isinstance(self.surface, ContactModel):
            distance = self.surface.standoff
            reach = standoff(arm, start, n) if distance is None else distance
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


#: What they are called.
NAME = "environment"


def solids_of(surface: ContactModel, p_WS: Array) -> tuple[Obstacle, ...]:
    """Return a solid round each collision geometry of a surface, as the surface adds it to a plant.

    They are those of `drake_rnn.robot.clearance.model_obstacle.ModelObstacle`: of a mesh, a box or
    a capsule that holds its convex hull.

    Args:
        surface: The surface.
        p_WS: Point of the surface below the tool at the start, shape (3,) [m].

    Raises:
        InvalidInputError: If it has a shape without bounds, or too many.
    """
    scene_graph, plant = SceneGraph(), MultibodyPlant(1e-3)
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    surface.add_to(plant, p_WS)
    plant.Finalize()
    try:
        return _solids(plant, scene_graph)
    except ValueError as error:
        raise InvalidInputError(f"environment: with obstacles, {error}") from None
    finally:
        del plant  # it points to the scene graph, which must outlive it


def _solids(plant: MultibodyPlant, scene_graph: SceneGraph) -> tuple[Obstacle, ...]:
    inspector, context = scene_graph.model_inspector(), plant.CreateDefaultContext()
    ids: Sequence[GeometryId] = inspector.GetAllGeometryIds(Role.kProximity)
    if len(ids) > MOST:
        raise ValueError(f"the surface may have up to {MOST} geometries, not {len(ids)}")
    entries = []
    for k, geometry in enumerate(ids):
        body = plant.GetBodyFromFrameId(inspector.GetFrameId(geometry))
        X_WG = body.EvalPoseInWorld(context) @ inspector.GetPoseInFrame(geometry)
        name = NAME if len(ids) == 1 else f"{NAME} {k + 1}"
        entries.append(solid_round(inspector.GetShape(geometry), X_WG, name))
    return tuple(entries)

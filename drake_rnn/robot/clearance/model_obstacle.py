"""An obstacle from a model file: a solid of a simple shape round each of its shapes.

- A small box round points, along their principal axes or those of their frame.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import Field
from pydrake.geometry import Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Shape, Sphere
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from ...errors import InvalidInputError
from ...inputs.fields import Angles, Array, Point, validated, zeros
from ...inputs.keys import Meaning
from ..model.model import StillModel
from .arm_shapes import enclosing_capsule, points_round
from .obstacles import (
    BallObstacle,
    BoxObstacle,
    CapsuleObstacle,
    CylinderObstacle,
    HalfSpaceObstacle,
    Obstacle,
)

# Beyond rounding errors of a projection [m].
_SAFE = 1e-9


class EnclosingBox(NamedTuple):
    """A box.

    Attributes:
        center: Its centre, shape (3,) [m].
        R: Orientation of its frame in that of the points, shape (3, 3).
        size: Its edges, shape (3,) [m].
    """

    center: Array
    R: Array
    size: Array

    @property
    def volume(self) -> float:
        """Volume [m^3]."""
        return float(self.size.prod())


def enclosing_box(points: Array) -> EnclosingBox:
    """Return a box that holds all points, the smaller of two.

    One is oriented as the points' frame, in which most parts are modelled, the other by their
    principal axes.

    Args:
        points: At least one point, shape (k, 3) [m].
    """
    _, _, rows = np.linalg.svd(points - points.mean(axis=0), full_matrices=True)
    principal = rows.T
    if np.linalg.det(principal) < 0.0:
        principal = -principal
    return min((_along(points, R) for R in (np.eye(3), principal)), key=lambda box: box.volume)


def _along(points: Array, R: Array) -> EnclosingBox:
    """Return the smallest box of an orientation."""
    turned = points @ R
    low, high = turned.min(axis=0) - _SAFE, turned.max(axis=0) + _SAFE
    return EnclosingBox(R @ (0.5 * (low + high)), R, high - low)


# No postponed annotations: older pydantic resolves inherited ones in the subclass's module.


@validated
class ModelObstacle(Obstacle):
    """What a URDF or SDF file describes, one rigid thing.

    Each collision geometry of a body, or what is drawn of a body that has none, is an obstacle of
    its own: balls, boxes, capsules, cylinders and half-spaces as they are; an ellipsoid or the
    convex hull of a mesh as a box or a capsule that holds it, whichever is smaller. Their names are
    that of the model and of the body.
    """

    kind: Literal["model"] = "model"
    file: Annotated[str, Meaning("URDF or SDF file, all of whose joints are fixed.")]
    translation: Annotated[
        Point,
        Meaning("Place of the model's frame, shape (3,).", unit="m"),
    ] = Field(default_factory=zeros)
    rpy: Annotated[
        Angles,
        Meaning("Roll, pitch and yaw of the model's frame, shape (3,).", unit="rad"),
    ] = Field(default_factory=zeros)

    def __post_init__(self) -> None:
        super().__post_init__()
        try:
            self.parts  # noqa: B018  a file that cannot be read is to be refused now
        except InvalidInputError as error:
            raise ValueError(f"file: {Path(self.file).name}: {error}") from None
        except ValueError as error:
            raise ValueError(f"file: {error}") from None

    @cached_property
    def parts(self) -> tuple[Obstacle, ...]:
        """Its shapes, as obstacles."""
        model, found = StillModel(Path(self.file)), list[Obstacle]()
        X_WM = RigidTransform(RollPitchYaw(self.rpy), self.translation)
        count = dict[str, int]()
        moving: dict[str, Any] = {"speed": self.speed, "error": self.error, "moves": self.moves}
        for body, X_MG, shape in model.shapes():
            count[body] = count.get(body, 0) + 1
            number = f" {count[body]}" if count[body] > 1 else ""
            name = f"{self.name}/{body}{number}"
            found.append(solid_round(shape, X_WM @ X_MG, name, **moving))
        return tuple(found)


def solid_round(shape: Shape, X_WG: RigidTransform, name: str, **moving: Any) -> Obstacle:
    """Return the obstacle that a shape of Drake's is, or the smaller one of two that hold it.

    Args:
        shape: The shape.
        X_WG: Its pose in the base frame.
        name: Name of the obstacle.
        moving: Fields of an obstacle that may move.

    Raises:
        ValueError: If it has no bounds and is no half-space.
    """
    kind, fields = _solid(shape, X_WG)
    return kind(name=name, **fields, **moving)


def _solid(shape: Shape, X_WG: RigidTransform) -> tuple[type[Obstacle], Mapping[str, Any]]:
    """Return the obstacle that a shape is, or the smaller one of two round it, as its fields."""
    if isinstance(shape, Sphere):
        return BallObstacle, {"center": X_WG.translation(), "radius": shape.radius()}
    if isinstance(shape, Capsule):
        half = 0.5 * shape.length()
        ends = tuple(X_WG @ np.array([0.0, 0.0, z]) for z in (-half, half))
        return CapsuleObstacle, {"ends": ends, "radius": shape.radius()}
    if isinstance(shape, Cylinder):
        sizes = {"radius": shape.radius(), "length": shape.length()}
        rpy = RollPitchYaw(X_WG.rotation()).vector()
        return CylinderObstacle, {"center": X_WG.translation(), "rpy": rpy, **sizes}
    if isinstance(shape, HalfSpace):
        normal = X_WG.rotation().col(2)
        return HalfSpaceObstacle, {"point": X_WG.translation(), "normal": normal}
    if isinstance(shape, Box):
        return _box(EnclosingBox(np.zeros(3), np.eye(3), shape.size()), X_WG)
    if (points := points_round(shape)) is None:
        raise ValueError(f"no box holds a {type(shape).__name__}")
    box, capsule = _box_round(shape) or enclosing_box(points), enclosing_capsule(points)
    if box.volume <= capsule.volume:
        return _box(box, X_WG)
    ends = tuple(X_WG @ end for end in capsule.ends)
    return CapsuleObstacle, {"ends": ends, "radius": capsule.radius}


def _box_round(shape: Shape) -> EnclosingBox | None:
    """Return the box that touches an ellipsoid on six sides; None for others."""
    if not isinstance(shape, Ellipsoid):
        return None
    size = 2.0 * np.array([shape.a(), shape.b(), shape.c()])
    return EnclosingBox(np.zeros(3), np.eye(3), size)


def _box(box: EnclosingBox, X_WG: RigidTransform) -> tuple[type[Obstacle], Mapping[str, Any]]:
    """Return a box as an obstacle; it is given in the frame of the shape that it holds."""
    R_WB = X_WG.rotation() @ RotationMatrix.ProjectToRotationMatrix(box.R)
    rpy = RollPitchYaw(R_WB).vector()
    return BoxObstacle, {"center": X_WG @ box.center, "size": box.size, "rpy": rpy}

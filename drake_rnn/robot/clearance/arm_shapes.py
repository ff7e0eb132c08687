"""Points round the geometry of an arm's bodies, as Drake reads it from the model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.geometry import (
    Box,
    Capsule,
    Convex,
    Cylinder,
    Ellipsoid,
    GeometryId,
    Mesh,
    Role,
    SceneGraph,
    SceneGraphInspector,
    Shape,
    Sphere,
)
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex

from ...errors import InvalidInputError
from ...inputs.fields import Array
from ..arm import Arm
from .enclosing_capsule import Enclosing

# Corners of the polygon round a circle, and of the directions round a ball.
_CORNERS = 24


@dataclass(frozen=True, eq=False)
class Part:
    """A part of an arm that moves as one.

    Attributes:
        body: Name of its body.
        points: Points whose hull holds it, in the body's frame, shape (k, 3) [m].
        exact: The capsule that it is, if it is a ball or a capsule; else None.
        shapes: Points round each of its shapes, in the body's frame; by default one of all.
    """

    body: str
    points: Array
    exact: Enclosing | None = None
    shapes: tuple[Array, ...] = ()

    @property
    def pieces(self) -> tuple[Array, ...]:
        """Points round each of its convex shapes, whose hulls together are the part."""
        return self.shapes or (self.points,)


def parts_of(arm: Arm) -> list[Part]:
    """Return the parts that an arm consists of, base to tip.

    A body is one part, of what the model has for collisions, or draws where it has nothing for
    them. Of a tool that was added each drawn part is one: it is slender, and may come close to
    things. A mesh counts with its convex hull.

    Raises:
        InvalidInputError: If a body has a shape that has no bounds.
    """
    scene_graph, plant = SceneGraph(), MultibodyPlant(0.0)
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    arm.add_to(plant)
    plant.Finalize()
    inspector, found = scene_graph.model_inspector(), list[Part]()
    tool = None if arm.tool is None else plant.GetFrameByName(arm.tool.tip).body().index()
    for body in map(plant.get_body, map(BodyIndex, range(1, plant.num_bodies()))):
        frame, name = plant.GetBodyFrameIdOrThrow(body.index()), body.name()
        drawn = inspector.GetGeometries(frame, Role.kIllustration)
        if body.index() == tool:
            found += [_part(inspector, [geometry], name) for geometry in drawn]
        elif shapes := inspector.GetGeometries(frame, Role.kProximity) or drawn:
            found.append(_part(inspector, shapes, name))
    del inspector, body, plant  # they point to the scene graph, which must outlive them
    return found


def _part(inspector: SceneGraphInspector, geometries: list[GeometryId], body: str) -> Part:
    """Return geometries of a body as a part of it."""
    points, exact = [], None
    for geometry in geometries:
        X_BG, shape = inspector.GetPoseInFrame(geometry), inspector.GetShape(geometry)
        points.append(_round(shape, body) @ X_BG.rotation().matrix().T + X_BG.translation())
        if isinstance(shape, (Sphere, Capsule)):
            half = 0.5 * shape.length() if isinstance(shape, Capsule) else 0.0
            ends = np.array([X_BG @ np.array([0.0, 0.0, z]) for z in (-half, half)])
            exact = Enclosing(ends, shape.radius())
    return Part(
        body, np.concatenate(points), exact if len(geometries) == 1 else None, tuple(points)
    )


def _round(shape: Shape, body: str) -> Array:
    """Return points whose hull holds a shape of a body."""
    if (points := points_round(shape)) is None:
        raise InvalidInputError(
            f"arm: {body!r} has a {type(shape).__name__}, round which no capsule fits; give the "
            "body a capsule in a file: capsules"
        )
    return points


def points_round(shape: Shape) -> Array | None:
    """Return points whose hull holds a shape, in its own frame, shape (k, 3) [m].

    Of a mesh they are the vertices of its convex hull. None for a shape that has no bounds.
    """
    if isinstance(shape, Box):
        signs = np.array(np.meshgrid(*[(-0.5, 0.5)] * 3)).reshape(3, -1).T
        return np.asarray(signs * shape.size())
    if isinstance(shape, (Cylinder, Capsule)):
        half = 0.5 * shape.length()
        if isinstance(shape, Capsule):
            return _at_ends(shape.radius() * _ball(), half)
        turn = 2.0 * np.pi * np.arange(_CORNERS) / _CORNERS
        r = shape.radius() / np.cos(np.pi / _CORNERS)
        circle = np.stack((r * np.cos(turn), r * np.sin(turn), 0.0 * turn), axis=1)
        return _at_ends(circle, half)
    if isinstance(shape, Sphere):
        return shape.radius() * _ball()
    if isinstance(shape, Ellipsoid):
        return np.array([shape.a(), shape.b(), shape.c()]) * _ball()
    if isinstance(shape, (Mesh, Convex)):
        hull = shape.GetConvexHull()
        return np.array([hull.vertex(k) for k in range(hull.num_vertices())])
    return None


def _at_ends(points: Array, half: float) -> Array:
    """Return points moved to either end of a segment of the z axis, shape (2 k, 3)."""
    end = np.array([0.0, 0.0, half])
    return np.concatenate((points + end, points - end))


def _ball() -> Array:
    """Return points whose hull holds the unit ball, shape (k, 3)."""
    z = np.cos(np.pi * (np.arange(_CORNERS // 2 + 1)) / (_CORNERS // 2))
    turn = 2.0 * np.pi * np.arange(_CORNERS) / _CORNERS
    r = np.sqrt(1.0 - z**2)[:, None]
    points = np.stack(
        (r * np.cos(turn), r * np.sin(turn), z[:, None] + 0.0 * turn), axis=-1
    ).reshape(-1, 3)
    # Each patch of the sphere lies within the hull if its corners are as far out as its middle is
    # in; half the diagonal of a patch is at most pi / _CORNERS times the root of two.
    return points / np.cos(np.sqrt(2.0) * np.pi / _CORNERS)

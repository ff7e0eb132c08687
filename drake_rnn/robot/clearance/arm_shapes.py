"""Points round the geometry of an arm's bodies, as Drake reads it from the model.

- The smallest capsule round points, as far as a search over its directions finds it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pydrake.geometry import (
    Box,
    Capsule,
    Convex,
    Cylinder,
    Ellipsoid,
    GeometryId,
    GeometryInstance,
    Mesh,
    ProximityProperties,
    Role,
    SceneGraph,
    SceneGraphInspector,
    Shape,
    Sphere,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Body, BodyIndex

from ...inputs.fields import Array
from ...inputs.files import cached_numbers
from ...inputs.packages import late_import
from ..arm import Arm
from ..arm_description import PayloadShape
from ..kinematics import joints_to
from ..model import LostMesh
from .capsules import off_segment

trimesh = late_import("trimesh")

# Directions over half of a sphere, and how often the best is looked at more closely.
_DIRECTIONS, _CLOSER = 200, 4
# Beyond rounding errors of a projection [m].
_SAFE = 1e-9


class Enclosing(NamedTuple):
    """A capsule: all points within a radius of a segment.

    Attributes:
        ends: Ends of the segment, shape (2, 3) [m].
        radius: Radius [m].
    """

    ends: Array
    radius: float

    @property
    def volume(self) -> float:
        """Volume [m^3]."""
        length = float(np.linalg.norm(self.ends[1] - self.ends[0]))
        return np.pi * self.radius**2 * (length + 4.0 / 3.0 * self.radius)


def enclosing_capsule(points: Array) -> Enclosing:
    """Return a small capsule that holds all points.

    The segment's direction is searched over a grid of a sphere that becomes finer; for each, the
    radius is that of the smallest circle round the projected points, and the segment as short as
    the points allow.

    Args:
        points: At least one point, shape (k, 3) [m].
    """
    _, _, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    directions = np.concatenate((axes, half_sphere(_DIRECTIONS)))
    best = min((capsule_along(points, d) for d in directions), key=lambda found: found.volume)
    width = 2.0 / np.sqrt(_DIRECTIONS)
    rng = np.random.default_rng(0)
    for _ in range(_CLOSER):
        along = best.ends[1] - best.ends[0]
        length = np.linalg.norm(along)
        if length < _SAFE:
            break
        near = along / length + width * rng.uniform(-1.0, 1.0, (40, 3))
        near /= np.linalg.norm(near, axis=1, keepdims=True)
        best = min(
            (best, *(capsule_along(points, d) for d in near)), key=lambda found: found.volume
        )
        width *= 0.4
    return best


def kept_capsule(points: Array) -> Enclosing:
    """Return what `enclosing_capsule` does, once found for all processes of a user."""

    def fit() -> Array:
        ends, radius = enclosing_capsule(points)
        return np.array([*ends.ravel(), radius])

    *ends, radius = cached_numbers(fit_name("capsule", points), fit).tolist()
    return Enclosing(np.array(ends).reshape(2, 3), radius)


def fit_name(what: str, *arrays: Array) -> str:
    """Return the name of a file of the cache for what is found of arrays by this folder's code."""
    digest = sha256(_code())
    for array in arrays:
        numbers = np.asarray(array, dtype=np.float64)
        digest.update(str(numbers.shape).encode() + numbers.tobytes())
    return f"fits/{what}_{digest.hexdigest()[:32]}.bin"


@cache
def _code() -> bytes:
    """Return what changes if what is found of the same shapes may."""
    digest = sha256(f"{np.__version__} {version('drake')}".encode())
    for file in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(file.read_bytes())
    return digest.digest()


def capsule_along(points: Array, direction: Array) -> Enclosing:
    """Return the smallest capsule whose segment has a direction."""
    _, _, axes = np.linalg.svd(direction[None, :])
    plane = axes[1:]
    centre, radius = smallest_circle(points @ plane.T)
    radius += _SAFE
    s = points @ direction
    away = ((points @ plane.T - centre) ** 2).sum(axis=1)
    # How far before and after its foot on the axis a point is within the radius.
    reach = np.sqrt(np.maximum(radius**2 - away, 0.0))
    first, last = (s + reach).min(), (s - reach).max()
    if first > last:
        # A ball holds all points, and no segment is needed.
        first = last = 0.5 * (first + last)
    foot = centre @ plane
    return Enclosing(np.array([foot + first * direction, foot + last * direction]), float(radius))


def smallest_circle(points: Array) -> tuple[Array, float]:
    """Return centre and radius of the smallest circle round points of a plane, shape (k, 2).

    The circle through two or three of them that leaves none out: it grows by the farthest that is
    outside until there is none (as the algorithms of Welzl, "Smallest enclosing disks", 1991).
    """
    centre = points.mean(axis=0)
    far = points[((points - centre) ** 2).sum(axis=1).argmax()]
    on, centre, radius = [far], far, 0.0
    for _ in range(100):
        away = np.sqrt(((points - centre) ** 2).sum(axis=1))
        k = int(away.argmax())
        if away[k] <= radius * (1.0 + 1e-12) + 1e-15:
            break
        on, centre, radius = _basis([*on, points[k]])
    away = np.sqrt(((points - centre) ** 2).sum(axis=1))
    return centre, float(max(radius, away.max()))


def _basis(on: list[Array]) -> tuple[list[Array], Array, float]:
    """Return the two or three of up to four points whose circle holds them all, and the circle."""
    last = on[-1]
    best: tuple[list[Array], Array, float] | None = None
    for choice in _choices(on[:-1], last):
        circle = _through(choice)
        if circle is None:
            continue
        centre, radius = circle
        holds = all(np.linalg.norm(p - centre) <= radius * (1.0 + 1e-10) + 1e-15 for p in on)
        if holds and (best is None or radius < best[2]):
            best = (choice, centre, radius)
    if best is None:
        centre = np.mean(on, axis=0)
        return on[-3:], centre, float(max(np.linalg.norm(p - centre) for p in on))
    return best


def _choices(others: list[Array], last: Array) -> list[list[Array]]:
    """Return the pairs and triples that hold the last point, the one which was outside."""
    pairs = [[p, last] for p in others]
    triples = [[p, r, last] for k, p in enumerate(others) for r in others[k + 1 :]]
    return pairs + triples


def _through(points: list[Array]) -> tuple[Array, float] | None:
    """Return the circle whose diameter is two points, or through three; None on a line."""
    if len(points) == 2:
        centre = 0.5 * (points[0] + points[1])
        return centre, float(np.linalg.norm(points[0] - centre))
    a, b = points[1] - points[0], points[2] - points[0]
    twice = 2.0 * (a[0] * b[1] - a[1] * b[0])
    if abs(twice) < 1e-18:
        return None
    aa, bb = a @ a, b @ b
    offset = np.array([b[1] * aa - a[1] * bb, a[0] * bb - b[0] * aa]) / twice
    return points[0] + offset, float(np.linalg.norm(offset))


def half_sphere(count: int) -> Array:
    """Return unit vectors spread over half of a sphere, shape (count, 3)."""
    k = np.arange(count) + 0.5
    z, turn = k / count, np.pi * (1.0 + np.sqrt(5.0)) * k
    r = np.sqrt(1.0 - z**2)
    return np.stack((r * np.cos(turn), r * np.sin(turn), z), axis=1)


# Farther than this from a body's origin, a joint is held by something [m]; what is lighter than
# this, as a frame of a sensor is, has no extent [kg].
_FAR, _LIGHT = 1e-3, 0.01
# What is smaller in all directions than this has no size [m].
_TINY = 1e-5
#: What is drawn may reach beyond collision shapes, and shapes beyond capsules, by so much [m].
HARDLY = 1e-3
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
        beyond: How far what is drawn of it reaches beyond the hull of its collision shapes, if it
            has both [m].
    """

    body: str
    points: Array
    exact: Enclosing | None = None
    shapes: tuple[Array, ...] = ()
    beyond: float = 0.0

    @property
    def pieces(self) -> tuple[Array, ...]:
        """Points round each of its convex shapes, whose hulls together are the part."""
        return self.shapes or (self.points,)


@dataclass(frozen=True, eq=False)
class ArmShapes:
    """What a model says of the shapes of an arm's bodies.

    Attributes:
        parts: The parts that it consists of, base to tip.
        bare: Names of the arm's bodies without any shape, which have a mass or hold a joint that
            is not at their origin.
        lost: Meshes of the arm's bodies that cannot be read.
        bodies: Names of the arm's bodies: those that its joints move, and those that carry it.
        endless: Names of bodies with a shape that has no bounds, and what it is.
    """

    parts: tuple[Part, ...]
    bare: tuple[str, ...]
    lost: tuple[LostMesh, ...]
    bodies: tuple[str, ...]
    endless: Mapping[str, str]

    def doubts(self, own_bodies: Collection[str] = ()) -> list[str]:
        """Return what in the model leaves the shapes of the arm's bodies open, each in a sentence.

        Args:
            own_bodies: Names of bodies that do not matter, as their capsules are stated.
        """
        own = set(self.bodies) - set(own_bodies)
        has = own & {part.body for part in self.parts}
        beyond = {p.body: p.beyond for p in self.parts if p.body in own and p.beyond > HARDLY}
        sentences = [
            f"the mesh {mesh.mesh} of {mesh.link!r} {mesh.fault}; only the body's other shapes are "
            "kept clear"
            for mesh in self.lost
            if mesh.link in has
        ]
        if beyond:
            most = sorted(beyond, key=lambda body: -beyond[body])
            text = ", ".join(f"{body} by {1e3 * beyond[body]:.0f} mm" for body in most)
            sentences.append(
                "the model's collision shapes hold less than it draws; both are kept clear: " + text
            )
        return sentences


def payload_of(arm: Arm) -> str | None:
    """Return the name of the body of what an arm holds; None if it holds nothing."""
    payload = arm.description.payload
    return None if payload is None else payload.name


def parts_of(arm: Arm) -> list[Part]:
    """Return the parts that an arm consists of, see `arm_shapes`."""
    return list(arm_shapes(arm).parts)


def arm_shapes(arm: Arm) -> ArmShapes:
    """Return the shapes of an arm's bodies.

    A body is one part: all that the model has of it for collisions and all that it draws. Of a tool
    that was added, and of a payload, each drawn part is one: it may come close to things. So is
    each of the bounds of a mobile base. A mesh
    counts with its convex hull; what has no size does not.
    """
    scene_graph, plant = SceneGraph(), MultibodyPlant(0.0)
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    lost_meshes = arm.add_shapes_to(plant)
    plant.Finalize()
    inspector, parts, bare = scene_graph.model_inspector(), list[Part](), list[str]()
    endless, payload = dict[str, str](), payload_of(arm)
    tools = {plant.GetFrameByName(tool.tip).body().index() for tool in arm.tools}
    own_bodies = _of_the_arm(arm, plant)
    names = tuple(plant.get_body(index).name() for index in sorted(own_bodies) if int(index))
    for body in map(plant.get_body, map(BodyIndex, range(1, plant.num_bodies()))):
        frame, name = plant.GetBodyFrameIdOrThrow(body.index()), body.name()
        visual, solid = (
            _solids(inspector, inspector.GetGeometries(frame, role), name, endless)
            for role in (Role.kIllustration, Role.kProximity)
        )
        if arm.base is not None and name == arm.base.name:
            parts += (_part(name, [_stated(solid)], []) for solid in arm.base.bounds or ())
        elif body.index() in tools or name == payload:
            parts += [_part(name, [shape], []) for shape in visual]
        elif visual or solid:
            parts.append(_part(name, visual, solid))
        elif body.index() in own_bodies and _has_extent(plant, body):
            bare.append(name)
    del inspector, body, plant  # they point to the scene graph, which must outlive them
    lost_meshes = tuple(mesh for mesh in dict.fromkeys(lost_meshes) if mesh.link in names)
    return ArmShapes(tuple(parts), tuple(bare), lost_meshes, names, endless)


def arm_surfaces(arm: Arm) -> dict[str, Array]:
    """Return the triangles of each body of an arm, shape (t, 3, 3) each, in its frame [m].

    They are all that the model has of the body for collisions and all that it draws, meshes as they
    are and primitives by triangles round them. A tool and a payload that were added are left out.
    """
    scene_graph, plant = SceneGraph(), MultibodyPlant(0.0)
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    arm.add_shapes_to(plant, whole=True)
    plant.Finalize()
    tools = {plant.GetFrameByName(tool.tip).body().index() for tool in arm.tools}
    inspector, surfaces = scene_graph.model_inspector(), dict[str, Array]()
    base = None if arm.base is None else arm.base.name
    for index in sorted(_of_the_arm(arm, plant) - tools - {BodyIndex(0)}):
        if plant.get_body(index).name() in (payload_of(arm), base):
            continue
        frame, triangles = plant.GetBodyFrameIdOrThrow(index), []
        for role in (Role.kProximity, Role.kIllustration):
            for geometry in inspector.GetGeometries(frame, role):
                X_BG, found = inspector.GetPoseInFrame(geometry), inspector.GetShape(geometry)
                corners = _triangles(found)
                if corners.size and np.ptp(corners, axis=(0, 1)).max() > _TINY:
                    R_BG, p_BG = X_BG.rotation().matrix(), X_BG.translation()
                    triangles.append(corners @ R_BG.T + p_BG)
        if triangles:
            surfaces[plant.get_body(index).name()] = np.concatenate(triangles)
    del inspector, plant  # they point to the scene graph, which must outlive them
    return surfaces


def _triangles(shape: Shape) -> Array:
    """Return the triangles of a mesh, or some round another shape, shape (t, 3, 3) [m]."""
    if isinstance(shape, Mesh) and shape.extension() == ".obj" and shape.source().is_path():
        mesh = trimesh.load_scene(str(shape.source().path()), process=False).to_mesh()
        vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
        return np.asarray((vertices * shape.scale3())[faces], dtype=float)
    points = points_round(shape)
    return np.zeros((0, 3, 3)) if points is None else hull_triangles(points)


def hull_triangles(points: Array) -> Array:
    """Return the triangles of the convex hull of points, shape (k, 3) [m], as shape (t, 3, 3)."""
    hull = convex(points, "hull").GetConvexHull()
    triangles = []
    for face in map(hull.element, range(hull.num_elements())):
        first, *others = (hull.vertex(face.vertex(k)) for k in range(face.num_vertices()))
        triangles += [(first, a, b) for a, b in pairwise(others)]
    return np.array(triangles)


def _of_the_arm(arm: Arm, plant: MultibodyPlant) -> set[BodyIndex]:
    """Return the bodies that controlled joints move, or that carry the first ones of a chain."""
    joints = [plant.GetJointByName(name) for name in arm.joints]
    bodies = plant.GetBodiesKinematicallyAffectedBy([joint.index() for joint in joints])
    bases = [joints[begin].parent_body() for begin in arm.begins]
    carriers = (j.parent_body().index() for base in bases for j in joints_to(plant, base))
    return {*bodies, *(base.index() for base in bases), *carriers}


def _has_extent(plant: MultibodyPlant, body: Body) -> bool:
    """Return whether a body without a shape must have one: it is heavy or reaches to a joint."""
    if body.default_mass() > _LIGHT:
        return True
    return any(
        joint.num_positions() > 0
        and joint.parent_body().index() == body.index()
        and np.linalg.norm(joint.frame_on_parent().GetFixedPoseInBodyFrame().translation()) > _FAR
        for joint in map(plant.get_joint, plant.GetJointIndices())
    )


class _Solid(NamedTuple):
    """A shape of a body: points round it, in the body's frame, and the capsule that it is."""

    points: Array
    exact: Enclosing | None


def _solids(
    inspector: SceneGraphInspector,
    geometries: Iterable[GeometryId],
    body: str,
    endless: dict[str, str],
) -> list[_Solid]:
    """Return geometries of a body that have a size; those without bounds are noted."""
    entries = []
    for geometry in geometries:
        X_BG, shape = inspector.GetPoseInFrame(geometry), inspector.GetShape(geometry)
        if (points := points_round(shape)) is None:
            endless[body] = type(shape).__name__
        elif np.ptp(points, axis=0).max() > _TINY:
            points = points @ X_BG.rotation().matrix().T + X_BG.translation()
            entries.append(_Solid(points, _exact(shape, X_BG)))
    return entries


def _stated(solid: PayloadShape) -> _Solid:
    """Return a shape of a description, in the frame of its body."""
    points, X_BG = points_round(solid.shape), solid.X_HG
    return _Solid((X_BG @ np.asarray(points).T).T, _exact(solid.shape, X_BG))


def _exact(shape: Shape, X_BG: RigidTransform) -> Enclosing | None:
    """Return the capsule that a shape of a body is; None if it is none."""
    if not isinstance(shape, (Sphere, Capsule)):
        return None
    half = 0.5 * shape.length() if isinstance(shape, Capsule) else 0.0
    ends = np.array([X_BG @ np.array([0.0, 0.0, z]) for z in (-half, half)])
    return Enclosing(ends, shape.radius())


def _part(body: str, visual: list[_Solid], solid: list[_Solid]) -> Part:
    """Return what is drawn of a body and what it has for collisions as a part."""
    every = [*solid, *visual]
    points = [shape.points for shape in every]
    holds = (s.exact for s in every if s.exact and all(_holds(s.exact, other) for other in every))
    beyond = 0.0
    if visual and solid:
        sides = (np.concatenate([shape.points for shape in side]) for side in (visual, solid))
        name = fit_name("beyond", *sides)
        beyond = cached_numbers(name, lambda: np.array([_beyond(visual, solid)])).item()
    return Part(body, np.concatenate(points), next(holds, None), tuple(points), beyond)


def _beyond(visual: Sequence[_Solid], solid: Sequence[_Solid]) -> float:
    """Return how far what is drawn reaches beyond the hull of the collision shapes [m]."""
    inner = np.concatenate([shape.points for shape in solid])
    every = np.concatenate((inner, *(shape.points for shape in visual)))
    whole, within = convex(every, "whole").GetConvexHull(), set(map(bytes, inner))
    corners = [whole.vertex(k) for k in range(whole.num_vertices())]
    outside = [corner for corner in corners if corner.tobytes() not in within]
    if not outside:
        return 0.0
    scene_graph = SceneGraph()
    source = scene_graph.RegisterSource("body")
    hull = GeometryInstance(RigidTransform(), convex(inner, "collision"), "collision")
    hull.set_proximity_properties(ProximityProperties())
    scene_graph.RegisterAnchoredGeometry(source, hull)
    context = scene_graph.CreateDefaultContext()
    query = scene_graph.get_query_output_port().Eval(context)
    away = (query.ComputeSignedDistanceToPoint(point)[0].distance for point in outside)
    return max(0.0, *away)


def _holds(capsule: Enclosing, shape: _Solid) -> bool:
    """Return whether a capsule holds a shape."""
    if shape.exact is None:
        return bool((off_segment(shape.points, capsule.ends) <= capsule.radius).all())
    off = off_segment(shape.exact.ends, capsule.ends) + shape.exact.radius
    return bool((off <= capsule.radius * (1.0 + 1e-12)).all())


def convex(points: Array, name: str) -> Convex:
    """Return the hull of points, shape (k, 3) [m], as Drake's shape; on a line, a thin one."""
    hull = Convex(points.T, name)
    try:
        hull.GetConvexHull()
    except RuntimeError:
        thick = _TINY * np.concatenate((np.eye(3), -np.eye(3)))
        return Convex((points[:, None] + thick).reshape(-1, 3).T, name)
    return hull


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

"""How near two bodies of an arm come within its joint limits, by a search over postures.

Shapes are those of the model, each mesh by its convex hull, as Drake's SceneGraph sees them, and
not the capsules. So it shows which pairs of bodies cannot touch, and may be left out in a file of
capsules. A hull holds more than its mesh: bodies that are apart here are apart; bodies that touch
here may do so only in a hollow of one of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.geometry import (
    AddContactMaterial,
    FramePoseVector,
    GeometryFrame,
    GeometryInstance,
    ProximityProperties,
    SceneGraph,
)
from pydrake.math import RigidTransform

from ...errors import InvalidInputError
from ...inputs.complaints import nearest
from ...inputs.fields import Array
from ..arm import Arm
from .arm_capsules import place_capsules
from .arm_shapes import Part, convex, parts_of
from .capsules import Capsule

# Postures of one joint, of two (each), and of more.
_ONE, _TWO, _MORE = 361, 41, 4000
# Ways down from the best postures, and shares of a joint's range at which they begin and end.
_DESCENTS, _WIDE, _NARROW = 6, 0.05, 1e-4
# Half of the range of a joint that slides without limits [m].
_WITHOUT_LIMITS = 1.0


@dataclass(frozen=True, eq=False)
class LeastDistance:
    """The least distance of two bodies that a search has found.

    Attributes:
        bodies: Names of the two.
        joints: Names of the joints between them, which alone change their distance.
        distance: The least distance [m]; negative where they overlap, by how deep.
        posture: Where it was found, shape (n,) [rad]; joints that do not matter are at zero, or at
            the limit that is nearest to it.
        postures: Number of postures that were looked at.
    """

    bodies: tuple[str, str]
    joints: tuple[str, ...]
    distance: float
    posture: Array
    postures: int

    @property
    def touch(self) -> bool:
        """Whether the two touch."""
        return self.distance <= 0.0


def least_distance(
    arm: Arm,
    bodies: tuple[str, str],
    parts: Sequence[Part] | None = None,
    enough: float = -np.inf,
    first: Array | None = None,
    seed: int = 0,
) -> LeastDistance:
    """Return how near two bodies of an arm come within its joint limits.

    One or two joints between them are looked at on a grid, of 361 or 41 by 41 postures, more joints
    at 4000 random ones. From the six best of these a search goes down along single joints.

    Args:
        arm: The arm.
        bodies: Names of two bodies.
        parts: Shapes of the bodies in their frames, e.g. of other meshes; by default those of the
            model. A body may have several.
        enough: Distance at or below which the search ends [m]: 0 if it matters only whether they
            touch.
        first: Posture that is looked at before all others, shape (n,) [rad].
        seed: Seed of the random postures.

    Raises:
        InvalidInputError: If a body does not exist, has no shape, or no joint is between the two.
    """
    parts = parts_of(arm) if parts is None else parts
    pieces = [[p for part in parts if part.body == name for p in part.pieces] for name in bodies]
    for name, found in zip(bodies, pieces, strict=True):
        if not found:
            names = sorted({part.body for part in parts})
            raise InvalidInputError(f"bodies: {name!r} has no shape; {nearest(name, names)}")
    point = np.zeros(3)
    placed = place_capsules(arm, [Capsule(body=b, ends=(point, point), radius=1.0) for b in bodies])
    begin, end = sorted(placed.links)
    if begin == end:
        raise InvalidInputError(f"bodies: no joint is between {bodies[0]!r} and {bodies[1]!r}")
    gap = _gap_of(arm, bodies, pieces)
    lower, upper = search_bounds(arm)
    rest = np.clip(0.0, lower, upper)

    def distance(free: Array) -> float:
        q = rest.copy()
        q[begin:end] = free
        return gap(*placed.poses.at(q)[placed.links])

    begins = _begins(lower[begin:end], upper[begin:end], seed)
    if first is not None:
        begins = np.concatenate((first[None, begin:end], begins))
    bounds = lower[begin:end], upper[begin:end]
    rest[begin:end], least, count = _searched(distance, begins, bounds, enough)
    return LeastDistance(bodies, arm.joints[begin:end], least, rest, count)


def search_bounds(arm: Arm) -> tuple[Array, Array]:
    """Return the position limits of an arm, of a joint that turns at most one turn, shapes (n,)."""
    half = np.array([np.pi if unit == "rad" else _WITHOUT_LIMITS for unit in arm.units])
    lower, upper = arm.limits.position_lower, arm.limits.position_upper
    turns = np.array([unit == "rad" for unit in arm.units]) & ~(upper - lower < 2.0 * np.pi)
    return (
        np.where(turns | ~np.isfinite(lower), -half, lower),
        np.where(turns | ~np.isfinite(upper), half, upper),
    )


def _searched(
    distance: Callable[[Array], float], begins: Array, bounds: tuple[Array, Array], enough: float
) -> tuple[Array, float, int]:
    """Return where a function of a few joints is least, its value, and how often it was looked at.

    Args:
        distance: The function.
        begins: Postures at which it is looked at first, shape (k, joints).
        bounds: Bounds of the joints.
        enough: Value at or below which the search ends.
    """
    values = list[float]()
    for q in begins:
        values.append(distance(q))
        if values[-1] <= enough:
            return q, values[-1], len(values)
    order = np.argsort(values)
    best, least, count = begins[order[0]], values[order[0]], len(values)
    for k in order[:_DESCENTS]:
        q, found, more = _descended(distance, begins[k], values[k], bounds, enough)
        count += more
        if found < least:
            best, least = q, found
        if least <= enough:
            break
    return best, least, count


def _begins(low: Array, high: Array, seed: int) -> Array:
    """Return the postures at which a search begins, shape (k, joints)."""
    if len(low) == 1:
        return np.linspace(low, high, _ONE)
    if len(low) == 2:
        sides = [np.linspace(a, b, _TWO) for a, b in zip(low, high, strict=True)]
        return np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, 2)
    return np.random.default_rng(seed).uniform(low, high, (_MORE, len(low)))


def _descended(
    distance: Callable[[Array], float],
    q: Array,
    least: float,
    bounds: tuple[Array, Array],
    enough: float,
) -> tuple[Array, float, int]:
    """Return a posture from which no single joint leads further down, its value, and the count."""
    share, count, ranges = _WIDE, 0, bounds[1] - bounds[0]
    while share > _NARROW and least > enough:
        moved = False
        for step in (*(share * np.diag(ranges)), *(-share * np.diag(ranges))):
            tried = np.clip(q + step, *bounds)
            count += 1
            if (found := distance(tried)) < least - 1e-9:
                q, least, moved = tried, found, True
        share = share if moved else 0.5 * share
    return q, least, count


def _gap_of(
    arm: Arm, bodies: tuple[str, str], pieces: Sequence[Sequence[Array]]
) -> Callable[[Array, Array], float]:
    """Return a function that gives the distance of two bodies whose links have moved from zero."""
    plant = arm.plant()
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, arm.posture(plant, np.zeros(arm.n)))
    X_WB = [plant.GetBodyByName(name).EvalPoseInWorld(context) for name in bodies]
    scene_graph = SceneGraph()
    source = scene_graph.RegisterSource("bodies")
    frame = scene_graph.RegisterFrame(source, GeometryFrame("second"))
    for side, body in enumerate(pieces):
        for k, points in enumerate(body):
            hull = convex((X_WB[side] @ points.T).T, f"{bodies[side]}_{k}")
            geometry = GeometryInstance(RigidTransform(), hull, f"{side}_{k}")
            geometry.set_proximity_properties(_touchable())
            if side:
                scene_graph.RegisterGeometry(source, frame, geometry)
            else:
                scene_graph.RegisterAnchoredGeometry(source, geometry)
    scene = scene_graph.CreateDefaultContext()
    port, output = scene_graph.get_source_pose_port(source), scene_graph.get_query_output_port()

    def gap(X_first: Array, X_second: Array) -> float:
        poses = FramePoseVector()
        poses.set_value(frame, RigidTransform(np.linalg.inv(X_first) @ X_second))
        port.FixValue(scene, poses)
        found = output.Eval(scene).ComputeSignedDistancePairwiseClosestPoints()
        return min(float(pair.distance) for pair in found)

    return gap


def _touchable() -> ProximityProperties:
    properties = ProximityProperties()
    AddContactMaterial(properties=properties)
    return properties

"""How near two bodies of an arm come within its limits, by their meshes, with a proof.

A pair's distance depends on the joints between its bodies alone. Boxes of these joints are halved,
the most doubtful first: from the middle of a box, joint i brings no point nearer than half the
box's width times the largest distance of a point from its axis. What remains is a bound that no
posture undercuts. Distances are coal's: of convex hulls first, of the triangles where these touch.
"""

from __future__ import annotations

import heapq
from itertools import combinations, pairwise
from typing import NamedTuple

import coal
import numpy as np
from scipy.spatial import ConvexHull

from drake_rnn.inputs.fields import Array
from drake_rnn.robot.arm import Arm
from makers_meshes import Surface, poses_of

# Boxes that are looked at before the search ends, and a nearness that ends it as well [m].
MOST, NEAR = 200_000, 0.005


class Least(NamedTuple):
    """The least distance of two bodies.

    Attributes:
        found: The least distance that was found [m]; at most 0 where they touch.
        proven: No posture has a smaller one [m].
        posture: Where it was found: the joints between the two [rad].
    """

    found: float
    proven: float
    posture: Array


class Joints:
    """The joints of an arm where all are at zero, and their ranges, of at most one turn."""

    def __init__(self, arm: Arm) -> None:
        plant = arm.plant()
        context = plant.CreateDefaultContext()
        plant.SetPositions(context, arm.posture(plant, np.zeros(arm.n)))
        joints = [plant.GetJointByName(name) for name in arm.joints]
        frames = [joint.frame_on_parent().CalcPoseInWorld(context) for joint in joints]
        self.axes = np.array(
            [X.rotation() @ j.revolute_axis() for X, j in zip(frames, joints, strict=True)]
        )
        self.points = np.array([X.translation() for X in frames])
        lower, upper = arm.limits.position_lower, arm.limits.position_upper
        turns = upper - lower > 2.0 * np.pi
        self.lower, self.upper = np.where(turns, -np.pi, lower), np.where(turns, np.pi, upper)
        self.X_WB = list(poses_of(arm, np.zeros(arm.n)).values())

    def world(self, link: int, points: Array) -> Array:
        """Return points of a body in the world where all joints are at zero."""
        X = self.X_WB[link]
        return np.asarray(points @ X.rotation().matrix().T + X.translation())

    def motion(self, first: int, q: Array) -> coal.Transform3s:
        """Return how joints from ``first`` on move what is behind them."""
        R, p = np.eye(3), np.zeros(3)
        for axis, point, angle in zip(self.axes[first:], self.points[first:], q, strict=False):
            K = np.cross(np.eye(3), axis)
            turn = np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K
            p = R @ (point - turn @ point) + p
            R = R @ turn
        return coal.Transform3s(R, p)

    def reaches(self, first: int, points: Array, last: int) -> Array:
        """Return how far from each joint's axis points of body ``last`` can be [m]."""
        found = []
        for k in range(first, last):
            after = self.points[k + 1 : last]
            way = np.cross((after[:1] if len(after) else points) - self.points[k], self.axes[k])
            reach = float(np.linalg.norm(way, axis=1).max())
            if len(after):
                reach += sum(float(np.linalg.norm(b - a)) for a, b in pairwise(after))
                reach += float(np.linalg.norm(points - after[-1], axis=1).max())
            found.append(reach)
        return np.array(found)


def hull_shape(points: Array) -> coal.CollisionGeometry:
    """Return the convex hull of points for coal."""
    model = coal.BVHModelOBBRSS()
    hull = ConvexHull(points)
    model.beginModel(len(hull.simplices), 3 * len(hull.simplices))
    for corners in hull.simplices:
        model.addTriangle(*points[corners])
    model.endModel()
    model.buildConvexHull(True, "Qt")
    return model.convex


def triangles(vertices: Array, faces: Array) -> coal.CollisionGeometry:
    """Return triangles for coal."""
    model = coal.BVHModelOBBRSS()
    model.beginModel(len(faces), 3 * len(faces))
    for a, b, c in faces:
        model.addTriangle(vertices[a], vertices[b], vertices[c])
    model.endModel()
    return model


def least_distance(
    joints: Joints, first: tuple[int, Surface], second: tuple[int, Surface], share: float = 0.9
) -> Least:
    """Return how near two bodies come, each given by its number from the base and its surface.

    Args:
        joints: The arm's joints.
        first: The one that is nearer to the base.
        second: The other one.
        share: The search ends where this share of the least distance found is proven.
    """
    (i, one), (j, other) = first, second
    points = joints.world(i, one.points), joints.world(j, other.points)
    hulls = hull_shape(points[0]), hull_shape(points[1])
    found = _searched(joints, (i, j), hulls, points[1], share)
    if found.found > NEAR:
        return found
    shapes = [triangles(joints.world(k, s.vertices), s.faces) for k, s in ((i, one), (j, other))]
    return _searched(joints, (i, j), (shapes[0], shapes[1]), points[1], share)


def _searched(
    joints: Joints,
    links: tuple[int, int],
    shapes: tuple[coal.CollisionGeometry, coal.CollisionGeometry],
    points: Array,
    share: float,
) -> Least:
    i, j = links
    reach = joints.reaches(i, points, j)
    rest, request = coal.Transform3s(), coal.DistanceRequest()

    def distance(q: Array) -> float:
        result = coal.DistanceResult()
        X = joints.motion(i, q)
        return float(coal.distance(shapes[0], rest, shapes[1], X, request, result))

    low, high = joints.lower[i:j], joints.upper[i:j]
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    best, where = distance(middle), middle
    boxes = [(best - float(half @ reach), 0, middle, half)]
    for count in range(1, MOST, 2):
        if best <= NEAR or boxes[0][0] >= max(share * best, NEAR):
            break
        _, _, middle, half = heapq.heappop(boxes)
        widest = int((half * reach).argmax())
        half = np.where(np.arange(j - i) == widest, 0.5 * half, half)
        for side in (-1, 1):
            at = middle + side * half * (np.arange(j - i) == widest)
            gap = distance(at)
            if gap < best:
                best, where = gap, at
            # A number that no two have keeps arrays from being compared.
            heapq.heappush(boxes, (gap - float(half @ reach), 2 * count + side, at, half))
    return Least(best, boxes[0][0], where)


def meshes_touch(
    joints: Joints, shapes: list[coal.CollisionGeometry], q: Array
) -> tuple[int, int] | None:
    """Return two bodies that touch in a posture, and that no joint joins; None if there are none.

    Args:
        joints: The arm's joints.
        shapes: The triangles of each body in the world where all joints are at zero.
        q: Joint positions, shape (n,) [rad].
    """
    request, result = coal.CollisionRequest(), coal.CollisionResult()
    X = [coal.Transform3s(), *(joints.motion(0, q[: k + 1]) for k in range(len(q)))]
    for i, j in combinations(range(len(shapes)), 2):
        result.clear()
        if j - i > 1 and coal.collide(shapes[i], X[i], shapes[j], X[j], request, result):
            return i, j
    return None

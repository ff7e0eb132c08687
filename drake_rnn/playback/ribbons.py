"""Lines as a pen draws them: flat on a surface, of some width."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..inputs.fields import Array

_SIDES = 16
# Straighter than this needs no joint.
_STRAIGHT = math.cos(math.radians(5.0))


def ribbon(points: Array, normal: Array, width: float) -> tuple[Any, Any, NDArray[np.int64]]:
    """A flat line along points of a plane, with round ends and corners.

    Args:
        points: Two or more, shape (k, 3) [m].
        normal: Of the plane, of length 1, shape (3,).
        width: Of the line [m].

    Returns:
        As `tubes.tube`: vertices, shape (3, v); faces along the line, shape (3, f); how many of
        the faces it takes to reach each point.
    """
    steps = np.diff(points, axis=0)
    # Points in one place are joined by nothing, and are a dot.
    along = steps / np.maximum(np.linalg.norm(steps, axis=1, keepdims=True), 1e-12)
    across = width / 2.0 * np.cross(normal, along)
    one = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    one /= np.linalg.norm(one)
    angles = np.linspace(0.0, math.tau, _SIDES, endpoint=False)
    rim = np.outer(np.cos(angles), one) + np.outer(np.sin(angles), np.cross(normal, one))
    fan = np.array([(0, k, k + 1) for k in range(1, _SIDES - 1)])
    vertices: list[Array] = []
    faces: list[NDArray[np.int64]] = []
    reached = [0]
    used = done = 0

    def add(corners: Array, triangles: NDArray[np.int64]) -> None:
        nonlocal used, done
        vertices.append(corners)
        faces.append(triangles + used)
        used += len(corners)
        done += len(triangles)

    def dot(centre: Array) -> None:
        add(centre + width / 2.0 * rim, fan)

    dot(points[0])
    for k, side in enumerate(across):
        begin, end = points[k], points[k + 1]
        quad = np.array([begin - side, end - side, end + side, begin + side])
        add(quad, np.array([(0, 1, 2), (0, 2, 3)]))
        if k + 1 == len(across) or along[k] @ along[k + 1] < _STRAIGHT:
            dot(end)
        reached.append(done)
    return (
        np.asfortranarray(np.concatenate(vertices).T),
        np.asfortranarray(np.concatenate(faces).T.astype(np.int32)),
        np.array(reached),
    )

"""Paths as tubes: a line is one pixel thin in a browser."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..inputs.fields import Array


def thinned(points: Array, step: float) -> tuple[Array, list[int]]:
    """Points at least a ``step`` apart, first and last included, and which they are."""
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    step = max(step, length / 3000)
    kept = [0]
    for k in range(1, len(points)):
        if math.dist(points[k], points[kept[-1]]) >= step:
            kept.append(k)
    if kept[-1] != len(points) - 1:
        if len(kept) > 1:
            kept.pop()
        kept.append(len(points) - 1)
    return points[kept], kept


def tube(points: Array, radius: float, sides: int = 8) -> tuple[Any, Any, NDArray[np.int64]]:
    """A round tube along a polyline, with round ends; a sharp corner is two ends.

    Returns:
        Vertices, shape (3, v); faces along the tube, shape (3, f); how many of the faces it
        takes to reach each point.
    """
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1, keepdims=True)
    # One point alone is a tube of no length.
    directions = steps / np.maximum(lengths, 1e-12) if len(steps) else np.array([[0.0, 0.0, 1.0]])
    along = np.linspace(0.0, math.tau, sides, endpoint=False)
    caps = np.radians([90.0, 60.0, 30.0])
    rings: list[Array] = []
    faces: list[Array] = []
    reached = [0]
    normal = np.array([0.0, 0.0, 1.0])

    def ring(centre: Array, tangent: Array, width: float, connected: bool) -> None:
        nonlocal normal
        # Carried along with as little twist as can be.
        normal = normal - (normal @ tangent) * tangent
        if np.linalg.norm(normal) < 1e-6:
            normal = np.cross(tangent, np.eye(3)[np.argmin(np.abs(tangent))])
        normal = normal / np.linalg.norm(normal)
        binormal = np.cross(tangent, normal)
        if connected:
            here = len(rings) * sides + np.arange(sides)
            there = len(rings) * sides + (np.arange(sides) + 1) % sides
            before, before_there = here - sides, there - sides
            faces.append(np.stack((before, before_there, there)))
            faces.append(np.stack((before, there, here)))
        outward = np.outer(np.cos(along), normal) + np.outer(np.sin(along), binormal)
        rings.append(centre + width * outward)

    def cap(centre: Array, tangent: Array, side: float) -> None:
        for k, angle in enumerate(caps if side < 0 else caps[::-1]):
            shift = side * radius * math.sin(angle)
            connected = side > 0 or k > 0
            ring(centre + shift * tangent, tangent, radius * math.cos(angle), connected)

    cap(points[0], directions[0], -1.0)
    ring(points[0], directions[0], radius, True)
    for k in range(1, len(directions)):
        before, after = directions[k - 1], directions[k]
        if before @ after > math.cos(math.radians(40.0)):
            middle = (before + after) / np.linalg.norm(before + after)
            ring(points[k], middle, radius, True)
            reached.append(len(faces) * sides)
        else:
            ring(points[k], before, radius, True)
            cap(points[k], before, 1.0)
            reached.append(len(faces) * sides)
            cap(points[k], after, -1.0)
            ring(points[k], after, radius, True)
    ring(points[-1], directions[-1], radius, True)
    cap(points[-1], directions[-1], 1.0)
    if len(points) > 1:
        reached.append(len(faces) * sides)
    return (
        np.asfortranarray(np.concatenate(rings).T),
        np.asfortranarray(np.concatenate(faces, axis=1).astype(np.int32)),
        np.array(reached),
    )

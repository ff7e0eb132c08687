"""Moving parts of a scene: objects that the recording moves, and traced paths that grow.

- Lines as meshes: a browser draws a plain line only one pixel wide.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Meshcat, MeshcatAnimation, Rgba

from .. import colours
from ..inputs.fields import Array
from .replay import pack

# Sides of a tube, and corners of a ribbon's round ends.
_TUBE_SIDES, _ROUND_CORNERS = 10, 24
# Elevations of the rings that round off a tube's end [rad].
_CAP_ANGLES = np.radians([90.0, 60.0, 30.0])
# Cosine of the angle of a corner from which on one tube ends there and another begins.
_SHARP = math.cos(math.radians(40.0))
# Cosine of the angle up to which two segments of a ribbon need no round joint.
_STRAIGHT = math.cos(math.radians(5.0))
# Length below which a segment has no direction [m].
_NO_LENGTH = 1e-12
_MOST_POINTS = 3000
# Longest time between two points that are kept [s]: a line grows from one to the next.
_STEP = 1.0 / 24.0


class LineMesh(NamedTuple):
    """A line as a triangle mesh.

    Attributes:
        vertices: Shape (3, v) [m].
        faces: Indices of each triangle's corners, in order along the line, shape (3, f).
        reached: Number of faces up to each point of the line, shape (k,).
    """

    vertices: Any
    faces: Any
    reached: NDArray[np.int64]


def thin(points: Array, step: float) -> tuple[Array, list[int]]:
    """Leave out points that are closer together than ``step`` [m].

    Args:
        points: Points along a line, shape (k, 3) [m].
        step: Smallest distance [m]; larger on a line so long that it would keep too many points.

    Returns:
        The remaining points, the first and the last included, and their indices.
    """
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    step = max(step, length / _MOST_POINTS)
    indices = [0]
    for k in range(1, len(points)):
        if math.dist(points[k], points[indices[-1]]) >= step:
            indices.append(k)
    if indices[-1] != len(points) - 1:
        if len(indices) > 1:
            indices.pop()
        indices.append(len(points) - 1)
    return points[indices], indices


def simplify(points: Array, deviation: float, time: Array | None = None) -> list[int]:
    """Return indices of points that a line needs, the first and the last included.

    Args:
        points: Points along a line, shape (k, 3) [m].
        deviation: How far the line through the points that are kept may be off the others [m];
            more on a line so long that it would keep too many points.
        time: Time of each point, shape (k,) [s]; with it, points are kept at least every 1/24 s
            while they move.
    """
    _, candidates = thin(points, deviation)
    indices = [0]
    for before, here in pairwise(candidates[1:]):
        since = points[indices[-1] : here + 1]
        late = time is not None and time[here] - time[indices[-1]] > _STEP
        if late or _off(since) > deviation:
            indices.append(before)
    indices += candidates[-1:] if candidates[-1] != indices[-1] else []
    return indices


def _off(points: Array) -> float:
    """Return how far points are off the line from the first to the last of them [m]."""
    along = points[-1] - points[0]
    away = points[1:-1] - points[0]
    share = np.clip(away @ along / max(float(along @ along), _NO_LENGTH**2), 0.0, 1.0)
    return float(np.linalg.norm(away - np.outer(share, along), axis=1).max(initial=0.0))


def tube(points: Array, radius: float) -> LineMesh:
    """Return a round tube with round ends along points, shape (k, 3) [m].

    At a sharp corner one tube ends and another begins. A single point is a ball.
    """
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1, keepdims=True)
    up = np.array([[0.0, 0.0, 1.0]])
    directions = steps / np.maximum(lengths, _NO_LENGTH) if len(steps) else up
    rings = _Rings(radius)
    indices = [0]
    rings.begin(points[0], directions[0])
    for point, (before, after) in zip(points[1:], pairwise(directions), strict=False):
        if before @ after > _SHARP:
            rings.add(point, (before + after) / np.linalg.norm(before + after), radius)
            indices.append(rings.face_count)
        else:
            rings.end(point, before)
            indices.append(rings.face_count)
            rings.begin(point, after)
    rings.end(points[-1], directions[-1])
    if len(points) > 1:
        indices.append(rings.face_count)
    return _mesh(np.concatenate(rings.vertices).T, np.concatenate(rings.faces, axis=1), indices)


class _Rings:
    """Rings of vertices that a tube consists of, each connected to the one before by faces.

    Args:
        radius: Radius of the tube [m].
    """

    def __init__(self, radius: float) -> None:
        self._radius = radius
        self._normal = np.array([0.0, 0.0, 1.0])
        self.vertices: list[Array] = []
        self.faces: list[NDArray[np.int64]] = []

    @property
    def face_count(self) -> int:
        """Number of faces so far."""
        return len(self.faces) * _TUBE_SIDES

    def begin(self, point: Array, tangent: Array) -> None:
        """Begin a tube with a round end."""
        for k, angle in enumerate(_CAP_ANGLES):
            self._add_to_cap(point, tangent, -angle, is_connected=k > 0)
        self.add(point, tangent, self._radius)

    def end(self, point: Array, tangent: Array) -> None:
        """End a tube with a round end."""
        self.add(point, tangent, self._radius)
        for angle in _CAP_ANGLES[::-1]:
            self._add_to_cap(point, tangent, angle, is_connected=True)

    def add(self, centre: Array, tangent: Array, width: float, is_connected: bool = True) -> None:
        """Add a ring of radius ``width`` [m] across the tangent, a unit vector of shape (3,)."""
        # The normal is carried along the line, so that the rings twist as little as possible.
        normal = self._normal - (self._normal @ tangent) * tangent
        if np.linalg.norm(normal) < 1e-6:
            normal = np.cross(tangent, np.eye(3)[np.argmin(np.abs(tangent))])
        self._normal = normal = normal / np.linalg.norm(normal)
        binormal = np.cross(tangent, normal)
        if is_connected:
            here = len(self.vertices) * _TUBE_SIDES + np.arange(_TUBE_SIDES)
            there = len(self.vertices) * _TUBE_SIDES + (np.arange(_TUBE_SIDES) + 1) % _TUBE_SIDES
            before, before_there = here - _TUBE_SIDES, there - _TUBE_SIDES
            self.faces.append(np.stack((before, before_there, there)))
            self.faces.append(np.stack((before, there, here)))
        angles = np.linspace(0.0, math.tau, _TUBE_SIDES, endpoint=False)
        outward = np.outer(np.cos(angles), normal) + np.outer(np.sin(angles), binormal)
        self.vertices.append(centre + width * outward)

    def _add_to_cap(self, centre: Array, tangent: Array, angle: float, is_connected: bool) -> None:
        """Add a ring on the ball round ``centre``, ``angle`` [rad] above its equator."""
        shift = self._radius * math.sin(angle)
        self.add(centre + shift * tangent, tangent, self._radius * math.cos(angle), is_connected)


def ribbon(points: Array, normal: Array, width: float) -> LineMesh:
    """Return a flat line with round ends and corners, as a pen draws it on a plane.

    Args:
        points: Two or more points of the plane, shape (k, 3) [m].
        normal: Unit normal of the plane, shape (3,).
        width: Width of the line [m].
    """
    steps = np.diff(points, axis=0)
    # Equal points need no segment between them: they are a dot.
    lengths = np.linalg.norm(steps, axis=1, keepdims=True)
    along = steps / np.maximum(lengths, _NO_LENGTH)
    across = width / 2.0 * np.cross(normal, along)
    disc = width / 2.0 * _circle(normal)
    fan = np.array([(0, k, k + 1) for k in range(1, _ROUND_CORNERS - 1)])
    vertices: list[Array] = []
    faces: list[NDArray[np.int64]] = []
    indices = [0]
    vertex_count = face_count = 0

    def add(corners: Array, triangles: NDArray[np.int64]) -> None:
        nonlocal vertex_count, face_count
        vertices.append(corners)
        faces.append(triangles + vertex_count)
        vertex_count += len(corners)
        face_count += len(triangles)

    add(points[0] + disc, fan)
    begin_side = across[0]
    for k, side in enumerate(across):
        begin, end = points[k], points[k + 1]
        bends = k + 1 == len(across) or along[k] @ along[k + 1] < _STRAIGHT
        # Where the line goes on nearly straight, two segments meet in the middle of their edges.
        end_side = side if bends else (side + across[k + 1]) / 2.0
        quad = np.array([begin - begin_side, end - end_side, end + end_side, begin + begin_side])
        add(quad, np.array([(0, 1, 2), (0, 2, 3)]))
        if bends:
            add(end + disc, fan)
        begin_side = across[min(k + 1, len(across) - 1)] if bends else end_side
        indices.append(face_count)
    return _mesh(np.concatenate(vertices).T, np.concatenate(faces).T, indices)


def merge(lines: Sequence[LineMesh]) -> tuple[Any, Any]:
    """Return the vertices and faces of several lines as one mesh, as `LineMesh` has them."""
    first = np.cumsum([0, *(line.vertices.shape[1] for line in lines[:-1])], dtype=np.int32)
    faces = [line.faces + k for line, k in zip(lines, first, strict=True)]
    vertices = [line.vertices for line in lines]
    return _store(np.concatenate(vertices, axis=1)), _store(np.concatenate(faces, axis=1))


def _circle(normal: Array) -> Array:
    """Return corners on a unit circle in the plane with this normal, shape (k, 3)."""
    one = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    one /= np.linalg.norm(one)
    angles = np.linspace(0.0, math.tau, _ROUND_CORNERS, endpoint=False)
    return np.outer(np.cos(angles), one) + np.outer(np.sin(angles), np.cross(normal, one))


def _mesh(vertices: Array, faces: NDArray[np.int64], indices: list[int]) -> LineMesh:
    """Return the mesh with its arrays stored as Meshcat takes them."""
    return LineMesh(_store(vertices), _store(faces.astype(np.int32)), np.array(indices))


def _store(values: Any) -> Any:
    """Return values stored as Meshcat takes them."""
    return np.asfortranarray(values)


def move(recording: MeshcatAnimation, path: str, points: Array) -> None:
    """Record the position of an object frame by frame.

    Args:
        recording: The animation.
        path: Scene path of the object.
        points: Its position in each frame, shape (f, 3) [m].
    """
    for frame, point in enumerate(points.tolist()):
        recording.SetProperty(frame, path, "position", point)


class Trace:
    """Lines that grow: one mesh, of which the page shows the faces that are reached by a time.

    Args:
        meshcat: Meshcat with the scene.
        place: Scene path of the mesh.
    """

    def __init__(self, meshcat: Meshcat, place: str = "/traced/path") -> None:
        self._meshcat = meshcat
        self._place = place
        self._lines: list[tuple[LineMesh, Array]] = []

    def add(self, line: LineMesh, time: Array) -> None:
        """Add a line.

        Args:
            line: The line, of two or more points.
            time: Time at which each point was passed, shape (k,) [s].
        """
        self._lines.append((line, np.asarray(time)))

    def draw(self) -> None:
        """Draw all lines; none, if none was added."""
        if not self._lines:
            return
        mesh = merge([line for line, _ in self._lines])
        draw_smooth(self._meshcat, self._place, *mesh, colours.TRACED)

    def as_data(self) -> list[dict[str, Any]]:
        """Return how the mesh grows: the number of faces that are visible at each time."""
        if not self._lines:
            return []
        before, indices = 0, []
        for line, _ in self._lines:
            # The round beginning of a line is visible from its first point on.
            indices.append(before + np.append(0, line.reached[1:]))
            before += line.faces.shape[1]
        time = np.concatenate([time for _, time in self._lines])
        faces = pack(np.concatenate(indices))
        return [{"path": self._place, "time": pack(time), "faces": faces}]


def draw_smooth(
    meshcat: Meshcat,
    place: str,
    vertices: Any,
    faces: Any,
    colour: str,
    side: Meshcat.SideOfFaceToRender = Meshcat.SideOfFaceToRender.kDoubleSide,
) -> None:
    """Draw a mesh whose faces join smoothly; Meshcat would show each of them flat.

    Args:
        meshcat: Meshcat with the scene.
        place: Scene path of the mesh.
        vertices: Shape (3, v) [m].
        faces: Indices of each triangle's corners, shape (3, f).
        colour: One of `drake_rnn.colours`.
        side: Which side of the faces is drawn.
    """
    rgba = Rgba(*colours.components(colour))
    meshcat.SetTriangleMesh(place, vertices, faces, rgba, side=side)
    meshcat.SetProperty(f"{place}/<object>", "material.flatShading", False)

"""Obstacles from files, and all obstacles that a document describes.

- Model files: a solid of a simple shape round each of their shapes.
- Point clouds, height maps and meshes: boxes that contain them.
- Planning scenes of MoveIt and MotionBenchMaker: files ``.scene``, the text that MoveIt writes, and
  messages ``moveit_msgs/PlanningScene`` in YAML or JSON.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import Field
from pydrake.common.eigen_geometry import Quaternion
from pydrake.geometry import (
    Box,
    Capsule,
    Convex,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Mesh,
    Shape,
    Sphere,
)
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from ...errors import InvalidInputError, old_arguments
from ...inputs.documents import list_of, numbers_of, records_of
from ...inputs.fields import Angles, Array, Length, Point, Positive, validated, zeros
from ...inputs.files import content_of, is_header, read_rows, require_few
from ...inputs.keys import Meaning
from ...inputs.messages import decimal, plural, require_several, short
from ...inputs.units import scale_of, split_unit
from ..model.meshes import Meshes, triangles_of
from ..model.model import StillModel
from ..model.ros_packages import Packages
from .arm_capsules import cut_small
from .arm_shapes import enclosing_capsule, points_round
from .obstacles import (
    MOST,
    OBSTACLES,
    BallObstacle,
    BoxObstacle,
    CapsuleObstacle,
    CylinderObstacle,
    HalfSpaceObstacle,
    Obstacle,
    PoseInBase,
    described_obstacles,
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
    local = points @ R
    low, high = local.min(axis=0) - _SAFE, local.max(axis=0) + _SAFE
    return EnclosingBox(R @ (0.5 * (low + high)), R, high - low)


@validated
class FileObstacle(Obstacle):
    """What a file describes, which stands where its frame is placed."""

    translation: Annotated[
        Point,
        Meaning("Place of the file's frame, shape (3,).", unit="m"),
    ] = Field(default_factory=zeros)
    rpy: Annotated[
        Angles,
        Meaning("Roll, pitch and yaw of the file's frame, shape (3,).", unit="rad"),
    ] = Field(default_factory=zeros)

    @property
    def pose(self) -> RigidTransform:
        """Pose of the file's frame in the base frame."""
        return RigidTransform(RollPitchYaw(self.rpy), self.translation)

    @property
    def motion(self) -> dict[str, Any]:
        """Fields of its parts that say how they move."""
        return {"speed": self.speed, "error": self.error, "moves": self.moves}


@validated
class ModelObstacle(FileObstacle):
    """What a URDF or SDF file describes, one rigid thing.

    Each collision geometry of a body, or what is drawn of a body that has none, is an obstacle of
    its own: balls, boxes, capsules, cylinders and half-spaces as they are; an ellipsoid or the
    convex hull of a mesh as a box or a capsule that holds it, whichever is smaller. Their names are
    that of the model and of the body.
    """

    kind: Literal["model"] = "model"
    file: Annotated[str, Meaning("URDF or SDF file, all of whose joints are fixed.")]

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
        model, obstacles = StillModel(Path(self.file)), list[Obstacle]()
        X_WM, moving = self.pose, self.motion
        count = dict[str, int]()
        for body, X_MG, shape in model.shapes():
            count[body] = count.get(body, 0) + 1
            number = f" {count[body]}" if count[body] > 1 else ""
            name = f"{self.name}/{body}{number}"
            obstacles.append(solid_round(shape, X_WM @ X_MG, name, **moving))
        return tuple(obstacles)


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


# Size of a text with the vertices of meshes, and of YAML, which takes longer [bytes]; corners round
# a circle.
_MOST_BYTES, _MOST_RECORDS, _CORNERS = 25_000_000, 5_000_000, 24
# Farthest coordinate of a point [m].
_FARTHEST = 100.0
# Numbers of the shapes of shape_msgs/SolidPrimitive.
_PRIMITIVES = {1: "box", 2: "sphere", 3: "cylinder", 4: "cone"}
# Numbers of sizes of the shapes.
_SIZES = {"box": 3, "sphere": 1, "cylinder": 2, "cone": 2}
# Keys of a scene that place nothing.
_NO_PLACE = {"name", "robot_model_name", "is_diff", "object_colors", "world", "header"}
_READ = {"collision_objects", "fixed_frame_transforms"}


class Part(NamedTuple):
    """A shape of an object, and its pose in the scene."""

    shape: Shape
    X_SG: RigidTransform


class Scene(NamedTuple):
    """What a file describes.

    Attributes:
        objects: The parts of each object, by its name.
        frame: Frame in which they are placed; empty if the file names none.
        ignored: What the file holds beside objects.
    """

    objects: Mapping[str, Sequence[Part]]
    frame: str
    ignored: Sequence[str]


@validated
class SceneObstacle(Obstacle):
    """The objects of a planning scene of MoveIt or MotionBenchMaker, one rigid thing.

    Boxes, spheres and cylinders count as they are, a plane as all that lies behind it, and a cone
    or the convex hull of a mesh as a box or a capsule that holds it, whichever is smaller. Their
    names are that of the scene and of the object.
    """

    kind: Literal["scene"] = "scene"
    file: Annotated[
        str,
        Meaning(
            "File ``.scene`` of MoveIt, or a PlanningScene or CollisionObject message in YAML or "
            "JSON."
        ),
    ]
    translation: Annotated[
        Point,
        Meaning(
            "Place of the scene's frame, shape (3,); a frame of the arm that is fixed to its base "
            "needs none.",
            unit="m",
        ),
    ] = Field(default_factory=zeros)
    rpy: Annotated[
        Angles,
        Meaning("Roll, pitch and yaw of the scene's frame, shape (3,).", unit="rad"),
    ] = Field(default_factory=zeros)

    def __post_init__(self) -> None:
        super().__post_init__()
        try:
            self.parts  # noqa: B018  a file that cannot be read is to be refused now
        except OSError as error:
            raise ValueError(f"file: {self.file}: cannot be read: {error.strerror}") from None
        except (ValueError, InvalidInputError) as error:
            raise ValueError(f"file: {Path(self.file).name}: {error}") from None

    @cached_property
    def _scene(self) -> Scene:
        return read_scene(Path(self.file))

    @cached_property
    def parts(self) -> tuple[Obstacle, ...]:
        """Its shapes, as obstacles."""
        obstacles, X_WS = list[Obstacle](), self._pose
        moving: dict[str, Any] = {"speed": self.speed, "error": self.error, "moves": self.moves}
        for name, parts in self._scene.objects.items():
            for k, part in enumerate(parts, 1):
                own = f"{self.name}/{name} {k}" if k > 1 else f"{self.name}/{name}"
                try:
                    obstacles.append(solid_round(part.shape, X_WS @ part.X_SG, own, **moving))
                except (ValueError, InvalidInputError) as error:
                    raise ValueError(f"object {name}: {error}") from None
        return tuple(obstacles)

    @property
    def _pose(self) -> RigidTransform:
        return RigidTransform(RollPitchYaw(self.rpy), self.translation)

    def placed(self, pose_in_base: PoseInBase) -> Obstacle:
        """See `Obstacle.placed`; where ``translation`` or ``rpy`` place the scene, they count."""
        frame = self._scene.frame.lstrip("/")
        if not frame or not self._pose.IsExactlyIdentity():
            return self
        try:
            X_WS = pose_in_base(frame)
        except InvalidInputError as error:
            raise InvalidInputError(
                f"{Path(self.file).name}: its objects are placed in the frame {error}; state "
                "them in the base, or give translation and rpy, where that frame stood in it"
            ) from None
        if X_WS is None or X_WS.IsNearlyIdentity(_SAFE):
            return self
        rpy = RollPitchYaw(X_WS.rotation()).vector()
        return replace(self, translation=X_WS.translation(), rpy=rpy)

    @property
    def notes(self) -> tuple[str, ...]:
        """See `Obstacle.notes`."""
        scene, place = self._scene, "taken as the base"
        text = [f"its {', '.join(scene.ignored)} are ignored"] if scene.ignored else []
        count = plural(len(scene.objects), "object")
        if not self._pose.IsExactlyIdentity():
            xyz, rpy = (np.round(each, 4).tolist() for each in (self.translation, self.rpy))
            place = f"at {xyz} m in the base, roll, pitch and yaw {rpy} rad"
        text.insert(0, f"{count}; {scene.frame or 'its frame'} is {place}")
        return (f"{Path(self.file).name}: {'; '.join(text)}",)


def read_scene(file: Path) -> Scene:
    """Return what a file of a planning scene describes.

    Raises:
        OSError: If it cannot be opened.
        ValueError: If it is no scene, or describes what is not known here.
    """
    if file.suffix.lower() in (".yaml", ".yml", ".json"):
        return _of_message(file)
    try:
        text = content_of(file, _MOST_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise ValueError("is not a text file") from None
    return _of_text(text)


def _solid_of_scene(kind: str, sizes: Sequence[float]) -> Shape:
    """Return a shape by its name; of what is round, sizes are length and radius."""
    if kind not in _SIZES:
        raise ValueError(f"no shape {short(kind)}; it may be box, sphere, cylinder, cone or mesh")
    if len(sizes) != _SIZES[kind]:
        raise ValueError(f"a {kind} has {plural(_SIZES[kind], 'size')}, not {len(sizes)}")
    if not min(sizes) > 0.0:
        raise ValueError(f"a {kind} must be larger than {min(sizes):g} m")
    if kind == "box":
        return Box(*sizes)
    if kind == "sphere":
        return Sphere(*sizes)
    length, radius = sizes
    if kind == "cylinder":
        return Cylinder(radius, length)
    turn = 2.0 * np.pi * np.arange(_CORNERS) / _CORNERS
    rim = radius / np.cos(np.pi / _CORNERS) * np.stack((np.cos(turn), np.sin(turn)))
    return _hull(np.vstack(([0.0, 0.0, length / 2], np.insert(rim, 2, -length / 2, axis=0).T)))


def _hull(points: Array) -> Shape:
    """Return the convex hull of points, shape (k, 3) [m]."""
    if len(points) < 4:
        raise ValueError(f"a mesh needs at least 4 vertices, not {len(points)}")
    try:
        hull = Convex(points.T, "scene")
        hull.GetConvexHull()
    except RuntimeError:
        raise ValueError("a mesh must not be flat") from None
    return hull


def _behind(coefficients: Sequence[float]) -> tuple[Shape, RigidTransform]:
    """Return the half-space behind a plane a x + b y + c z + d = 0, and its pose."""
    if len(coefficients) != 4 or not any(coefficients[:3]):
        raise ValueError("a plane has four coefficients, of which the first three are its normal")
    normal, d = np.array(coefficients[:3]), coefficients[3]
    R = RotationMatrix.MakeFromOneVector(normal, 2)
    return HalfSpace(), RigidTransform(R, -d * normal / normal.dot(normal))


def _pose(position: Sequence[float], xyzw: Sequence[float]) -> RigidTransform:
    """Return a pose; a quaternion of zeros is none, as in ROS."""
    if len(position) != 3 or len(xyzw) != 4:
        raise ValueError("a pose has a position x, y, z and an orientation x, y, z, w")
    length = float(np.linalg.norm(xyzw))
    if length == 0.0:
        return RigidTransform(position)
    if abs(length - 1.0) > 1e-2:
        raise ValueError(f"a quaternion must have the length 1, not {length:.4g}")
    x, y, z, w = np.array(xyzw) / length
    return RigidTransform(Quaternion(w, x, y, z), position)


class _Words:
    """The words of some lines, one after another."""

    def __init__(self, lines: Sequence[str]) -> None:
        self._words = [word for line in lines for word in line.split()]
        self._ends = np.cumsum([len(line.split()) for line in lines]).tolist()
        self._next = 0

    @property
    def left(self) -> int:
        """Number of words that follow."""
        return len(self._words) - self._next

    def word(self) -> str:
        """Return the next word."""
        if not self.left:
            raise ValueError("ends within an object")
        self._next += 1
        return self._words[self._next - 1]

    def numbers(self, count: int) -> list[float]:
        """Return the next numbers."""
        return [decimal(self.word()) for _ in range(count)]

    def row(self, count: int, what: str) -> list[float]:
        """Return the next numbers, which MoveIt writes in one line; ``what`` has so many."""
        end = next((end for end in self._ends if end > self._next), self._next)
        if self._next < end < self._next + count:
            raise ValueError(
                f"{what} has {plural(count, 'number')} in a line, not {end - self._next}"
            )
        return self.numbers(count)

    def pose(self) -> RigidTransform:
        """Return the next pose, of which MoveIt writes the quaternion as it is, never zeros."""
        position, xyzw = self.row(3, "a position"), self.row(4, "a quaternion")
        if not any(xyzw):
            raise ValueError("a quaternion must have the length 1, not 0")
        return _pose(position, xyzw)

    def skip_line(self) -> None:
        """Pass the rest of a line."""
        self._next = next((end for end in self._ends if end > self._next), self._next)

    def count(self) -> int:
        """Return the next number, which counts something that follows."""
        word = self.word()
        if not word.isdecimal() or int(word) > self.left:
            raise ValueError(f"no count at {short(word)}")
        return int(word)


def _of_text(text: str) -> Scene:
    """Return the scene of MoveIt's text: with a pose for each object, or without in older ones."""
    lines = [line.strip() for line in text.splitlines()]
    # The first line is the scene's name.
    lines = lines if lines and lines[0].startswith("*") else lines[1:]
    if not lines or not lines[0].startswith(("*", ".")):
        raise ValueError("is no scene of MoveIt: its second line must begin an object, with *")
    objects: dict[str, list[Part]] = {}
    inside: list[str] = []
    names, contents = list[str](), list[list[str]]()
    end = lines.index(".") if "." in lines else None
    for line in lines[:end]:
        if line.startswith("*"):
            names.append(line[1:].strip())
            contents.append(inside := [])
        else:
            inside.append(line)
    for name, content in zip(names, contents, strict=True):
        with _naming(name):
            # As in MoveIt, what has the name of an object before it is a part of that.
            objects.setdefault(name, []).extend(_text_object(content))
    if end is None:
        raise ValueError("is not whole: MoveIt ends a scene with a line '.', and it has none")
    if any(lines[end + 1 :]):
        raise ValueError("goes on after the line '.', which ends a scene")
    return Scene(objects, "", [])


def _text_object(lines: Sequence[str]) -> Iterator[Part]:
    """Yield the shapes of an object."""
    full_lines = [line for line in lines if line.strip()]
    has_pose = bool(full_lines) and len(full_lines[0].split()) > 1
    words = _Words(full_lines)
    X_SO = words.pose() if has_pose else RigidTransform()
    count = words.count()
    for _ in range(count):
        shape, X = _text_shape(words.word(), words)
        X_OG = words.pose()
        words.row(4, "a colour")
        yield Part(shape, X_SO @ X_OG @ X)
    # Frames of the object, which place nothing.
    for _ in range(words.count() if has_pose and words.left else 0):
        words.skip_line()
        words.pose()
    if words.left:
        raise ValueError(f"holds more than its {plural(count, 'shape')}")


def _text_shape(kind: str, words: _Words) -> tuple[Shape, RigidTransform]:
    if kind == "mesh":
        vertices, triangles = words.count(), words.count()
        points = np.array(words.numbers(3 * vertices)).reshape(-1, 3)
        words.numbers(3 * triangles)
        return _hull(points), RigidTransform()
    if kind == "plane":
        return _behind(words.row(4, "a plane"))
    sizes = words.row(_SIZES[kind], f"a {kind}") if kind in _SIZES else []
    # Here the radius comes first.
    return _solid_of_scene(kind, sizes[::-1] if len(sizes) == 2 else sizes), RigidTransform()


@contextmanager
def _naming(name: str) -> Iterator[None]:
    """Name an object in what is said of it."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"object {short(name)}: {error}") from None


def _scene_in(file: Path) -> tuple[Mapping[str, Any], list[str]]:
    """Return the first scene of a file, and what else it holds; objects alone are one."""
    every = list(records_of(file, _MOST_RECORDS))
    scene = every[0] if every else None
    objects_alone = scene if isinstance(scene, list) else every
    if objects_alone and all(map(_is_object, objects_alone)):
        # As rostopic echo writes them, or one by itself.
        return {"collision_objects": objects_alone}, []
    while isinstance(scene, Mapping) and len(scene) == 1 and not _holds_objects(scene):
        (scene,) = scene.values()
    if not isinstance(scene, Mapping) or not _holds_objects(scene):
        raise ValueError("is no planning scene: it has no world with collision_objects")
    return scene, ["later scenes"] if len(every) > 1 else []


def _of_message(file: Path) -> Scene:
    """Return the scene of a PlanningScene message, or of the world in one."""
    scene, later = _scene_in(file)
    world = scene.get("world") if "world" in scene else scene
    world = world if isinstance(world, Mapping) else {}
    frames = dict(map(_transform, list_of(scene, "fixed_frame_transforms")))
    meshes = Meshes(Packages({}, file), for_distances=True)
    objects: dict[str, list[Part]] = {}
    replaced = list[str]()
    placed_in = set[str]()
    for k, thing in enumerate(list_of(world, "collision_objects"), 1):
        if not isinstance(thing, Mapping):
            raise ValueError(f"object {k}: must be a mapping, not {short(thing)}")
        name, frame = str(thing.get("id", k)), _frame(thing)
        operation = _operation(name, thing)
        # As in MoveIt, an object of the same name replaces one.
        earlier = objects.pop(name, None)
        if operation == "remove":
            continue
        replaced += [] if earlier is None else [f"earlier objects of the name {short(name)}"]
        root, X = _root_of(frame, frames)
        if root:
            placed_in.add(root)
        with _naming(name):
            parts = list(_message_object(thing, meshes))
        objects[name] = [part._replace(X_SG=X @ part.X_SG) for part in parts]
    if len(placed_in) > 1:
        raise ValueError(f"its objects are in several frames, {', '.join(sorted(placed_in))}")
    zeros = ["orientations of zeros"] if _turns_nowhere(scene) else []
    return Scene(objects, "".join(placed_in), _others(scene, world) + zeros + replaced + later)


# Of a moveit_msgs/CollisionObject, by their numbers.
_OPERATIONS = ("add", "remove", "append", "move")


def _operation(name: str, thing: Mapping[str, Any]) -> str:
    """Return whether an object is to be added or removed; others change one that is there."""
    value = given = thing.get("operation", 0)
    if isinstance(value, (str, bytes)) and len(value) == 1:
        value = ord(value)
    if isinstance(value, int) and 0 <= value < len(_OPERATIONS):
        value = _OPERATIONS[value]
    if (text := str(value).lower()) not in _OPERATIONS[:2]:
        raise ValueError(
            f"object {short(name)}: operation: may be add or remove, 0 or 1, not {short(given)}"
        )
    return text


def _turns_nowhere(value: Any) -> bool:
    """Return whether a message has an orientation of zeros, which is none, as in MoveIt."""
    if isinstance(value, (list, tuple)):
        return any(map(_turns_nowhere, value))
    if not isinstance(value, Mapping):
        return False
    for key in ("orientation", "rotation"):
        xyzw = value.get(key)
        numbers = [*xyzw.values()] if isinstance(xyzw, Mapping) else xyzw
        if isinstance(numbers, list) and numbers and not any(numbers):
            return True
    return any(map(_turns_nowhere, value.values()))


def _holds_objects(scene: Mapping[str, Any]) -> bool:
    return "collision_objects" in scene or isinstance(scene.get("world"), Mapping)


def _others(scene: Mapping[str, Any], world: Mapping[str, Any]) -> list[str]:
    """Return what else a scene holds, by name."""
    every = {**world, **scene} if world is not scene else scene
    return sorted(
        str(key)
        for key, value in every.items()
        if key not in _NO_PLACE | _READ and _says_something(value)
    )


def _says_something(value: Any) -> bool:
    """Return whether any number, word or list of a message is not what it is by default."""
    if isinstance(value, Mapping):
        return any(_says_something(each) for key, each in value.items() if key != "header")
    if isinstance(value, (list, tuple)):
        return len(value) > 0
    return bool(value)


def _frame(record: Mapping[str, Any]) -> str:
    header = record.get("header")
    return str(header.get("frame_id", "")) if isinstance(header, Mapping) else ""


def _is_object(thing: Any) -> bool:
    """Return whether a record is a CollisionObject."""
    shapes = {"primitives", "meshes", "planes"}
    return isinstance(thing, Mapping) and bool(shapes & set(thing)) and not _holds_objects(thing)


def _root_of(
    frame: str, frames: Mapping[str, tuple[str, RigidTransform]]
) -> tuple[str, RigidTransform]:
    """Return the frame in which a frame is stated after all, and its pose there."""
    X_RF, passed = RigidTransform(), {frame}
    while frame in frames:
        frame, X_PF = frames[frame]
        X_RF = X_PF @ X_RF
        if frame in passed:
            raise ValueError(f"fixed_frame_transforms: {short(frame)} is stated in itself")
        passed.add(frame)
    return frame, X_RF


def _transform(message: Any) -> tuple[str, tuple[str, RigidTransform]]:
    """Return a frame, and in which one it is stated with its pose there."""
    if not isinstance(message, Mapping):
        raise ValueError(f"fixed_frame_transforms: must be mappings, not {short(message)}")
    transform = message.get("transform") or {}
    pose = {"position": transform.get("translation"), "orientation": transform.get("rotation")}
    return str(message.get("child_frame_id", "")), (_frame(message), _message_pose(pose))


def _message_pose(message: Any) -> RigidTransform:
    if message is None:
        return RigidTransform()
    if not isinstance(message, Mapping):
        raise ValueError(f"a pose must be a mapping, not {short(message)}")
    position, xyzw = (message.get(key) for key in ("position", "orientation"))
    return _pose(
        numbers_of([0.0] * 3 if position is None else position, "xyz"),
        numbers_of([0.0] * 4 if xyzw is None else xyzw, "xyzw"),
    )


def _message_object(thing: Mapping[str, Any], meshes: Meshes) -> Iterator[Part]:
    """Yield the shapes of a moveit_msgs/CollisionObject."""
    X_SO = _message_pose(thing.get("pose"))
    for shapes, poses in (
        ("primitives", "primitive_poses"),
        ("meshes", "mesh_poses"),
        ("planes", "plane_poses"),
    ):
        shape_list, places = list_of(thing, shapes), list_of(thing, poses)
        if len(places) not in (0, len(shape_list)):
            raise ValueError(f"{poses}: must be {len(shape_list)}, one for each of {shapes}")
        for k, shape in enumerate(shape_list):
            if not isinstance(shape, Mapping):
                raise ValueError(f"{shapes}: must be mappings, not {short(shape)}")
            X_OG = _message_pose(places[k] if places else None)
            solid, X = _message_shape(shapes, shape, meshes)
            yield Part(solid, X_SO @ X_OG @ X)


def _message_shape(
    shapes: str, shape: Mapping[str, Any], meshes: Meshes
) -> tuple[Shape, RigidTransform]:
    if shapes == "planes":
        return _behind(numbers_of(shape.get("coef", [])))
    if shapes == "primitives":
        kind = shape.get("type")
        name = _PRIMITIVES.get(kind, str(kind)) if isinstance(kind, int) else str(kind).lower()
        return _solid_of_scene(name, numbers_of(shape.get("dimensions", []))), RigidTransform()
    if "resource" not in shape:
        vertices = [numbers_of(p, "xyz") for p in list_of(shape, "vertices")]
        return _hull(np.array(vertices)), RigidTransform()
    uri = str(shape["resource"])
    if (file := meshes.plain(uri)) is None:
        raise ValueError(f"there is no mesh {short(uri)} that can be read")
    scale = numbers_of(shape.get("dimensions", [1.0, 1.0, 1.0]))
    if len(scale) != 3 or not all(scale):
        raise ValueError("a mesh has three scales, none of them 0")
    return Mesh(str(file), np.array(scale)), RigidTransform()


# Points, and small triangles of a mesh, that a file may have; a triangle is cut until no side is
# longer than this share of the whole.
_MOST_POINTS, _SHARE = 500_000, 0.02


# Boxes that are merged to fewer.
_LEAVES = 640


def covering_boxes(lows: Array, highs: Array, most: int) -> list[tuple[Array, Array]]:
    """Return a few boxes that together contain many, each of these in one of them.

    All of them begin in one box. The largest is halved across its longest edge, until there are
    640; then the two are merged that one box round both adds the least space to. So it is proved
    what is contained: a box reaches from the least to the largest coordinates of what is in it.

    Args:
        lows: Least coordinates of the many boxes, shape (k, 3) [m].
        highs: Their largest coordinates, shape (k, 3) [m].
        most: Largest number of boxes.

    Returns:
        Least and largest coordinates of each box, shape (3,) each [m].
    """
    low, high = _halved(lows, highs)
    space = (high - low).prod(axis=1)
    # What a box round two takes more than both.
    more = np.array([_added(low, high, space, k) for k in range(len(low))])
    np.fill_diagonal(more, np.inf)
    alive = np.ones(len(low), dtype=bool)
    count = len(low)
    while count > 1:
        k, m = np.unravel_index(int(more.argmin()), more.shape)
        if count <= most and more[k, m] > 1e-9 * (space[k] + space[m]):
            break
        low[k], high[k] = np.minimum(low[k], low[m]), np.maximum(high[k], high[m])
        space[k] = (high[k] - low[k]).prod()
        alive[m], count = False, count - 1
        more[m], more[:, m] = np.inf, np.inf
        row = np.where(alive, _added(low, high, space, int(k)), np.inf)
        row[k] = np.inf
        more[k], more[:, k] = row, row
    return list(zip(low[alive], high[alive], strict=True))


def _added(low: Array, high: Array, space: Array, k: int) -> Array:
    """Return what a box round one and each other takes more than both, shape (b,) [m^3]."""
    sizes = np.maximum(high, high[k]) - np.minimum(low, low[k])
    return np.asarray(sizes.prod(axis=1) - space - space[k])


def _halved(lows: Array, highs: Array) -> tuple[Array, Array]:
    """Return boxes round parts of many, each of which is in one of them, shape (b, 3) each."""
    middles, parts = 0.5 * (lows + highs), [np.arange(len(lows))]
    low, high = [lows.min(axis=0)], [highs.max(axis=0)]
    spaces = [float((high[0] - low[0]).prod())]
    while len(parts) < _LEAVES and max(spaces) > 0.0:
        k = int(np.argmax(spaces))
        part = parts[k]
        axis = int(np.argmax(np.ptp(middles[part], axis=0)))
        values = middles[part, axis]
        is_left = values < 0.5 * (values.min() + values.max())
        if not is_left.any():
            # They have the same middle.
            spaces[k] = 0.0
            continue
        halves = part[is_left], part[~is_left]
        del parts[k], low[k], high[k], spaces[k]
        for half in halves:
            parts.append(half)
            low.append(lows[half].min(axis=0))
            high.append(highs[half].max(axis=0))
            spaces.append(float((high[-1] - low[-1]).prod()) if len(half) > 1 else 0.0)
    return np.array(low), np.array(high)


@validated
class BoxedObstacle(FileObstacle, ABC):
    """What a file describes, contained in a number of boxes along the axes of the file's frame."""

    file: Annotated[str, Meaning("File, relative to the document's folder.")]
    boxes: Annotated[
        int,
        Field(strict=True, ge=1, le=MOST),
        Meaning("Largest number of boxes that contain it; each of them is an obstacle."),
    ] = 32

    def __post_init__(self) -> None:
        super().__post_init__()
        try:
            self.parts  # noqa: B018  a file that cannot be read is to be refused now
        except (ValueError, InvalidInputError) as error:
            text = str(error).removeprefix(f"file {self.file}: ")
            raise ValueError(f"file: {Path(self.file).name}: {text}") from None

    @abstractmethod
    def contents(self) -> tuple[Array, Array]:
        """Return least and largest coordinates of what the file has, shape (k, 3) each [m].

        Raises:
            ValueError: If it cannot be read.
        """

    @cached_property
    def parts(self) -> tuple[Obstacle, ...]:
        """The boxes, as obstacles."""
        low, high = self.contents()
        X_WF, moving = self.pose, self.motion
        return tuple(
            BoxObstacle(
                name=f"{self.name}/{number}",
                center=X_WF @ (0.5 * (one + other)),
                size=other - one + 2.0 * _SAFE,
                rpy=self.rpy,
                **moving,
            )
            for number, (one, other) in enumerate(covering_boxes(low, high, self.boxes), start=1)
        )

    @property
    def notes(self) -> tuple[str, ...]:
        """See `Obstacle.notes`."""
        sizes = [part.size.prod() for part in self.parts if isinstance(part, BoxObstacle)]
        count = plural(len(sizes), "box", "boxes")
        return (f"{Path(self.file).name}: in {count} of {1e3 * sum(sizes):.3g} l together",)


@validated
class PointCloudObstacle(BoxedObstacle):
    """Points of a sensor or a map, each with a ball round it."""

    kind: Literal["point_cloud"] = "point_cloud"
    radius: Annotated[
        Length,
        Meaning(
            "Radius of the ball round each point, half of what they are apart or more.", unit="m"
        ),
    ]

    def contents(self) -> tuple[Array, Array]:
        """See `BoxedObstacle.contents`; the file has a row x, y, z [m] for each point."""
        points = _rows_of(self.file, 3)
        return points - self.radius, points + self.radius


@validated
class HeightMapObstacle(BoxedObstacle):
    """Ground, solid from its lowest height up to heights over a grid of x and y."""

    kind: Literal["height_map"] = "height_map"
    spacing: Annotated[Length, Meaning("Distance of two heights along x and y.", unit="m")]
    depth: Annotated[
        Length,
        Meaning("How far it is solid below its lowest height.", unit="m"),
    ] = 0.1

    def contents(self) -> tuple[Array, Array]:
        """See `BoxedObstacle.contents`; a row of the file has the heights along x [m].

        Between four heights the ground is nowhere above the highest of them.
        """
        heights = _rows_of(self.file, None)
        if min(heights.shape) < 2:
            raise ValueError("must have two rows and two columns of heights or more")
        rows, columns = np.indices((heights.shape[0] - 1, heights.shape[1] - 1))
        top = np.maximum.reduce(
            [heights[:-1, :-1], heights[1:, :-1], heights[:-1, 1:], heights[1:, 1:]]
        )
        bottom = np.full(top.shape, heights.min() - self.depth)
        low = np.stack((self.spacing * columns, self.spacing * rows, bottom), axis=-1)
        high = np.stack((self.spacing * (columns + 1), self.spacing * (rows + 1), top), axis=-1)
        return low.reshape(-1, 3), high.reshape(-1, 3)


@validated
class MeshObstacle(BoxedObstacle):
    """The surface of a mesh, which need not be convex nor closed."""

    kind: Literal["mesh"] = "mesh"
    scale: Annotated[Positive, Meaning("Factor of all coordinates.")] = 1.0

    def contents(self) -> tuple[Array, Array]:
        """See `BoxedObstacle.contents`; large triangles are cut into small ones."""
        triangles = self.scale * triangles_of(Path(self.file))
        require_few(len(triangles), "triangles", _MOST_POINTS)
        longest = _SHARE * float(np.ptp(triangles, axis=(0, 1)).max())
        area = np.linalg.norm(
            np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1
        ).sum()
        longest = max(longest, float(np.sqrt(4.0 * area / _MOST_POINTS)))
        small = cut_small(triangles, longest)
        return small.min(axis=1), small.max(axis=1)


def _rows_of(file: str, columns: int | None) -> Array:
    """Return the numbers of a CSV file or of one with blanks between them, shape (k, columns)."""

    def parse(rows: list[tuple[int, list[str]]]) -> Array:
        head = rows[0][1] if is_header(rows[0][1]) else []
        rows = rows[1:] if head else rows
        if not rows:
            raise ValueError("has no numbers")
        places, scales = _columns_of(head, columns)
        count = len(head) or columns or len(rows[0][1])
        for number, cells in rows:
            if len(cells) != count:
                raise ValueError(f"row {number}: must have {count} numbers, not {len(cells)}")
        values = np.array(
            [[decimal(cells[k]) for k in places or range(count)] for _, cells in rows]
        )
        values *= scales
        if np.abs(values).max() > _FARTHEST:
            raise ValueError(f"must be within {_FARTHEST:g} m; are these millimetres?")
        return values

    return read_rows(file, _MOST_BYTES, _MOST_POINTS, parse)


def _columns_of(head: Sequence[str], count: int | None) -> tuple[list[int], Array]:
    """Return the places of columns x, y, z, or none of all as they are, and their units [m]."""
    names = [split_unit(cell)[0].lower() for cell in head]
    if count is None or not head:
        return [], np.array([scale_of(cell, "length") for cell in head] or 1.0)
    if sorted(names) != ["x", "y", "z"]:
        raise ValueError(f"must have the columns x, y, z, not {', '.join(head)}")
    places = [names.index(name) for name in "xyz"]
    return places, np.array([scale_of(head[k], "length") for k in places])


#: Classes of obstacles by kind.
KINDS = {
    **OBSTACLES,
    "model": ModelObstacle,
    "scene": SceneObstacle,
    "point_cloud": PointCloudObstacle,
    "height_map": HeightMapObstacle,
    "mesh": MeshObstacle,
}


# Frames that are an arm's base wherever no arm says otherwise.
_BASES = ("world", "map", "odom", "base", "base_link", "base_footprint")


def _base_by_name(frame: str) -> None:
    """Raise an InvalidInputError for a frame that no arm knows and that is no base by its name."""
    if frame not in _BASES:
        raise InvalidInputError(
            f"{frame!r}, which may not be the base; give pose_in_base of the arm"
        )


def all_obstacles(
    sections: list[Any], pose_in_base: PoseInBase = _base_by_name
) -> tuple[tuple[Obstacle, ...], list[str]]:
    """Return the obstacles of a document, each a single shape, and notes about their files.

    Args:
        sections: For each, its ``kind`` and fields; a model or a scene consists of several shapes.
        pose_in_base: See `Obstacle.placed`, such as `Arm.pose_in_base`; without it, a scene must be
            stated in a frame that is a base by its name.

    Raises:
        InvalidInputError: If there are too many, a kind is unknown, a field is wrong, or a file
            cannot be read or has joints that move.
    """
    require_several("obstacles", sections)
    obstacles, notes = described_obstacles(sections, KINDS, pose_in_base)
    return tuple(obstacles), notes


@old_arguments(given="sections")
def make_obstacles(sections: list[Any], pose_in_base: PoseInBase = _base_by_name) -> list[Obstacle]:
    """Return the obstacles of `all_obstacles` without the notes."""
    return list(all_obstacles(sections, pose_in_base)[0])

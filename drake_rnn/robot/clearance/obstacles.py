"""What stands where an arm must not be: balls, capsules, boxes, cylinders and half-spaces."""

# No postponed annotations: older pydantic resolves inherited ones in the subclass's module.
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field

from ...errors import InvalidInputError
from ...inputs.documents import construct, without_kind
from ...inputs.fields import (
    Angles,
    Array,
    Length,
    NonNegative,
    Point,
    Speed,
    is_name,
    validated,
    zeros,
)
from ...inputs.keys import Meaning
from ...inputs.messages import fields_of, metres_hint, nearest, short
from ..rotation import rotation_of

#: Obstacles that an arm can have; it takes longer than a sample to look at more.
MOST = 200
# Beyond the reach of any arm that stands at the origin [m].
_FARTHEST = 100.0
_SIGNS = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T


def _place(value: Any) -> Any:
    if isinstance(value, (list, tuple, np.ndarray)) and np.shape(value) == (3,):
        try:
            far = float(np.abs(np.asarray(value, dtype=float)).max())
        except (TypeError, ValueError):
            return value
        if far > _FARTHEST:
            raise ValueError(
                f"must be within {_FARTHEST:g} m of the base, not {far:g} m away{metres_hint(far)}"
            )
    return value


_Place = Annotated[Point, BeforeValidator(_place)]


#: What returns the pose of a frame in the base, Drake's RigidTransform, by its name; or None.
PoseInBase = Callable[[str], Any]


@validated
class Obstacle:
    """A solid of a simple shape, in the base frame W.

    One with a ``speed`` may move, but does not turn: where it is stated is where it begins.
    """

    name: Annotated[str, Meaning("Name in messages; by default its kind and number.")] = ""
    speed: Annotated[
        Speed | None,
        Meaning(
            "Largest speed that is counted on; without it the obstacle never moves.",
            unit="m/s",
        ),
    ] = None
    error: Annotated[
        NonNegative,
        Meaning("Largest error of the position that is measured of it.", unit="m"),
    ] = 0.0
    moves: Annotated[
        dict[str, Any] | None,
        Meaning(
            "Its motion, a path with its ``kind`` and fields that begins where the obstacle is; "
            "without it, one that may move stands still in a simulation.",
        ),
    ] = None

    def __post_init__(self) -> None:
        if self.name and not is_name(self.name):
            raise ValueError(f"name: must be a name, not {self.name!r}")
        if self.speed is None and (self.moves is not None or self.error):
            key = "error" if self.moves is None else "moves"
            raise ValueError(
                f"speed: must be given with {key}, the largest that is counted on [m/s]"
            )

    @property
    def corners(self) -> Array:
        """Corners of a box round it, shape (8, 3) [m]; none if it has no bounds."""
        return np.zeros((0, 3))

    @property
    def parts(self) -> Sequence["Obstacle"]:
        """What it consists of, itself alone if it is a single shape."""
        return (self,)

    def placed(self, pose_in_base: PoseInBase) -> "Obstacle":
        """Return the same obstacle, stated in the base frame if it was in another frame of an arm.

        Args:
            pose_in_base: Returns the pose of a frame in the base; None of an unknown one.

        Raises:
            InvalidInputError: If that frame moves with the arm.
        """
        return self

    @property
    def notes(self) -> Sequence[str]:
        """Sentences about what was taken of its file and what was not."""
        return ()


@validated
class BallObstacle(Obstacle):
    """A ball."""

    kind: Literal["ball"] = "ball"
    center: Annotated[_Place, Meaning("Its centre, shape (3,).", unit="m")]
    radius: Annotated[Length, Meaning("Its radius.", unit="m")]

    @property
    def corners(self) -> Array:
        """See `Obstacle.corners`."""
        return np.asarray(self.center + self.radius * _SIGNS)


@validated
class CapsuleObstacle(Obstacle):
    """All points within a radius of a segment."""

    kind: Literal["capsule"] = "capsule"
    ends: Annotated[tuple[_Place, _Place], Meaning("Ends of the segment, two points.", unit="m")]
    radius: Annotated[Length, Meaning("Radius.", unit="m")]

    @property
    def corners(self) -> Array:
        """See `Obstacle.corners`."""
        low, high = np.minimum(*self.ends), np.maximum(*self.ends)
        return np.asarray(0.5 * (low + high) + (0.5 * (high - low) + self.radius) * _SIGNS)


@validated
class BoxObstacle(Obstacle):
    """A box."""

    kind: Literal["box"] = "box"
    center: Annotated[_Place, Meaning("Its centre, shape (3,).", unit="m")]
    size: Annotated[Point, Meaning("Its edges, shape (3,).", unit="m")]
    rpy: Annotated[
        Angles,
        Meaning("Roll, pitch and yaw of its frame, shape (3,).", unit="rad"),
    ] = Field(default_factory=zeros)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (self.size > 0.0).all() or (self.size > 2.0 * _FARTHEST).any():
            raise ValueError(
                f"size: must be three edges above 0 and up to {2.0 * _FARTHEST:g} m, not "
                f"{self.size.tolist()}{metres_hint(self.size.max())}"
            )

    @property
    def corners(self) -> Array:
        """See `Obstacle.corners`."""
        return np.asarray(self.center + (0.5 * self.size * _SIGNS) @ self.R_WO.T)

    @property
    def R_WO(self) -> Array:
        """Orientation of its frame, shape (3, 3)."""
        return rotation_of(self.rpy)


@validated
class CylinderObstacle(Obstacle):
    """A cylinder with flat ends, about the z axis of its frame."""

    kind: Literal["cylinder"] = "cylinder"
    center: Annotated[_Place, Meaning("Its centre, shape (3,).", unit="m")]
    radius: Annotated[Length, Meaning("Its radius.", unit="m")]
    length: Annotated[Length, Meaning("Its length along its axis.", unit="m")]
    rpy: Annotated[
        Angles,
        Meaning("Roll, pitch and yaw of its frame, shape (3,).", unit="rad"),
    ] = Field(default_factory=zeros)

    @property
    def corners(self) -> Array:
        """See `Obstacle.corners`."""
        axis = self.axis_W
        across = self.radius * np.sqrt(np.maximum(1.0 - axis**2, 0.0))
        return np.asarray(self.center + (0.5 * self.length * np.abs(axis) + across) * _SIGNS)

    @property
    def axis_W(self) -> Array:
        """Unit vector along its axis, shape (3,)."""
        return rotation_of(self.rpy)[:, 2]


@validated
class HalfSpaceObstacle(Obstacle):
    """All that lies behind a plane, such as a floor or a wall."""

    kind: Literal["half_space"] = "half_space"
    point: Annotated[_Place, Meaning("A point of the plane, shape (3,).", unit="m")]
    normal: Annotated[Point, Meaning("Normal out of what is solid, shape (3,); of any length.")]

    def __post_init__(self) -> None:
        super().__post_init__()
        if not np.linalg.norm(self.normal) > 0.0:
            raise ValueError("normal: must not be zero")

    @property
    def normal_W(self) -> Array:
        """Unit normal, shape (3,)."""
        return np.asarray(self.normal / np.linalg.norm(self.normal))


#: Obstacles by their ``kind``.
OBSTACLES: Mapping[str, type[Obstacle]] = {
    "ball": BallObstacle,
    "capsule": CapsuleObstacle,
    "box": BoxObstacle,
    "cylinder": CylinderObstacle,
    "half_space": HalfSpaceObstacle,
}


def described_obstacles(
    sections: list[Any],
    kinds: Mapping[str, type[Obstacle]] = OBSTACLES,
    pose_in_base: PoseInBase = lambda frame: None,
) -> tuple[list[Obstacle], list[str]]:
    """Return the obstacles of a document, each a single shape, and notes about their files.

    Args:
        sections: For each, its ``kind`` and fields.
        kinds: Obstacles that there may be by their ``kind``.
        pose_in_base: See `Obstacle.placed`.

    Raises:
        InvalidInputError: If there are too many, a kind is unknown, a field is wrong, or one is
            stated in a frame that moves.
    """
    _require_few(sections)
    obstacles, notes, names = list[Obstacle](), list[str](), set[str]()
    for k, fields in enumerate(sections):
        key = f"obstacles[{k}]"
        if not isinstance(fields, Mapping):
            raise InvalidInputError(f"{key}: must be a kind with its fields, not {short(fields)}")
        kind = str(fields.get("kind"))
        if kind not in kinds:
            raise InvalidInputError(f"{key}.kind: {short(kind)}: {nearest(kind, list(kinds))}")
        own = {"name": f"{kind} {k + 1}", **without_kind(fields)}
        if own["name"] == "":
            raise InvalidInputError(f"{key}.name: must be a name, not ''")
        obstacle = construct(kinds[kind], own, key)
        try:
            obstacle = obstacle.placed(pose_in_base)
        except InvalidInputError as error:
            raise InvalidInputError(f"{key}: {error}") from None
        notes += (f"{key}: {note}" for note in obstacle.notes)
        for part in obstacle.parts:
            if part.name in names:
                raise InvalidInputError(f"{key}.name: {part.name!r} is given twice")
            names.add(part.name)
            obstacles.append(part)
    _require_few(obstacles)
    return obstacles, notes


def make_obstacles(
    sections: list[Any], kinds: Mapping[str, type[Obstacle]] = OBSTACLES
) -> list[Obstacle]:
    """Return the obstacles of `described_obstacles` without the notes."""
    return described_obstacles(sections, kinds)[0]


def single_shapes(obstacles: Sequence[Obstacle]) -> list[Obstacle]:
    """Return the single shapes of obstacles; those without a name get their kind and number."""
    shapes = [shape for obstacle in obstacles for shape in obstacle.parts]
    return [
        shape if shape.name else replace(shape, name=f"{fields_of(shape).get('kind', '')} {number}")
        for number, shape in enumerate(shapes, start=1)
    ]


def _require_few(obstacles: Sequence[Any]) -> None:
    if len(obstacles) > MOST:
        raise InvalidInputError(f"obstacles: may be up to {MOST}, not {len(obstacles)}")

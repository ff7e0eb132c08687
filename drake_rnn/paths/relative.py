"""Paths that are given by their motion from their own first pose.

- A path that goes along with another point, such as the tool of a second arm.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from operator import attrgetter
from typing import Annotated

import numpy as np
from pydantic import Field
from pydrake.math import RigidTransform

from ..errors import InvalidInputError
from ..inputs.fields import Array, Point, validated, zeros
from ..inputs.keys import Meaning
from ..robot.arm import Arm
from .path import (
    BASE,
    TOOL,
    Motion,
    Passage,
    Path,
    PathOfAnother,
    PlacedPath,
    require_pose,
    require_start,
    require_times,
    require_values,
)

# No postponed annotations: see `path`.


# Number of times at which a path is tried when it is placed.
_CHECKS = 5


@validated
class RelativePath(Path, Passage):
    """A path given by its motion from its first pose, along the axes of a frame F."""

    offset: Annotated[
        Point,
        Meaning("Arm's start relative to the path's first point, in F, shape (3,).", unit="m"),
    ] = Field(default_factory=zeros)
    frame: Annotated[
        str,
        Meaning(
            "The frame F: ``base``; ``tool``, the task frame E as it is when the path begins; or "
            "the name of any frame of the model, e.g. a camera's, as it is when the run begins.",
        ),
    ] = BASE

    @property
    def frames(self) -> frozenset[str]:
        return frozenset() if self.frame in (BASE, TOOL) else frozenset((self.frame,))

    @abstractmethod
    def evaluate(self, t: float) -> Motion:
        """Return the motion of the point at time ``t`` [s].

        Before t = 0 the point rests at the start, after the end where it ends. Where a derivative
        jumps, the value after the jump is returned.

        Returns:
            Displacement from the first point [m], velocity [m/s], acceleration [m/s^2]; each
            of shape (3,), in F.

        Raises:
            InvalidInputError: If ``t`` is not finite.
        """

    def evaluate_rotation(self, t: float) -> Motion:
        """Return the rotation from the first orientation at time ``t`` [s].

        Returns:
            The rotation, shape (3, 3); angular velocity [rad/s] and acceleration [rad/s^2], each
            of shape (3,), in F. A path that `turns` overrides this method.
        """
        return np.eye(3), np.zeros(3), np.zeros(3)

    def start_point(self, p_FE: Array) -> Array:
        """Return the path's first point for an arm that starts at ``p_FE``, shape (3,) [m]."""
        return p_FE - self.offset

    def start_orientation(self, R_FE: Array | None) -> Array | None:
        """Return the path's first orientation, shape (3, 3), for an arm that starts with ``R_FE``.

        None if the arm's orientation is not known.
        """
        return R_FE

    def begun_at(self, p_FE: Array) -> RelativePath:
        """Return the path for an arm that starts at ``p_FE``, shape (3,) [m].

        By default that is the path itself; a path whose displacement depends on where it begins
        overrides this method.
        """
        return self

    def _require_no_offset(self, rival: str, remedy: str = "give one of them") -> None:
        """Raise a ValueError for an ``offset`` beside another key that sets the start."""
        if self.offset.any():
            raise ValueError(
                f"offset: cannot be combined with {rival}, which also sets where the path starts; "
                f"{remedy}"
            )

    def sample(self, count: int) -> Array:
        """See `Passage.sample`; points are displacements from the first one, in F."""
        return self._sample(self.evaluate, count)

    def require_motion(self) -> None:
        """Raise an InvalidInputError unless this is a motion that a point can follow."""
        name = type(self).__name__
        require_times(name, self.duration, self.traversal)
        times = [-1.0, *np.linspace(0.0, self.traversal, _CHECKS).tolist(), 2.0 * self.traversal]
        require_values(f"{name}.evaluate", self.evaluate, "t", times, ((3,), (3,), (3,)))
        if self.turns:
            require_values(
                f"{name}.evaluate_rotation",
                self.evaluate_rotation,
                "t",
                times,
                ((3, 3), (3,), (3,)),
            )
        last = self.sample(2)[-1] if self.closed else None
        require_start(name, self.evaluate(0.0)[0], last)

    def placed(
        self,
        p_WE: Array | None = None,
        R_WE: Array | None = None,
        frames: Mapping[str, RigidTransform] | None = None,
    ) -> PlacedPath:
        require_pose(p_WE, R_WE)
        if p_WE is None:
            if not self.has_place or self.frame == TOOL:
                raise InvalidInputError(
                    "p_WE: must be given, for a path that begins where the arm starts"
                )
            p_WE = np.zeros(3)
        X_WF = self._frame_pose(p_WE, R_WE, frames or {})
        if X_WF is None:
            path = self.begun_at(p_WE)
            path.require_motion()
            return _PathInWorld(path, path.start_point(p_WE), path.start_orientation(R_WE))
        p_WF, R_WF = X_WF
        p_FE = R_WF.T @ (p_WE - p_WF)
        path = self.begun_at(p_FE)
        path.require_motion()
        R_FE = path.start_orientation(None if R_WE is None else R_WF.T @ R_WE)
        start = p_WF + R_WF @ path.start_point(p_FE)
        return _PathInFrame(path, start, None if R_FE is None else R_WF @ R_FE, R_WF)

    def _frame_pose(
        self, p_WE: Array, R_WE: Array | None, frames: Mapping[str, RigidTransform]
    ) -> tuple[Array, Array] | None:
        """Return origin and axes of F; None for the base."""
        if self.frame == BASE:
            return None
        if self.frame == TOOL:
            if R_WE is None:
                raise InvalidInputError("R_WE: must be given, for a path in the frame of the tool")
            return p_WE, R_WE
        if self.frame not in frames:
            raise InvalidInputError(
                f"frames: must hold the pose of {self.frame!r}, which the path is given in"
            )
        X_WF = frames[self.frame]
        return X_WF.translation(), X_WF.rotation().matrix()


@dataclass(frozen=True, eq=False)
class _PathInWorld(PlacedPath):
    """A path along the axes of W.

    Attributes:
        path: The path.
        start: First point, shape (3,) [m].
        R_WE: First orientation, shape (3, 3); None if it is not known.
    """

    path: RelativePath
    start: Array
    R_WE: Array | None

    duration = property(attrgetter("path.duration"))
    traversal = property(attrgetter("path.traversal"))
    closed = property(attrgetter("path.closed"))
    turns = property(attrgetter("path.turns"))

    @property
    def oriented(self) -> bool:
        return self.R_WE is not None

    def position(self, t: float) -> Motion:
        p, v, a = self.path.evaluate(t)
        return self.start + p, v, a

    def orientation(self, t: float) -> Motion:
        if self.R_WE is None:
            raise InvalidInputError("R_WE: must be given, for the orientation to be known")
        if not self.path.turns:
            return self.R_WE, np.zeros(3), np.zeros(3)
        R, w, alpha = self.path.evaluate_rotation(t)
        return R @ self.R_WE, w, alpha

    def knots(self, until: float) -> Array:
        return self.path.knots(until)

    def sample(self, count: int) -> Array:
        return self.start + self.path.sample(count)


def displacement_of(path: PlacedPath) -> tuple[RelativePath, Array] | None:
    """Return the path whose displacement a placed path adds to its first point, and that point.

    Paths that differ only in their first point can share the computed displacement. None for a path
    along the axes of another frame, and for one that is not a `RelativePath`.

    Args:
        path: The placed path.
    """
    return (path.path, path.start) if type(path) is _PathInWorld else None


@dataclass(frozen=True, eq=False)
class _PathInFrame(_PathInWorld):
    """A path along the axes of another frame F.

    Attributes:
        R_WF: Orientation of F, shape (3, 3).
    """

    R_WF: Array

    def position(self, t: float) -> Motion:
        p, v, a = self.path.evaluate(t)
        return self.start + self.R_WF @ p, self.R_WF @ v, self.R_WF @ a

    def orientation(self, t: float) -> Motion:
        if self.R_WE is None or not self.path.turns:
            return super().orientation(t)
        R, w, alpha = self.path.evaluate_rotation(t)
        R_WE = self.R_WF @ R @ self.R_WF.T @ self.R_WE
        return R_WE, self.R_WF @ w, self.R_WF @ alpha

    def sample(self, count: int) -> Array:
        return np.asarray(self.start + self.path.sample(count) @ self.R_WF.T)


@dataclass(frozen=True, eq=False)
class LedPath(PathOfAnother):
    """A placed path, each point of which is displaced by how far another path has led by then.

    Attributes:
        own: The path by itself.
        leader: The path that leads it.
        arm: The arm that follows that path.
        begin: Where that arm's end effector starts, in its own base, shape (3,) [m].
        R: Orientation of the leader's base in that of the path, shape (3, 3).
    """

    own: PlacedPath
    leader: PlacedPath
    arm: Arm
    begin: Array
    R: Array

    @property
    def duration(self) -> float:
        """See `Passage.duration`."""
        return max(self.own.duration, self.leader.duration)

    @property
    def traversal(self) -> float:
        """See `Passage.traversal`."""
        return max(self.own.traversal, self.leader.traversal)

    def position(self, t: float) -> Motion:
        """See `PlacedPath.position`."""
        p, v, a = self.own.position(t)
        p_led, v_led, a_led = self.leader.position(t)
        return p + self.R @ (p_led - self.begin), v + self.R @ v_led, a + self.R @ a_led

    def orientation(self, t: float) -> Motion:
        """See `PlacedPath.orientation`."""
        return self.own.orientation(t)

    def _breaks(self, until: float) -> list[Array | float]:
        return [*self.own._breaks(until), *self.leader._breaks(until)]

    def beside(self, t: float, p_leader: Array) -> Array:
        """Return the point at a time where the leader is in truth, shape (3,) [m].

        Args:
            t: The time [s].
            p_leader: Where the leading end effector is, in its own base, shape (3,) [m].
        """
        return np.asarray(self.own.position(t)[0] + self.R @ (p_leader - self.begin))

"""The description of an arm: its model file and how it is used."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from ..inputs.dataclass_fields import fields_of
from ..inputs.documents import construct
from ..inputs.fields import Count, Finite, Point, Positive, Vector, between, validated
from .link_error_settings import LinkErrorSettings
from .tool_description import ToolDescription

_EARTH = (0.0, 0.0, -9.81)
# On the Sun it is 274 m/s^2.
_MOST_GRAVITY = 300.0
Scale = Annotated[Positive, between(1e-3, 1e3)]


@validated
class ArmDescription:
    """Description of an arm: its model file and how it is used; the contents of an ``arm.yaml``.

    Args:
        model: URDF, SDF or MJCF file.
        frame: Name of the task frame E. If there is a ``tool`` that names no ``mount``, it is the
            frame that carries the tool, and E is the centre of the tool's ball.
        tip: Name of the frame at the tool's contact point, if there is one in the model.
        tool: Tool to add to the model.
        joints: Names of the controlled joints, base to tip; by default all between base and
            ``frame``.
        lock: Positions of joints held still, by name [rad or m]. Joints that mimic a held joint are
            held where they follow it; other joints that are not controlled are held at the
            model's default.
        packages: Folders of the packages that ``package://`` names in the model refer to.
        home: Home posture, from which the arm starts by default, shape (n,) [rad].
        gravity: Gravitational acceleration in the base frame, shape (3,) [m/s^2].
        mass_scale: Factor on all masses and inertias of the model and the tool.
        believed_mass_scale: The same factor in the dynamics that a law is given, to give it wrong
            masses; by default ``mass_scale``.
        limits: File of joint limits, see `drake_rnn.robot.limits_file`; limits that the file does
            not state are those of the model.
        capsules: File of the capsules round the links, for distances from obstacles, see
            `drake_rnn.robot.clearance.arm_capsules.CapsulesFile`; by default they are fitted to
            the model.
        message_period: Time between two messages of the robot's own controller [s], for
            ``level: robot``; None if nothing drives the robot.
        looks: URDF file of the same arm, whose meshes are drawn in place of this model's shapes in
            playbacks; ``example-robot-data`` for that of the package of this name, of a shipped
            arm. Nothing but the looks depends on it.
        triangles: Number of triangles to which these meshes are simplified, in all. Acts only with
            ``looks``.
        link_errors: Errors in the dimensions of the model, a URDF file.
    """

    model: str
    frame: str
    tip: str | None = None
    tool: ToolDescription | None = None
    joints: list[str] | None = None
    lock: dict[str, Finite] = Field(default_factory=dict)
    packages: dict[str, str] = Field(default_factory=dict)
    home: Vector | None = None
    gravity: Point = Field(default_factory=lambda: np.array(_EARTH))
    mass_scale: Scale = 1.0
    believed_mass_scale: Scale | None = None
    limits: str | None = None
    capsules: str | None = None
    message_period: Positive | None = None
    looks: str | None = None
    triangles: Annotated[Count, between(100, 2_000_000)] = 20_000
    link_errors: LinkErrorSettings | None = None

    def __post_init__(self) -> None:
        if self.tip is not None and self.tool is not None:
            raise ValueError(
                f"tip: cannot be combined with a tool, whose tip is tool.tip, {self.tool.tip!r}"
            )
        if np.linalg.norm(self.gravity) > _MOST_GRAVITY:
            raise ValueError(
                f"gravity: may be at most {_MOST_GRAVITY:g} m/s^2, not {self.gravity.tolist()}"
            )

    def mounted(self) -> ArmDescription:
        """Return the same description with the mount of the tool named, and ``frame`` that of E."""
        if self.tool is None or self.tool.mount is not None:
            return self
        return replace(self, frame=self.tool.tip, tool=replace(self.tool, mount=self.frame))

    def changed(self, changes: Mapping[str, Any]) -> ArmDescription:
        """Return the description with some fields changed; a new tool goes where the old one was.

        Raises:
            InvalidInputError: If a field is invalid.
        """
        # A tool has a tip of its own, in place of the model's.
        kept = fields_of(self) | ({"tip": None} if changes.get("tool") is not None else {})
        new = construct(ArmDescription, kept | dict(changes), "arm")
        if "tool" not in changes or self.tool is None or new.frame != self.tool.tip:
            return new
        # E was the tip of the former tool.
        leaves = "frame" not in changes if new.tool is None else new.tool.mount is None
        return replace(new, frame=str(self.tool.mount)) if leaves else new

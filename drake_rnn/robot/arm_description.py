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
from ..inputs.keys import Meaning, Only
from .link_error_settings import LinkErrorSettings
from .tool_description import ToolDescription

_EARTH = (0.0, 0.0, -9.81)
# On the Sun it is 274 m/s^2.
_MOST_GRAVITY = 300.0
Scale = Annotated[Positive, between(1e-3, 1e3)]


@validated
class ArmDescription:
    """Description of an arm: its model file and how it is used; the contents of an ``arm.yaml``."""

    model: Annotated[str, Meaning("URDF, SDF or MJCF file.")]
    frame: Annotated[
        str,
        Meaning(
            "Name of the task frame E. If there is a ``tool`` that names no ``mount``, it is the "
            "frame that carries the tool, and E is the centre of the tool's ball.",
        ),
    ]
    tip: Annotated[
        str | None,
        Meaning("Name of the frame at the tool's contact point, if there is one in the model."),
    ] = None
    tool: Annotated[ToolDescription | None, Meaning("Tool to add to the model.")] = None
    joints: Annotated[
        list[str] | None,
        Meaning(
            "Names of the controlled joints, base to tip; by default all between base and "
            "``frame``.",
        ),
    ] = None
    lock: Annotated[
        dict[str, Finite],
        Meaning(
            "Positions of joints held still, by name [rad or m]. Joints that mimic a held joint "
            "are held where they follow it; other joints that are not controlled are held at the "
            "model's default.",
        ),
    ] = Field(default_factory=dict)
    packages: Annotated[
        dict[str, str],
        Meaning("Folders of the packages that ``package://`` names in the model refer to."),
    ] = Field(default_factory=dict)
    home: Annotated[
        Vector | None,
        Meaning("Home posture, from which the arm starts by default, shape (n,).", unit="rad"),
    ] = None
    gravity: Annotated[
        Point,
        Meaning("Gravitational acceleration in the base frame, shape (3,).", unit="m/s^2"),
    ] = Field(default_factory=lambda: np.array(_EARTH))
    mass_scale: Annotated[
        Scale,
        Meaning("Factor on all masses and inertias of the model and the tool."),
    ] = 1.0
    believed_mass_scale: Annotated[
        Scale | None,
        Meaning(
            "The same factor in the dynamics that a law is given, to give it wrong masses; by "
            "default ``mass_scale``.",
        ),
    ] = None
    limits: Annotated[
        str | None,
        Meaning(
            "File of joint limits, see `drake_rnn.robot.limits_file`; limits that the file does "
            "not state are those of the model.",
        ),
    ] = None
    capsules: Annotated[
        str | None,
        Meaning(
            "File of the capsules round the links, for distances from obstacles, see "
            "`drake_rnn.robot.clearance.arm_capsules.CapsulesFile`; by default they are fitted "
            "to the model.",
        ),
    ] = None
    message_period: Annotated[
        Positive | None,
        Meaning(
            "Time between two messages of the robot's own controller [s], for ``level: robot``; "
            "None if nothing drives the robot.",
            unit="s",
        ),
    ] = None
    looks: Annotated[
        str | None,
        Meaning(
            "URDF file of the same arm, whose meshes are drawn in place of this model's shapes "
            "in playbacks; ``example-robot-data`` for that of the package of this name, of a "
            "shipped arm. Nothing but the looks depends on it.",
        ),
    ] = None
    triangles: Annotated[
        Count,
        between(100, 2_000_000),
        Meaning(
            "Number of triangles to which these meshes are simplified, in all.",
            only=(Only("looks"),),
        ),
    ] = 20_000
    link_errors: Annotated[
        LinkErrorSettings | None,
        Meaning("Errors in the dimensions of the model, a URDF file."),
    ] = None

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

"""What a camera asks of the rest of an experiment: that its points stay in its image."""

from __future__ import annotations

import numpy as np

from ..errors import InvalidInputError
from ..inputs.fields import Array
from ..paths import PlacedPath
from ..robot.kinematics import ArmKinematics
from ..robot.pinhole import NEAR
from ..robot.tool_camera import ToolCamera
from .sections import Sections

# Number of points of a path that are looked at.
_SAMPLES = 400


def check_seen(parts: Sections, desired: PlacedPath, kinematics: ArmKinematics) -> None:
    """Raise an InvalidInputError if a camera does not see all of its points where they are to be.

    Args:
        parts: What the sections of the experiment's document describe.
        desired: The path, placed at the start.
        kinematics: Kinematics of the arm.
    """
    document = parts.document
    if (camera := document.camera) is None:
        return
    for number, swap in enumerate(camera.swaps):
        if swap.time >= document.duration:
            raise InvalidInputError(
                f"camera.swaps.{number}.time: must be before the end of the run, "
                f"{document.duration:g} s, not {swap.time:g}"
            )
    q = parts.start
    _require_in_image(camera, 0.0, kinematics.p_WE(q), kinematics.R_WE(q), "starts")
    times = np.linspace(0.0, document.duration, _SAMPLES)
    for t in sorted([*times.tolist(), *(swap.time for swap in camera.swaps)]):
        _require_in_image(
            camera, t, desired.position(t)[0], desired.orientation(t)[0], f"is to be at {t:.3g} s"
        )


def _require_in_image(camera: ToolCamera, t: float, p_WE: Array, R_WE: Array, said: str) -> None:
    seeing = camera.at(t)
    depths = seeing.depth(camera.placed(p_WE, R_WE))
    if not (nearest := depths.min()) >= NEAR:
        raise InvalidInputError(
            f"camera.points.{depths.argmin()}: {said} {nearest:.3g} m in front of the camera at "
            f"{seeing.position.tolist()}, and is seen from {NEAR:g} m on; move the camera, or turn "
            "it by look_at"
        )
    pixels = camera.pixels(t, p_WE, R_WE).reshape(-1, 2)
    for number, (point, margin) in enumerate(zip(pixels, seeing.margin(pixels), strict=True)):
        if margin < 0.0:
            width, height = seeing.image_size
            raise InvalidInputError(
                f"camera.points.{number}: {said} at ({point[0]:.4g}, {point[1]:.4g}) px, out of "
                f"the image of {width} x {height} px; move the camera or the path, or give a "
                "shorter focal_length or a larger image_size"
            )

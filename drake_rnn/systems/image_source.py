"""Desired pixels: what the camera would see of a tool on its path."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from pydrake.systems.framework import Context

from ..errors import InvalidInputError
from ..inputs.complaints import require_type
from ..inputs.fields import Array
from ..paths import PlacedPath
from ..robot.tool_camera import ToolCamera
from .block import Block
from .path_source import require_time


class ImageSource(Block):
    """Source of a path as pixels of points on the tool, one after the other, shape (2 k,) [px].

    Outputs are ``pixels_desired``, now, and ``pixels_preview``, a time ahead. Both are as the
    camera sees them that sees now: what comes in its place is not known before.

    Args:
        path: The path of the tool, which has been placed with an orientation.
        camera: The camera, and those that come in its place.
        preview: The time ahead [s].
        delay: Time by which pictures are late [s].

    Raises:
        InvalidInputError: If an argument has the wrong type, a time is negative, infinite or not a
            number, or the path has no orientation.
    """

    def __init__(
        self, path: PlacedPath, camera: ToolCamera, preview: float, delay: float = 0.0
    ) -> None:
        super().__init__()
        require_type("path", path, PlacedPath)
        require_type("camera", camera, ToolCamera)
        require_time("preview", preview)
        require_time("delay", delay)
        if not path.oriented:
            raise InvalidInputError(
                "path: must be placed with R_WE, the orientation in which the points are seen"
            )
        self.preview = preview

        # What was ahead at a sample is now at the next one, but where the times differ by rounding.
        @lru_cache(maxsize=2)
        def pose(t: float) -> tuple[Array, Array]:
            return path.position(t)[0], path.orientation(t)[0]

        for name, ahead in (("pixels_desired", 0.0), ("pixels_preview", preview)):

            def calc(context: Context, output: Any, ahead: float = ahead) -> None:
                t = context.get_time()
                output.set_value(camera.pixels(t - delay, *pose(t + ahead)))

            self.DeclareVectorOutputPort(name, camera.size, calc, {self.time_ticket()})

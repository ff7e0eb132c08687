"""The pixels of points on a tool, as a camera sees them."""

from __future__ import annotations

from pydrake.systems.framework import Context

from ..inputs.complaints import require_type
from ..inputs.fields import Array
from ..robot.kinematics import ArmKinematics
from ..robot.tool_camera import ToolCamera
from .lateness import LateSensor
from .sensing_settings import SensingSettings
from .white_noise import WhiteNoise


class Camera(LateSensor):
    """A camera that has a picture of the tool for every sample of the controller.

    Input is ``position_true``, shape (n,) [rad]: the camera sees the true arm. Output is
    ``pixels``, shape (2 k,) [px], of k points, one after the other.

    Args:
        camera: The camera, and those that come in its place.
        settings: Measurements of the joints, whose delay the camera shares.
        kinematics: Kinematics of the arm.
        start: Start posture, shape (n,) [rad].
        period: Sampling period [s].
        seed: Seed of the noise.

    Raises:
        InvalidInputError: If the delay is not a multiple of the period, or a point is behind the
            camera at the start.
    """

    def __init__(
        self,
        camera: ToolCamera,
        settings: SensingSettings,
        kinematics: ArmKinematics,
        start: Array,
        period: float,
        seed: int = 0,
    ) -> None:
        require_type("camera", camera, ToolCamera)
        super().__init__(settings, period, WhiteNoise(6, seed, stream=6))
        self._camera, self._kinematics = camera, kinematics
        position = self.DeclareVectorInputPort("position_true", start.size)
        self._read_q = position.Eval
        self._declare("pixels", self._measured, self._pixels(0.0, start), {position.ticket()})

    def _pixels(self, t: float, q: Array) -> Array:
        return self._camera.pixels(t, self._kinematics.p_WE(q), self._kinematics.R_WE(q))

    def _measured(self, context: Context) -> Array:
        """Return the pixels of now, or of the next sample, shape (2 k,) [px]."""
        pixels = self._pixels(context.get_time(), self._read_q(context))
        if self._camera.noise == 0.0:
            return pixels
        return pixels + self._camera.noise * self._sample(context)[: pixels.size]

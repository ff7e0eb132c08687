r"""The camera: what it sees of some points, what it should see, and what it asks of a run.

The camera stands and sees points on the tool, or it is on the tool and sees points that stand.

`ToolCamera` is the section ``camera``, with the cameras that come in its place. `Camera` makes
pixels of the true arm, and `ImageSource` the desired ones of a path; `check_seen` tells before a
run whether these are in the image.

A pinhole camera: where a point of the world is in its image.

The camera's frame C has its origin in the lens, x to the right of the image, y down and z forward,
as OpenCV and Drake have it. A point at (x, y, z) in C is seen at

.. math:: u = c_u + f x / z, \qquad v = c_v + f y / z

in pixels from the image's upper left corner, with the focal length f and the principal point c.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field
from pydrake.geometry import Box, MeshcatCone, Rgba, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context, System

from .. import colours
from ..errors import InvalidInputError, OldName
from ..inputs.fields import (
    Angle,
    Array,
    Finite,
    Length,
    NonNegative,
    Point,
    Positive,
    between,
    validated,
    zeros,
)
from ..inputs.keys import Meaning
from ..inputs.messages import require_type
from ..measures import ImageMotion, Motion, RunMetrics, Steps
from ..paths import PlacedPath
from ..robot.kinematics import ArmKinematics
from ..systems.controllers import Controller
from ..systems.sources import PreviewSource, require_time
from .feature import (
    EvaluationSteps,
    Feature,
    Frames,
    LegendEntry,
    LoopBuild,
    LoopPart,
    Moment,
    SceneItem,
    Stage,
    ports_of,
)
from .sensing import LateSensor, SensingSettings, Stream, WhiteNoise

#: Depth from which on a point is in front of a camera [m].
NEAR = 0.01
# Of cameras with wide and with long lenses [px].
_Focal = Annotated[Positive, between(1.0, 1e5)]
_Pixels = Annotated[int, Field(strict=True, ge=1, le=100_000)]


@validated
class Pinhole:
    """A camera without distortion.

    Where it is fixed to another frame than the world, that one is meant where W is said.
    """

    position: Annotated[Point, Meaning("Position of the lens in W, shape (3,).", unit="m")]
    look_at: Annotated[
        Point,
        Meaning("Point in W that is seen at the principal point, shape (3,).", unit="m"),
    ] = Field(default_factory=zeros)
    roll: Annotated[
        Angle,
        Meaning(
            "Turn of the camera about the way it looks; at 0 the image's vertical is upright in W.",
            unit="rad",
        ),
    ] = 0.0
    focal_length: Annotated[_Focal, Meaning("Focal length.", unit="px")] = 600.0
    image_size: Annotated[
        tuple[_Pixels, _Pixels],
        Meaning("Width and height of the image.", unit="px"),
    ] = (640, 480)
    principal_point: Annotated[
        tuple[Finite, Finite] | None,
        Meaning("Where the way that it looks meets the image; by default the middle.", unit="px"),
    ] = None

    def __post_init__(self) -> None:
        if np.linalg.norm(self.look_at - self.position) < NEAR:
            raise ValueError(
                f"look_at: must be {NEAR:g} m or more from position, not {self.look_at.tolist()}"
            )

    @cached_property
    def R_WC(self) -> Array:
        """Orientation of the camera's frame in W, shape (3, 3)."""
        z = self.look_at - self.position
        z = z / np.linalg.norm(z)
        # Straight down or up, the image's vertical is along W's x axis.
        upright = np.abs(z[2]) < 1.0 - 1e-9
        x = np.cross(z, [0.0, 0.0, 1.0] if upright else [1.0, 0.0, 0.0])
        x /= np.linalg.norm(x)
        y = np.cross(z, x)
        c, s = np.cos(self.roll), np.sin(self.roll)
        return np.stack((c * x + s * y, c * y - s * x, z), axis=1)

    @property
    def center(self) -> Array:
        """The principal point, shape (2,) [px]."""
        if self.principal_point is not None:
            return np.array(self.principal_point)
        return 0.5 * np.array(self.image_size)

    def depth(self, p_WP: Array) -> Array:
        """Return how far points are in front of the lens, shape (...) [m].

        Args:
            p_WP: Positions of the points in W, shape (..., 3) [m].
        """
        return np.asarray((p_WP - self.position) @ self.R_WC[:, 2])

    def project(self, p_WP: Array) -> Array:
        """Return where points are in the image, shape (..., 2) [px].

        Args:
            p_WP: Positions of the points in W, shape (..., 3) [m].

        Raises:
            InvalidInputError: If a point is not in front of the camera.
        """
        p_CP = self._in_camera(p_WP)
        return np.asarray(self.center + self.focal_length * p_CP[..., :2] / p_CP[..., 2:])

    def J(self, p_WP: Array) -> Array:
        """Return the derivatives of `seen` by the positions, shape (..., 2, 3) [px/m].

        Args:
            p_WP: Positions of the points in W, shape (..., 3) [m].

        Raises:
            InvalidInputError: If a point is not in front of the camera.
        """
        p_CP = self._in_camera(p_WP)
        x, y, z = np.moveaxis(p_CP, -1, 0)
        none, one = np.zeros_like(z), np.ones_like(z)
        rows = np.stack((one, none, -x / z, none, one, -y / z), axis=-1)
        rows = rows.reshape(*z.shape, 2, 3) * (self.focal_length / z)[..., None, None]
        return np.asarray(rows @ self.R_WC.T)

    def margin(self, pixels: Array) -> Array:
        """Return how far points are from the image's edge [px], less than 0 where out of it.

        Args:
            pixels: Where they are in the image, shape (..., 2) [px].
        """
        return np.minimum(pixels, np.array(self.image_size) - pixels).min(axis=-1)

    def _in_camera(self, p_WP: Array) -> Array:
        p_CP = (p_WP - self.position) @ self.R_WC
        if not (nearest := p_CP[..., 2].min()) >= NEAR:
            raise InvalidInputError(
                f"camera: a point is {nearest:.3g} m in front of the camera at "
                f"{self.position.tolist()}, and is seen from {NEAR:g} m on"
            )
        return np.asarray(p_CP)

    seen = OldName("project")


# Sample times carry rounding errors [s].
_ROUNDING = 1e-9
# Largest noise that leaves anything to see [px].
_Noise = Annotated[NonNegative, between(0.0, 100.0)]
# Number of points of a path that are looked at.
_SAMPLES = 400


@validated
class CameraSwap(Pinhole):
    """A camera that comes in place of the former one, all at once."""

    time: Annotated[Positive, Meaning("Time from which on it is the one that sees.", unit="s")]


@validated
class ToolCamera(Pinhole, LoopPart):
    """A camera that sees points on a tool, or from a tool points that stand.

    A law with ``points`` sees pixels in place of the end effector's position, and is told
    ``pixel_size`` alone: nothing of where the camera is, of its lens, or of where the points are.
    """

    mount: Annotated[
        Literal["world", "tool"],
        Meaning(
            "What the camera is fixed to: the ``world``, from where it sees points on the tool, or "
            "the ``tool``, from where it sees points that stand in W (eye in hand). ``position`` "
            "and ``look_at``, those of swaps too, are in W or in the tool's frame E, and "
            "``points`` in the other frame."
        ),
    ] = "world"
    points: Annotated[
        list[Point],
        Field(min_length=1, max_length=3),
        Meaning(
            "Positions of one to three points, shape (3,) each: on the tool in its frame E, or in "
            "W for a camera on the tool.",
            unit="m",
        ),
    ] = Field(default_factory=lambda: [zeros()])
    noise: Annotated[
        _Noise,
        Meaning(
            "Standard deviation of the normal noise on each coordinate of each pixel.",
            unit="px",
        ),
    ] = 0.0
    pixel_size: Annotated[
        Length,
        Meaning(
            "What a pixel is taken to be at the tool [m]: the way between two points that the "
            "camera sees a pixel apart, as well as it is known.",
            unit="m",
        ),
    ] = 1e-3
    swaps: Annotated[
        list[CameraSwap],
        Meaning("Cameras that come in place of this one, in order."),
    ] = Field(default_factory=list)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.mount == "tool" and not np.any(self.points):
            raise InvalidInputError(
                "camera.points: must be given with mount: tool, where they are in W; W's origin is "
                "in the arm's base"
            )
        for number in range(1, len(self.points)):
            for other in range(number):
                if np.array_equal(self.points[number], self.points[other]):
                    raise InvalidInputError(
                        f"camera.points.{number}: must differ from points.{other}, "
                        f"{self.points[other].tolist()}"
                    )
        times = [swap.time for swap in self.swaps]
        for number, (before, after) in enumerate(pairwise(times), start=1):
            if after <= before:
                raise InvalidInputError(
                    f"camera.swaps.{number}.time: must be after that of the swap before it, "
                    f"{before:g} s, not {after:g}"
                )

    @cached_property
    def size(self) -> int:
        """Number of coordinates of all pixels, two for each point."""
        return 2 * len(self.points)

    @property
    def cameras(self) -> tuple[Pinhole, ...]:
        """All cameras, in the order in which they see."""
        return (self, *self.swaps)

    @property
    def swap_times(self) -> tuple[float, float] | None:
        """Times of the first and the last swap [s]; None without one."""
        return (self.swaps[0].time, self.swaps[-1].time) if self.swaps else None

    def at(self, t: float) -> Pinhole:
        """Return the camera that sees at a time.

        Args:
            t: The time [s].
        """
        number = sum(t >= swap.time - _ROUNDING for swap in self.swaps)
        return self.cameras[number]

    def pixels(self, t: float, p_WE: Array, R_WE: Array) -> Array:
        """Return the pixels of the points, one point after the other, shape (size,) [px].

        Args:
            t: Time, which says which camera sees [s].
            p_WE: Position of the tool, shape (3,) [m].
            R_WE: Orientation of the tool, shape (3, 3).

        Raises:
            InvalidInputError: If a point is not in front of the camera.
        """
        return self.at(t).project(self.points_from_mount(p_WE, R_WE)).ravel()

    def tool_J(self, t: float, p_WE: Array, R_WE: Array, J_omega: Array, J: Array) -> Array:
        """Return the image Jacobian, shape (size, n) [px/rad].

        Args:
            t: Time, which says which camera sees [s].
            p_WE: Position of the tool, shape (3,) [m].
            R_WE: Orientation of the tool, shape (3, 3).
            J_omega: Jacobian of its rotation, shape (3, n).
            J: Jacobian of its position, shape (3, n) [m].

        Raises:
            InvalidInputError: If a point is not in front of the camera.
        """
        arms = (self.points_in_world(p_WE, R_WE) - p_WE)[:, None, :]
        # Each joint moves a point along with E, and round it.
        J_points = J.T + np.cross(J_omega.T, arms)
        if self.mount == "tool":
            # It is the point that stands, and seen from E moves the other way.
            J_points = -J_points @ R_WE
        J_camera = self.at(t).J(self.points_from_mount(p_WE, R_WE))
        return (J_camera @ np.swapaxes(J_points, -1, -2)).reshape(self.size, -1)

    def tool_margin(self, t: float, pixels: Array) -> float:
        """Return how far the points are from the image's edge [px], less than 0 out of it.

        Args:
            t: Time, which says which camera sees [s].
            pixels: Their pixels, shape (size,) [px].
        """
        return float(self.at(t).margin(pixels.reshape(-1, 2)).min())

    def traits(self) -> Mapping[str, Any]:
        return {"camera": self}

    def check(self, controller: Controller) -> None:
        """Raise an InvalidInputError if the law sees another number of points."""
        if controller.law.inputs.parts["pixels"][1] != (self.size,):
            raise InvalidInputError(
                f"camera.points: must be as many as the law's, not {len(self.points)}"
            )

    def add_sensors(self, loop: LoopBuild) -> None:
        body, period = loop.body, loop.period
        if period is None:
            return
        sensing = (each for each in loop.parts if isinstance(each, SensingSettings))
        settings = next(sensing, SensingSettings())
        seeing = Camera(self, settings, body.kinematics, body.start, period, loop.seed)
        loop.wiring.add("camera", seeing)
        loop.wiring.connect(body.GetOutputPort("position"), seeing.GetInputPort("position_true"))
        loop.outside |= ports_of(seeing)

    def points_in_world(self, p_WE: Array, R_WE: Array) -> Array:
        """Return where the points are in W, shape (points, 3) [m].

        Args:
            p_WE: Position of the tool, shape (3,) [m].
            R_WE: Orientation of the tool, shape (3, 3).
        """
        return self._rows if self.mount == "tool" else np.asarray(p_WE + self._rows @ R_WE.T)

    def points_from_mount(self, p_WE: Array, R_WE: Array) -> Array:
        """Return where the points are in the frame that the camera is fixed to, as above."""
        points = self.points_in_world(p_WE, R_WE)
        return np.asarray((points - p_WE) @ R_WE) if self.mount == "tool" else points

    @cached_property
    def _rows(self) -> Array:
        return np.array(self.points)

    swapped = OldName("swap_times")
    placed = OldName("points_in_world")


class Camera(LateSensor):
    """A camera that has a picture of its points for every sample of the controller.

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

    role = "sensor"

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
        super().__init__(settings, period, WhiteNoise(6, seed, Stream.CAMERA))
        self._camera, self._kinematics = camera, kinematics
        position = self.DeclareVectorInputPort("position_true", start.size)
        self._read_q = position.Eval
        self._declare("pixels", self._measure, self._pixels(0.0, start), {position.ticket()})

    def _pixels(self, t: float, q: Array) -> Array:
        return self._camera.pixels(t, self._kinematics.p_WE(q), self._kinematics.R_WE(q))

    def _measure(self, context: Context) -> Array:
        """Return the pixels of now, or of the next sample, shape (2 k,) [px]."""
        pixels = self._pixels(context.get_time(), self._read_q(context))
        if self._camera.noise == 0.0:
            return pixels
        return pixels + self._camera.noise * self._sample(context)[: pixels.size]


class ImageSource(PreviewSource):
    """Source of a path as pixels of the camera's points, one after the other, shape (2 k,) [px].

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

    role = "reference"

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


def check_seen(
    camera: ToolCamera | None,
    path: PlacedPath,
    duration: float,
    kinematics: ArmKinematics,
    start: Array,
) -> None:
    """Raise an InvalidInputError if a camera does not see all of its points where they are to be.

    Args:
        camera: The camera; None without one.
        path: The path, placed at the start.
        duration: Duration of the run [s].
        kinematics: Kinematics of the arm.
        start: Start posture, shape (n,) [rad].
    """
    if camera is None:
        return
    for number, swap in enumerate(camera.swaps):
        if swap.time >= duration:
            raise InvalidInputError(
                f"camera.swaps.{number}.time: must be before the end of the run, "
                f"{duration:g} s, not {swap.time:g}"
            )
    _require_in_image(camera, 0.0, kinematics.p_WE(start), kinematics.R_WE(start), "starts")
    times = np.linspace(0.0, duration, _SAMPLES)
    for t in sorted([*times.tolist(), *(swap.time for swap in camera.swaps)]):
        _require_in_image(
            camera, t, path.position(t)[0], path.orientation(t)[0], f"is to be at {t:.3g} s"
        )


def _require_in_image(camera: ToolCamera, t: float, p_WE: Array, R_WE: Array, what: str) -> None:
    seeing = camera.at(t)
    depths = seeing.depth(camera.points_from_mount(p_WE, R_WE))
    if not (nearest := depths.min()) >= NEAR:
        raise InvalidInputError(
            f"camera.points.{depths.argmin()}: {what} {nearest:.3g} m in front of the camera at "
            f"{seeing.position.tolist()} of the {camera.mount}, and is seen from {NEAR:g} m on; "
            "move the camera, or turn it by look_at"
        )
    pixels = camera.pixels(t, p_WE, R_WE).reshape(-1, 2)
    for number, (point, margin) in enumerate(zip(pixels, seeing.margin(pixels), strict=True)):
        if margin < 0.0:
            width, height = seeing.image_size
            raise InvalidInputError(
                f"camera.points.{number}: {what} at ({point[0]:.4g}, {point[1]:.4g}) px, out of "
                f"the image of {width} x {height} px; move the camera or the path, or give a "
                "shorter focal_length or a larger image_size"
            )


def image_motion(
    camera: ToolCamera,
    kinematics: ArmKinematics,
    path: PlacedPath,
    run: EvaluationSteps,
) -> ImageMotion:
    """Return what a camera sees at every step.

    Args:
        camera: The camera.
        kinematics: Kinematics of the arm.
        path: The path, placed at the start.
        run: The steps.
    """
    steps, n = run.position.shape
    pixels, desired_pixels = np.empty((steps, camera.size)), np.empty((steps, camera.size))
    image_J, margin = np.empty((steps, camera.size, n)), np.empty(steps)
    for k, (t, q) in enumerate(zip(run.steps.time.tolist(), run.position, strict=True)):
        p_WE, R_WE = kinematics.p_WE(q), kinematics.R_WE(q)
        pixels[k] = camera.pixels(t, p_WE, R_WE)
        desired_pixels[k] = camera.pixels(t, path.position(t)[0], path.orientation(t)[0])
        J = camera.tool_J(t, p_WE, R_WE, kinematics.J_omega(q), run.J[k])
        image_J[k] = camera.pixel_size * J
        margin[k] = camera.tool_margin(t, pixels[k])
    return ImageMotion(pixels, desired_pixels, image_J, margin, camera.swap_times)


# Ball of a point, edges of a camera's body, and length and radius of its lens [m].
_RADIUS, _BODY, _LENS = 0.012, (0.08, 0.06, 0.08), (0.06, 0.04)


class DrawnCameras(SceneItem):
    """The camera that sees and the points that it sees, below "/cameras" in the scene.

    Args:
        stage: Where it is drawn.
        camera: The camera, and those that come in its place.
    """

    def __init__(self, stage: Stage, camera: ToolCamera) -> None:
        self._stage, self._camera = stage, camera
        self._kinematics = stage.experiment.arm.kinematics()

    @property
    def corners(self) -> Array:
        """Points that stand, shape (k, 3) [m]; those on a tool are in the frame with it."""
        points = np.array(self._camera.points)
        return points if self._camera.mount == "tool" else super().corners

    def draw(self) -> list[str]:
        meshcat = self._stage.meshcat
        dark = Rgba(*colours.components(colours.ARM_DARK))
        for number in range(len(self._camera.points)):
            ball = Rgba(*colours.components(colours.TRACED))
            meshcat.SetObject(f"/cameras/point{number}", Sphere(_RADIUS), ball)
        length, radius = _LENS
        for number, each in enumerate(self._camera.cameras):
            place = f"/cameras/{number}"
            # The body lies behind the lens, whose cone opens the way that it looks.
            behind = RigidTransform([0.0, 0.0, -0.5 * _BODY[2] - length])
            meshcat.SetObject(f"{place}/body", Box(*_BODY), dark)
            meshcat.SetTransform(f"{place}/body", behind)
            cone = MeshcatCone(length, radius, radius)
            meshcat.SetObject(f"{place}/lens", cone, dark)
            meshcat.SetTransform(f"{place}/lens", RigidTransform([0.0, 0.0, -length]))
            pose = RigidTransform(RotationMatrix(each.R_WC), each.position)
            meshcat.SetTransform(place, pose)
            meshcat.SetProperty(place, "visible", number == 0)
        return []

    def record(self, frames: Frames) -> None:
        """Record where the points and cameras are, and which camera sees."""
        motion = self._stage.motion
        postures = motion.at(frames.time, motion.position)
        poses = [self._pose(q) for q in postures]
        points = np.array([self._camera.points_in_world(p, R) for R, p in poses])
        for number in range(points.shape[1]):
            frames.move(f"/cameras/point{number}", points[:, number])
        if self._camera.mount == "tool":
            for number, each in enumerate(self._camera.cameras):
                X_EC = RigidTransform(RotationMatrix(each.R_WC), each.position)
                for frame, (R, p) in enumerate(poses):
                    X_WC = RigidTransform(RotationMatrix(R), p) @ X_EC
                    frames.recording.SetTransform(frame, f"/cameras/{number}", X_WC)
        swaps = [swap.time - self._stage.begin for swap in self._camera.swaps]
        for number, (begin, end) in enumerate(zip([None, *swaps], [*swaps, None], strict=True)):
            frames.show(f"/cameras/{number}", begin, end)

    def _pose(self, q: Array) -> tuple[Array, Array]:
        """Return the pose R_WE, p_WE of the tool in a posture."""
        return self._kinematics.R_WE(q), self._kinematics.p_WE(q)


class CameraFeature(Feature):
    """The section ``camera``."""

    key = "camera"

    def loop_arguments(self, experiment: Any) -> Mapping[str, Any]:
        return {"camera": experiment.document.camera}

    def path_source(self, experiment: Any, period: float | None) -> System | None:
        """Return the source of the path as pixels."""
        document = experiment.document
        if document.camera is None or period is None:
            return None
        late = 0.0 if document.sensing is None else document.sensing.delay
        return ImageSource(experiment.desired, document.camera, period, late)

    def doubts(self, experiment: Any) -> list[str]:
        """Return no warning; the points must be in the image."""
        kinematics, duration = experiment.arm.kinematics(), experiment.document.duration
        camera = experiment.document.camera
        check_seen(camera, experiment.desired, duration, kinematics, experiment.start)
        return []

    def moments(self, experiment: Any) -> Iterable[Moment]:
        camera = experiment.document.camera
        for swap in () if camera is None else camera.swaps:
            yield Moment(swap.time, "another camera", of_arm=False)

    def observe(self, experiment: Any, run: EvaluationSteps) -> Mapping[str, Any]:
        if (camera := experiment.document.camera) is None:
            return {}
        image = image_motion(camera, experiment.arm.kinematics(), experiment.desired, run)
        return {"image": image, "J": image.J}

    def series(self, motion: Motion, steps: Steps) -> Mapping[str, Array]:
        if motion.image is None:
            return {}
        return {"pixels": motion.image.pixels, "pixels_desired": motion.image.desired}

    def caveats(
        self, experiment: Any, metrics: Mapping[str, float], run: RunMetrics
    ) -> Iterable[str]:
        """Yield a warning if a point left the image, where no camera would see it."""
        margin = metrics.get("image_margin_min_px", 0.0)
        if margin < 0.0:
            yield (
                f"camera: a point leaves the image, by up to {-margin:.3g} px; it was seen as if "
                "the image were larger"
            )

    def items(self, stage: Stage) -> Iterable[SceneItem]:
        if (camera := stage.experiment.document.camera) is not None:
            yield DrawnCameras(stage, camera)

    def legend(self, experiment: Any) -> Sequence[LegendEntry]:
        entry = LegendEntry("seen", "what the camera sees", colour=colours.TRACED)
        return () if experiment.document.camera is None else (entry,)

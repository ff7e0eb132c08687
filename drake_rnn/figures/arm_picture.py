"""A picture of an arm in a posture, rendered by Drake without a window."""

from __future__ import annotations

import ctypes
import logging
import sys
from pathlib import Path

import numpy as np
from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    Cylinder,
    LightParameter,
    MakeRenderEngineVtk,
    RenderCameraCore,
    RenderEngineVtkParams,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.sensors import CameraInfo, ImageRgba8U

from ..errors import InvalidInputError
from ..inputs.fields import Array
from ..inputs.packages import import_name
from ..robot.arm import Arm
from ..robot.model.model import one_line, quiet_drake
from ..runs.folder import replacing, require_output
from ..systems.block import release

# Size of the picture [pixels], vertical field of view [rad], and the room around the arm.
_WIDTH, _HEIGHT, _FIELD_OF_VIEW, _MARGIN = 900, 900, 0.6, 1.15
# Direction from the arm to the camera, for an arm that stands upright.
_FROM = np.array([0.75, -1.0, 0.45])
_SKY, _GROUND = np.array([0.93, 0.95, 0.97]), np.array([0.8, 0.83, 0.86, 1.0])
# Lights: direction and brightness, in the world frame.
_LIGHTS = (((-0.4, 0.6, -1.0), 1.9), ((-1.0, 0.2, -0.2), 1.2), ((0.6, 1.0, 0.2), 0.8))
# Length of the axes of E as a share of the size of the arm, and their radius over their length.
_AXES, _THICKNESS = 0.12, 0.04
_RENDERER = "picture"
# Of EGL: a display of a device, and how many devices are looked at.
_EGL_PLATFORM_DEVICE_EXT, _MOST_DEVICES = 0x313F, 16


class NoPictureError(InvalidInputError):
    """A picture that Drake cannot draw, for the machine or for a shape of the model."""


def write_arm_picture(arm: Arm, q: Array, file: str | Path) -> Path:
    """Write a picture of an arm, with the axes of its task frame E in red, green and blue.

    Args:
        arm: The arm.
        q: Posture, shape (n,) [rad].
        file: PNG file to write; its folder is created if it does not exist.

    Returns:
        The file.

    Raises:
        NoPictureError: If nothing here can draw, or Drake cannot draw the arm.
        InvalidInputError: If the file cannot be written.
    """
    if why := rendering_fault():
        raise NoPictureError(f"picture {file}: {why}")
    file = Path(file)
    require_output(file, "picture")
    # Drake warns of materials in meshes, when it reads them and when it draws them.
    with quiet_drake(logging.ERROR):
        try:
            image = _draw_arm(arm, q)
        # Drake exits where a condition of its own code fails.
        except (RuntimeError, SystemExit) as error:
            raise NoPictureError(
                f"picture {file}: Drake cannot draw {arm.name}: {one_line(error)}"
            ) from None
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with replacing(file) as new:
            picture = import_name("PIL.Image:fromarray")(np.asarray(image.data)[..., :3])
            picture.save(new, "PNG", optimize=True)
    except OSError as error:
        raise InvalidInputError(f"picture {file}: {error.strerror}") from None
    return file


def _draw_arm(arm: Arm, q: Array) -> ImageRgba8U:
    """Return the picture of an arm at a posture, shape (n,) [rad]."""
    skeleton = arm.kinematics().skeleton(q)
    size = max(float(np.ptp(skeleton, axis=0).max()), 0.1)
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, MultibodyPlant(0.0))
    arm.add_to(plant)
    _add_axes(plant, arm, _AXES * size)
    ground = RigidTransform([0.0, 0.0, float(skeleton[:, 2].min()) - 0.012 * size])
    shape = Cylinder(0.45 * size, 0.004 * size)
    plant.RegisterVisualGeometry(plant.world_body(), ground, shape, "ground", _GROUND)
    plant.Finalize()
    scene_graph.AddRenderer(_RENDERER, MakeRenderEngineVtk(_parameters()))
    diagram = builder.Build()
    release(diagram)
    context = diagram.CreateDefaultContext()
    plant.SetPositions(plant.GetMyContextFromRoot(context), arm.posture(plant, q))
    query = scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(context))
    middle = (skeleton.min(axis=0) + skeleton.max(axis=0)) / 2.0
    radius = _MARGIN * float(np.linalg.norm(np.ptp(skeleton, axis=0)) / 2.0 + 0.1 * size)
    return query.RenderColorImage(
        _camera(radius), scene_graph.world_frame_id(), _view(middle, radius)
    )


def rendering_fault() -> str:
    """Return why Drake cannot draw on this machine; empty if it can.

    On Linux it draws with EGL. Without a driver, as in a slim container, it would end the process.
    """
    if sys.platform != "linux" or _egl_starts():
        return ""
    return (
        "Drake finds no EGL to draw with; on Debian and Ubuntu: "
        "apt-get install libegl1 libgl1-mesa-dri"
    )


def _egl_starts() -> bool:
    """Return whether EGL is installed, and starts on a device."""
    pointer = ctypes.c_void_p
    try:
        egl = ctypes.CDLL("libEGL.so.1")
    except OSError:
        return False
    address = ctypes.CFUNCTYPE(pointer, ctypes.c_char_p)(("eglGetProcAddress", egl))
    query, display = address(b"eglQueryDevicesEXT"), address(b"eglGetPlatformDisplayEXT")
    if not (query and display):
        return False
    devices, count = (pointer * _MOST_DEVICES)(), ctypes.c_int()
    query_devices = ctypes.CFUNCTYPE(ctypes.c_uint, ctypes.c_int, pointer, pointer)(query)
    display_of = ctypes.CFUNCTYPE(pointer, ctypes.c_uint, pointer, pointer)(display)
    initialize = ctypes.CFUNCTYPE(ctypes.c_uint, pointer, pointer, pointer)(("eglInitialize", egl))
    if not query_devices(_MOST_DEVICES, devices, ctypes.byref(count)):
        return False
    displays = (display_of(_EGL_PLATFORM_DEVICE_EXT, each, None) for each in devices[: count.value])
    return any(display and initialize(display, None, None) for display in displays)


def _parameters() -> RenderEngineVtkParams:
    parameters = RenderEngineVtkParams()
    parameters.default_clear_color = _SKY
    parameters.force_to_pbr = True  # as meshes are, which otherwise look darker than shapes
    parameters.lights = [
        LightParameter(type="directional", frame="world", direction=direction, intensity=brightness)
        for direction, brightness in _LIGHTS
    ]
    return parameters


def _camera(radius: float) -> ColorRenderCamera:
    """Return a camera for a scene of this radius [m]."""
    info = CameraInfo(_WIDTH, _HEIGHT, _FIELD_OF_VIEW)
    clipping = ClippingRange(0.1 * radius, 20.0 * radius)
    return ColorRenderCamera(RenderCameraCore(_RENDERER, info, clipping, RigidTransform()), False)


def _view(middle: Array, radius: float) -> RigidTransform:
    """Return the pose of a camera that shows a sphere; it looks along z, and y points down."""
    direction = _FROM / np.linalg.norm(_FROM)
    right = np.cross([0.0, 0.0, 1.0], direction)
    right /= np.linalg.norm(right)
    R = RotationMatrix(np.column_stack((right, -np.cross(direction, right), -direction)))
    return RigidTransform(R, middle + radius / np.sin(_FIELD_OF_VIEW / 2.0) * direction)


def _add_axes(plant: MultibodyPlant, arm: Arm, length: float) -> None:
    """Draw the axes of E as thin cylinders in red, green and blue."""
    frame = plant.GetFrameByName(arm.frame)
    X_BE = frame.GetFixedPoseInBodyFrame()
    for k, name in enumerate("xyz"):
        axis, colour = np.eye(3)[k], np.append(0.75 * np.eye(3)[k] + 0.1, 1.0)
        X_EG = RigidTransform(RotationMatrix.MakeFromOneVector(axis, 2), length / 2.0 * axis)
        shape = Cylinder(_THICKNESS * length, length)
        X_BG = X_BE.multiply(X_EG)
        plant.RegisterVisualGeometry(frame.body(), X_BG, shape, f"E_{name}", colour)

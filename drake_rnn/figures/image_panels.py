"""Panels of what a camera sees of points on a tool; each function draws on given axes."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from ..inputs.fields import Array
from ..measures import NEAR_PX
from ..runs.result import Result
from .looks import BOUND, DESIRED, INK, MOMENT, TRACED, Style, nth
from .style import legend, log_axis, mark_times, plane_axes, time_axis

_START: Style = {"marker": "o", "color": "black", "markersize": 3.5, "linestyle": "none"}


def plot_image(ax: Axes, result: Result, number: int = -1) -> None:
    """Plot traced and desired pixels of all points in the image of one camera.

    Args:
        ax: The axes.
        result: The run.
        number: Number of the camera among those that saw; the last one by default.
    """
    steps = _steps_of_cameras(result)[cameras_that_saw(result)[number]]
    pixels, desired = (_points(result, name)[steps] for name in ("pixels", "pixels_desired"))
    for k in range(pixels.shape[1]):
        several: Style = {"color": nth(k)["color"]} if pixels.shape[1] > 1 else {}
        first = k == 0
        label = "traced" if first else None
        ax.plot(*pixels[:, k].T, label=label, **{**TRACED, **several})
        ax.plot(*desired[:, k].T, label="desired" if first else None, **DESIRED)
        ax.plot(*pixels[:1, k].T, label="start" if first else None, **_START)
    cameras = cameras_that_saw(result)
    which = "" if len(cameras) == 1 else f" of camera {cameras[number] + 1}"
    plane_axes(ax, f"$u${which} [px]", f"$v${which} [px]")
    ax.yaxis.set_inverted(True)
    legend(ax)


def plot_pixel_error(ax: Axes, result: Result) -> None:
    """Plot how far the point that is farthest off is from where it is to be seen."""
    error = result.pixel_error
    ax.plot(result.time, error, color=INK)
    ax.axhline(NEAR_PX, label=f"{NEAR_PX:g} px", **BOUND)
    swaps = () if (camera := result.experiment.document.camera) is None else camera.swaps
    for swap in swaps:
        ax.axvline(swap.time, label="another camera", **MOMENT)
    mark_times(ax, result)
    log_axis(ax, [error, NEAR_PX * np.array([0.6, 1.6])])
    time_axis(ax, result, "error in the image [px]")
    legend(ax)


def cameras_that_saw(result: Result) -> list[int]:
    """Return the numbers of the cameras of which the run has samples."""
    return [number for number, steps in enumerate(_steps_of_cameras(result)) if steps.any()]


def _points(result: Result, name: str) -> Array:
    """Return pixels as points, shape (k, points, 2) [px]."""
    return result.series[name].reshape(len(result.time), -1, 2)


def _steps_of_cameras(result: Result) -> list[Array]:
    """Return at which samples each camera sees, shape (k,) each."""
    camera = result.experiment.document.camera
    assert camera is not None
    seeing = [camera.cameras.index(camera.at(t)) for t in result.time.tolist()]
    return [np.array(seeing) == number for number in range(len(camera.cameras))]

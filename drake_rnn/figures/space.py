"""The arm as a stick figure, in space or in the plane, and axes for it."""

from __future__ import annotations

from collections.abc import Iterable
from math import ceil
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure

from .. import colours as meanings
from ..inputs.fields import Array
from ..runs.result import Result
from .looks import TARGET, TRACED, Style
from .paper import wide
from .style import COLUMN, finite, largest, legend, plane_axes, single, ticks
from .traits import first_pass, has_path

_LOOKS: dict[str, Style] = {
    "start": {"color": meanings.ARM, "linewidth": 1.6},
    "end": {"color": meanings.ARM_DARK, "linewidth": 2.8},
    "target": {**TARGET, "linewidth": 1.3, "markersize": 2.0},
}
#: Path of the end effector, drawn over the arm.
_TRACE: Style = {**TRACED, "linewidth": 1.2, "zorder": 4}
#: Approximate number of postures of a stroboscopic picture.
_FLASHES = 20
#: The same along a path, which is short compared with the arm: more postures would blur.
_FLASHES_ALONG = 10
#: Speed relative to the largest one below which the arm counts as resting.
_AT_REST = 0.02
#: Greys of the first and of the last posture.
_FIRST, _LAST = 0.85, 0.3
#: Elevation of the view [deg].
_ELEVATION = 20.0
#: The same for a horizontal path, which would be a mere line from lower down [deg].
_HIGH = 42.0
#: Azimuths of the view [deg]; others would look along an axis and crowd its labels.
_AZIMUTHS = [quarter + angle for quarter in (-90, 0, 90, 180) for angle in (35, 55)]


def plot_postures(ax: Axes, result: Result) -> None:
    """Plot the arm at the start, at the end, and in its target posture."""
    known = finite(result.series["position"])
    ends = {"start": known[0], "end": known[-1]} if known.size else {}
    target = result.experiment.target
    assert target is not None, "drawn only with a target"
    shown = {**ends, "target": target}
    joints = _skeletons(result, shown.values())
    for name, points in zip(shown, joints, strict=True):
        _plot_stick(ax, points, label=name, **_LOOKS[name])
    _mark_ends(ax, joints[0])
    _fit(ax, joints)
    legend(ax)


def plot_stroboscope(ax: Axes, result: Result) -> ScalarMappable | None:
    """Plot the arm at equal intervals of time while it moves, along a path until it is passed once.

    Returns:
        The relation of colour and time, for a colour bar; None if no posture was finite.
    """
    steps, flashes = _steps_in_motion(result), _FLASHES
    if has_path(result):
        steps, flashes = min(steps, int(first_pass(result).sum())), _FLASHES_ALONG
    stride = max(1, ceil(steps / flashes))
    shown = slice(0, stride * flashes + 1, stride)
    time, position = result.time[shown], result.series["position"][shown]
    known = np.isfinite(position).all(axis=1)
    joints = _skeletons(result, position[known])
    if not joints.size:
        return None
    colours = np.linspace(_FIRST, _LAST, time.size)[:, np.newaxis].repeat(3, axis=1)
    for points, colour in zip(joints, colours[known], strict=True):
        _plot_stick(ax, points, color=colour, linewidth=0.9, markersize=2.0)
    _mark_ends(ax, joints[0])
    lies_flat = False
    if has_path(result):
        traced = _skeletons(result, finite(result.series["position"][:steps]))[:, -1]
        ax.plot(*_shown(ax, traced).T, label="traced", **_TRACE)
        lies_flat = np.ptp(traced, axis=0).argmin() == 2
    _fit(ax, joints, _HIGH if lies_flat else _ELEVATION)
    legend(ax)
    half = (time[-1] - time[0]) / max(1, time.size - 1) / 2
    return ScalarMappable(Normalize(time[0] - half, time[-1] + half), ListedColormap(colours))


def arm_figure(result: Result, below: float = 0.0) -> tuple[Figure, Axes]:
    """Return a figure of the width of a column, and axes for the arm.

    Args:
        result: The run; a planar arm gets plane axes.
        below: Height to leave free below the axes [inch].
    """
    if not is_spatial(result):
        return single(height=3.0 + below)
    height = 3.2 + below
    figure = Figure(figsize=(wide(COLUMN), height))
    box = (0.02, (0.3 + below) / height, 0.86, 2.65 / height)
    return figure, figure.add_axes(box, projection="3d")


def is_spatial(result: Result) -> bool:
    """Return whether the arm leaves a plane z = const, at the start or in the target posture."""
    start, target = result.experiment.start, result.experiment.target
    postures = [start] if target is None else [start, target]
    return bool(np.ptp(_skeletons(result, postures)[..., 2]) > 1e-9)


def frame_space(ax: Any, points: Array) -> None:
    """Set axes in space to equal scales around ``points``, shape (k, 3) [m]."""
    middle = (points.max(axis=0) + points.min(axis=0)) / 2
    half = np.ptp(points, axis=0) / 2
    # A planar path gets some depth: on a thin box, the labels of the edges would overlap.
    half = 1.05 * np.maximum(half, max(0.6 * half.max(), 1e-6))
    ax.set(
        xlim=(middle[0] - half[0], middle[0] + half[0]),
        ylim=(middle[1] - half[1], middle[1] + half[1]),
        zlim=(middle[2] - half[2], middle[2] + half[2]),
    )
    ax.set_box_aspect(half, zoom=1.0)
    for name, axis, length in zip("xyz", (ax.xaxis, ax.yaxis, ax.zaxis), half, strict=True):
        ticks(axis, max(2, round(4 * length / half.max())))
        axis.set_pane_color((0.97, 0.97, 0.97))
        axis.set_label_text(f"{name} [m]")
        axis.labelpad = -1
        axis.set_tick_params(pad=-1)


def _steps_in_motion(result: Result) -> int:
    """Return the number of samples until the joints nearly rest; later postures would overlap."""
    speed = np.abs(result.series["velocity"]).max(axis=1)
    moving = np.flatnonzero(speed > _AT_REST * largest(speed))
    return int(moving[-1]) + 1 if moving.size else 1


def _skeletons(result: Result, postures: Iterable[Array]) -> Array:
    """Return the points of the stick figure in each posture, shape (postures, k, 3) [m]."""
    kinematics = result.experiment.arm.kinematics()
    return np.array([kinematics.skeleton(q) for q in postures])


def _plot_stick(ax: Axes, points: Array, **style: Any) -> None:
    ax.plot(*_shown(ax, points).T, **{"marker": "o", "markersize": 3.0, **style})


def _mark_ends(ax: Axes, points: Array) -> None:
    """Mark base and end effector of a stick figure."""
    base, hand = _shown(ax, points)[[0, -1]]
    mark: Style = {"linestyle": "none", "color": "black", "zorder": 5}
    ax.plot(*base[:, np.newaxis], marker="s", markersize=4.5, **mark)
    ax.plot(*hand[:, np.newaxis], marker="*", markersize=6.5, label="end effector", **mark)


def _shown(ax: Axes, points: Array) -> Array:
    """Return the coordinates of points that the axes show."""
    return points if ax.name == "3d" else points[:, :2]


def _fit(ax: Any, postures: Array, elevation: float = _ELEVATION) -> None:
    """Fit axes to stick figures, shape (postures, k, 3) [m], and label them."""
    if ax.name == "3d":
        ax.view_init(elevation, _azimuth(postures))
        frame_space(ax, postures.reshape(-1, 3))
        # From some directions the label would be upside down.
        ax.zaxis.set_rotate_label(False)
        ax.zaxis.label.set_rotation(90)
        return
    plane_axes(ax, "x [m]", "y [m]", margin=0.08)


def _azimuth(postures: Array) -> float:
    """Return the azimuth [deg] at which the arm looks wide and its postures differ most."""
    change = postures - postures[0]

    def worth(azimuth: float) -> float:
        across = np.array([-np.sin(np.radians(azimuth)), np.cos(np.radians(azimuth))])
        apart = np.hypot(change[..., :2] @ across, change[..., 2])
        return float(np.ptp(postures[..., :2] @ across) * apart.max())

    return max(_AZIMUTHS, key=worth)

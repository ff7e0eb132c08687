"""Axes in space, and the arm in them as a stick figure."""

from __future__ import annotations

from math import ceil
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize, to_rgb
from matplotlib.figure import Figure

from ..inputs.fields import Array
from ..runs.result import Result
from .style import COLOURS, COLUMN, DESIRED, Style, finite, largest, legend, single, ticks
from .traits import first_lap, has_path

_LOOKS: dict[str, Style] = {
    "start": {"color": COLOURS[4], "linewidth": 1.2},
    "end": {"color": COLOURS[5], "linewidth": 2.4},
    "target": {**DESIRED, "markersize": 2.0},
}
#: What the end effector traces, above the arm.
_TRACE: Style = {"color": COLOURS[1], "linewidth": 1.0, "zorder": 4}
#: Postures of a stroboscopic picture, about.
_FLASHES = 20
#: On the way along a path, which is short beside the arm: more would be a smear.
_FLASHES_ALONG = 10
#: Share of its largest speed below which the arm counts as resting.
_AT_REST = 0.02
#: Of the palest of them.
_PALEST = 0.25
_ELEVATION = 20.0
#: From where a path in a horizontal plane is more than a line.
_HIGH = 42.0
#: Views along or across an axis would fold its labels up.
_AZIMUTHS = [quarter + angle for quarter in (-90, 0, 90, 180) for angle in (35, 55)]


def plot_postures(ax: Axes, result: Result) -> None:
    """The arm as it starts, as it ends, and as it should."""
    sound = finite(result.series["position"])
    ends = {"start": sound[0], "end": sound[-1]} if sound.size else {}
    joints = {name: _skeleton(result, q) for name, q in {**ends, "target": _target(result)}.items()}
    for name, points in joints.items():
        _plot_stick(ax, points, label=name, **_LOOKS[name])
    _mark_ends(ax, next(iter(joints.values())))
    _fit(ax, np.array([*joints.values()]))
    legend(ax)


def plot_stroboscope(ax: Axes, result: Result) -> ScalarMappable | None:
    """The arm at equal intervals of time while it moves, along a path for a lap.

    Dense where it is slow.

    Returns:
        What a colour bar shows time by; None if nothing was finite.
    """
    steps, flashes = _steps_in_motion(result), _FLASHES
    if has_path(result):
        steps, flashes = min(steps, int(first_lap(result).sum())), _FLASHES_ALONG
    stride = max(1, ceil(steps / flashes))
    shown = slice(0, stride * flashes + 1, stride)
    time, position = result.time[shown], result.series["position"][shown]
    sound = np.isfinite(position).all(axis=1)
    joints = np.array([_skeleton(result, q) for q in position[sound]])
    if not joints.size:
        return None
    shares = np.linspace(_PALEST, 1.0, time.size)[:, np.newaxis]
    colours = 1.0 - shares * (1.0 - np.array(to_rgb(COLOURS[0])))
    for points, colour in zip(joints, colours[sound], strict=True):
        _plot_stick(ax, points, color=colour, linewidth=0.9, markersize=2.0)
    _mark_ends(ax, joints[0])
    lies_flat = False
    if has_path(result):
        tips = [_skeleton(result, q)[-1] for q in finite(result.series["position"][:steps])]
        traced = np.array(tips)
        ax.plot(*_shown(ax, traced).T, label="traced", **_TRACE)
        lies_flat = np.ptp(traced, axis=0).argmin() == 2
    _fit(ax, joints, _HIGH if lies_flat else _ELEVATION)
    legend(ax)
    half = (time[-1] - time[0]) / max(1, time.size - 1) / 2
    return ScalarMappable(Normalize(time[0] - half, time[-1] + half), ListedColormap(colours))


def arm_figure(result: Result, below: float = 0.0) -> tuple[Figure, Axes]:
    """A figure as wide as a column, with axes for the arm; ``below`` [inch] leaves room."""
    if not is_spatial(result):
        return single(height=3.0 + below)
    height = 3.2 + below
    figure = Figure(figsize=(COLUMN, height))
    box = (0.02, (0.3 + below) / height, 0.86, 2.65 / height)
    return figure, figure.add_axes(box, projection="3d")


def is_spatial(result: Result) -> bool:
    """Whether the arm leaves the plane z = const."""
    setup = result.experiment
    postures = [setup.start] if setup.target is None else [setup.start, setup.target]
    heights = [_skeleton(result, q)[:, 2] for q in postures]
    return bool(np.ptp(heights) > 1e-9)


def frame_space(ax: Any, points: Array) -> None:
    """Axes of equal scale about ``points``, shape (k, 3) [m]."""
    middle = (points.max(axis=0) + points.min(axis=0)) / 2
    half = np.ptp(points, axis=0) / 2
    # A planar path gets some depth, or the labels of a slab's edges would collide.
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
    """Samples until the joints all but rest: of those after, one posture would hide another."""
    speed = np.abs(result.series["velocity"]).max(axis=1)
    moving = np.flatnonzero(speed > _AT_REST * largest(speed))
    return int(moving[-1]) + 1 if moving.size else 1


def _target(result: Result) -> Array:
    target = result.experiment.target
    assert target is not None, "not drawn without one"
    return target


def _skeleton(result: Result, q: Array) -> Array:
    return result.experiment.arm.kinematics().skeleton(q)


def _plot_stick(ax: Axes, points: Array, **style: Any) -> None:
    ax.plot(*_shown(ax, points).T, **{"marker": "o", "markersize": 3.0, **style})


def _mark_ends(ax: Axes, points: Array) -> None:
    base, hand = _shown(ax, points)[[0, -1]]
    mark: Style = {"linestyle": "none", "color": "black", "zorder": 5}
    ax.plot(*base[:, np.newaxis], marker="s", markersize=4.5, **mark)
    ax.plot(*hand[:, np.newaxis], marker="*", markersize=6.5, label="end effector", **mark)


def _shown(ax: Axes, points: Array) -> Array:
    return points if ax.name == "3d" else points[:, :2]


def _fit(ax: Any, postures: Array, elevation: float = _ELEVATION) -> None:
    if ax.name == "3d":
        ax.view_init(elevation, _azimuth(postures))
        frame_space(ax, postures.reshape(-1, 3))
        # From some sides it would stand on its head.
        ax.zaxis.set_rotate_label(False)
        ax.zaxis.label.set_rotation(90)
        return
    ax.margins(0.08)
    ax.set_aspect("equal", adjustable="datalim")
    ticks(ax.xaxis, 6)
    ticks(ax.yaxis, 6)
    ax.set(xlabel="x [m]", ylabel="y [m]")


def _azimuth(postures: Array) -> float:
    """From where the arm looks wide and its postures lie apart."""
    change = postures - postures[0]

    def worth(azimuth: float) -> float:
        across = np.array([-np.sin(np.radians(azimuth)), np.cos(np.radians(azimuth))])
        apart = np.hypot(change[..., :2] @ across, change[..., 2])
        return float(np.ptp(postures[..., :2] @ across) * apart.max())

    return max(_AZIMUTHS, key=worth)

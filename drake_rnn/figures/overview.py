"""The overview: a run on one page.

- The panel of limits: how much of each limit a run uses, and which limits it breaks.
- The arm as a stick figure, in space or in the plane, and axes for it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from math import ceil
from textwrap import wrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from .. import colours as meanings
from ..inputs.fields import Array
from ..measures import place_metrics
from ..runs.limit_use import uses
from ..runs.result import (
    NOT_JUDGED,
    Result,
    Verdict,
    bound_text,
    name_with_ending,
    value_text,
    words_of,
)
from ..signals import TASK_MEASURES, TRACKING
from .force_panels import (
    plot_force,
    plot_force_error,
    plot_image,
    plot_jacobian,
    plot_jacobian_error,
    plot_pixel_error,
    plot_singular_value,
)
from .joint_panels import (
    number,
    plot_acceleration_norm,
    plot_angles,
    plot_drift,
    plot_joint_error,
    plot_moving_bounds,
    plot_torques,
    plot_velocities,
)
from .registry import (
    commands_acceleration,
    draws,
    first_pass,
    has_path,
    has_target,
    moving_bounds_matter,
    presses,
    returns,
)
from .style import (
    ALARM,
    BOUND,
    BROKEN,
    COLUMN,
    INK,
    NOTE,
    PAGE,
    TARGET,
    TRACED,
    Style,
    finite,
    largest,
    legend,
    plane_axes,
    single,
    ticks,
    wide,
)
from .task_panels import (
    plot_distance,
    plot_end_effector,
    plot_on_surface,
    plot_orientation_error,
    plot_path,
    plot_position_error,
    plot_position_error_axes,
    plot_velocity_error,
    task_panel,
)

#: Ratio to a bound from which on the axis is logarithmic beyond the bound.
_FAR = 3.0
#: End of the axis that leaves room for a number, as a multiple of the largest ratio.
_ROOM, _ROOM_BEYOND = 1.25, 30.0


def plot_limits(ax: Axes, result: Result) -> None:
    """Plot a bar for each limit that applies; a broken one is red, with a cross and its ratio."""
    limit_uses = uses(result)
    for row, use in enumerate(limit_uses):
        look: Style = {"color": BROKEN, "hatch": "////", "edgecolor": "white"} if use.broken else {}
        ax.barh(row, use.share, height=0.62, **{"color": INK, "linewidth": 0.0, **look})
        sign, note = ("✗", ALARM) if use.broken else ("✓", NOTE)
        place: Style = {"xytext": (3, 0), "textcoords": "offset points", "va": "center"}
        ax.annotate(f"{sign} {_ratio_text(use.share)}", (max(use.share, 0.0), row), **place, **note)
    ax.axvline(1.0, label="bound", **BOUND)
    _scale(ax, max(use.share for use in limit_uses))
    ax.set_yticks(range(len(limit_uses)), [use.name for use in limit_uses])
    ax.set_ylim(len(limit_uses) - 0.45, -0.55)
    ax.grid(visible=False, axis="y")
    ax.set(xlabel="largest ratio to its bound [-]", ylabel="limit [-]")


def _ratio_text(share: float) -> str:
    """Return a ratio with three digits; with more where these would hide that it is not 1."""
    return f"{share:.3g}" if abs(share - 1.0) > 5e-3 or share == 1.0 else f"{share:.6g}"


def _scale(ax: Axes, most: float) -> None:
    """Set an axis that is linear up to the bound, and logarithmic beyond if a bar goes far."""
    if most < _FAR:
        ax.set_xlim(0.0, _ROOM * max(1.0, most))
        return
    decades = int(np.ceil(np.log10(most)))
    ax.set_xscale("symlog", linthresh=1.0, linscale=max(1.0, decades / 3))
    ax.set_xlim(0.0, _ROOM_BEYOND ** max(0.5, decades / 5) * most)
    step = max(1, decades // 4)
    ax.xaxis.set_major_locator(FixedLocator([0.0, 0.5, *(10.0 ** np.arange(0, decades + 1, step))]))
    ax.xaxis.set_minor_locator(NullLocator())
    ax.xaxis.set_major_formatter(FuncFormatter(lambda x, place: number(x)))


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
    postures = finite(result.series["position"])
    ends = {"start": postures[0], "end": postures[-1]} if postures.size else {}
    target = result.experiment.target
    assert target is not None, "drawn only with a target"
    ends_and_target = {**ends, "target": target}
    joints = _skeletons(result, ends_and_target.values())
    for name, points in zip(ends_and_target, joints, strict=True):
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
    samples = slice(0, stride * flashes + 1, stride)
    time, position = result.time[samples], result.series["position"][samples]
    is_finite = np.isfinite(position).all(axis=1)
    joints = _skeletons(result, position[is_finite])
    if not joints.size:
        return None
    colours = np.linspace(_FIRST, _LAST, time.size)[:, np.newaxis].repeat(3, axis=1)
    for points, colour in zip(joints, colours[is_finite], strict=True):
        _plot_stick(ax, points, color=colour, linewidth=0.9, markersize=2.0)
    _mark_ends(ax, joints[0])
    lies_flat = False
    if has_path(result):
        trace = _skeletons(result, finite(result.series["position"][:steps]))[:, -1]
        ax.plot(*_visible(ax, trace).T, label="traced", **_TRACE)
        lies_flat = np.ptp(trace, axis=0).argmin() == 2
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
    ax.plot(*_visible(ax, points).T, **{"marker": "o", "markersize": 3.0, **style})


def _mark_ends(ax: Axes, points: Array) -> None:
    """Mark base and end effector of a stick figure."""
    base, hand = _visible(ax, points)[[0, -1]]
    mark: Style = {"linestyle": "none", "color": "black", "zorder": 5}
    ax.plot(*base[:, np.newaxis], marker="s", markersize=4.5, **mark)
    ax.plot(*hand[:, np.newaxis], marker="*", markersize=6.5, label="end effector", **mark)


def _visible(ax: Axes, points: Array) -> Array:
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


_Panels = list[tuple[set[str], Callable[[Axes, Result], None]]]


def _plot_bounded_velocities(ax: Axes, result: Result) -> None:
    """Plot the joint velocities between changing bounds that matter, or fixed ones."""
    moving = {"velocity_lower", "velocity_upper"} <= result.series.keys()
    matter = moving and moving_bounds_matter(result)
    (plot_moving_bounds if matter else plot_velocities)(ax, result)


#: Panels of a run along a path, each with the series it needs.
_PANELS: _Panels = [
    ({*TRACKING}, plot_path),
    ({*TRACKING}, plot_position_error),
    ({"orientation_error"}, plot_orientation_error),
    *(({measure.name}, task_panel(measure)) for measure in TASK_MEASURES),
    ({"distance"}, plot_distance),
    ({"position"}, plot_angles),
    ({"velocity"}, plot_velocities),
    ({"torque"}, plot_torques),
    ({"acceleration_peak"}, plot_acceleration_norm),
    ({"J", "network_velocity"}, plot_jacobian),
]
#: Panels of a run in which a camera sees points on the tool.
_IMAGE_PANELS: _Panels = [
    ({"pixels", "pixels_desired"}, plot_image),
    ({"pixels", "pixels_desired"}, plot_pixel_error),
    ({"position"}, plot_angles),
    ({"velocity"}, plot_velocities),
    ({"acceleration_peak"}, plot_acceleration_norm),
    ({"J", "network_velocity"}, plot_jacobian),
]
#: Panels of a run towards a target posture.
_TARGET_PANELS: _Panels = [
    ({"position"}, plot_postures),
    ({"p_WE"}, plot_end_effector),
    ({"position"}, plot_angles),
    ({"joint_error"}, plot_joint_error),
    ({"velocity"}, _plot_bounded_velocities),
    ({"acceleration_peak"}, plot_acceleration_norm),
]
#: Panels of a run in which the joints should return to their start; without torques, the last
#: one takes their place.
_RETURN_PANELS: _Panels = [
    ({*TRACKING}, plot_path),
    ({*TRACKING}, plot_position_error_axes),
    ({"v_WE", "v_WE_desired"}, plot_velocity_error),
    ({"position"}, plot_drift),
    ({"acceleration_peak"}, plot_acceleration_norm),
    ({"torque"}, plot_torques),
    ({"J"}, plot_singular_value),
]
#: Panels of a run in which the tool presses against a surface; without an estimate of the Jacobian,
#: the last one takes its place.
_PRESSING_PANELS: _Panels = [
    ({*TRACKING, "normal_force", "normal_force_desired"}, plot_on_surface),
    ({"normal_force", "normal_force_desired", "normal_force_measured"}, plot_force),
    ({*TRACKING}, plot_position_error),
    ({"orientation_error"}, plot_orientation_error),
    ({"velocity"}, plot_velocities),
    ({"J", "J_hat", "network_velocity"}, plot_jacobian_error),
    ({"normal_force", "normal_force_desired", "normal_force_measured"}, plot_force_error),
]
_MOST_PANELS = 6
#: Heights of the header's title and of each line below it [inch].
_TITLE, _LINE = 0.24, 0.14
#: Width of these lines [characters].
_LINE_WIDTH = 120
#: Heights of a row of panels, of the panel of limits without its bars and of each of these, of the
#: table's head and of each of its lines [inch].
_ROW, _LIMITS, _BAR, _HEAD, _ENTRY = 2.3, 0.45, 0.16, 0.25, 0.165
#: Places beside the left edge of names, as shares of the width: of the right edge of values, and of
#: the left edges of verdicts and bounds.
_VALUE, _VERDICT, _BOUND = 0.325, 0.332, 0.368


@draws(*TRACKING, least=6.5)
def overview(result: Result) -> Figure:
    """Draw path, joints and errors, and a table of the metrics with their expected values."""
    candidates, metrics = _contents(result)
    panels = [plot for needs, plot in candidates if needs <= result.series.keys()]
    if not returns(result):
        # Along an open path, the joints are not expected to return.
        panels = [plot_angles if plot is plot_drift else plot for plot in panels]
    panels = panels[:_MOST_PANELS]
    document = result.experiment.document
    lines = [*wrap(document.paper, _LINE_WIDTH), *wrap(document.expect, _LINE_WIDTH)]
    limits, entries = uses(result), _entries(result, metrics)
    heights = (
        _TITLE + _LINE * len(lines),
        _ROW * ((len(panels) + 1) // 2),
        *([_LIMITS + _BAR * len(limits)] if limits else []),
        _HEAD + _ENTRY * -(-len(entries) // 2),
    )
    figure = Figure(figsize=(wide(PAGE), sum(heights)), layout="constrained")
    parts: Any = figure.subfigures(len(heights), 1, height_ratios=heights)
    header, body, *strip, footer = parts
    _header(header, name_with_ending(document.name or "experiment", result), lines)
    _plot_all(body, panels, result)
    if strip:
        plot_limits(strip[0].add_subplot(), result)
    _table(footer, result, entries)
    return figure


def _plot_all(body: Any, panels: list[Callable[[Axes, Result], None]], result: Result) -> None:
    """Plot panels in two columns; a last one that is alone in its row is as wide as both."""
    grid = body.add_gridspec((len(panels) + 1) // 2, 2)
    for k, plot in enumerate(panels):
        in_space = plot is plot_postures and is_spatial(result)
        alone = k == len(panels) - 1 and k % 2 == 0
        cell = grid[k // 2, :] if alone else grid[k // 2, k % 2]
        if plot is plot_on_surface:
            # A grid of its own: its colour bar then takes no room from the panels below.
            cell = cell.subgridspec(1, 1)[0, 0]
        plot(body.add_subplot(cell, projection="3d" if in_space else None), result)


def _contents(result: Result) -> tuple[_Panels, tuple[str, ...]]:
    """Return panels and names of metrics for the kind of run."""
    if has_target(result):
        return _TARGET_PANELS, place_metrics("posture")
    if presses(result):
        return _PRESSING_PANELS, place_metrics("force")
    if "pixels" in result.series:
        return _IMAGE_PANELS, place_metrics("path")
    if commands_acceleration(result):
        return _RETURN_PANELS, place_metrics("return")
    return _PANELS, place_metrics("path")


def _header(part: Any, name: str, lines: list[str]) -> None:
    """Write a title, and the lines below it."""
    height = _TITLE + _LINE * len(lines)
    part.text(0.5, 1 - 0.04 / height, name, va="top", ha="center", fontsize=11)
    if lines:
        y = 1 - (_TITLE + 0.01) / height
        part.text(0.5, y, "\n".join(lines), va="top", ha="center", fontsize=7.5)


def _entries(result: Result, metrics: tuple[str, ...]) -> list[tuple[str, Verdict | None]]:
    """Return the metrics to write, those with bounds first, with their verdicts."""
    verdicts = {verdict.metric: verdict for verdict in result.verdicts}
    others = [name for name in metrics if name in result.metrics and name not in verdicts]
    return [*verdicts.items(), *((name, None) for name in others)]


def _table(part: Any, result: Result, entries: Sequence[tuple[str, Verdict | None]]) -> None:
    """Write the metrics in two columns, with their expected values and whether these are met."""
    rows = max(1, -(-len(entries) // 2))
    step = 1.0 / (_HEAD / _ENTRY + rows)
    for k, (name, verdict) in enumerate(entries):
        column, row = divmod(k, rows)
        x, y = 0.02 + 0.5 * column, 1.0 - (row + 1.4) * step
        verdict_bound = None if verdict is None else verdict.bound
        value = value_text(name, result.metrics.get(name), verdict_bound)
        is_missed = verdict is not None and verdict.judged and not verdict.met
        style = ALARM if is_missed else {}
        line: Style = {"va": "top", "fontsize": 7}
        part.text(x, y, words_of(name), **line)
        part.text(x + _VALUE, y, value, ha="right", **{**line, **style, "fontsize": 7})
        if verdict is not None:
            bound = bound_text(name, verdict.bound)
            mark = ("✗ no" if is_missed else "✓") if verdict.judged else "–"
            part.text(x + _VERDICT, y, mark, va="top", **(style or NOTE))
            part.text(x + _BOUND, y, bound, va="top", **(style or NOTE))
        if row == 0:
            top = 1.0 - 0.4 * step
            part.text(x + _VALUE, top, "value", va="top", ha="right", **NOTE)
            if any(other is not None for _, other in entries[k : k + rows]):
                text = f"expected, {NOT_JUDGED}" if result.ending else "expected"
                part.text(x + _BOUND, top, text, va="top", **NOTE)

"""The overview: a run on one page."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from textwrap import wrap
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..measures import shown_in
from ..runs.limit_use import uses
from ..runs.result import Result
from ..runs.told_metrics import told_bound, told_value, words_of
from ..runs.verdict import Verdict
from ..signals import TRACKING
from .force_panels import plot_force, plot_force_error
from .image_panels import plot_image, plot_pixel_error
from .jacobian_panels import plot_jacobian, plot_jacobian_error, plot_singular_value
from .joint_panels import (
    plot_acceleration_norm,
    plot_angles,
    plot_drift,
    plot_joint_error,
    plot_moving_bounds,
    plot_torques,
    plot_velocities,
)
from .limit_panel import plot_limits
from .looks import ALARM, NOTE, Style
from .paper import wide
from .registry import draws
from .space import is_spatial, plot_postures
from .style import PAGE
from .surface import plot_on_surface
from .task_panels import (
    plot_distance,
    plot_end_effector,
    plot_orientation_error,
    plot_path,
    plot_position_error,
    plot_position_error_axes,
    plot_velocity_error,
)
from .traits import commands_acceleration, has_target, moving_bounds_matter, presses, returns

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
    ({"distance"}, plot_distance),
    ({"position"}, plot_angles),
    ({"velocity"}, plot_velocities),
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
    _header(header, document.name or "experiment", lines)
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
        return _TARGET_PANELS, shown_in("posture")
    if presses(result):
        return _PRESSING_PANELS, shown_in("force")
    if "pixels" in result.series:
        return _IMAGE_PANELS, shown_in("path")
    if commands_acceleration(result):
        return _RETURN_PANELS, shown_in("return")
    return _PANELS, shown_in("path")


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
        value = told_value(name, result.metrics.get(name))
        missed = verdict is not None and not verdict.met
        style = ALARM if missed else {}
        line: Style = {"va": "top", "fontsize": 7}
        part.text(x, y, words_of(name), **line)
        part.text(x + _VALUE, y, value, ha="right", **{**line, **style, "fontsize": 7})
        if verdict is not None:
            bound = told_bound(name, verdict.bound)
            part.text(x + _VERDICT, y, "✗ no" if missed else "✓", va="top", **(style or NOTE))
            part.text(x + _BOUND, y, bound, va="top", **(style or NOTE))
        if row == 0:
            top = 1.0 - 0.4 * step
            part.text(x + _VALUE, top, "value", va="top", ha="right", **NOTE)
            if any(other is not None for _, other in entries[k : k + rows]):
                part.text(x + _BOUND, top, "expected", va="top", **NOTE)

"""The overview: a run on one page."""

from __future__ import annotations

from collections.abc import Callable
from textwrap import wrap
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..experiment import expected_bounds
from ..measures import shown_in
from ..runs.result import Result
from .force_panels import plot_force, plot_force_error
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
from .registry import draws
from .space import is_spatial, plot_postures
from .style import COLOURS, NOTE, PAGE, Style
from .surface import plot_on_surface
from .task_panels import (
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
    ({"p_WE", "p_WE_desired"}, plot_path),
    ({"p_WE", "p_WE_desired"}, plot_position_error),
    ({"orientation_error"}, plot_orientation_error),
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
    ({"p_WE", "p_WE_desired"}, plot_path),
    ({"p_WE", "p_WE_desired"}, plot_position_error_axes),
    ({"v_WE", "v_WE_desired"}, plot_velocity_error),
    ({"position"}, plot_drift),
    ({"acceleration_peak"}, plot_acceleration_norm),
    ({"torque"}, plot_torques),
    ({"J"}, plot_singular_value),
]
#: Panels of a run in which the tool presses against a surface; without an estimate of the Jacobian,
#: the last one takes its place.
_PRESSING_PANELS: _Panels = [
    ({"p_WE", "p_WE_desired", "normal_force", "normal_force_desired"}, plot_on_surface),
    ({"normal_force", "normal_force_desired", "normal_force_measured"}, plot_force),
    ({"p_WE", "p_WE_desired"}, plot_position_error),
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


@draws("p_WE", "p_WE_desired")
def overview(result: Result) -> Figure:
    """Draw path, joints and errors, and a table of the metrics with their expected values."""
    candidates, metrics = _contents(result)
    panels = [plot for needs, plot in candidates if needs <= result.series.keys()]
    if not returns(result):
        # Along an open path nothing should return.
        panels = [plot_angles if plot is plot_drift else plot for plot in panels]
    panels = panels[:_MOST_PANELS]
    rows = (len(panels) + 1) // 2
    document = result.experiment.document
    lines = [*wrap(document.paper, _LINE_WIDTH), *wrap(document.expect, _LINE_WIDTH)]
    heights = (_TITLE + _LINE * len(lines), 2.3 * rows, 1.3)
    figure = Figure(figsize=(PAGE, sum(heights)), layout="constrained")
    parts: Any = figure.subfigures(3, 1, height_ratios=heights)
    header, body, footer = parts
    _header(header, document.name or "experiment", lines)
    grid = body.add_gridspec(rows, 2)
    for k, plot in enumerate(panels):
        in_space = plot is plot_postures and is_spatial(result)
        cell = grid[k // 2, k % 2]
        if plot is plot_on_surface:
            # A grid of its own: its colour bar then takes no room from the panels below.
            cell = cell.subgridspec(1, 1)[0, 0]
        plot(body.add_subplot(cell, projection="3d" if in_space else None), result)
    _table(footer, result, metrics)
    return figure


def _contents(result: Result) -> tuple[_Panels, tuple[str, ...]]:
    """Return panels and names of metrics for the kind of run."""
    if has_target(result):
        return _TARGET_PANELS, shown_in("posture")
    if presses(result):
        return _PRESSING_PANELS, shown_in("force")
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


def _table(part: Any, result: Result, metrics: tuple[str, ...]) -> None:
    """Write the metrics in two columns, with the values that the experiment expects."""
    accept, bounds = result.experiment.document.accept, expected_bounds(result.experiment)
    names = [name for name in dict.fromkeys((*accept, *metrics)) if name in result.metrics]
    rows = max(1, (len(names) + 1) // 2)
    for k, name in enumerate(names):
        column, row = divmod(k, rows)
        x, y = 0.04 + 0.5 * column, 0.95 - 0.92 * (row + 1) / max(rows + 1, 6)
        accepted, value = bounds.get(name), result.metrics[name]
        missed = accepted is not None and not accepted.holds(value)
        part.text(x, y, name, fontsize=7, va="top")
        style: Style = {"color": COLOURS[1], "weight": "bold"} if missed else {}
        part.text(
            x + 0.33, y, f"{value:.4g}".replace("-", "−"), fontsize=7, va="top", ha="right", **style
        )
        if accepted is not None:
            text = str(accepted).replace("<=", "≤").replace(">=", "≥")
            part.text(x + 0.35, y, text, va="top", **NOTE)
        if row == 0:
            part.text(x + 0.33, 0.95, "value", va="top", ha="right", **NOTE)
            if any(other in bounds for other in names[k : k + rows]):
                part.text(x + 0.35, 0.95, "expected", va="top", **NOTE)

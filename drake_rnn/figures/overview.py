"""One page that sums a run up."""

from __future__ import annotations

from collections.abc import Callable
from textwrap import wrap
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..measures import shown_in
from ..runs.result import Result
from .force_panels import plot_force, plot_force_error
from .jacobian_panels import plot_jacobian_error, plot_least_known, plot_singular_value
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
from .traits import bounds_are_felt, commands_acceleration, has_target, presses

_Panels = list[tuple[set[str], Callable[[Axes, Result], None]]]


def _plot_velocities(ax: Axes, result: Result) -> None:
    """Between the bounds that matter."""
    moving = {"velocity_lower", "velocity_upper"} <= result.series.keys()
    felt = moving and bounds_are_felt(result)
    (plot_moving_bounds if felt else plot_velocities)(ax, result)


_PANELS: _Panels = [
    ({"p_WE", "p_WE_desired"}, plot_path),
    ({"p_WE", "p_WE_desired"}, plot_position_error),
    ({"position"}, plot_angles),
    ({"velocity"}, plot_velocities),
    ({"acceleration_peak"}, plot_acceleration_norm),
    ({"J", "network_velocity"}, plot_least_known),
]
#: In their stead where a posture is sought.
_TARGET_PANELS: _Panels = [
    ({"position"}, plot_postures),
    ({"p_WE"}, plot_end_effector),
    ({"position"}, plot_angles),
    ({"joint_error"}, plot_joint_error),
    ({"velocity"}, _plot_velocities),
    ({"acceleration_peak"}, plot_acceleration_norm),
]
#: And where the joints are to return; the last but where there are torques.
_RETURN_PANELS: _Panels = [
    ({"p_WE", "p_WE_desired"}, plot_path),
    ({"p_WE", "p_WE_desired"}, plot_position_error_axes),
    ({"v_WE", "v_WE_desired"}, plot_velocity_error),
    ({"position"}, plot_drift),
    ({"acceleration_peak"}, plot_acceleration_norm),
    ({"torque"}, plot_torques),
    ({"J"}, plot_singular_value),
]
#: And where a tool is pressed against a surface; the last where there is room.
_PRESSING_PANELS: _Panels = [
    ({"p_WE", "p_WE_desired", "normal_force", "normal_force_desired"}, plot_on_surface),
    ({"normal_force", "normal_force_desired", "normal_force_measured"}, plot_force),
    ({"p_WE", "p_WE_desired"}, plot_position_error),
    ({"orientation_error"}, plot_orientation_error),
    ({"velocity"}, plot_velocities),
    ({"J", "J_hat", "network_velocity"}, plot_jacobian_error),
    ({"normal_force", "normal_force_desired", "normal_force_measured"}, plot_force_error),
]
_MOST = 6
#: Height of the header's name and of each line below it [inch].
_TITLE, _LINE = 0.24, 0.14
#: Of those lines, whose room is known before they are drawn.
_LETTERS = 120


@draws("p_WE", "p_WE_desired")
def overview(result: Result) -> Figure:
    """One page: path, joints, errors, and the metrics beside what they are expected to be."""
    every, names = _contents(result)
    panels = [plot for needs, plot in every if needs <= result.series.keys()][:_MOST]
    rows = (len(panels) + 1) // 2
    told = [
        *wrap(result.experiment.document.paper, _LETTERS),
        *wrap(result.experiment.document.expect, _LETTERS),
    ]
    heights = (_TITLE + _LINE * len(told), 2.3 * rows, 1.3)
    figure = Figure(figsize=(PAGE, sum(heights)), layout="constrained")
    parts: Any = figure.subfigures(3, 1, height_ratios=heights)
    header, body, footer = parts
    _header(header, result.experiment.name or "experiment", told)
    grid = body.add_gridspec(rows, 2)
    for k, plot in enumerate(panels):
        in_space = plot is plot_postures and is_spatial(result)
        cell = grid[k // 2, k % 2]
        if plot is plot_on_surface:
            # Its colour bar takes its own room, not that of the panels below.
            cell = cell.subgridspec(1, 1)[0, 0]
        plot(body.add_subplot(cell, projection="3d" if in_space else None), result)
    _table(footer, result, names)
    return figure


def _contents(result: Result) -> tuple[_Panels, tuple[str, ...]]:
    """Panels and metrics that say what a law is about."""
    if has_target(result):
        return _TARGET_PANELS, shown_in("posture")
    if presses(result):
        return _PRESSING_PANELS, shown_in("force")
    if commands_acceleration(result):
        return _RETURN_PANELS, shown_in("return")
    return _PANELS, shown_in("path")


def _header(part: Any, name: str, told: list[str]) -> None:
    """Lines below the name, if there is anything to be told."""
    height = _TITLE + _LINE * len(told)
    part.text(0.5, 1 - 0.04 / height, name, va="top", ha="center", fontsize=11)
    if told:
        y = 1 - (_TITLE + 0.01) / height
        part.text(0.5, y, "\n".join(told), va="top", ha="center", fontsize=7.5)


def _table(part: Any, result: Result, common: tuple[str, ...]) -> None:
    """Metrics in two columns, each beside what the experiment accepts."""
    accept = result.experiment.document.accept
    names = [name for name in dict.fromkeys((*accept, *common)) if name in result.metrics]
    rows = max(1, (len(names) + 1) // 2)
    for k, name in enumerate(names):
        column, row = divmod(k, rows)
        x, y = 0.04 + 0.5 * column, 0.95 - 0.92 * (row + 1) / max(rows + 1, 6)
        accepted, value = accept.get(name), result.metrics[name]
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
            if any(other in accept for other in names[k : k + rows]):
                part.text(x + 0.35, 0.95, "expected", va="top", **NOTE)

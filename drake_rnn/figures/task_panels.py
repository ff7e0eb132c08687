"""Panels of the end effector's motion; each function draws on given axes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ..inputs.fields import Array
from ..measures import prefixed
from ..runs.result import Result
from ..signals import TRACKING
from .ends import mark_ends
from .looks import BEHIND, BOUND, DESIRED, INK, MOMENT, PREDICTED, TRACED, Style, nth
from .style import (
    depths,
    finite,
    label,
    largest,
    legend,
    log_axis,
    mark_times,
    noisy,
    plane_axes,
    time_axis,
)
from .surface import surface_axes
from .traits import first_pass, has_path, presses, strokes_of
from .transients import in_view, keep_in_view


def plot_path(ax: Axes, result: Result) -> None:
    """Plot the desired and the traced path in the plane in which the former varies most."""
    p_WE, desired = (strokes_of(result, name) for name in TRACKING)
    a, b = sorted(np.argsort(np.ptp(finite(desired), axis=0), kind="stable")[-2:].tolist())
    ax.plot(p_WE[:, a], p_WE[:, b], label="traced", **TRACED)
    once = first_pass(result)
    ax.plot(desired[once, a], desired[once, b], label="desired", **DESIRED)
    mark_ends(ax, result, *(result.series[name][:, [a, b]] for name in TRACKING))
    plane_axes(ax, f"{'xyz'[a]} [m]", f"{'xyz'[b]} [m]")
    legend(ax)


def plot_position_error(ax: Axes, result: Result) -> None:
    """Plot the norm of the position error, and when it has settled."""
    tolerance = result.experiment.document.settling_tolerance_m
    ax.plot(result.time, result.position_error, color=INK)
    ax.axhline(tolerance, label="settling tolerance", **BOUND)
    if (settled := result.metrics.get("settling_time_s", 0.0)) > 0:
        ax.axvline(settled, label=f"settled at {settled:.2f} s", **MOMENT)
    mark_times(ax, result)
    log_axis(ax, [result.position_error, tolerance * np.array([0.6, 1.6])])
    if not has_path(result):
        # The error starts at zero: a line from there would run along the axis.
        ax.set_yscale("log", nonpositive="mask")
    time_axis(ax, result, label(_along(result, "position error"), "p_WE"))
    legend(ax)


def plot_position_error_axes(ax: Axes, result: Result) -> None:
    """Plot the position error along each axis, and its norm."""
    error = result.series["p_WE"] - result.desired_position
    _plot_error(ax, result, error, "position error", "m", norm="norm")
    mark_times(ax, result)
    legend(ax)


def plot_velocity_error(ax: Axes, result: Result) -> None:
    """Plot the velocity error along each axis, with the error that the law's theory predicts."""
    error = result.series["v_WE"] - result.series["v_WE_desired"]
    predicted = result.series.get("velocity_error_predicted")
    if predicted is None:
        _plot_error(ax, result, error, "velocity error", "m/s")
    else:
        pale: Style = {"linestyle": "-", "linewidth": 2.6, "alpha": 0.4}
        scale = _plot_axes(ax, result, error, "velocity error", "m/s", **pale)
        for k, column in enumerate(predicted.T):
            ax.plot(result.time, scale * column, **{**PREDICTED, "color": nth(k)["color"]})
        ax.plot([], [], label=r"predicted, $\sigma$", **PREDICTED)
        keep_in_view(ax, result, np.hstack((error, predicted)), "m/s", scale)
    mark_times(ax, result)
    legend(ax)


def plot_end_effector(ax: Axes, result: Result) -> None:
    """Plot the end effector's distance from its start, and that which the multipliers imply."""
    moved = result.series["p_WE"] - result.series["p_WE"][0]
    scale = _plot_axes(ax, result, moved, "end-effector drift", "m", norm="distance")
    if "displacement" in result.series:
        implied = result.series["displacement"] - result.series["displacement"][0]
        lines = ax.plot(result.time, scale * implied, **PREDICTED)
        lines[0].set_label("by the multipliers")
    legend(ax)


def plot_rotation(ax: Axes, result: Result) -> None:
    """Plot the angle between the end effector and the orientation that it should keep."""
    ax.plot(result.time, 1e3 * result.series["orientation_error"], color=INK)
    ax.set_ylim(bottom=0)
    time_axis(ax, result, "orientation error [mrad]")


def plot_distance(ax: Axes, result: Result) -> None:
    """Plot the least distance from obstacles and from the arm itself, and what the law keeps."""
    distance = result.series["distance"]
    shown, scale = prefixed(largest(distance), "m")
    ax.plot(result.time, scale * distance, color=INK)
    floor = result.experiment.guarantees.command.distance
    ax.axhline(scale * (floor or 0.0), **BOUND)
    ax.set_ylim(bottom=min(0.0, 1.06 * scale * float(np.nanmin(distance, initial=0.0))))
    time_axis(ax, result, f"least distance [{shown}]")


def plot_orientation_error(ax: Axes, result: Result) -> None:
    """Plot the angle between the end effector and its desired orientation.

    The axis suits the values in the window.
    """
    error = result.series["orientation_error"]
    shown, scale = prefixed(largest(in_view(result, error)), "rad")
    ax.plot(result.time, scale * error, color=INK, linewidth=0.6 if noisy(error) else 1.0)
    mark_times(ax, result)
    ax.set_ylim(0, 1.06 * scale * largest(error) or None)
    time_axis(ax, result, f"orientation error [{shown}]")
    keep_in_view(ax, result, error, "rad", scale)
    legend(ax)


def _plot_error(
    ax: Axes, result: Result, error: Array, text: str, unit: str, norm: str = ""
) -> None:
    """Plot an error along each axis; on a surface, along the surface's axes.

    Across the surface, the force is controlled and not the position.

    Args:
        ax: The axes.
        result: The run.
        error: Shape (k, m).
        text: Label of the axis, without the unit.
        unit: Unit of the error.
        norm: Label of its norm; the norm is not plotted if it is empty.
    """
    names: Sequence[str] = "xyz"
    if presses(result):
        axes, names = surface_axes(result)
        error = error @ axes.T
    style: Style = {"linewidth": 0.5, "alpha": 0.7} if noisy(error) else {}
    scale = _plot_axes(ax, result, error, _along(result, text), unit, norm, names, **style)
    shown = np.column_stack((error, np.linalg.norm(error, axis=1))) if norm else error
    keep_in_view(ax, result, shown, unit, scale)


def _along(result: Result, text: str) -> str:
    """Return a label that says whether an error is that along the surface."""
    return f"{text}\nalong the surface" if presses(result) else text


def _plot_axes(
    ax: Axes,
    result: Result,
    values: Array,
    text: str,
    unit: str,
    norm: str = "",
    names: Sequence[str] = "xyz",
    **style: Any,
) -> float:
    """Plot the components of vectors, with a unit that suits them.

    Args:
        ax: The axes.
        result: The run.
        values: Vectors, shape (k, m).
        text: Label of the axis, without the unit.
        unit: Unit of the values.
        norm: Label of their norm; the norm is not plotted if it is empty.
        names: Names of the components.
        style: Line style.

    Returns:
        Factor from ``unit`` to the unit shown.
    """
    shown, scale = prefixed(largest(in_view(result, values)), unit)
    if norm:
        size = scale * np.linalg.norm(values, axis=1)
        ax.plot(result.time, size, label=norm, **BEHIND)
    order = depths(values)
    for k, (name, column) in enumerate(zip(names, values.T, strict=False)):
        look = {**nth(k), "linewidth": 1.2, "zorder": order[k], **style}
        ax.plot(result.time, scale * column, label=name, **look)
    time_axis(ax, result, f"{text} [{shown}]")
    return scale

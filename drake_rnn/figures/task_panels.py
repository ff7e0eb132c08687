"""Panels of the end effector's motion; each function draws on given axes.

- Axes that show the curves after a transient, with a note of how far the transient goes beyond.
- Markers of where a path begins and ends.
- The path on the surface that a tool presses against, as seen from above.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import ceil
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import BoundaryNorm, ListedColormap, to_rgb
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from ..features.contact import Contact
from ..inputs.fields import Array
from ..measures import format_quantity, prefix_unit
from ..runs.result import Result
from ..signals import TRACKING, TaskMeasure
from .registry import first_pass, has_path, open_end, presses, samples_in_window, strokes_of
from .style import (
    BEHIND,
    BOUND,
    DESIRED,
    FORCE,
    INK,
    MOMENT,
    NOTE,
    PREDICTION,
    SERIES,
    TRACED,
    Style,
    depths,
    finite,
    label,
    largest,
    legend,
    log_axis,
    mark_times,
    noisy,
    nth,
    plane_axes,
    span,
    time_axis,
)

#: Ratio of the values before to the values after from which on only the latter are in view.
_OUTSIZE = 4.0
#: Share of a run without a window that may be a transient.
_EARLY = 0.1
#: Room beyond the curves in view, as a share of their range.
_ROOM, _ROOM_FOR_NUMBERS = 0.15, 0.35


def keep_in_view(ax: Axes, result: Result, values: Array, unit: str, scale: float = 1.0) -> None:
    """Limit the y-axis to the values after a transient, if the transient would flatten them.

    After a transient is the window, or without one what follows the first tenth of the run. Where
    curves leave the view, an arrow and a number at its edge say how far they go, in a unit that
    suits the number.

    Args:
        ax: The axes, from the result's first sample to its last.
        result: The run.
        values: All that is drawn, shape (k,) or (k, m).
        unit: SI unit of the values.
        scale: Factor from it to the unit of the axis.
    """
    values = scale * values.reshape(result.time.size, -1)
    visible = in_view(result, values)
    if visible is values:
        return
    low, high = span(np.append(visible.ravel(), 0.0), least=0.0)
    room = high - low
    bottom = low - _ROOM_FOR_NUMBERS * room if low < 0.0 else 0.0
    top = high + (_ROOM_FOR_NUMBERS if high > 0.0 else _ROOM) * room
    ax.set_ylim(bottom, top)
    finite_values = np.where(np.isfinite(values), values, 0.0)
    for extremes, edge, sign in (
        (finite_values.max(axis=1), top, 1.0),
        (finite_values.min(axis=1), bottom, -1.0),
    ):
        if sign * (peak := extremes[np.argmax(sign * extremes)]) > sign * edge:
            time = float(result.time[np.argmax(sign * extremes)])
            _mark(ax, time, edge, format_quantity(float(peak) / scale, unit, 3))


def in_view(result: Result, values: Array) -> Array:
    """Return the ``values`` in view, shape (j, ..): all of them, or those after a transient.

    Args:
        result: The run.
        values: A series, shape (k, ..).
    """
    after = values[_after(result)]
    return after if largest(values) > _OUTSIZE * largest(after) > 0.0 else values


def _after(result: Result) -> NDArray[np.bool_]:
    """Return which samples come after a transient, shape (k,)."""
    if result.experiment.document.window is not None:
        return samples_in_window(result)
    start, end = result.time[0], result.time[-1]
    return np.asarray(result.time >= start + _EARLY * (end - start))


def _mark(ax: Axes, time: float, edge: float, peak: str) -> None:
    """Mark a peak beyond the edge of the view with an arrow and its value."""
    up = edge == ax.get_ylim()[1]
    start, end = ax.get_xlim()
    before = time < (start + end) / 2.0
    arrow: Style = {"marker": "^" if up else "v", "s": 16.0, "color": NOTE["color"]}
    ax.scatter([time], [edge], clip_on=False, zorder=6, **arrow)
    ax.annotate(
        f"{peak} at {time:.3g} s".replace("-", "−"),
        (time, edge),
        xytext=(5.0 if before else -5.0, -1.0 if up else 1.0),
        textcoords="offset points",
        ha="left" if before else "right",
        va="top" if up else "bottom",
        annotation_clip=False,
        zorder=6,
        bbox={"facecolor": "white", "alpha": 0.8, "linewidth": 0, "pad": 0.5},
        **NOTE,
    )


_START: Style = {"marker": "o", "color": "black", "markersize": 3.5, "linestyle": "none"}
_END: Style = {**_START, "marker": "s", "markersize": 5.0, "markerfacecolor": "none"}


def mark_ends(ax: Any, result: Result, trace: Array, desired: Array) -> None:
    """Mark where the traced path starts and, if it is open, where the desired one ends.

    Args:
        ax: Axes, plane or in space.
        result: The run.
        trace: Points of the traced path in the coordinates of the axes, shape (k, 2) or (k, 3).
        desired: Those of the desired path, of the same shape.
    """
    ax.plot(*trace[:1].T, label="start", **_START)
    if (end := open_end(result)).any():
        ax.plot(*desired[end].T, label="end", **_END)


#: Relative error up to which a force counts as near the desired one.
NEAR = 0.05

#: Vertical part of the normal below which a surface is a wall: it is read with its top up.
_WALL = 0.7
#: The desired force has the colour of forces, smaller ones are paler and larger ones darker: these
#: are the ends, and the ways towards them in the order of the distance from the desired force.
_PALE, _DARK = "#F3E9A6", "#06170F"
_WAYS = (0.42, 0.65, 0.85, 1.0)
#: Widths of a colour's range to choose from, relative to the desired force. None is narrower: that
#: would show differences between forces that are all near the desired one.
_STEPS = (0.02, 0.05, 0.1, 0.2, 0.25, 0.5, 1.0)
#: Smallest extent of the axes, for a curve that hardly moves [mm].
_LEAST = 1.0


def surface_axes(result: Result) -> tuple[Array, list[str]]:
    """Return two axes along the surface, to the right and up as its drawing is read.

    It is seen from where the tool is, against the normal. On a wall, up is the base's z-axis
    projected onto it. Elsewhere, as on a table, the first axis is the base's x-axis projected.

    Returns:
        Unit vectors, shape (2, 3), and for each the name of the closest axis of the base, with its
        sign.
    """
    n = _contact(result).surface.normal_W
    is_wall = abs(n[2]) < _WALL
    base = np.eye(3)[2 if is_wall else 0]
    along = base - n.dot(base) * n
    along /= np.linalg.norm(along)
    axes = np.stack((np.cross(along, n), along) if is_wall else (along, np.cross(n, along)))
    closest = np.abs(axes).round(9).argmax(axis=1)
    signs = ["−" if axis[k] < 0 else "" for axis, k in zip(axes, closest, strict=True)]
    return axes, [sign + "xyz"[k] for sign, k in zip(signs, closest, strict=True)]


def surface_coordinates(result: Result, points: Array) -> Array:
    """Return coordinates along the surface, shape (k, 2) [m], from the desired path's start.

    Args:
        result: The run.
        points: Shape (k, 3) [m].
    """
    axes, _ = surface_axes(result)
    return np.asarray((points - result.desired_position[0]) @ axes.T)


def desired_at_tool_height(result: Result) -> Array:
    """Return the desired path moved along the normal to the tool's height, shape (k, 3) [m].

    Along the normal, the force is controlled and not the position. The remaining distance to the
    tool is the position error.
    """
    n = _contact(result).surface.normal_W
    points = result.desired_position
    height = (result.series["p_WE"] - points) @ n
    # The height of a run that diverged may not be finite.
    return np.asarray(points + np.outer(np.where(np.isfinite(height), height, 0.0), n))


def plot_on_surface(ax: Axes, result: Result) -> None:
    """Plot the path on the surface as seen from above, coloured by the normal force."""
    trace = 1e3 * surface_coordinates(result, result.series["p_WE"])
    path_on_surface = 1e3 * surface_coordinates(result, result.desired_position)
    unit, scale = prefix_unit(largest(result.series["normal_force_desired"]), "N")
    force = scale * result.series["normal_force"]
    edges, colours = force_scale(result)
    edges = scale * edges
    curve = LineCollection(
        list(np.stack((trace[:-1], trace[1:]), axis=1)),
        array=(force[:-1] + force[1:]) / 2,
        norm=BoundaryNorm(edges.tolist(), colours.N),
        cmap=colours,
        linewidth=4.4,
        capstyle="round",
    )
    ax.add_collection(curve)
    # A thin line on top: the error is usually smaller than the width of the coloured curve.
    once = first_pass(result)
    edge: Style = {"path_effects": [withStroke(linewidth=1.6, foreground="white")]}
    ax.plot(
        *path_on_surface[once].T, label="desired", zorder=3, **{**DESIRED, "linewidth": 0.8, **edge}
    )
    mark_ends(ax, result, trace, path_on_surface)
    points = finite(np.concatenate((trace, path_on_surface)))
    ax.update_datalim(np.stack([span(values, least=_LEAST) for values in points.T], axis=1))
    across, up = surface_axes(result)[1]
    plane_axes(ax, f"{across} along the surface [mm]", f"{up} along the surface [mm]")
    figure: Any = ax.figure
    place: Style = {"ax": ax, "aspect": 25, "pad": 0.02, "spacing": "proportional"}
    bar = figure.colorbar(curve, extend=_beyond(force, edges[0], edges[-1]), format="%.4g", **place)
    bar.ax.axhline(scale * _desired_force(result), **DESIRED)
    bar.set_label(f"normal force [{unit}]")
    bar.outline.set_visible(False)
    legend(ax)


def force_scale(result: Result) -> tuple[Array, ListedColormap]:
    """Return the edges of the colours' ranges of force, ascending [N], and the colours.

    The desired force is in the middle of the range of one colour, which is the same in every run.
    The others cover the forces in the window; if they covered the first contact as well, all forces
    in the window would have one colour.
    """
    desired = _desired_force(result)
    # The range to tell apart: the forces in the window, and those near the desired one.
    near = desired * np.array([1 - NEAR, 1 + NEAR])
    force = result.series["normal_force"][samples_in_window(result)]
    low, high = span(np.concatenate((force, near)), least=0.0)
    low = max(0.0, low)
    most = len(_WAYS) + 0.5
    far = max(desired - low, high - desired)
    step = desired * next((s for s in _STEPS if far <= most * s * desired), far / (most * desired))
    # The colour in the middle takes half a step; a rounding error needs no further colour.
    beyond = ((off / step - 0.5 - 1e-9) for off in (desired - low, high - desired))
    less, more = (max(0, ceil(steps)) for steps in beyond)
    paler, darker = (_towards(end) for end in (_PALE, _DARK))
    edges = desired + step * (np.arange(-less, more + 2) - 0.5)
    tints = [*paler[:less][::-1], to_rgb(FORCE["color"]), *darker[:more]]
    return edges.clip(min=0.0), ListedColormap(tints)


def _towards(end: str) -> list[tuple[float, ...]]:
    """Return colours on the way from the colour of forces to another colour."""
    start, stop = (np.array(to_rgb(colour)) for colour in (FORCE["color"], end))
    return [tuple(start + way * (stop - start)) for way in _WAYS]


def _contact(result: Result) -> Contact:
    """Return the contact of a run that has one."""
    contact = result.experiment.contact
    assert contact is not None, "drawn only with a contact"
    return contact


def _desired_force(result: Result) -> float:
    """Return the desired force once it has risen [N]."""
    return _contact(result).force.scale


def _beyond(values: Array, low: float, high: float) -> str:
    """Return which ends of the colour bar stand for values beyond them."""
    # Without contact, the force may be negative by a rounding error.
    rounding = 1e-6 * (high - low)
    below, above = bool((values < low - rounding).any()), bool((values > high + rounding).any())
    return ("both" if above else "min") if below else ("max" if above else "neither")


def plot_path(ax: Axes, result: Result) -> None:
    """Plot the desired and the traced path in the plane in which the former varies most."""
    p_WE, desired_strokes = (strokes_of(result, name) for name in TRACKING)
    a, b = sorted(np.argsort(np.ptp(finite(desired_strokes), axis=0), kind="stable")[-2:].tolist())
    ax.plot(p_WE[:, a], p_WE[:, b], label="traced", **TRACED)
    once = first_pass(result)
    ax.plot(desired_strokes[once, a], desired_strokes[once, b], label="desired", **DESIRED)
    mark_ends(ax, result, *(result.series[name][:, [a, b]] for name in TRACKING))
    plane_axes(ax, f"{'xyz'[a]} [m]", f"{'xyz'[b]} [m]")
    legend(ax)


def plot_position_error(ax: Axes, result: Result) -> None:
    """Plot the norm of the position error, and when it has settled."""
    tolerance = result.experiment.document.settling_tolerance_m
    ax.plot(result.time, result.position_error, color=INK)
    ax.axhline(tolerance, label="settling tolerance", **BOUND)
    if (settling_time := result.metrics.get("settling_time_s", 0.0)) > 0:
        ax.axvline(settling_time, label=f"settled at {settling_time:.2f} s", **MOMENT)
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
    prediction = result.series.get("velocity_error_predicted")
    if prediction is None:
        _plot_error(ax, result, error, "velocity error", "m/s")
    else:
        pale: Style = {"linestyle": "-", "linewidth": 2.6, "alpha": 0.4}
        scale = _plot_axes(ax, result, error, "velocity error", "m/s", **pale)
        for k, column in enumerate(prediction.T):
            ax.plot(result.time, scale * column, **{**PREDICTION, "color": nth(k)["color"]})
        ax.plot([], [], label=r"predicted, $\sigma$", **PREDICTION)
        keep_in_view(ax, result, np.hstack((error, prediction)), "m/s", scale)
    mark_times(ax, result)
    legend(ax)


def plot_end_effector(ax: Axes, result: Result) -> None:
    """Plot the end effector's distance from its start, and that which the multipliers imply."""
    displacement = result.series["p_WE"] - result.series["p_WE"][0]
    scale = _plot_axes(ax, result, displacement, "end-effector drift", "m", norm="distance")
    if "displacement" in result.series:
        displacement_sum = result.series["displacement"] - result.series["displacement"][0]
        lines = ax.plot(result.time, scale * displacement_sum, **PREDICTION)
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
    unit, scale = prefix_unit(largest(distance), "m")
    ax.plot(result.time, scale * distance, color=INK)
    if (between := result.series.get("arms_distance")) is not None:
        ax.lines[-1].set_label("of all")
        ax.plot(result.time, scale * between, color=SERIES[0], label="of the arms")
        for k, threshold in enumerate(result.experiment.law.arms_thresholds or ()):
            text = None if k else "outer, inner"
            ax.axhline(scale * threshold, color=SERIES[0], linestyle=":", label=text)
        legend(ax)
    floor = result.experiment.guarantees.command.distance
    ax.axhline(scale * (floor or 0.0), **BOUND)
    ax.set_ylim(bottom=min(0.0, 1.06 * scale * float(np.nanmin(distance, initial=0.0))))
    time_axis(ax, result, f"least distance [{unit}]")


def plot_orientation_error(ax: Axes, result: Result) -> None:
    """Plot the angle between the end effector and its desired orientation.

    The axis suits the values in the window.
    """
    _plot_size(ax, result, "orientation_error", "rad", "orientation error")


def task_panel(measure: TaskMeasure) -> Callable[[Axes, Result], None]:
    """Return the function that plots what a task of objectives is measured by."""

    def plot(ax: Axes, result: Result) -> None:
        if measure.kind == "error":
            _plot_size(ax, result, measure.name, measure.unit, measure.text)
            return
        values = result.series[measure.name]
        unit, scale = prefix_unit(largest(values), measure.unit)
        ax.plot(result.time, scale * values, color=INK)
        if measure.kind == "margin":
            ax.axhline(0.0, **BOUND)
        mark_times(ax, result)
        time_axis(ax, result, f"{measure.text} [{unit}]")

    plot.__doc__ = f"Plot {measure.meaning}."
    return plot


def _plot_size(ax: Axes, result: Result, name: str, of: str, title: str) -> None:
    error = result.series[name]
    unit, scale = prefix_unit(largest(in_view(result, error)), of)
    ax.plot(result.time, scale * error, color=INK, linewidth=0.6 if noisy(error) else 1.0)
    mark_times(ax, result)
    ax.set_ylim(0, 1.06 * scale * largest(error) or None)
    time_axis(ax, result, f"{title} [{unit}]")
    keep_in_view(ax, result, error, of, scale)
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
    columns = np.column_stack((error, np.linalg.norm(error, axis=1))) if norm else error
    keep_in_view(ax, result, columns, unit, scale)


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
    unit_text, scale = prefix_unit(largest(in_view(result, values)), unit)
    if norm:
        size = scale * np.linalg.norm(values, axis=1)
        ax.plot(result.time, size, label=norm, **BEHIND)
    order = depths(values)
    for k, (name, column) in enumerate(zip(names, values.T, strict=False)):
        look = {**nth(k), "linewidth": 1.2, "zorder": order[k], **style}
        ax.plot(result.time, scale * column, label=name, **look)
    time_axis(ax, result, f"{text} [{unit_text}]")
    return scale

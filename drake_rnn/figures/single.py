"""The figures of one quantity each; a function's name is its file's."""

from __future__ import annotations

from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..inputs.fields import Array
from ..runs.result import Result
from .jacobian_panels import plot_jacobian_error
from .joint_panels import (
    plot_acceleration_norm,
    plot_angles,
    plot_bounded,
    plot_drift,
    plot_drift_left,
    plot_joint_error,
    plot_moving_bounds,
    plot_range,
    plot_torques,
)
from .registry import draws
from .space import arm_figure, frame_space, plot_postures, plot_stroboscope
from .style import (
    BOUND,
    COLOURS,
    COLUMN,
    DESIRED,
    NOTE,
    PAGE,
    TARGET,
    TRACED,
    Style,
    finite,
    joint_handles,
    joint_style,
    legend,
    plot_joints,
    single,
    span,
    ticks,
    time_axis,
    unit,
)
from .surface import brought_onto_surface
from .task_panels import (
    plot_end_effector,
    plot_path,
    plot_position_error,
    plot_position_error_axes,
    plot_turn,
    plot_velocity_error,
)
from .traits import apart, bounds_are_felt, first_lap, has_path, has_target, presses


@draws("p_WE", "p_WE_desired", applies=lambda r: has_path(r) and r.series["p_WE"].shape[1] == 3)
def path_3d(result: Result) -> Figure:
    """Desired and traced path in space."""
    figure = Figure(figsize=(COLUMN, 3.2))
    ax: Any = figure.add_axes((0.02, 0.13, 0.84, 0.82), projection="3d")
    p_WE, desired, text = _traced_and_desired(result)
    ax.plot(*p_WE.T, label="traced", **TRACED)
    ax.plot(*desired[first_lap(result)].T, label=text, **DESIRED)
    ax.plot(*p_WE[:1].T, "o", color="black", markersize=3.5, label="start")
    frame_space(ax, finite(np.concatenate((p_WE, desired))))
    figure.legend(*ax.get_legend_handles_labels(), loc="upper center", ncols=3)
    return figure


@draws("p_WE", "p_WE_desired", applies=lambda r: has_path(r) and not presses(r))
def path_plane(result: Result) -> Figure:
    """Desired and traced path in the plane in which it varies most."""
    figure, ax = single(height=3.0)
    plot_path(ax, result)
    return figure


@draws("position")
def joint_angles(result: Result) -> Figure:
    """A panel for each joint, and one that shows where within its bounds each has been."""
    position, limits = result.series["position"], result.experiment.limits
    target = result.experiment.target
    bounds = np.stack((limits.position_lower, limits.position_upper), axis=1)
    bounded = bool(np.isfinite(bounds).all(axis=1).any())
    n = position.shape[1]
    cells = n + bounded
    rows = (cells + 1) // 2
    figure = Figure(figsize=(PAGE, 0.4 + 1.25 * rows), layout="constrained")
    axes: Any = figure.subplots(rows, 2, squeeze=False).ravel()
    for ax in axes[cells:]:
        ax.remove()
    for k, (ax, angle) in enumerate(zip(axes, position.T, strict=False)):
        ax.plot(result.time, angle, **joint_style(k))
        low, high = span(angle, least=0.02)
        if target is not None:
            ax.axhline(target[k], **TARGET)
            low, high = min(low, target[k]), max(high, target[k])
        for bound in bounds[k]:
            # Near enough that the curve still fills half of its panel.
            if low - (high - low) <= bound <= high + (high - low):
                ax.axhline(bound, **BOUND)
                low, high = min(low, bound), max(high, bound)
        ax.set_ylim(low - 0.08 * (high - low), high + 0.08 * (high - low))
        ticks(ax.yaxis, 4)
        ax.set_ylabel(f"$q_{{{k + 1}}}$ [rad]")
        ax.set_title(_bounds_note(bounds[k]), loc="right", pad=2, **NOTE)
        time_axis(ax, result)
        if k + 2 < n:
            ax.tick_params(labelbottom=False)
            ax.set_xlabel("")
    if bounded:
        plot_range(axes[n], position, bounds)
    if target is not None:
        handles = [Line2D([], [], label="target", **TARGET)]
        figure.legend(handles=handles, loc="outside upper center")
    figure.align_ylabels()
    return figure


@draws("velocity")
def joint_velocities(result: Result) -> Figure:
    """All joints with their bounds; the law's apart from the arm's where they differ."""
    return _law_and_arm(result, "velocity", result.experiment.limits.velocity)


@draws("acceleration")
def joint_accelerations(result: Result) -> Figure:
    """All joints with their bounds; the law's apart from the arm's where they differ."""
    return _law_and_arm(result, "acceleration", result.experiment.limits.acceleration)


@draws("acceleration_peak")
def acceleration_norm(result: Result) -> Figure:
    """Largest joint acceleration in magnitude, no step left out, with the bound."""
    figure, ax = single()
    plot_acceleration_norm(ax, result)
    return figure


@draws("p_WE", "p_WE_desired")
def position(result: Result) -> Figure:
    """Position and what is desired, axis by axis."""
    p_WE, desired, text = _traced_and_desired(result)
    m = p_WE.shape[1]
    figure = Figure(figsize=(COLUMN, 0.6 + 1.1 * m), layout="constrained")
    axes = figure.subplots(m, 1, sharex=True, squeeze=False).ravel()
    # Where nothing is to move, all axes have the scale of that which does most.
    widest = max(np.ptp(span(values, 0.0)) for values in (desired if has_path(result) else p_WE).T)
    share = 0.05 if has_path(result) else 1.0
    for name, ax, is_, ought in zip("xyz", axes, p_WE.T, desired.T, strict=False):
        ax.plot(result.time, is_, label="traced", **TRACED)
        ax.plot(result.time, ought, label=text, **DESIRED)
        # An axis along which nothing should move is not filled with micrometres.
        low, high = span(np.concatenate((is_, ought)), least=max(share * widest, 1e-4))
        ax.set_ylim(low - 0.06 * (high - low), high + 0.06 * (high - low))
        ticks(ax.yaxis, 4)
        ax.ticklabel_format(axis="y", useOffset=False)
        ax.set_ylabel(f"{name} [m]")
    time_axis(axes[-1], result)
    legend(axes[0])
    figure.align_ylabels()
    return figure


@draws("p_WE", "p_WE_desired")
def position_error(result: Result) -> Figure:
    """Norm of the position error, with what counts as settled."""
    figure, ax = single()
    plot_position_error(ax, result)
    return figure


@draws("p_WE", "p_WE_desired", applies=has_path)
def position_error_axes(result: Result) -> Figure:
    """Position error axis by axis."""
    figure, ax = single()
    plot_position_error_axes(ax, result)
    return figure


@draws("v_WE", "v_WE_desired", applies=has_path)
def velocity_error(result: Result) -> Figure:
    """Velocity error axis by axis, with what the law's theory says that it is."""
    figure, ax = single()
    plot_velocity_error(ax, result)
    return figure


@draws("position", applies=has_path)
def joint_drift(result: Result) -> Figure:
    """How far each joint is from where it was at first, and what is left of that in the end."""
    figure = Figure(figsize=(COLUMN, 4.1), layout="constrained")
    axes = figure.subplots(2, 1, height_ratios=(3, 2))
    plot_drift(axes[0], result)
    plot_drift_left(axes[1], result)
    figure.align_ylabels()
    return figure


@draws("torque")
def joint_torques(result: Result) -> Figure:
    """All joints."""
    figure, ax = single()
    plot_torques(ax, result)
    return figure


@draws("position", applies=has_target)
def postures(result: Result) -> Figure:
    """The arm as it starts, as it ends, and as it should."""
    figure, ax = arm_figure(result)
    plot_postures(ax, result)
    return figure


@draws("position", "velocity", applies=has_target)
def stroboscope(result: Result) -> Figure:
    """The arm at equal intervals of time while it moves: dense where it is slow."""
    return _flashes(result)


@draws("position", "velocity", applies=has_path)
def motion(result: Result) -> Figure:
    """The arm at equal intervals of time along its path."""
    return _flashes(result)


@draws("position", applies=has_target)
def angles_to_target(result: Result) -> Figure:
    """All joints, with where they should end."""
    figure, ax = single()
    plot_angles(ax, result)
    return figure


@draws("joint_error", applies=has_target)
def joint_error(result: Result) -> Figure:
    """How far each joint is from its target, and when all have arrived."""
    figure, ax = single()
    plot_joint_error(ax, result)
    return figure


@draws("velocity", "velocity_lower", "velocity_upper", applies=bounds_are_felt)
def moving_bounds(result: Result) -> Figure:
    """Joint velocities between bounds that change."""
    figure, ax = single()
    plot_moving_bounds(ax, result)
    return figure


@draws("p_WE", applies=has_target)
def end_effector(result: Result) -> Figure:
    """How far the end effector strays from its start, and what the law makes of it."""
    turned = result.series.get("orientation_error")
    panels = 1 if turned is None else 2
    figure = Figure(figsize=(COLUMN, 0.5 + 1.9 * panels), layout="constrained")
    axes = figure.subplots(panels, 1, sharex=True, squeeze=False).ravel()
    plot_end_effector(axes[0], result)
    if turned is not None:
        axes[0].set_xlabel("")
        plot_turn(axes[1], result)
        figure.align_ylabels()
    return figure


@draws("J", "J_hat")
def jacobian(result: Result) -> Figure:
    """Every entry of J and of J_hat: a column of panels for each, a row for each axis."""
    J, J_hat = result.series["J"], result.series["J_hat"]
    m = J.shape[1]
    figure = Figure(figsize=(PAGE, 0.7 + 1.35 * m), layout="constrained")
    axes: Any = figure.subplots(m, 2, sharex=True, sharey=True, squeeze=False)
    for column, (values, name) in enumerate(((J, "$J$"), (J_hat, r"$\hat J$"))):
        for row in range(m):
            ax = axes[row, column]
            plot_joints(ax, result.time, values[:, row])
            ax.set_ylabel(f"{'xyz'[row]} row of {name} [{unit('J')}]")
            if values is J_hat:
                # What it starts from may last no longer than a sample.
                for entry, colour in zip(J_hat[0, row], cycle(COLOURS), strict=False):
                    ax.plot(0, entry, "o", color=colour, markersize=3, clip_on=False)
        time_axis(axes[-1, column], result)
    figure.legend(
        handles=joint_handles(J.shape[2]), loc="outside upper center", ncols=J.shape[2] + 1
    )
    return figure


@draws("J", "J_hat", "network_velocity")
def jacobian_error(result: Result) -> Figure:
    """How far J_hat is from J, at large and along the motion."""
    figure, ax = single()
    plot_jacobian_error(ax, result)
    return figure


def _traced_and_desired(result: Result) -> tuple[Array, Array, str]:
    """Points, shape (k, m) [m] both, that are to be compared, and what the latter are called."""
    if presses(result):
        return result.series["p_WE"], brought_onto_surface(result), "desired, along the surface"
    return result.series["p_WE"], result.series["p_WE_desired"], "desired"


def _flashes(result: Result) -> Figure:
    figure, ax = arm_figure(result, below=0.5)
    times = plot_stroboscope(ax, result)
    if times is not None:
        place: Style = {"ax": ax, "shrink": 0.7, "aspect": 28}
        if ax.name == "3d":  # whose labels layouts do not reckon with
            place = {"cax": ax.inset_axes((0.15, -0.16, 0.7, 0.035))}
        bar: Any = figure.colorbar(times, orientation="horizontal", **place)
        bar.set_label("time [s]")
        bar.outline.set_visible(False)
    return figure


def _law_and_arm(result: Result, quantity: str, bounds: Array | None) -> Figure:
    """One panel if the arm does what the law asks for, else one for each."""
    if apart(result, quantity):
        names = {f"network_{quantity}": f"{quantity}, law", quantity: f"{quantity}, arm"}
    else:
        names = {quantity: f"joint {quantity}"}
    figure = Figure(figsize=(COLUMN, 0.5 + 1.9 * len(names)), layout="constrained")
    axes = figure.subplots(len(names), 1, sharex=True, squeeze=False).ravel()
    for ax, (name, text) in zip(axes, names.items(), strict=True):
        plot_bounded(ax, result, name, bounds, text)
        if ax is not axes[-1]:
            ax.set_xlabel("")
    legend(axes[0], joint_handles(result.series[quantity].shape[1]))
    figure.align_ylabels()
    return figure


def _bounds_note(bounds: Array) -> str:
    if not np.isfinite(bounds).any():
        return "no bounds"
    low, high = (f"{bound:.3g}" if np.isfinite(bound) else "none" for bound in bounds)
    return f"bounds {low}, {high}".replace("-", "−")

"""The figures of one quantity each; a function's name is its file's."""

from __future__ import annotations

from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ..fields import Array
from ..result import Result
from .panels import (
    apart,
    first_lap,
    plot_acceleration_norm,
    plot_bounded,
    plot_jacobian_error,
    plot_path,
    plot_position_error,
    plot_range,
)
from .registry import draws
from .style import (
    BOUND,
    COLOURS,
    COLUMN,
    DESIRED,
    NOTE,
    PAGE,
    TRACED,
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


@draws("p_WE", "p_WE_desired", applies=lambda result: result.series["p_WE"].shape[1] == 3)
def path_3d(result: Result) -> Figure:
    """Desired and traced path in space."""
    figure = Figure(figsize=(COLUMN, 3.2))
    ax: Any = figure.add_axes((0.02, 0.13, 0.84, 0.82), projection="3d")
    p_WE, desired = result.series["p_WE"], result.series["p_WE_desired"]
    ax.plot(*p_WE.T, label="traced", **TRACED)
    ax.plot(*desired[first_lap(result)].T, label="desired", **DESIRED)
    ax.plot(*p_WE[:1].T, "o", color="black", markersize=3.5, label="start")
    points = finite(np.concatenate((p_WE, desired)))
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
    figure.legend(*ax.get_legend_handles_labels(), loc="upper center", ncols=3)
    return figure


@draws("p_WE", "p_WE_desired")
def path_plane(result: Result) -> Figure:
    """Desired and traced path in the plane in which it varies most."""
    figure, ax = single(height=3.0)
    plot_path(ax, result)
    return figure


@draws("position")
def joint_angles(result: Result) -> Figure:
    """A panel for each joint, and one that shows where within its bounds each has been."""
    position, limits = result.series["position"], result.experiment.setup.limits
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
    figure.align_ylabels()
    return figure


@draws("velocity")
def joint_velocities(result: Result) -> Figure:
    """All joints with their bounds; the law's apart from the arm's where they differ."""
    return _law_and_arm(result, "velocity", result.experiment.setup.limits.velocity)


@draws("acceleration")
def joint_accelerations(result: Result) -> Figure:
    """All joints with their bounds; the law's apart from the arm's where they differ."""
    return _law_and_arm(result, "acceleration", result.experiment.setup.limits.acceleration)


@draws("acceleration_peak")
def acceleration_norm(result: Result) -> Figure:
    """Largest joint acceleration in magnitude, no step left out, with the bound."""
    figure, ax = single()
    plot_acceleration_norm(ax, result)
    return figure


@draws("p_WE", "p_WE_desired")
def position(result: Result) -> Figure:
    """Position and what is desired, axis by axis."""
    p_WE, desired = result.series["p_WE"], result.series["p_WE_desired"]
    m = p_WE.shape[1]
    figure = Figure(figsize=(COLUMN, 0.6 + 1.1 * m), layout="constrained")
    axes = figure.subplots(m, 1, sharex=True, squeeze=False).ravel()
    widest = max(np.ptp(span(values, 0.0)) for values in desired.T)
    for name, ax, is_, ought in zip("xyz", axes, p_WE.T, desired.T, strict=False):
        ax.plot(result.time, is_, label="traced", **TRACED)
        ax.plot(result.time, ought, label="desired", **DESIRED)
        # An axis along which nothing should move is not filled with micrometres.
        low, high = span(np.concatenate((is_, ought)), least=max(0.05 * widest, 1e-4))
        ax.set_ylim(low - 0.06 * (high - low), high + 0.06 * (high - low))
        ticks(ax.yaxis, 4)
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

"""Panels of the joints' motion; each function draws on given axes."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from ..inputs.fields import Array
from ..measures import ARRIVED, prefixed
from ..runs.limit_use import EXCEEDED
from ..runs.result import Result
from .bound_lines import draw_bounds, known_bounds, number_bounds
from .looks import ALARM, BOUND, INK, MOMENT, NOTE, PREDICTED, TARGET, Style, nth
from .style import (
    corner_note,
    joint_handles,
    label,
    largest,
    legend,
    log_axis,
    mark_times,
    plot_joints,
    span,
    time_axis,
    unit,
)
from .traits import apart, commands_acceleration, evaluated, law_velocity, presses

#: Ratio of a bound to the curves' peak above which it is written rather than drawn.
_IN_VIEW = 3.0
#: The same for a tool that presses: its motion is slow, and its details at turns should be visible.
_IN_VIEW_PRESSING = 2.0
#: Ratio of a bound to the curves' peak below which it cannot be read from the axis.
_LEGIBLE = 0.05
#: Marker of a joint's target, filled with the colour of the joint.
_GOAL: Style = {"marker": "D", "markersize": 4.0, "markeredgecolor": TARGET["color"]}
#: Number of the colour of the arm's own motion beside the motion of the law.
_ARM = 2


def plot_angles(ax: Axes, result: Result) -> None:
    """Plot the angles of all joints, with their targets on the right edge."""
    plot_joints(ax, result.time, result.series["position"])
    handles = joint_handles(result.series["position"].shape[1])
    target = result.experiment.target
    if target is not None:
        for k, angle in enumerate(target):
            colour = nth(k)["color"]
            ax.plot(result.time[-1:], angle, color=colour, zorder=3, clip_on=False, **_GOAL)
        handles.append(Line2D([], [], color="white", label="target", linestyle="none", **_GOAL))
    time_axis(ax, result, label("joint angle", "position"))
    legend(ax, handles)


def plot_velocities(ax: Axes, result: Result) -> None:
    """Plot the joint velocities of the law, as the arm's may be noisy."""
    name = "network_velocity" if "network_velocity" in result.series else "velocity"
    text = "joint velocity, law" if apart(result, "velocity") else "joint velocity"
    plot_bounded(ax, result, name, result.experiment.limits.velocity, text)
    legend(ax, joint_handles(result.series[name].shape[1]))


def plot_acceleration_norm(ax: Axes, result: Result) -> None:
    """Plot the largest joint acceleration since the previous sample."""
    # There is no step before the first sample.
    time, arm = result.time[1:], result.series["acceleration_peak"][1:]
    curves = [arm]
    if apart(result, "acceleration"):
        curves.append(result.series["network_acceleration_peak"][1:])
        ax.plot(time, arm, color=nth(_ARM)["color"], label="arm")
    ax.plot(time, curves[-1], color=INK, label="law" if len(curves) > 1 else None)
    if commands_acceleration(result) and result.series["saturated"].any():
        # The acceleration that the law asked for before it was cut to the bound.
        demand = np.abs(result.series["acceleration_demand"][1:]).max(axis=1)
        ax.plot(time, demand, label="asked for", **PREDICTED)
        curves.append(demand)
    known = known_bounds(result.experiment.limits.acceleration)
    # Bounds may differ from joint to joint: the least and the greatest are drawn.
    for k, bound in enumerate(np.unique(known[[0, -1]]) if known.size else ()):
        text = "bound" if known.size == 1 else "least and greatest bound"
        ax.axhline(bound, label=None if k else text, **BOUND)
    levels = [*map(largest, curves), *known]
    if max(levels) > 10 * min(levels) > 0 or largest(arm) > 10 * np.median(arm) > 0:
        log_axis(ax, [*curves, known])
    else:
        ax.set_ylim(0, 1.08 * max(levels) or None)
    time_axis(ax, result, label(r"largest $|\ddot q_i|$", "acceleration"))
    legend(ax)


def plot_drift(ax: Axes, result: Result) -> None:
    """Plot the drift of each joint from the start of the window, and mark the last values."""
    drift, end = joint_drift(result)
    plot_joints(ax, result.time, drift)
    for k, final in enumerate(end):
        last = result.time[evaluated(result)][-1:]
        ax.plot(last, final, "o", color=nth(k)["color"], markersize=3, clip_on=False)
    shown, scale = prefixed(largest(end), "rad")
    sizes = scale * np.abs(end)
    corner_note(ax, f"at the end: mean {sizes.mean():.3g}, largest {sizes.max():.3g} {shown}")
    low, high = span(drift, least=1e-6)
    ax.set_ylim(low - 0.06 * (high - low), high + 0.16 * (high - low))
    mark_times(ax, result)
    time_axis(ax, result, label("joint drift", "position"))
    legend(ax, joint_handles(end.size))


def plot_drift_left(ax: Axes, result: Result) -> None:
    """Plot the drift that is left at the end as a bar for each joint."""
    sizes = np.abs(joint_drift(result)[1])
    shown, scale = prefixed(largest(sizes), "rad")
    joints = np.arange(sizes.size) + 1
    colours = [nth(k)["color"] for k in range(sizes.size)]
    ax.bar(joints, scale * sizes, width=0.6, color=colours)
    ax.axhline(scale * sizes.mean(), label="mean", **BOUND)
    ax.set_xticks(joints)
    ax.grid(visible=False, axis="x")
    ax.margins(x=0.02)
    ax.set(xlabel="joint [-]", ylabel=f"drift at the end [{shown}]")
    legend(ax)


def joint_drift(result: Result) -> tuple[Array, Array]:
    """Return the drift of the joints from the first sample of the window.

    Returns:
        The drift at every sample, shape (k, n) [rad], and at the last sample of the window, shape
        (n,) [rad].
    """
    position, within = result.series["position"], evaluated(result)
    position = np.where(np.isfinite(position), position, np.nan)
    drift = position - position[within][0]
    return drift, drift[within][-1]


def plot_torques(ax: Axes, result: Result) -> None:
    """Plot the torques of all joints."""
    plot_joints(ax, result.time, result.series["torque"])
    time_axis(ax, result, label("joint torque", "torque"))
    legend(ax, joint_handles(result.series["torque"].shape[1]))


def plot_joint_error(ax: Axes, result: Result) -> None:
    """Plot the distance of each joint to its target, and the time when all have arrived."""
    error = np.abs(result.series["joint_error"])
    plot_joints(ax, result.time, error)
    bound = ax.axhline(ARRIVED, label=f"{ARRIVED:g} rad", **BOUND)
    handles = [*joint_handles(error.shape[1]), bound]
    if (settled := result.metrics.get("joint_settling_time_s", 0.0)) > 0:
        ax.axvline(settled, **MOMENT)
        side = "left" if settled < result.time[[0, -1]].mean() else "right"
        place: Style = {"ha": side, "va": "top", "transform": ax.get_xaxis_transform()}
        ax.text(settled, 0.98, f" settled at {settled:.2f} s ", **place, **NOTE)
    log_axis(ax, [*error.T, ARRIVED * np.array([0.6, 1.6])])
    time_axis(ax, result, label(r"$|q_i - q_{i,\mathrm{target}}|$", "joint_error"))
    legend(ax, handles)


def plot_moving_bounds(ax: Axes, result: Result) -> None:
    """Plot the joint velocities of the law between bounds that change with time."""
    values = law_velocity(result)
    plot_joints(ax, result.time, values)
    sides = [result.series["velocity_lower"], result.series["velocity_upper"]]
    for bounds in sides:
        plot_bound_curves(ax, result.time, bounds)
    # Bounds far beyond the curves would flatten them.
    peak = largest(values)
    reach = 1.08 * min(max(peak, *map(largest, sides)), 2.0 * peak)
    if reach > 0:
        ax.set_ylim(-reach, reach)
    time_axis(ax, result, label("joint velocity", "velocity"))
    legend(ax, [*joint_handles(values.shape[1]), Line2D([], [], label="bounds", **BOUND)])


def plot_range(ax: Axes, position: Array, bounds: Array) -> None:
    """Plot the range of each joint relative to its bounds: 0 is the lower, 1 the upper.

    Args:
        ax: The axes.
        position: Joint positions, shape (k, n) [rad].
        bounds: Lower and upper bounds, shape (n, 2) [rad].
    """
    bounded = np.flatnonzero(np.isfinite(bounds).all(axis=1))
    for k in bounded.tolist():
        lower, upper = bounds[k]
        low, high = (span(position[:, k], least=0.0) - lower) / (upper - lower)
        bar: Style = {"linewidth": 3, "solid_capstyle": "butt"}
        ax.plot([0, 1], [k + 1, k + 1], color="0.88", **bar)
        # Widened, so that a joint at rest is visible as well.
        ax.plot([low - 0.004, high + 0.004], [k + 1, k + 1], color=nth(k)["color"], **bar)
    for bound in (0, 1):
        ax.axvline(bound, **BOUND)
    ax.set_yticks(bounded + 1)
    ax.tick_params(axis="y", labelsize=6)
    ax.grid(visible=False, axis="y")
    ax.set(xlabel="position between bounds, lower to upper [-]", ylabel="joint [-]")
    ax.set_ylim(position.shape[1] + 0.7, 0.3)
    ax.margins(x=0.02)


def plot_bounded(ax: Axes, result: Result, name: str, bounds: Array | None, text: str) -> None:
    """Plot a series of all joints with the bounds of its magnitude.

    Args:
        ax: The axes.
        result: The run.
        name: Name of the series.
        bounds: Shape (n,); None if there are none.
        text: Label of the axis, without the unit.
    """
    values = result.series[name]
    plot_joints(ax, result.time, values)
    peak, known = largest(values), known_bounds(bounds)
    far = _IN_VIEW_PRESSING if presses(result) else _IN_VIEW
    in_view = known[(known <= far * peak) & (known > 0.2 * _LEGIBLE * peak)]
    draw_bounds(ax, in_view)
    reach = 1.08 * max([peak, *in_view])
    notes = []
    ratio = 0.0 if bounds is None else largest(values / bounds)
    if ratio > EXCEEDED:
        notes.append(f"✗ {ratio:.3g} × bound")
    # Values that cannot be read from the axes are written above the curves.
    steps = result.series.get(f"{name}_peak")
    if steps is not None and largest(steps) > 1.5 * peak:
        notes.append(f"up to {largest(steps):.3g} between samples")
    if known.size and (known[0] < _LEGIBLE * peak or in_view.size < known.size):
        ends = " to ".join(f"±{bound:.4g}" for bound in np.unique(known[[0, -1]]))
        notes.append(f"bounds {ends} {unit(name)}")
    if notes:
        corner_note(ax, "; ".join(notes), ALARM if ratio > EXCEEDED else NOTE)
        reach *= 1.15
    if reach > 0:
        ax.set_ylim(-reach, reach)
    number_bounds(ax, bounds)
    time_axis(ax, result, label(text, name))


def plot_bound_curves(ax: Axes, time: Array, bounds: Array) -> None:
    """Plot bounds that change with time, shape (k, n), without drawing shared ones repeatedly.

    The bound that most joints share is drawn once; the others only where they differ from it, with
    the numbers of their joints.
    """
    curves, holders, counts = np.unique(bounds, axis=1, return_inverse=True, return_counts=True)
    common = curves[:, np.argmax(counts)]
    ax.plot(time, common, **BOUND)
    for k in np.flatnonzero(np.arange(counts.size) != np.argmax(counts)):
        curve = np.where(curves[:, k] == common, np.nan, curves[:, k])
        apart = np.abs(curve - common)
        # A run that failed may hold bounds that are not numbers, which cannot be drawn.
        if np.isnan(apart).all():
            continue
        ax.plot(time, curve, **BOUND)
        joints = ", ".join(f"{joint + 1}" for joint in np.flatnonzero(holders.ravel() == k))
        at = int(np.nanargmax(apart))
        ax.annotate(joints, (time[at], curve[at]), clip_on=True, **NOTE)

"""Panels of the joints' motion; each function draws on given axes.

- Lines of bounds, in the one look of bounds; numbers beside them say of which joints they are.
- Panels of the joint positions and their derivatives, one for each order, with bounds.
- The figures of experiments that bound derivatives of the motion beyond the acceleration.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from ..experiment import EXCESS_RATIO, torque_share_bound
from ..inputs.fields import Array
from ..measures import ARRIVAL_TOLERANCE, prefix_unit, superscript
from ..measures.metric import RATIO_METRICS
from ..robot.limits import DERIVATIVE_UNITS
from ..robot.sides import Sides
from ..runs.limit_use import Signal, derivatives_of_motion
from ..runs.result import Result
from .registry import (
    apart,
    bounds_jerk,
    commands_acceleration,
    draws,
    law_velocity,
    presses,
    samples_in_window,
    shows_signals,
)
from .style import (
    ALARM,
    BOUND,
    INK,
    MOMENT,
    NOTE,
    PAGE,
    PREDICTION,
    TARGET,
    Style,
    corner_note,
    joint_handles,
    label,
    largest,
    legend,
    log_axis,
    mark_times,
    nth,
    plot_joints,
    span,
    ticks,
    time_axis,
    unit,
    wide,
)

#: Smallest distance of two labels, as a share of the axis.
_APART = 0.07


def known_bounds(bounds: Array | None) -> Array:
    """Return the distinct values of finite bounds in ascending order; none for None."""
    return np.empty(0) if bounds is None else np.unique(bounds[np.isfinite(bounds)])


def draw_bounds(ax: Axes, sides: Sides | None, in_view: Array) -> None:
    """Draw bounds in both directions, of those that are in view, shape (k,)."""
    for bound in in_view:
        for sign, own in zip((-1, 1), sides or (), strict=False):
            if (own == bound).any():
                ax.axhline(sign * bound, **BOUND)


def number_bounds(ax: Axes, sides: Sides | None) -> None:
    """Write at the right edge of which joints each bound in view is, if they differ.

    Args:
        ax: The axes, with their final limits.
        sides: Bounds of each joint, shape (n,) each; None if there are none.
    """
    # Of those downwards nothing is written.
    bounds = None if sides is None else sides.up
    if bounds is None or known_bounds(bounds).size < 2:
        return
    low, high = ax.get_ylim()
    labels: list[tuple[float, list[str]]] = []
    for bound in np.unique(bounds[(bounds > low) & (bounds < high)]):
        joints = [f"{k + 1}" for k in np.flatnonzero(bounds == bound)]
        if labels and bound - labels[-1][0] < _APART * (high - low):
            labels[-1][1].extend(joints)
        else:
            labels.append((float(bound), joints))
    for bound, joints in labels:
        place: Style = {"xytext": (2, 0), "textcoords": "offset points", "va": "center"}
        text = ", ".join(sorted(joints, key=int))
        ax.annotate(text, (1.0, bound), xycoords=ax.get_yaxis_transform(), **place, **NOTE)


def excess_note(ax: Axes, ratio: float) -> None:
    """Write above the axes how many times the bound the curves reach, as an alarm if beyond it."""
    exceeds = ratio > EXCESS_RATIO
    text = f"{'✗ ' if exceeds else ''}up to {ratio:.3g} × bound"
    ax.set_title(text, loc="right", pad=2, **(ALARM if exceeds else NOTE))


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
    plot_bounded(ax, result, name, result.experiment.limits.known_sides("velocity"), text)
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
        ax.plot(time, demand, label="asked for", **PREDICTION)
        curves.append(demand)
    sides = result.experiment.limits.known_sides("acceleration")
    bounds = known_bounds(None if sides is None else np.concatenate(sides))
    # Bounds may differ from joint to joint: the least and the greatest are drawn.
    for k, bound in enumerate(np.unique(bounds[[0, -1]]) if bounds.size else ()):
        text = "bound" if bounds.size == 1 else "least and greatest bound"
        ax.axhline(bound, label=None if k else text, **BOUND)
    levels = [*map(largest, curves), *bounds]
    if max(levels) > 10 * min(levels) > 0 or largest(arm) > 10 * np.median(arm) > 0:
        log_axis(ax, [*curves, bounds])
    else:
        ax.set_ylim(0, 1.08 * max(levels) or None)
    time_axis(ax, result, label(r"largest $|\ddot q_i|$", "acceleration"))
    legend(ax)


def plot_drift(ax: Axes, result: Result) -> None:
    """Plot the drift of each joint from the start of the window, and mark the last values."""
    drift, end = joint_drift(result)
    plot_joints(ax, result.time, drift)
    for k, final in enumerate(end):
        last = result.time[samples_in_window(result)][-1:]
        ax.plot(last, final, "o", color=nth(k)["color"], markersize=3, clip_on=False)
    end_unit, scale = prefix_unit(largest(end), "rad")
    sizes = scale * np.abs(end)
    corner_note(ax, f"at the end: mean {sizes.mean():.3g}, largest {sizes.max():.3g} {end_unit}")
    low, high = span(drift, least=1e-6)
    ax.set_ylim(low - 0.06 * (high - low), high + 0.16 * (high - low))
    mark_times(ax, result)
    time_axis(ax, result, label("joint drift", "position"))
    legend(ax, joint_handles(end.size))


def plot_drift_left(ax: Axes, result: Result) -> None:
    """Plot the drift that is left at the end as a bar for each joint."""
    sizes = np.abs(joint_drift(result)[1])
    shown, scale = prefix_unit(largest(sizes), "rad")
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
    position, within = result.series["position"], samples_in_window(result)
    position = np.where(np.isfinite(position), position, np.nan)
    drift = position - position[within][0]
    return drift, drift[within][-1]


def plot_torques(ax: Axes, result: Result) -> None:
    """Plot the torques of all joints; those that a law commands as shares of their limits.

    The bound is what is kept by construction; where nothing is, it is the limits themselves.
    """
    torque, most = result.series["torque"], result.experiment.arm.effort
    handles, text = joint_handles(torque.shape[1]), label("joint torque", "torque")
    if result.experiment.law.commands_torque and np.isfinite(most).all():
        torque, text = torque / most, "joint torque / limit [-]"
        kept = torque_share_bound(result.experiment)
        bound, name = (1.0, "limit") if kept is None else (kept, "kept by construction")
        ax.axhline(-bound, **BOUND)
        handles = [*handles, ax.axhline(bound, label=name, **BOUND)]
    plot_joints(ax, result.time, torque)
    time_axis(ax, result, text)
    legend(ax, handles)


def plot_joint_error(ax: Axes, result: Result) -> None:
    """Plot the distance of each joint to its target, and the time when all have arrived."""
    error = np.abs(result.series["joint_error"])
    plot_joints(ax, result.time, error)
    bound = ax.axhline(ARRIVAL_TOLERANCE, label=f"{ARRIVAL_TOLERANCE:g} rad", **BOUND)
    handles = [*joint_handles(error.shape[1]), bound]
    if (settling_time := result.metrics.get("joint_settling_time_s", 0.0)) > 0:
        ax.axvline(settling_time, **MOMENT)
        side = "left" if settling_time < result.time[[0, -1]].mean() else "right"
        place: Style = {"ha": side, "va": "top", "transform": ax.get_xaxis_transform()}
        ax.text(settling_time, 0.98, f" settled at {settling_time:.2f} s ", **place, **NOTE)
    log_axis(ax, [*error.T, ARRIVAL_TOLERANCE * np.array([0.6, 1.6])])
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
    has_bounds = np.flatnonzero(np.isfinite(bounds).all(axis=1))
    for k in has_bounds.tolist():
        lower, upper = bounds[k]
        low, high = (span(position[:, k], least=0.0) - lower) / (upper - lower)
        bar: Style = {"linewidth": 3, "solid_capstyle": "butt"}
        ax.plot([0, 1], [k + 1, k + 1], color="0.88", **bar)
        # Widened, so that a joint at rest is visible as well.
        ax.plot([low - 0.004, high + 0.004], [k + 1, k + 1], color=nth(k)["color"], **bar)
    for bound in (0, 1):
        ax.axvline(bound, **BOUND)
    ax.set_yticks(has_bounds + 1)
    ax.tick_params(axis="y", labelsize=6)
    ax.grid(visible=False, axis="y")
    ax.set(xlabel="position between bounds, lower to upper [-]", ylabel="joint [-]")
    ax.set_ylim(position.shape[1] + 0.7, 0.3)
    ax.margins(x=0.02)


def plot_bounded(ax: Axes, result: Result, name: str, sides: Sides | None, text: str) -> None:
    """Plot a series of all joints with its bounds.

    Args:
        ax: The axes.
        result: The run.
        name: Name of the series.
        sides: The bounds, shape (n,) each; None if there are none.
        text: Label of the axis, without the unit.
    """
    values = result.series[name]
    plot_joints(ax, result.time, values)
    peak = largest(values)
    finite = known_bounds(None if sides is None else np.concatenate(sides))
    far = _IN_VIEW_PRESSING if presses(result) else _IN_VIEW
    in_view = finite[(finite <= far * peak) & (finite > 0.2 * _LEGIBLE * peak)]
    draw_bounds(ax, sides, in_view)
    reach = 1.08 * max([peak, *in_view])
    notes = []
    ratio = 0.0 if sides is None else largest(values / sides.toward(values > 0.0))
    if ratio > EXCESS_RATIO:
        notes.append(f"✗ {ratio:.3g} × bound")
    # Values that cannot be read from the axes are written above the curves.
    steps = result.series.get(f"{name}_peak")
    if steps is not None and largest(steps) > 1.5 * peak:
        notes.append(f"up to {largest(steps):.3g} between samples")
    if finite.size and (finite[0] < _LEGIBLE * peak or in_view.size < finite.size):
        ends = " to ".join(f"±{bound:.4g}" for bound in np.unique(finite[[0, -1]]))
        notes.append(f"bounds {ends} {unit(name)}")
    if notes:
        corner_note(ax, "; ".join(notes), ALARM if ratio > EXCESS_RATIO else NOTE)
        reach *= 1.15
    if reach > 0:
        ax.set_ylim(-reach, reach)
    number_bounds(ax, sides)
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


#: Ratio of curves to their bound from which on the axis is logarithmic beyond the bound.
_BEYOND = 10.0
#: Ratio of a bound to the curves above which it is not drawn, as it would flatten them.
_FAR = 30.0
#: Room left of the start, as a share of the axis, so that a jump there is not hidden by the axis.
_ROOM = 0.012


def stacked_panels(
    result: Result,
    signals: Sequence[Signal],
    texts: Sequence[str],
    ratios: Mapping[int, float] | None = None,
) -> Figure:
    """Return a figure with a panel for each order of derivative from 0 on, with its bounds.

    Args:
        result: The run, with the bounds.
        signals: The curves of each order.
        texts: Their names.
        ratios: Ratio to the bound to write above a panel, by order; by default that of the curves.
    """
    ratios = {} if ratios is None else ratios
    limits = result.experiment.limits
    bounds = [limits.known_sides(name) for name in DERIVATIVE_UNITS]
    units = ["rad", *DERIVATIVE_UNITS.values()]
    n = signals[0][1].shape[1]
    figure = Figure(figsize=(wide(PAGE), 0.6 + 1.3 * len(signals)), layout="constrained")
    axes = figure.subplots(len(signals), 1, sharex=True, squeeze=False).ravel()
    for order, (ax, (time, values), text) in enumerate(zip(axes, signals, texts, strict=True)):
        if order == 0:
            plot_between(ax, time, values, np.stack((limits.position_lower, limits.position_upper)))
        else:
            plot_bounded_order(ax, time, values, bounds[order - 1], ratios.get(order))
        ax.set_ylabel(f"{text} [{superscript(units[order])}]")
    time_axis(axes[-1], result)
    leave_room(axes[-1])
    figure.legend(handles=joint_handles(n), loc="outside upper center", ncols=n + 1)
    figure.align_ylabels()
    return figure


def plot_between(ax: Axes, time: Array, values: Array, bounds: Array) -> None:
    """Plot the angles of all joints, and the bounds that are near them.

    Args:
        ax: The axes.
        time: Shape (k,) [s].
        values: Angles, shape (k, n) [rad].
        bounds: Bounds of any joints, in an array of any shape [rad].
    """
    plot_joints(ax, time, values)
    low, high = span(values, least=0.02)
    near = np.unique(bounds[(bounds > low - (high - low)) & (bounds < high + (high - low))])
    for bound in near:
        ax.axhline(bound, **BOUND)
    low, high = min([low, *near]), max([high, *near])
    ax.set_ylim(low - 0.06 * (high - low), high + 0.06 * (high - low))
    ticks(ax.yaxis, 5)


def leave_room(ax: Axes) -> None:
    """Extend the time axis a little to the left of the start."""
    start, end = ax.get_xlim()
    ax.set_xlim(start - _ROOM * (end - start), end)


def plot_bounded_order(
    ax: Axes, time: Array, values: Array, sides: Sides | None, ratio: float | None = None
) -> None:
    """Plot one derivative of all joints with its bounds.

    The axis is linear between the bounds. If curves go far beyond, it is logarithmic outside.

    Args:
        ax: The axes.
        time: Shape (k,) [s].
        values: Shape (k, n).
        sides: Bounds, shape (n,) each; None if there are none.
        ratio: Ratio to the bounds to write above; by default that of the curves.
    """
    plot_joints(ax, time, values)
    finite = known_bounds(None if sides is None else np.concatenate(sides))
    peak = largest(values)
    in_view = finite[finite <= _FAR * peak] if peak > 0 else finite
    draw_bounds(ax, sides, in_view)
    if finite.size and peak > _BEYOND * finite[-1]:
        _linear_between(ax, float(finite[-1]), peak)
    else:
        reach = 1.15 * max([peak, *in_view])
        if reach > 0:
            ax.set_ylim(-reach, reach)
        ticks(ax.yaxis, 5)
    if sides is not None and finite.size:
        if ratio is None:
            known_values = np.where(np.isfinite(values), values, 0.0)
            shares = np.abs(known_values) / sides.toward(known_values > 0.0)
            ratio = float(shares.max(initial=0.0))
        excess_note(ax, ratio)
    if ax.get_yscale() == "linear":
        number_bounds(ax, sides)


def _linear_between(ax: Axes, bound: float, peak: float) -> None:
    """Set an axis that is linear up to the bound and logarithmic beyond, with few ticks."""
    reach = 10 ** np.ceil(np.log10(1.5 * peak))
    beyond = np.log10(reach / bound)
    ax.set_yscale("symlog", linthresh=bound, linscale=max(1.0, beyond / 3))
    ax.set_ylim(-reach, reach)
    decades = np.arange(np.ceil(np.log10(5.0 * bound)), np.log10(reach) + 0.5)
    decades = decades[:: -max(1, -(-decades.size // 2))]
    marks = [bound, *(10.0**decades)]
    ax.yaxis.set_major_locator(FixedLocator([-mark for mark in marks] + [0.0, *marks]))
    ax.yaxis.set_minor_locator(NullLocator())
    ax.yaxis.set_major_formatter(FuncFormatter(lambda x, place: number(x)))


def number(x: float) -> str:
    """Return a tick's label: large numbers as a power of ten."""
    if abs(x) < 1e3:
        return f"{x:g}".replace("-", "−")
    return f"${'-' if x < 0 else ''}10^{{{round(np.log10(abs(x)))}}}$"


@draws("position", "velocity", applies=bounds_jerk)
def derivatives(result: Result) -> Figure:
    """Draw angle to crackle of the arm's motion, with bounds.

    The ratio to a bound is taken from the metrics: for the acceleration, it is that of single
    steps and not of 10 ms.
    """
    ratios = {
        order: result.metrics[name]
        for order, name in enumerate(RATIO_METRICS.values(), start=1)
        if name in result.metrics
    }
    texts = ["angle", *DERIVATIVE_UNITS]
    return stacked_panels(result, derivatives_of_motion(result), texts, ratios)


@draws("position", "velocity", "levels", applies=lambda r: bounds_jerk(r) and shows_signals(r))
def displayed_signals(result: Result) -> Figure:
    """Draw the signals of the law's filters that stand for derivatives, with the same bounds.

    They are not the derivatives of the motion; `derivatives` shows those.
    """
    v = result.series.get("network_velocity", result.series["velocity"])
    levels = result.series["levels"]
    signals = [result.series["position"], v, *(levels[:, k] for k in range(levels.shape[1]))]
    names = [f"signal {order}" for order in range(2, len(signals))]
    return stacked_panels(
        result, [(result.time, values) for values in signals], ["angle", "velocity", *names]
    )

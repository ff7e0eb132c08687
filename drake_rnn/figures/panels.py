"""Panels, of which the figures consist: each draws on axes what it finds in a result."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from ..fields import Array
from ..metrics import ARRIVED
from ..paths import Rest
from ..result import Result
from .style import (
    BOUND,
    COLOURS,
    DESIRED,
    NOTE,
    TRACED,
    Style,
    finite,
    joint_handles,
    joint_style,
    label,
    largest,
    legend,
    log_axis,
    plot_joints,
    shade_window,
    span,
    ticks,
    time_axis,
    unit,
)

#: A bound further away than this many times the curves' peak is named rather than drawn.
_IN_VIEW = 3.0
#: Bounds closer to zero than this share of the curves' peak cannot be read from the axis.
_LEGIBLE = 0.05
#: The arm's curves are shown apart from the law's if they differ by more than this share.
_APART = 0.01
#: Units for small lengths.
_LENGTHS = (("m", 1.0), ("mm", 1e3), ("µm", 1e6))
#: How a joint's target is marked.
_GOAL: Style = {"marker": "D", "markersize": 3.0}


def plot_path(ax: Axes, result: Result) -> None:
    """Desired and traced path in the plane in which the desired one varies most."""
    p_WE, desired = result.series["p_WE"], result.series["p_WE_desired"]
    a, b = sorted(np.argsort(np.ptp(finite(desired), axis=0), kind="stable")[-2:].tolist())
    ax.plot(p_WE[:, a], p_WE[:, b], label="traced", **TRACED)
    lap = first_lap(result)
    ax.plot(desired[lap, a], desired[lap, b], label="desired", **DESIRED)
    ax.plot(p_WE[0, a], p_WE[0, b], "o", color="black", markersize=3.5, label="start")
    ax.margins(0.06)
    ax.set_aspect("equal", adjustable="datalim")
    ticks(ax.xaxis, 6)
    ticks(ax.yaxis, 6)
    ax.set(xlabel=f"{'xyz'[a]} [m]", ylabel=f"{'xyz'[b]} [m]")
    legend(ax)


def plot_angles(ax: Axes, result: Result) -> None:
    """All joints, and on the right edge where they should end."""
    plot_joints(ax, result.time, result.series["position"])
    handles = joint_handles(result.series["position"].shape[1])
    target = result.experiment.setup.target
    if target is not None:
        for k, angle in enumerate(target):
            colour = joint_style(k)["color"]
            ax.plot(result.time[-1:], angle, color=colour, zorder=3, clip_on=False, **_GOAL)
        handles.append(Line2D([], [], color="0.25", label="target", linestyle="none", **_GOAL))
    ax.set_ylabel(label("joint angle", "position"))
    time_axis(ax, result)
    legend(ax, handles)


def plot_velocities(ax: Axes, result: Result) -> None:
    """All joints, as the law asks for; the arm's own may be hidden in noise."""
    name = "network_velocity" if "network_velocity" in result.series else "velocity"
    text = "joint velocity, law" if apart(result, "velocity") else "joint velocity"
    plot_bounded(ax, result, name, result.experiment.setup.limits.velocity, text)
    legend(ax, joint_handles(result.series[name].shape[1]))


def plot_acceleration_norm(ax: Axes, result: Result) -> None:
    """Largest joint acceleration since the sample before."""
    # Before the first sample there is no step.
    time, arm = result.time[1:], result.series["acceleration_peak"][1:]
    curves = [arm]
    if apart(result, "acceleration"):
        curves.append(result.series["network_acceleration_peak"][1:])
        ax.plot(time, arm, color=COLOURS[4], label="arm")
    ax.plot(time, curves[-1], color=COLOURS[0], label="law" if len(curves) > 1 else None)
    known = _known(result.experiment.setup.limits.acceleration)
    # Joints may differ; the norm is between the extremes of their bounds.
    for k, bound in enumerate(np.unique(known[[0, -1]]) if known.size else ()):
        text = "bound" if known.size == 1 else "least and greatest bound"
        ax.axhline(bound, label=None if k else text, **BOUND)
    levels = [*map(largest, curves), *known]
    if max(levels) > 10 * min(levels) > 0 or largest(arm) > 10 * np.median(arm) > 0:
        log_axis(ax, [*curves, known])
    else:
        ax.set_ylim(0, 1.08 * max(levels) or None)
    ax.set_ylabel(label(r"largest $|\ddot q_i|$", "acceleration"))
    time_axis(ax, result)
    legend(ax)


def plot_position_error(ax: Axes, result: Result) -> None:
    """Its norm, and when it has settled."""
    tolerance = result.experiment.settling_tolerance_m
    ax.plot(result.time, result.position_error, color=COLOURS[0])
    ax.axhline(tolerance, label="settling tolerance", **BOUND)
    if (settled := result.metrics.get("settling_time_s", 0.0)) > 0:
        ax.axvline(settled, color="0.25", linestyle=":", label=f"settled at {settled:.2f} s")
    shade_window(ax, result)
    log_axis(ax, [result.position_error, tolerance * np.array([0.6, 1.6])])
    if not has_path(result):
        # It starts from zero, whence a line would run along the axis.
        ax.set_yscale("log", nonpositive="mask")
    ax.set_ylabel(label("position error", "p_WE"))
    time_axis(ax, result)
    legend(ax)


def plot_end_effector(ax: Axes, result: Result) -> None:
    """How far it is from its start, and how far the network's multipliers say it is."""
    p_WE = result.series["p_WE"]
    moved = p_WE - p_WE[0]
    length, scale = next(
        (name, scale) for name, scale in _LENGTHS if largest(moved) * scale >= 0.1 or name == "µm"
    )
    norm = np.linalg.norm(moved, axis=1)
    ax.plot(result.time, scale * norm, color="0.75", linewidth=2.2, label="distance")
    for name, colour, values in zip("xyz", COLOURS, moved.T, strict=False):
        ax.plot(result.time, scale * values, color=colour, linewidth=1.4, label=name)
    if "displacement" in result.series:
        told = result.series["displacement"] - result.series["displacement"][0]
        lines = ax.plot(result.time, scale * told, **DESIRED)
        lines[0].set_label("by the multipliers")
    ax.set_ylabel(f"end-effector drift [{length}]")
    time_axis(ax, result)
    legend(ax)


def plot_turn(ax: Axes, result: Result) -> None:
    """How far the end effector is off the orientation that it should keep."""
    ax.plot(result.time, 1e3 * result.series["orientation_error"], color=COLOURS[0])
    ax.set_ylim(bottom=0)
    ax.set_ylabel("orientation error [mrad]")
    time_axis(ax, result)


def plot_joint_error(ax: Axes, result: Result) -> None:
    """How far each joint is from its target, and when all have arrived."""
    error = np.abs(result.series["joint_error"])
    plot_joints(ax, result.time, error)
    bound = ax.axhline(ARRIVED, label=f"{ARRIVED:g} rad", **BOUND)
    handles = [*joint_handles(error.shape[1]), bound]
    if (settled := result.metrics.get("joint_settling_time_s", 0.0)) > 0:
        ax.axvline(settled, color="0.25", linestyle=":")
        side = "left" if settled < result.time[[0, -1]].mean() else "right"
        place: Style = {"ha": side, "va": "top", "transform": ax.get_xaxis_transform()}
        ax.text(settled, 0.98, f" settled at {settled:.2f} s ", **place, **NOTE)
    log_axis(ax, [*error.T, ARRIVED * np.array([0.6, 1.6])])
    ax.set_ylabel(label(r"$|q_i - q_{i,\mathrm{target}}|$", "joint_error"))
    time_axis(ax, result)
    legend(ax, handles)


def plot_moving_bounds(ax: Axes, result: Result) -> None:
    """All joints, as the law asks for, between bounds that change; what joints share, once."""
    values = law_velocity(result)
    plot_joints(ax, result.time, values)
    sides = [result.series["velocity_lower"], result.series["velocity_upper"]]
    for bounds in sides:
        plot_bound_curves(ax, result.time, bounds)
    # What opens far beyond the curves would flatten them.
    peak = largest(values)
    reach = 1.08 * min(max(peak, *map(largest, sides)), 2.0 * peak)
    if reach > 0:
        ax.set_ylim(-reach, reach)
    ax.set_ylabel(label("joint velocity", "velocity"))
    time_axis(ax, result)
    legend(ax, [*joint_handles(values.shape[1]), Line2D([], [], label="bounds", **BOUND)])


def plot_jacobian_error(ax: Axes, result: Result) -> None:
    """How far J_hat is from J, at large and along the motion."""
    difference = result.series["J"] - result.series["J_hat"]
    v = result.series["network_velocity"]
    size = np.linalg.norm(difference, axis=(1, 2))
    speed = np.linalg.norm(v, axis=1)
    along = np.linalg.norm(np.einsum("kmn,kn->km", difference, v), axis=1)
    # At rest there is no direction of motion.
    along = np.divide(along, speed, out=np.full(size.shape, np.nan), where=speed > 1e-6)
    ax.plot(result.time, along, color=COLOURS[4], linewidth=0.7, label="along the motion")
    ax.plot(result.time, size, color=COLOURS[0], label="Frobenius norm")
    shade_window(ax, result)
    log_axis(ax, [size, along])
    ax.set_ylabel(label(r"error of $\hat J$", "J"))
    time_axis(ax, result)
    legend(ax)


def plot_singular_value(ax: Axes, result: Result) -> None:
    """How far J is from losing rank."""
    J = result.series["J"]
    smallest = np.full(J.shape[0], np.nan)
    sound = np.isfinite(J).all(axis=(1, 2))
    smallest[sound] = np.linalg.svd(J[sound], compute_uv=False)[:, -1]
    ax.plot(result.time, smallest, color=COLOURS[0])
    ax.set_ylim(bottom=0)
    ax.set_ylabel(label("smallest singular value of $J$", "J"))
    time_axis(ax, result)


def plot_least_known(ax: Axes, result: Result) -> None:
    """What is least certain of J: its estimate, or else its rank."""
    (plot_jacobian_error if "J_hat" in result.series else plot_singular_value)(ax, result)


def plot_range(ax: Axes, position: Array, bounds: Array) -> None:
    """Where between its bounds each joint has been: 0 is the lower, 1 the upper."""
    bounded = np.flatnonzero(np.isfinite(bounds).all(axis=1))
    for k in bounded.tolist():
        lower, upper = bounds[k]
        low, high = (span(position[:, k], least=0.0) - lower) / (upper - lower)
        bar: Style = {"linewidth": 3, "solid_capstyle": "butt"}
        ax.plot([0, 1], [k + 1, k + 1], color="0.88", **bar)
        # A joint that rests is still seen.
        ax.plot([low - 0.004, high + 0.004], [k + 1, k + 1], **joint_style(k), **bar)
    for bound in (0, 1):
        ax.axvline(bound, **BOUND)
    ax.set_yticks(bounded + 1)
    ax.tick_params(axis="y", labelsize=6)
    ax.grid(visible=False, axis="y")
    ax.set(xlabel="position between bounds, lower to upper [-]", ylabel="joint [-]")
    ax.set_ylim(position.shape[1] + 0.7, 0.3)
    ax.margins(x=0.02)


def plot_bounded(ax: Axes, result: Result, name: str, bounds: Array | None, text: str) -> None:
    """Curves of all joints, with their bounds of either sign."""
    values = result.series[name]
    plot_joints(ax, result.time, values, linewidth=0.5 if _noisy(values) else 1.0)
    peak, known = largest(values), _known(bounds)
    in_view = known[(known <= _IN_VIEW * peak) & (known > 0.2 * _LEGIBLE * peak)]
    for bound in in_view:
        holders = np.flatnonzero(bounds == bound)
        own = {"color": joint_style(int(holders[0]))["color"]} if holders.size == 1 else {}
        for sign in (-1, 1):
            ax.axhline(sign * bound, **{**BOUND, **own})
    reach = 1.08 * max([peak, *in_view])
    notes = []
    # What cannot be read from the axes is written above the curves.
    steps = result.series.get(f"{name}_peak")
    if steps is not None and largest(steps) > 1.5 * peak:
        notes.append(f"up to {largest(steps):.3g} between samples")
    if known.size and (known[0] < _LEGIBLE * peak or in_view.size < known.size):
        ends = " to ".join(f"±{bound:g}" for bound in np.unique(known[[0, -1]]))
        notes.append(f"bounds {ends} {unit(name)}")
    if notes:
        place: Style = {"ha": "right", "va": "top", "transform": ax.transAxes}
        ax.text(0.99, 0.99, "; ".join(notes), **place, **NOTE)
        reach *= 1.15
    if reach > 0:
        ax.set_ylim(-reach, reach)
    ax.set_ylabel(label(text, name))
    time_axis(ax, result)


def plot_bound_curves(ax: Axes, time: Array, bounds: Array) -> None:
    """What joints share, once; of the others' bounds where they are not that."""
    curves, holders, counts = np.unique(bounds, axis=1, return_inverse=True, return_counts=True)
    common = curves[:, np.argmax(counts)]
    for k in np.argsort(-counts, kind="stable"):
        own = np.flatnonzero(holders.ravel() == k)
        colour = {"color": joint_style(int(own[0]))["color"]} if own.size == 1 else {}
        curve = curves[:, k]
        if k != np.argmax(counts):
            curve = np.where(curve == common, np.nan, curve)
        ax.plot(time, curve, **{**BOUND, **colour})


def has_target(result: Result) -> bool:
    """Whether there is a posture to reach."""
    return result.experiment.setup.target is not None


def has_path(result: Result) -> bool:
    """Whether the end effector is to go anywhere."""
    path = result.experiment.setup.path
    return not isinstance(path, Rest) or bool(path.offset.any())


def bounds_are_felt(result: Result) -> bool:
    """Whether a bound on the velocity that is not what it can be comes near a joint's."""
    v = law_velocity(result)
    for sign, name in ((1, "velocity_upper"), (-1, "velocity_lower")):
        bound = sign * result.series[name]
        widest = np.fmax.reduce(bound, axis=0)
        if ((bound < 0.95 * widest) & (sign * v > 0.5 * bound)).any():
            return True
    return False


def law_velocity(result: Result) -> Array:
    """What the law asks for; the arm's own velocity may be hidden in noise."""
    return result.series.get("network_velocity", result.series["velocity"])


def first_lap(result: Result) -> NDArray[np.bool_]:
    """Which samples belong to it: laps drawn over one another would fill the dashes' gaps."""
    return result.time <= result.experiment.setup.path.period + result.experiment.log_period


def apart(result: Result, quantity: str) -> bool:
    """Whether the arm's joints do something else than the law asks for."""
    law = result.series.get(f"network_{quantity}")
    if law is None:
        return False
    return largest(result.series[quantity] - law) > _APART * largest(law)


def _known(bounds: Array | None) -> Array:
    """The values that finite bounds have, rising."""
    return np.empty(0) if bounds is None else np.unique(bounds[np.isfinite(bounds)])


def _noisy(values: Array) -> bool:
    """Whether curves go to and fro from sample to sample, and so would hide one another."""
    steps = np.diff(values, axis=0)
    return bool(np.nansum(np.abs(np.diff(steps, axis=0))) > 0.5 * np.nansum(np.abs(steps)))

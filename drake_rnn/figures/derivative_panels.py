"""Panels of the joint positions and their derivatives, one for each order, with bounds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from ..inputs.fields import Array
from ..measures import raised
from ..robot.limits import DERIVATIVE_UNITS
from ..runs.derivatives import Signal
from ..runs.result import Result
from .bound_lines import draw_bounds, excess_note, known_bounds, number_bounds
from .looks import BOUND
from .paper import wide
from .style import PAGE, joint_handles, largest, plot_joints, span, ticks, time_axis

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
    bounds = [limits.bounds[name] for name in DERIVATIVE_UNITS]
    units = ["rad", *DERIVATIVE_UNITS.values()]
    n = signals[0][1].shape[1]
    figure = Figure(figsize=(wide(PAGE), 0.6 + 1.3 * len(signals)), layout="constrained")
    axes = figure.subplots(len(signals), 1, sharex=True, squeeze=False).ravel()
    for order, (ax, (time, values), text) in enumerate(zip(axes, signals, texts, strict=True)):
        if order == 0:
            plot_between(ax, time, values, np.stack((limits.position_lower, limits.position_upper)))
        else:
            plot_bounded_order(ax, time, values, bounds[order - 1], ratios.get(order))
        ax.set_ylabel(f"{text} [{raised(units[order])}]")
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
    ax: Axes, time: Array, values: Array, bounds: Array | None, ratio: float | None = None
) -> None:
    """Plot one derivative of all joints with its bounds.

    The axis is linear between the bounds. If curves go far beyond, it is logarithmic outside.

    Args:
        ax: The axes.
        time: Shape (k,) [s].
        values: Shape (k, n).
        bounds: Bounds of the magnitude, shape (n,); None if there are none.
        ratio: Ratio to the bounds to write above; by default that of the curves.
    """
    plot_joints(ax, time, values)
    known = known_bounds(bounds)
    peak = largest(values)
    in_view = known[known <= _FAR * peak] if peak > 0 else known
    draw_bounds(ax, in_view)
    if known.size and peak > _BEYOND * known[-1]:
        _linear_between(ax, float(known[-1]), peak)
    else:
        reach = 1.15 * max([peak, *in_view])
        if reach > 0:
            ax.set_ylim(-reach, reach)
        ticks(ax.yaxis, 5)
    if known.size:
        if ratio is None:
            known_values = np.where(np.isfinite(values), np.abs(values), 0.0)
            ratio = float((known_values / bounds).max(initial=0.0))
        excess_note(ax, ratio)
    if ax.get_yscale() == "linear":
        number_bounds(ax, bounds)


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

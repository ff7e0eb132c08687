"""Panels of the joints' derivatives, one an order, each with its bounds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from ..inputs.fields import Array
from ..robot.limits import DERIVATIVE_UNITS
from ..runs.result import Result
from .style import (
    BOUND,
    NOTE,
    PAGE,
    joint_handles,
    joint_style,
    largest,
    plot_joints,
    span,
    ticks,
    time_axis,
)

#: Between the velocities of which derivatives are differences [s]; the metrics have the same.
_DIFFERENCE = 0.01
#: Curves this many times beyond their bound are drawn logarithmically beyond it.
_BEYOND = 10.0
#: Bounds this many times beyond the curves would flatten them, and are not drawn.
_FAR = 30.0
#: Room before the start, so that what jumps there is not hidden by the axis.
_ROOM = 0.012

#: A signal of every joint: when, shape (k,) [s], and what, shape (k, n).
Signal = tuple[Array, Array]


def derivatives_of_motion(result: Result) -> list[Signal]:
    """Positions, velocities, and the second to fifth derivative as differences over 10 ms.

    Each difference is at the middle of what it is taken over. Where samples are stored further
    apart, it is over their own distance.
    """
    position, velocity = result.series["position"], result.series["velocity"]
    found = [(result.time, position), (result.time, velocity)]
    step = max(_DIFFERENCE, result.experiment.document.log_period)
    time = np.arange(result.time[0], result.time[-1] + 1e-9, step)
    at = np.minimum(np.searchsorted(result.time, time - 1e-9), result.time.size - 1)
    for order in range(1, len(DERIVATIVE_UNITS)):
        # A run that diverged may hold numbers of which there is no difference.
        with np.errstate(invalid="ignore", over="ignore"):
            values = np.diff(velocity[at], n=order, axis=0) / step**order
        found.append((time[: len(values)] + order * step / 2, values))
    return found


def stacked(
    result: Result,
    signals: Sequence[Signal],
    texts: Sequence[str],
    ratios: Mapping[int, float] | None = None,
) -> Figure:
    """A panel for each order from 0 on, with its bounds.

    Args:
        result: Whose bounds there are.
        signals: Of each order.
        texts: What they are.
        ratios: To their bounds, by order, where that of the curves is not all there is to say.
    """
    ratios = {} if ratios is None else ratios
    limits = result.experiment.limits
    bounds = [limits.bounds[name] for name in DERIVATIVE_UNITS]
    units = ["rad", *DERIVATIVE_UNITS.values()]
    n = signals[0][1].shape[1]
    figure = Figure(figsize=(PAGE, 0.6 + 1.3 * len(signals)), layout="constrained")
    axes = figure.subplots(len(signals), 1, sharex=True, squeeze=False).ravel()
    for order, (ax, (time, values), text) in enumerate(zip(axes, signals, texts, strict=True)):
        if order == 0:
            plot_between(ax, time, values, np.stack((limits.position_lower, limits.position_upper)))
        else:
            plot_bounded_order(ax, time, values, bounds[order - 1], ratios.get(order))
        unit = units[order]
        for power, raised in zip("2345", "²³⁴⁵", strict=True):
            unit = unit.replace(f"^{power}", raised)
        ax.set_ylabel(f"{text} [{unit}]")
    time_axis(axes[-1], result)
    with_room(axes[-1])
    figure.legend(handles=joint_handles(n), loc="outside upper center", ncols=n + 1)
    figure.align_ylabels()
    return figure


def plot_between(ax: Axes, time: Array, values: Array, bounds: Array) -> None:
    """Angles of all joints, and those bounds that are near them."""
    plot_joints(ax, time, values)
    low, high = span(values, least=0.02)
    near = np.unique(bounds[(bounds > low - (high - low)) & (bounds < high + (high - low))])
    for bound in near:
        ax.axhline(bound, **BOUND)
    low, high = min([low, *near]), max([high, *near])
    ax.set_ylim(low - 0.06 * (high - low), high + 0.06 * (high - low))
    ticks(ax.yaxis, 5)


def with_room(ax: Axes) -> None:
    """A little time before the start."""
    start, end = ax.get_xlim()
    ax.set_xlim(start - _ROOM * (end - start), end)


def plot_bounded_order(
    ax: Axes, time: Array, values: Array, bounds: Array | None, ratio: float | None = None
) -> None:
    """One derivative of all joints with its bounds, which are in view unless they are far away.

    The axis is linear between the bounds; where curves go far beyond, it is logarithmic there.
    ``ratio``, by default that of the curves to their bounds, stands above it.
    """
    plot_joints(ax, time, values)
    known = np.empty(0) if bounds is None else np.unique(bounds[np.isfinite(bounds)])
    peak = largest(values)
    in_view = known[known <= _FAR * peak] if peak > 0 else known
    for bound in in_view:
        holders = np.flatnonzero(bounds == bound)
        own = {"color": joint_style(int(holders[0]))["color"]} if holders.size == 1 else {}
        for sign in (-1, 1):
            ax.axhline(sign * bound, **{**BOUND, **own})
    if known.size and peak > _BEYOND * known[-1]:
        _linear_between(ax, float(known[-1]), peak)
    else:
        reach = 1.15 * max([peak, *in_view])
        if reach > 0:
            ax.set_ylim(-reach, reach)
        ticks(ax.yaxis, 5)
    if known.size:
        if ratio is None:
            sound = np.where(np.isfinite(values), np.abs(values), 0.0)
            ratio = float((sound / bounds).max(initial=0.0))
        ax.set_title(f"up to {ratio:.3g} × bound", loc="right", pad=2, **NOTE)


def _linear_between(ax: Axes, bound: float, peak: float) -> None:
    """Linear up to the bound and logarithmic from there; ticks that do not crowd."""
    reach = 10 ** np.ceil(np.log10(1.5 * peak))
    beyond = np.log10(reach / bound)
    ax.set_yscale("symlog", linthresh=bound, linscale=max(1.0, beyond / 3))
    ax.set_ylim(-reach, reach)
    decades = np.arange(np.ceil(np.log10(5.0 * bound)), np.log10(reach) + 0.5)
    decades = decades[:: -max(1, -(-decades.size // 2))]
    marks = [bound, *(10.0**decades)]
    ax.yaxis.set_major_locator(FixedLocator([-mark for mark in marks] + [0.0, *marks]))
    ax.yaxis.set_minor_locator(NullLocator())
    ax.yaxis.set_major_formatter(FuncFormatter(lambda x, place: _number(x)))


def _number(x: float) -> str:
    """Of many sizes on one axis, each by itself."""
    if abs(x) < 1e3:
        return f"{x:g}".replace("-", "−")
    return f"${'-' if x < 0 else ''}10^{{{round(np.log10(abs(x)))}}}$"

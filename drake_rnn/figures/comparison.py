"""The figure that compares laws: their errors, and how much of each bound they use."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from ..inputs.fields import Array
from ..robot.limits import DERIVATIVE_UNITS
from ..runs.derivatives import derivatives_of_motion
from ..runs.limit_use import share_of_range
from ..runs.result import Result
from .derivative_panels import leave_room
from .looks import BOUND, nth
from .paper import wide
from .style import PAGE, largest, legend_above, log_axis, save, styled, time_axis

#: Times [s] and shares of bounds [-] for each order of derivative, shape (k,) both.
Shares = list[tuple[Array, Array]]

#: Share of a bound, and error [m], below which curves are not shown.
_LEAST, _LEAST_ERROR = 1e-3, 1e-10


def comparison_figure(groups: Mapping[str, Mapping[str, Result]], file: Path) -> Path:
    """Draw the runs of several laws over one another, a column of panels for each group of runs.

    The first panel of a column shows the position error. Each of the others shows, for one order of
    derivative that is bounded in any run, the largest share of its bound that any joint uses; 1 is
    the bound.

    Args:
        groups: Runs by law, in groups by path; each group has the same laws in the same order.
        file: File to write.

    Returns:
        The file.
    """
    shares = {
        title: [shares_of_bounds(run) for run in runs.values()] for title, runs in groups.items()
    }
    orders = bounded_orders([share for each in shares.values() for share in each])
    kinds = ("angle", *DERIVATIVE_UNITS)
    names = ["position error [m]", *(f"{kinds[order]} / bound [-]" for order in orders)]
    with styled():
        figure = Figure(figsize=(wide(PAGE), 0.8 + 1.25 * len(names)), layout="constrained")
        axes: Any = figure.subplots(len(names), len(groups), squeeze=False, sharex="col")
        for column, (title, runs) in zip(axes.T, groups.items(), strict=True):
            column[0].set_title(title)
            plot_errors(column[0], runs)
            plot_shares(dict(zip(orders, column[1:], strict=True)), shares[title])
            time_axis(column[-1], max(runs.values(), key=lambda run: float(run.time[-1])))
            leave_room(column[-1])
        for ax, name in zip(axes[:, 0], names, strict=True):
            ax.set_ylabel(name)
        legend_above(figure, axes[0, 0])
        figure.align_ylabels()
        save(figure, file)
    return file


def shares_of_bounds(result: Result) -> Shares:
    """Return the largest share of its bound that any joint uses, for derivatives of order 0 to 5.

    Returns:
        Times [s] and shares [-] for each order, shape (k,) both.
    """
    limits = result.experiment.limits
    signals = derivatives_of_motion(result)
    shares = [(signals[0][0], share_of_range(signals[0][1], limits))]
    for (time, values), name in zip(signals[1:], DERIVATIVE_UNITS, strict=True):
        bound = limits.bounds[name]
        share = np.full_like(values, np.nan) if bound is None else np.abs(values) / bound
        shares.append((time, share.max(axis=1)))
    return shares


def plot_errors(ax: Axes, runs: Mapping[str, Result]) -> None:
    """Plot the position error of every run."""
    for k, (name, result) in enumerate(runs.items()):
        ax.plot(result.time, result.position_error, label=name, **nth(k))
    _log_axis_from(ax, _LEAST_ERROR, [result.position_error for result in runs.values()])


def bounded_orders(shares: Sequence[Shares]) -> list[int]:
    """Return the orders of derivatives that are bounded in any of some runs."""
    every = zip(*shares, strict=True)
    return [k for k, runs in enumerate(every) if any(np.isfinite(share).any() for _, share in runs)]


def plot_shares(axes: Mapping[int, Axes], shares: Sequence[Shares]) -> None:
    """Plot the share of its bound that each order of derivative uses, a panel for each order."""
    for order, ax in axes.items():
        curves = [each[order] for each in shares]
        for k, (time, share) in enumerate(curves):
            ax.plot(time, share, **nth(k))
        ax.axhline(1.0, **BOUND)
        values = [share for _, share in curves]
        if order == 0:
            ax.set_ylim(0, 1.15 * max(1.0, *map(largest, values)))
        else:
            _log_axis_from(ax, _LEAST, [*values, np.array([0.05, 2.0])])


def _log_axis_from(ax: Axes, least: float, curves: list[Array]) -> None:
    """Set a logarithmic y-axis for curves, which begins no lower than at ``least``."""
    log_axis(ax, curves)
    ax.set_ylim(bottom=max(ax.get_ylim()[0], least))
    ax.yaxis.set_minor_locator(NullLocator())

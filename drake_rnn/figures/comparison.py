"""The picture that lays laws over one another: errors, and how much of each bound they take."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from ..inputs.fields import Array
from ..robot.limits import DERIVATIVE_UNITS, JointLimits
from ..runs.result import Result
from .derivative_panels import derivatives_of_motion, with_room
from .style import BOUND, COLOURS, PAGE, largest, log_axis, save, styled, time_axis

#: Less than this share of a bound, or this error [m], is not told from none.
_LEAST, _LEAST_ERROR = 1e-3, 1e-10

_LOOKS: tuple[dict[str, Any], ...] = (
    {"color": COLOURS[1], "linewidth": 0.8},
    {"color": COLOURS[0], "linewidth": 0.8},
    {"color": COLOURS[2], "linewidth": 1.2},
    {"color": COLOURS[3], "linewidth": 0.8},
)


def comparison_figure(groups: Mapping[str, Mapping[str, Result]], file: Path) -> Path:
    """A column for each group of runs; position error, then a panel an order.

    Those panels show the largest share of its bound that any joint takes; 1 is the bound.

    Args:
        groups: The runs to be laid over one another, by law, in groups by path; of the same laws,
            in the same order, in each.
        file: To write.

    Returns:
        The file.
    """
    rows = 2 + len(DERIVATIVE_UNITS)
    with styled():
        figure = Figure(figsize=(PAGE, 0.8 + 1.25 * rows), layout="constrained")
        axes: Any = figure.subplots(rows, len(groups), squeeze=False, sharex="col")
        for column, (title, runs) in zip(axes.T, groups.items(), strict=True):
            column[0].set_title(title)
            panels: list[list[tuple[Array, Array]]] = [[] for _ in column]
            for k, (name, result) in enumerate(runs.items()):
                panels[0].append((result.time, result.position_error))
                for panel, share in zip(panels[1:], shares_of_bounds(result), strict=True):
                    panel.append(share)
                for ax, panel in zip(column, panels, strict=True):
                    ax.plot(*panel[-1], label=name, **_LOOKS[k % len(_LOOKS)])
            for order, (ax, panel) in enumerate(zip(column, panels, strict=True), start=-1):
                curves = [values for _, values in panel]
                if order >= 0:
                    ax.axhline(1.0, **BOUND)
                    curves.append(np.array([0.05, 2.0]))
                if order == 0:
                    ax.set_ylim(0, 1.08 * max(1.0, *map(largest, curves)))
                else:
                    log_axis(ax, curves)
                    ax.set_ylim(bottom=max(ax.get_ylim()[0], _LEAST_ERROR if order < 0 else _LEAST))
                    ax.yaxis.set_minor_locator(NullLocator())
            time_axis(column[-1], max(runs.values(), key=lambda run: float(run.time[-1])))
            with_room(column[-1])
        names = ["position error [m]"]
        names += [f"{name} / bound [-]" for name in ("angle", *DERIVATIVE_UNITS)]
        for ax, name in zip(axes[:, 0], names, strict=True):
            ax.set_ylabel(name)
        handles = axes[0, 0].get_legend_handles_labels()
        figure.legend(*handles, loc="outside upper center", ncols=len(handles[1]))
        figure.align_ylabels()
        save(figure, file)
    return file


def shares_of_bounds(result: Result) -> list[tuple[Array, Array]]:
    """The largest share of its bound that any joint takes, of orders 0 to 5: times and shares."""
    limits = result.experiment.limits
    signals = derivatives_of_motion(result)
    shares = [(signals[0][0], _share_of_range(signals[0][1], limits))]
    for (time, values), name in zip(signals[1:], DERIVATIVE_UNITS, strict=True):
        bound = limits.bounds[name]
        share = np.full_like(values, np.nan) if bound is None else np.abs(values) / bound
        shares.append((time, share.max(axis=1)))
    return shares


def _share_of_range(position: Array, limits: JointLimits) -> Array:
    """1 at either limit, 0 in the middle between them."""
    middle = (limits.position_upper + limits.position_lower) / 2
    half = (limits.position_upper - limits.position_lower) / 2
    return np.asarray((np.abs(position - middle) / half).max(axis=1))

"""The figures of a campaign: how metrics are distributed, and what they depend on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter

from ..campaigns.summary import MetricSummary, Summary
from ..campaigns.table import Line, metric_column, varied_numbers
from ..inputs.fields import Array
from .style import BOUND, COLOURS, PAGE, save, styled, ticks

_COLUMNS = 3
#: Largest number of panels; further metrics are in the tables alone.
_MOST = 12
#: Values of a positive metric that spread more than this are drawn over a logarithmic axis.
_DECADES = 30.0
#: Points of a scatter; of more, every so many.
_POINTS = 4000


def distribution_figure(
    summary: Summary, lines: Sequence[Line], bounds: Mapping[str, Any], file: Path | BytesIO
) -> bool:
    """Draw a histogram of each metric, with its bounds; return whether there is anything to draw.

    Args:
        summary: What is known of the campaign.
        lines: Its rows.
        bounds: The section ``accept`` of its experiment, by metric.
        file: Where to write it.
    """
    shown = [metric for metric in summary.metrics if metric.count > 1][:_MOST]
    if not shown:
        return False
    with styled():
        figure, panels = _panels(len(shown))
        for ax, metric in zip(panels, shown, strict=False):
            _histogram(ax, _known(lines, metric.name))
            for bound in bounds.get(metric.name, {}).values():
                ax.axvline(bound, **BOUND)
            ax.set_title(metric.name, fontsize="small")
            ax.set_ylabel("runs")
        save(figure, file)
    return True


def sensitivity_figure(summary: Summary, lines: Sequence[Line], file: Path | BytesIO) -> bool:
    """Draw each metric over the varied number that its order follows most; return whether any is.

    Args:
        summary: What is known of the campaign.
        lines: Its rows.
        file: Where to write it.
    """
    numbers = varied_numbers([line for line in lines if line.outcome.status == "complete"])
    complete = [line for line in lines if line.outcome.status == "complete"]
    shown = [(metric, key) for metric in summary.metrics if (key := strongest(metric))][:_MOST]
    if not shown:
        return False
    with styled():
        figure, panels = _panels(len(shown))
        for ax, (metric, key) in zip(panels, shown, strict=False):
            every = max(1, len(complete) // _POINTS)
            x, y = numbers[key][::every], metric_column(complete, metric.name)[::every]
            ax.plot(x, y, ".", color=COLOURS[0], markersize=2.5)
            if _is_wide(y[np.isfinite(y)]):
                ax.set_yscale("log")
            if _is_wide(x):
                ax.set_xscale("log")
            ax.margins(x=0.05)
            ax.set_xlabel(f"{key}  (rank correlation {metric.correlations[key]:.2f})")
            ax.set_title(metric.name, fontsize="small")
        save(figure, file)
    return True


def strongest(metric: MetricSummary) -> str:
    """Return the varied number that a metric's order follows most; empty if there is none."""
    known = {key: abs(r) for key, r in metric.correlations.items() if np.isfinite(r)}
    return max(known, key=lambda key: known[key], default="")


def _panels(count: int) -> tuple[Figure, list[Axes]]:
    height = -(-count // _COLUMNS)
    figure = Figure(figsize=(PAGE, 2.0 * height + 0.2), layout="constrained")
    axes = figure.subplots(height, min(_COLUMNS, count), squeeze=False)
    for ax in list(axes.flat)[count:]:
        ax.set_visible(False)
    return figure, list(axes.flat)


def _histogram(ax: Axes, values: Array) -> None:
    if _is_wide(values):
        ax.set_xscale("log")
        edges = np.geomspace(values.min(), values.max(), _bins(values) + 1)
    else:
        edges = np.linspace(values.min(), values.max(), _bins(values) + 1)
    if edges[0] == edges[-1]:
        edges = np.array([edges[0] - 0.5, edges[0] + 0.5])
    ax.hist(values, bins=edges.tolist(), color=COLOURS[0])
    ax.margins(x=0.05)
    # Panels are narrow, and runs are whole.
    if ax.get_xscale() == "log":
        ax.xaxis.set_major_locator(LogLocator(numticks=4))
        ax.xaxis.set_minor_formatter(NullFormatter())
    else:
        ticks(ax.xaxis, 3)
    ax.yaxis.set_major_locator(MaxNLocator(4, integer=True))


def _bins(values: Array) -> int:
    return int(np.clip(np.sqrt(values.size), 5, 40))


def _known(lines: Sequence[Line], name: str) -> Array:
    column = metric_column(lines, name)
    return np.asarray(column[np.isfinite(column)])


def _is_wide(values: Array) -> bool:
    return bool(values.size and values.min() > 0 and values.max() > _DECADES * values.min())

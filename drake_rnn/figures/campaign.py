"""The figures of a campaign: how metrics are distributed, and what they depend on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter, StrMethodFormatter

from ..campaigns.summary import MetricSummary, Summary
from ..campaigns.table import Line, metric_column, varied_numbers
from ..experiment import unit_of_key
from ..inputs.fields import Array
from .grid import filled_page
from .labels import key_label, metric_label
from .looks import BOUND, INK, NOTE
from .style import save, styled, ticks

#: Largest number of panels; further metrics are in the tables alone.
_MOST = 12
#: Values of a positive metric that spread more than this are drawn over a logarithmic axis.
_DECADES = 30.0
#: Points of a scatter; of more, every so many.
_POINTS = 4000
#: Colour of a histogram: a paler ink, as it covers much.
_BARS = "0.55"


def distribution_figure(
    summary: Summary, lines: Sequence[Line], bounds: Mapping[str, Any], file: Path | BytesIO
) -> bool:
    """Draw a histogram of each metric, with its bounds; return whether there is anything to draw.

    Args:
        summary: The summary of the campaign.
        lines: Its rows.
        bounds: The section ``accept`` of its experiment, by metric.
        file: File to write.
    """
    shown = [metric for metric in summary.metrics if metric.count > 1][:_MOST]
    if not shown:
        return False
    with styled():
        figure, panels = filled_page(len(shown))
        for ax, metric in zip(panels, shown, strict=True):
            column = metric_column(lines, metric.name)
            _histogram(ax, column[np.isfinite(column)])
            for bound in bounds.get(metric.name, {}).values():
                ax.axvline(bound, label="bound", **BOUND)
            ax.set_xlabel(metric_label(metric.name))
            ax.set_ylabel("runs [-]")
        _legend_of_bounds(figure, panels)
        save(figure, file)
    return True


def sensitivity_figure(
    summary: Summary,
    lines: Sequence[Line],
    document: Mapping[str, Any],
    file: Path | BytesIO,
) -> bool:
    """Draw each metric over the varied number that its order follows most; return whether any is.

    Args:
        summary: The summary of the campaign.
        lines: Its rows.
        document: The document of its experiment, for the units of varied keys.
        file: Where to write it.
    """
    complete = [line for line in lines if line.outcome.status == "complete"]
    numbers = varied_numbers(complete)
    shown = [(metric, key) for metric in summary.metrics if (key := strongest(metric))][:_MOST]
    if not shown:
        return False
    with styled():
        figure, panels = filled_page(len(shown))
        for ax, (metric, key) in zip(panels, shown, strict=True):
            every = max(1, len(complete) // _POINTS)
            x, y = numbers[key][::every], metric_column(complete, metric.name)[::every]
            ax.plot(x, y, ".", color=INK, markersize=2.5)
            if _is_wide(y[np.isfinite(y)]):
                ax.set_yscale("log")
            if _is_wide(x):
                ax.set_xscale("log")
            ax.margins(x=0.05)
            ax.set_xlabel(key_label(key, unit_of_key(document, key)))
            ax.set_ylabel(metric_label(metric.name))
            note = f"rank correlation {metric.correlations[key]:.2f}".replace("-", "−")
            ax.set_title(note, loc="right", pad=2, **NOTE)
        save(figure, file)
    return True


def strongest(metric: MetricSummary) -> str:
    """Return the varied number that a metric's order follows most; empty if there is none."""
    known = {key: abs(r) for key, r in metric.correlations.items() if np.isfinite(r)}
    return max(known, key=lambda key: known[key], default="")


def _legend_of_bounds(figure: Figure, panels: Sequence[Axes]) -> None:
    """Add a legend that names the dashed lines, if there are any."""
    lines = [line for ax in panels for line in ax.lines]
    if lines:
        figure.legend(handles=lines[:1], loc="outside upper center")


def _histogram(ax: Axes, values: Array) -> None:
    """Draw a histogram of finite values, over a logarithmic axis if they spread widely."""
    wide = _is_wide(values)
    bins = int(np.clip(np.sqrt(values.size), 5, 40))
    edges = (np.geomspace if wide else np.linspace)(values.min(), values.max(), bins + 1)
    ax.set_xscale("log" if wide else "linear")
    if edges[0] == edges[-1]:
        edges = np.array([edges[0] - 0.5, edges[0] + 0.5])
    ax.hist(values, bins=edges.tolist(), color=_BARS)
    ax.margins(x=0.05)
    # Panels are narrow, and numbers of runs are integers.
    if wide:
        ax.xaxis.set_major_locator(LogLocator(numticks=4))
        ax.xaxis.set_minor_formatter(NullFormatter())
    else:
        ticks(ax.xaxis, 3)
        # A power of ten beside the axis would touch its label.
        ax.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    ax.yaxis.set_major_locator(MaxNLocator(4, integer=True))


def _is_wide(values: Array) -> bool:
    return bool(values.size and values.min() > 0 and values.max() > _DECADES * values.min())

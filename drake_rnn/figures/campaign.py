"""The figures of a campaign: how metrics are distributed, and what they depend on.

- The page of a campaign: one file, with tables and figures inside it.
"""

from __future__ import annotations

import math
from base64 import b64encode
from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter, StrMethodFormatter

from ..colours import components
from ..errors import InvalidInputError
from ..experiment import unit_of_key
from ..inputs.fields import Array
from ..inputs.files import page_templates
from ..jobs import CampaignResult
from ..jobs.summary import (
    Interval,
    Line,
    MetricSummary,
    Spread,
    Statistic,
    Summary,
    metric_column,
    smaller_is_worse,
    varied_numbers,
)
from ..measures import METRICS, format_number, prefix_unit, superscript
from ..runs.folder import written_whole
from .style import (
    BOUND,
    INK,
    NOTE,
    SERIES,
    common_style,
    current,
    filled_page,
    key_label,
    metric_label,
    save,
    ticks,
)

#: Largest number of panels; further metrics are in the tables alone.
_MOST = 12
#: Values of a positive metric that spread more than this are drawn over a logarithmic axis.
_DECADES = 30.0
#: Largest value that is drawn; a logarithmic axis up to the largest double has no end.
_LARGEST = 1e100
#: Points of a scatter; of more, every so many.
_POINTS = 4000
#: Height of a group in a panel [inch], and the most runs of one that are drawn as dots.
_LINE, _DOTS = 0.28, 200
#: Most characters of a value beside a panel.
_VALUE = 24
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
    metrics = [metric for metric in summary.metrics if metric.count > 1][:_MOST]
    if not metrics:
        return False
    with common_style():
        figure, panels = filled_page(len(metrics))
        for ax, metric in zip(panels, metrics, strict=True):
            column = _clip_diverged(metric_column(lines, metric.name))
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
    complete = [line for line in lines if line.record.complete]
    numbers = varied_numbers(complete)
    metrics = [(metric, key) for metric in summary.metrics if (key := strongest(metric))][:_MOST]
    if not metrics:
        return False
    with common_style():
        figure, panels = filled_page(len(metrics))
        for ax, (metric, key) in zip(panels, metrics, strict=True):
            every = max(1, len(complete) // _POINTS)
            x, y = (
                numbers[key][::every],
                _clip_diverged(metric_column(complete, metric.name)[::every]),
            )
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


def groups_figure(
    groups: Mapping[str, Mapping[str, Spread]],
    metrics: Sequence[str],
    statistic: Statistic,
    file: Path | BytesIO,
) -> bool:
    """Draw each metric of groups with error bars, over its runs; return whether there is any.

    Args:
        groups: The metrics of each group, by the name that it is called by.
        metrics: Names of the metrics, a panel each.
        statistic: Mean and standard deviation, or the middle quantile with the outer ones.
        file: File to write.
    """
    metric_names = [m for m in metrics if any(m in g and g[m].count for g in groups.values())][
        :_MOST
    ]
    if not metric_names:
        return False
    with common_style():
        figure, panels = filled_page(len(metric_names))
        width, height = figure.get_size_inches()
        # A line for each group in each row of panels.
        rows = len({round(ax.get_position().y0, 3) for ax in panels})
        figure.set_size_inches(width, max(height, rows * (0.6 + _LINE * len(groups))))
        for ax, metric in zip(panels, metric_names, strict=True):
            _error_bars(ax, metric, [each.get(metric) for each in groups.values()], statistic)
            ax.set_yticks(range(len(groups)), labels=[_on_lines(name) for name in groups])
            ax.set_ylim(len(groups) - 0.5, -0.5)
        save(figure, file)
    return True


def _on_lines(name: str) -> str:
    """Return the name of a group on a line for each value, which leave room for the panel."""
    parts = name.split(", ")
    return "\n".join(each if len(each) <= _VALUE else f"{each[: _VALUE - 1]}…" for each in parts)


def _error_bars(
    ax: Axes, metric: str, spreads: Sequence[Spread | None], statistic: Statistic
) -> None:
    """Draw the middle of each group with bars, and its runs as dots, below one another."""
    every = np.concatenate([each.values for each in spreads if each is not None])
    own = METRICS.by_name[metric].unit
    unit, factor = (own, 1.0) if own == "1" else prefix_unit(float(np.abs(every).max()), own)
    for k, each in enumerate(spreads):
        if each is None or not each.count:
            continue
        dots = factor * each.values[:: max(1, each.count // _DOTS)]
        ax.plot(dots, np.full(dots.size, k), ".", color=_BARS, markersize=2.5, zorder=1)
        middle, down, up = (factor * number for number in each.interval(statistic))
        reach = None if math.isnan(down) else [[max(down, 0.0)], [max(up, 0.0)]]
        ax.errorbar(middle, k, xerr=reach, fmt="o", color=INK, markersize=4, capsize=3)
    if _is_wide(every):
        ax.set_xscale("log")
    else:
        ticks(ax.xaxis, 3)
        ax.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    ax.margins(x=0.08)
    ax.set_xlabel(metric_label(metric).replace(f"[{superscript(own)}]", f"[{superscript(unit)}]"))
    text = "mean ± standard deviation" if statistic == "mean" else "middle and outer quantiles"
    ax.set_title(text, loc="right", pad=2, **NOTE)


def strongest(metric: MetricSummary) -> str:
    """Return the varied number that a metric's order follows most; empty if there is none."""
    finite = {key: abs(r) for key, r in metric.correlations.items() if np.isfinite(r)}
    return max(finite, key=lambda key: finite[key], default="")


def _clip_diverged(column: Array) -> Array:
    """Return the values of a metric as they are drawn: those of runs that diverged at the end."""
    return np.clip(column, -_LARGEST, _LARGEST)


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


#: Rows that did not come to their end that are listed; all are in the table.
_MOST_ROWS = 50
#: Numbers of the colours of negative and positive correlations, which have no meaning of their own.
_LESS, _MORE = 4, 2


def write_campaign_page(result: CampaignResult, file: Path) -> Path:
    """Write the outcome of a campaign as a page of HTML, and return its file.

    Args:
        result: The campaign.
        file: File to write.

    Raises:
        InvalidInputError: If it cannot be written.
    """
    template = page_templates(Path(__file__).parent).get_template("campaign_page.html.jinja")
    summary = result.summary
    distributions, sensitivity = _figures(result)
    page = template.render(
        summary=summary,
        expect=result.plan.campaign.expect,
        confidence=f"{summary.confidence:.0%}",
        counts=_counts(result),
        shares=[(name, interval_text(share, True)) for name, share in summary.shares.items()],
        metrics=_metrics(summary),
        distributions=distributions,
        sensitivity=sensitivity,
        worst=[
            (metric.name, worst.row, f"{worst.value:.6g}", worst.command)
            for metric in summary.metrics
            for worst in metric.worst
        ],
        smaller_is_worse=[m.name for m in summary.metrics if smaller_is_worse(m.name)],
        correlations=[metric for metric in summary.metrics if metric.correlations],
        less=_colour(_LESS),
        more=_colour(_MORE),
        listed=_MOST_ROWS,
    )
    try:
        with written_whole(file) as stream:
            stream.write(page)
    except OSError as error:
        raise InvalidInputError(f"page {file}: {error.strerror}") from None
    return file


def write_campaign_figures(result: CampaignResult, folder: Path) -> list[Path]:
    """Write the figures of a campaign's page as files of their own, as far as there are any.

    Args:
        result: The campaign.
        folder: Folder to write to.
    """
    form, document = current().form, result.plan.experiment
    files = [folder / f"{name}.{form}" for name in ("distributions", "sensitivity")]
    figure = (
        distribution_figure(result.summary, result.lines, document.get("accept", {}), files[0]),
        sensitivity_figure(result.summary, result.lines, document, files[1]),
    )
    return [file for file, is_written in zip(files, figure, strict=True) if is_written]


def interval_text(interval: Interval, percent: bool = False, factor: float = 1.0) -> str:
    """Return an estimate with its bounds as a text; bounds that are not known are left out."""
    number = "{:.1%}".format if percent else lambda x: format_number(factor * x)
    bounds = (interval.low, interval.high)
    low, high = ("?" if math.isinf(bound) else number(bound) for bound in bounds)
    return f"{number(interval.value)} [{low}, {high}]"


def _counts(result: CampaignResult) -> list[tuple[str, int]]:
    """Return the number of rows of each status, by each method, and of those not run."""
    methods = [(f"by {method}", count) for method, count in result.summary.methods.items()]
    missing = [("not run", result.missing)] if result.missing else []
    return [*result.summary.statuses.items(), *methods, *missing]


def _metrics(summary: Summary) -> list[list[str]]:
    """Return the rows of the table of metrics, the head first; none without metrics."""
    if not summary.metrics:
        return []
    quantiles = [f"{probability:g} quantile" for probability in summary.metrics[0].quantiles]
    rows = [["metric", "unit", "rows", "mean", "least", *quantiles, "largest"]]
    for metric in summary.metrics:
        own = METRICS.by_name[metric.name].unit if metric.name in METRICS.names else "1"
        size = max(abs(metric.least), abs(metric.largest))
        unit, factor = ("", 1.0) if own == "1" else prefix_unit(size, own)
        numbers = [format_number(factor * metric.mean), format_number(factor * metric.least)]
        numbers += [interval_text(each, factor=factor) for each in metric.quantiles.values()]
        largest = format_number(factor * metric.largest)
        rows.append([metric.name, unit, str(metric.count), *numbers, largest])
    return rows


def _figures(result: CampaignResult) -> tuple[str, str]:
    """Return both figures as PNG files in base64; empty where there is nothing to draw."""
    document, (distributions, sensitivity) = result.plan.experiment, (BytesIO(), BytesIO())
    distribution_figure(result.summary, result.lines, document.get("accept", {}), distributions)
    sensitivity_figure(result.summary, result.lines, document, sensitivity)
    return (
        b64encode(distributions.getvalue()).decode(),
        b64encode(sensitivity.getvalue()).decode(),
    )


def _colour(number: int) -> str:
    """Return red, green and blue of the colour of curve ``number``, as HTML takes them."""
    return ", ".join(f"{255 * part:.0f}" for part in components(SERIES[number]))

"""The figures of a campaign: how metrics are distributed, and what they depend on.

- The page of a campaign: one file, with tables and figures inside it.
- The figures of a sweep: metrics against the swept value, and how runs learned the Jacobian.
- The figure of a tuning: the metric and the gains, step by step.
"""

from __future__ import annotations

import math
from base64 import b64encode
from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import (
    LogFormatterSciNotation,
    LogLocator,
    MaxNLocator,
    NullFormatter,
    NullLocator,
    StrMethodFormatter,
)

from ..colours import components
from ..errors import InvalidInputError
from ..experiment import unit_of_key
from ..inputs.fields import Array
from ..inputs.files import page_templates
from ..jobs import CampaignResult
from ..jobs.requests import Row
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
from ..measures import METRICS, format_number, format_quantity, prefix_unit, superscript
from ..runs.folder import written_whole
from ..tuning import TuningOutcome
from .style import (
    BOUND,
    INK,
    MOMENT,
    NOTE,
    PAGE,
    SERIES,
    common_style,
    current,
    filled_page,
    key_label,
    label,
    largest,
    legend,
    legend_above,
    log_axis,
    metric_label,
    nth,
    save,
    single,
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


#: Largest number of swept values that a logarithmic axis labels.
_TICKS = 10
#: Width of a character of a label, and room between two, as shares of a panel's width.
_CHARACTER, _GAP = 0.034, 0.02
#: Smallest number of labels of a logarithmic axis.
_LABEL_LIMIT = 2
#: Relative variation of a metric below which its axis begins at zero: it is nearly constant.
_FLAT = 0.1
#: How far above the axis an acceptance bound may be to be drawn, as a factor.
_FAR = 4.0
#: Markers: two curves that coincide are both visible.
_MARKERS: Sequence[dict[str, Any]] = (
    {"marker": "o"},
    {"marker": "s", "markerfacecolor": "white"},
    {"marker": "^"},
    {"marker": "D", "markerfacecolor": "white"},
)

#: Swept values and the metrics there.
_Curve = list[tuple[float, dict[str, float]]]


def sweep_figure(
    keys: Sequence[str],
    rows: Sequence[Row],
    metrics: Sequence[str],
    file: Path,
    units: Mapping[str, str] = MappingProxyType({}),
    accept: Mapping[str, Mapping[str, float]] = MappingProxyType({}),
) -> Path | None:
    """Draw a panel for each metric, against the first swept key with numbers as values.

    There is a curve for each combination of values of the other keys.

    Args:
        keys: Swept keys.
        rows: Rows of the sweep; those that failed have no point.
        metrics: Names of the metrics to show.
        file: File to write.
        units: Units of the swept keys, as far as they are known.
        accept: Acceptance bounds, ``at_most`` and ``at_least`` by metric, drawn as levels.

    Returns:
        The file, or None if there is nothing to draw: no run, no metric, or no key with numbers as
        values.
    """
    along = next((k for k in range(len(keys)) if any(_is_number(r.values[k]) for r in rows)), 0)
    curves = _curves(rows, along)
    metrics = _distinct(metrics, curves)
    if not metrics or not curves:
        return None
    others = [key for k, key in enumerate(keys) if k != along]
    with common_style():
        figure, axes = filled_page(len(metrics))
        for ax, metric in zip(axes, metrics, strict=True):
            for k, (values, curve) in enumerate(curves.items()):
                x = np.array([value for value, _ in curve])
                y = np.array([metrics_of_row.get(metric, np.nan) for _, metrics_of_row in curve])
                look = {"markersize": 3.5, **nth(k), **_MARKERS[k % len(_MARKERS)]}
                ax.plot(x, y, label=_name_of(others, values, units), **look)
            _scale(ax)
            _draw_accepted(ax, metric, accept.get(metric, {}))
            ax.set_xlabel(key_label(keys[along], units.get(keys[along], "")))
            ax.set_ylabel(metric_label(metric))
        if others:
            legend_above(figure, axes[0])
        save(figure, file)
    return file


def _draw_accepted(ax: Axes, metric: str, accept: Mapping[str, float]) -> None:
    """Draw acceptance bounds as levels where the axis reaches, and write them above the panel."""
    unit = METRICS.by_name[metric].unit if metric in METRICS.names else "1"
    signs = {"at_most": "≤", "at_least": "≥"}
    levels = {sign: accept[key] for key, sign in signs.items() if accept.get(key) is not None}
    for level in levels.values():
        low, high = ax.get_ylim()
        if level <= _FAR * high and (level > 0.0 or ax.get_yscale() == "linear"):
            ax.axhline(level, **BOUND)
            ax.set_ylim(min(low, level), max(high, 1.05 * level))
    if levels:
        told_levels = ", ".join(
            f"{sign} {format_quantity(level, unit)}" for sign, level in levels.items()
        )
        ax.set_title(f"accepted {told_levels}", loc="right", pad=2, **NOTE)


def learning_figure(
    keys: Sequence[str],
    rows: Sequence[Row],
    file: Path,
    units: Mapping[str, str] = MappingProxyType({}),
) -> Path | None:
    """Draw the Frobenius norm of J - J_hat over time, a curve for each run.

    Args:
        keys: Swept keys.
        rows: Rows of the sweep; those that learned no Jacobian have no curve.
        file: File to write.
        units: Units of the swept keys, as far as they are known.

    Returns:
        The file, or None if no run learned a Jacobian.
    """
    rows_with_learning = [(row.values, *row.learning) for row in rows if row.learning is not None]
    if not rows_with_learning:
        return None
    with common_style():
        figure, ax = single()
        for k, (values, time, error) in enumerate(rows_with_learning):
            ax.plot(time, error, label=", ".join(map(str, values)), **nth(k))
        log_axis(ax, [error for _, _, error in rows_with_learning])
        ax.set_ylabel(label(r"error of $\hat J$, Frobenius norm", "J"))
        ax.set_xlim(0.0, max(float(time[-1]) for _, time, _ in rows_with_learning))
        ticks(ax.xaxis, 5)
        ax.set_xlabel("time [s]")
        names = ", ".join(key_label(key.split(".")[-1], units.get(key, "")) for key in keys)
        legend_above(figure, ax, room=55, beside=6, title=names)
        save(figure, file)
    return file


def _name_of(keys: Sequence[str], values: Sequence[object], units: Mapping[str, str]) -> str:
    """Return the values of some keys with their units."""
    pairs = zip(keys, values, strict=True)
    return ", ".join(
        f"{key} = {value} {superscript(units.get(key, ''))}".strip() for key, value in pairs
    )


def _scale(ax: Axes) -> None:
    """Set axes to a logarithmic scale if values span decades, and from zero if they hardly vary."""
    points = np.concatenate([line.get_xydata() for line in ax.lines])
    x, y = points[:, 0], points[:, 1]
    if _spans_decades(x):
        ax.set_xscale("log")
        xs = np.unique(x)
        if xs.size <= _TICKS:
            ax.set_xticks(xs, _legible(xs))
            ax.xaxis.set_minor_locator(NullLocator())
        else:
            _label_decades(ax.xaxis)
        ax.xaxis.set_minor_formatter(NullFormatter())
    if _spans_decades(y):
        ax.set_yscale("log")
        _label_decades(ax.yaxis)
        ax.yaxis.set_minor_formatter(NullFormatter())
    elif np.nanmin(y, initial=np.inf) >= (1 - _FLAT) * np.nanmax(y, initial=0.0) > 0:
        ax.set_ylim(0, 1.15 * np.nanmax(y))
    ax.margins(x=0.05)


def _label_decades(axis: Any) -> None:
    """Label decades, and 2 and 5 between them if too few decades are in view."""
    is_x = axis.axis_name == "x"
    low, high = axis.axes.get_xlim() if is_x else axis.axes.get_ylim()
    if sum(low <= tick <= high for tick in axis.get_majorticklocs()) < _LABEL_LIMIT:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_minor_locator(NullLocator())
        powers = LogFormatterSciNotation(minor_thresholds=(np.inf, np.inf))
        # Swept values are written as plain numbers.
        axis.set_major_formatter(StrMethodFormatter("{x:g}") if is_x else powers)


def _legible(values: Array) -> list[str]:
    """Return labels for a logarithmic axis; empty where one would touch another.

    The first and the last value have theirs.
    """
    names = [f"{value:g}" for value in values]
    places = (np.log10(values) - np.log10(values[0])) / np.log10(values[-1] / values[0])

    def clear(one: int, other: int) -> bool:
        distance = _CHARACTER * (len(names[one]) + len(names[other])) / 2 + _GAP
        return bool(abs(places[one] - places[other]) > distance)

    last = 0
    for k in range(1, len(names) - 1):
        if clear(last, k) and clear(k, len(names) - 1):
            last = k
        else:
            names[k] = ""
    return names


def _curves(rows: Sequence[Row], along: int) -> Mapping[tuple[object, ...], _Curve]:
    """Return the points of each curve by the values of the other keys.

    Args:
        rows: Rows of the sweep.
        along: Index of the key that the metrics are drawn against.
    """
    curves: dict[tuple[object, ...], _Curve] = {}
    for row in rows:
        value = row.values[along]
        if _is_number(value) and row.failure is None:
            others = row.values[:along] + row.values[along + 1 :]
            curves.setdefault(others, []).append((float(value), row.metrics))
    return {others: sorted(curve, key=lambda point: point[0]) for others, curve in curves.items()}


def _distinct(metrics: Sequence[str], curves: Mapping[Any, _Curve]) -> list[str]:
    """Return the metrics without those that equal an earlier one up to rounding."""
    entries: dict[str, Array] = {}
    for name in metrics:
        points = [point.get(name, np.nan) for curve in curves.values() for _, point in curve]
        values = np.array(points)
        if not any(np.allclose(values, v, 1e-9, 0, equal_nan=True) for v in entries.values()):
            entries[name] = values
    return list(entries)


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _spans_decades(values: Array) -> bool:
    """Return whether the finite values suit a logarithmic axis."""
    finite = values[np.isfinite(values)]
    return bool(finite.size and finite.min() > 0 and finite.max() >= 8 * finite.min())


# Number of decades from which on an axis has labels at decades alone.
_SWEPT_DECADES = 2.0
#: Number of the colour of Drake's runs.
_RUN_MARKER = 3


def tuning_figure(outcome: TuningOutcome, file: Path) -> Path:
    """Draw the metric and the gains after each step that made the metric smaller.

    Args:
        outcome: The outcome of the tuning.
        file: File to write.

    Returns:
        The file.
    """
    steps = np.arange(len(outcome.history))
    values = np.array([trial.value for trial in outcome.history])
    with common_style():
        figure = Figure(figsize=(PAGE, 2.5), layout="constrained")
        left, right = figure.subplots(1, 2)
        unit, scale = prefix_unit(largest(values), METRICS.by_name[outcome.metric].unit)
        left.plot(steps, scale * values, label="compiled run", **_look(0))
        results = {0: outcome.before, outcome.chosen: outcome.after}
        metric_values = [scale * result.metrics[outcome.metric] for result in results.values()]
        square: dict[str, Any] = {"marker": "s", "markersize": 6, "markerfacecolor": "none"}
        square |= {"color": nth(_RUN_MARKER)["color"], "linestyle": "none"}
        left.plot(list(results), metric_values, label="run by Drake", **square)
        left.set_ylabel(f"{outcome.metric} [{unit}]")
        _finish(left, outcome, scale * values)
        factors = []
        for k, key in enumerate(outcome.bounds):
            gains = np.array([trial.gains[key] for trial in outcome.history])
            factors.append(gains / gains[0])
            name = f"{key.removeprefix('law.')}: {gains[0]:.3g} to {outcome.gains[key]:.3g}"
            right.plot(steps, factors[-1], label=name, **_look(k))
        right.set_ylabel("gain / gain at the start")
        _finish(right, outcome, np.concatenate(factors))
        save(figure, file)
    return file


def _look(k: int) -> dict[str, Any]:
    return {**nth(k), "marker": "o", "markersize": 3}


def _finish(ax: Axes, outcome: TuningOutcome, values: Array) -> None:
    """Mark the chosen step, and scale and label the axes."""
    ax.axvline(outcome.chosen, zorder=0, **MOMENT)
    positive = values[values > 0.0]
    if positive.size == values.size:
        low, high = 0.8 * values.min(), 1.25 * values.max()
        few = np.log10(high / low) < _SWEPT_DECADES
        ax.set_yscale("log")
        ax.set_ylim(low, high)
        ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if few else (1.0,)))
        ax.yaxis.set_minor_locator(NullLocator())
        ax.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    ax.xaxis.set_major_locator(MaxNLocator(6, integer=True))
    ax.margins(x=0.05)
    ax.set_xlabel("step (dotted: the gains taken)")
    legend(ax)

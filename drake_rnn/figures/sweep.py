"""The figures of a sweep: metrics against the swept value, and how runs learned the Jacobian.

- The figure of a tuning: the metric and the gains, step by step.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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

from ..inputs.fields import Array
from ..jobs.requests import Row
from ..measures import METRICS, format_quantity, prefix_unit, superscript
from ..tuning import TuningOutcome
from .style import (
    BOUND,
    MOMENT,
    NOTE,
    PAGE,
    common_style,
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
_DECADES = 2.0
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
        few = np.log10(high / low) < _DECADES
        ax.set_yscale("log")
        ax.set_ylim(low, high)
        ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if few else (1.0,)))
        ax.yaxis.set_minor_locator(NullLocator())
        ax.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    ax.xaxis.set_major_locator(MaxNLocator(6, integer=True))
    ax.margins(x=0.05)
    ax.set_xlabel("step (dotted: the gains taken)")
    legend(ax)

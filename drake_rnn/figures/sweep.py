"""The picture of a sweep: each metric that differs, against the swept value."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import (
    LogFormatterSciNotation,
    LogLocator,
    NullFormatter,
    NullLocator,
    StrMethodFormatter,
)

from ..inputs.fields import Array
from ..runs.sweep import Row
from .style import COLOURS, PAGE, save, styled

_COLUMNS = 3
#: Values of a logarithmic axis are labelled up to this many, and this far apart [decades].
_TICKS, _APART = 10, 0.17
#: A logarithmic axis has at least as many labels.
_LABELLED = 2
#: A metric that varies by less is shown from zero, as the constant that it all but is.
_FLAT = 0.1
#: Of the curves, so that of two that coincide both are seen.
_LOOKS: Sequence[dict[str, Any]] = (
    {"linestyle": "-", "marker": "o"},
    {"linestyle": (0, (4, 2)), "marker": "s", "markerfacecolor": "white"},
    {"linestyle": (0, (1, 1)), "marker": "^"},
)

_Curve = list[tuple[float, dict[str, float]]]


def sweep_figure(
    keys: Sequence[str], rows: Sequence[Row], metrics: Sequence[str], file: Path
) -> Path | None:
    """One panel a metric, over the first key of numbers; one curve for each of the others' values.

    Args:
        keys: That were swept.
        rows: Of the sweep; those that failed have no point.
        metrics: To show.
        file: To write.

    Returns:
        The file, or None if there is nothing to draw: no run, no metric, or no key whose
        values are numbers.
    """
    along = next((k for k in range(len(keys)) if any(_is_number(r.values[k]) for r in rows)), 0)
    curves = _curves(rows, along)
    metrics = _distinct(metrics, curves)
    if not metrics or not curves:
        return None
    others = [key for k, key in enumerate(keys) if k != along]
    height = -(-len(metrics) // _COLUMNS)
    with styled():
        figure = Figure(figsize=(PAGE, 2.1 * height + 0.3), layout="constrained")
        axes = figure.subplots(height, min(_COLUMNS, len(metrics)), squeeze=False)
        for ax, metric in zip(axes.flat, metrics, strict=False):
            for k, (values, curve) in enumerate(curves.items()):
                x = np.array([value for value, _ in curve])
                y = np.array([found.get(metric, np.nan) for _, found in curve])
                name = ", ".join(f"{key} = {v}" for key, v in zip(others, values, strict=True))
                look = {"markersize": 3, **_LOOKS[k % len(_LOOKS)]}
                ax.plot(x, y, color=COLOURS[k % len(COLOURS)], label=name, **look)
            _scale(ax)
            ax.set_xlabel(keys[along])
            ax.set_title(metric, fontsize="small")
        for ax in list(axes.flat)[len(metrics) :]:
            ax.set_visible(False)
        if others:
            handles, names = axes.flat[0].get_legend_handles_labels()
            figure.legend(handles, names, loc="outside upper center", ncols=len(names[:4]))
        save(figure, file)
    return file


def _scale(ax: Axes) -> None:
    """Logarithmic where numbers span decades, and from zero where they hardly differ."""
    points = np.concatenate([line.get_xydata() for line in ax.lines])
    x, y = points[:, 0], points[:, 1]
    if _spans_decades(x):
        ax.set_xscale("log")
        swept = np.unique(x)
        if swept.size <= _TICKS:
            ax.set_xticks(swept, _legible(swept))
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
    """And 2 and 5 between them where too few are in view: one label alone gives no scale."""
    is_x = axis.axis_name == "x"
    low, high = axis.axes.get_xlim() if is_x else axis.axes.get_ylim()
    if sum(low <= tick <= high for tick in axis.get_majorticklocs()) < _LABELLED:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_minor_locator(NullLocator())
        powers = LogFormatterSciNotation(minor_thresholds=(np.inf, np.inf))
        # Swept values as they were given.
        axis.set_major_formatter(StrMethodFormatter("{x:g}") if is_x else powers)


def _legible(values: Array) -> list[str]:
    """Names of the values on a logarithmic axis, but of none that would touch the one before."""
    names, last = [], -np.inf
    for value in np.log10(values):
        names.append(f"{10**value:g}" if value - last >= _APART else "")
        last = value if names[-1] else last
    return names


def _curves(rows: Sequence[Row], along: int) -> Mapping[tuple[object, ...], _Curve]:
    curves: dict[tuple[object, ...], _Curve] = {}
    for row in rows:
        value = row.values[along]
        if _is_number(value) and row.failure is None:
            others = row.values[:along] + row.values[along + 1 :]
            curves.setdefault(others, []).append((float(value), row.metrics))
    return {others: sorted(curve, key=lambda point: point[0]) for others, curve in curves.items()}


def _distinct(metrics: Sequence[str], curves: Mapping[Any, _Curve]) -> list[str]:
    """The metrics but those that say the same as one before, up to rounding."""
    found: dict[str, Array] = {}
    for name in metrics:
        points = [point.get(name, np.nan) for curve in curves.values() for _, point in curve]
        values = np.array(points)
        if not any(np.allclose(values, v, 1e-9, 0, equal_nan=True) for v in found.values()):
            found[name] = values
    return list(found)


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _spans_decades(values: Array) -> bool:
    """Whether a logarithmic axis shows them better."""
    sound = values[np.isfinite(values)]
    return bool(sound.size and sound.min() > 0 and sound.max() >= 8 * sound.min())

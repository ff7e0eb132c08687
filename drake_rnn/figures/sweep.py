"""The picture of a sweep: each metric that differs, against the swept value."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from ..fields import Array
from ..sweep import Row
from .style import COLOURS, PAGE, save, styled

_COLUMNS = 3
_TICKS = 10


def sweep_figure(
    keys: Sequence[str], rows: Sequence[Row], metrics: Sequence[str], file: Path
) -> Path | None:
    """One panel a metric, over the first key; one curve for each combination of the others.

    Args:
        keys: That were swept.
        rows: Of the sweep; those that failed have no point.
        metrics: To show.
        file: To write.

    Returns:
        The file, or None if there is nothing to draw: no run, no metric, or values of the
        first key that are no numbers.
    """
    curves = _curves(rows)
    if not metrics or not curves:
        return None
    swept = sorted({value for curve in curves.values() for value, _ in curve})
    height = -(-len(metrics) // _COLUMNS)
    with styled():
        figure = Figure(figsize=(PAGE, 2.1 * height + 0.3), layout="constrained")
        axes = figure.subplots(height, min(_COLUMNS, len(metrics)), squeeze=False)
        for ax, metric in zip(axes.flat, metrics, strict=False):
            for k, (others, curve) in enumerate(curves.items()):
                x = np.array([value for value, _ in curve])
                y = np.array([found.get(metric, np.nan) for _, found in curve])
                name = ", ".join(
                    f"{key} = {value}" for key, value in zip(keys[1:], others, strict=True)
                )
                ax.plot(x, y, "o-", markersize=3, color=COLOURS[k % len(COLOURS)], label=name)
            if _spans_decades(np.array(swept)):
                ax.set_xscale("log")
                if len(swept) <= _TICKS:
                    ax.set_xticks(swept, [f"{value:g}" for value in swept])
                ax.xaxis.set_minor_formatter(NullFormatter())
            if _spans_decades(np.concatenate([line.get_ydata() for line in ax.lines])):
                ax.set_yscale("log")
                ax.yaxis.set_minor_formatter(NullFormatter())
            ax.margins(x=0.05)
            ax.set_xlabel(keys[0])
            ax.set_title(metric, fontsize="small")
        for ax in list(axes.flat)[len(metrics) :]:
            ax.set_visible(False)
        if len(keys) > 1:
            handles, names = axes.flat[0].get_legend_handles_labels()
            figure.legend(handles, names, loc="outside upper center", ncols=len(names[:4]))
        save(figure, file)
    return file


def _curves(
    rows: Sequence[Row],
) -> Mapping[tuple[object, ...], list[tuple[float, dict[str, float]]]]:
    curves: dict[tuple[object, ...], list[tuple[float, dict[str, float]]]] = {}
    for row in rows:
        value = row.values[0]
        if isinstance(value, (int, float)) and row.failure is None:
            curves.setdefault(row.values[1:], []).append((float(value), row.metrics))
    return {others: sorted(curve, key=lambda point: point[0]) for others, curve in curves.items()}


def _spans_decades(values: Array) -> bool:
    """Whether a logarithmic axis shows them better, with one labelled tick at least."""
    sound = values[np.isfinite(values)]
    if sound.size == 0 or sound.min() <= 0 or sound.max() < 8 * sound.min():
        return False
    return bool(np.floor(np.log10(sound.max())) >= np.ceil(np.log10(sound.min())))

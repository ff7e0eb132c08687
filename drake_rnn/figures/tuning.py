"""The figure of a tuning: the metric and the gains, step by step."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator, StrMethodFormatter

from ..inputs.fields import Array
from ..measures import METRICS, prefixed
from ..tuning import Tuned
from .looks import MOMENT, nth
from .style import PAGE, largest, legend, save, styled

_UNITS = {metric.name: metric.unit for metric in METRICS}
# Number of decades from which on an axis has labels at decades alone.
_DECADES = 2.0
#: Number of the colour of Drake's runs.
_VERIFIED = 3


def tuning_figure(tuned: Tuned, file: Path) -> Path:
    """Draw the metric and the gains after each step that made the metric smaller.

    Args:
        tuned: The outcome of the tuning.
        file: File to write.

    Returns:
        The file.
    """
    steps = np.arange(len(tuned.history))
    values = np.array([trial.value for trial in tuned.history])
    with styled():
        figure = Figure(figsize=(PAGE, 2.5), layout="constrained")
        left, right = figure.subplots(1, 2)
        unit, scale = prefixed(largest(values), _UNITS[tuned.metric])
        left.plot(steps, scale * values, label="compiled run", **_look(0))
        verified = {0: tuned.before, tuned.chosen: tuned.after}
        seen = [scale * result.metrics[tuned.metric] for result in verified.values()]
        square: dict[str, Any] = {"marker": "s", "markersize": 6, "markerfacecolor": "none"}
        square |= {"color": nth(_VERIFIED)["color"], "linestyle": "none"}
        left.plot(list(verified), seen, label="run by Drake", **square)
        left.set_ylabel(f"{tuned.metric} [{unit}]")
        _finish(left, tuned, scale * values)
        factors = []
        for k, key in enumerate(tuned.bounds):
            gains = np.array([trial.gains[key] for trial in tuned.history])
            factors.append(gains / gains[0])
            name = f"{key.removeprefix('law.')}: {gains[0]:.3g} to {tuned.gains[key]:.3g}"
            right.plot(steps, factors[-1], label=name, **_look(k))
        right.set_ylabel("gain / gain at the start")
        _finish(right, tuned, np.concatenate(factors))
        save(figure, file)
    return file


def _look(k: int) -> dict[str, Any]:
    return {**nth(k), "marker": "o", "markersize": 3}


def _finish(ax: Axes, tuned: Tuned, values: Array) -> None:
    """Mark the chosen step, and scale and label the axes."""
    ax.axvline(tuned.chosen, zorder=0, **MOMENT)
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

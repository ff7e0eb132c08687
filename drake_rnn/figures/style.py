"""What all figures look like, and the parts of axes they share."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import AbstractContextManager
from functools import cache
from pathlib import Path
from typing import Any

import matplotlib.style
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter
from numpy.typing import NDArray
from PIL import Image

from ..inputs.fields import Array
from ..measures import UNITS
from ..runs.result import Result

Style = dict[str, Any]

#: Width of a column and of a page [inch]; text is set for them, not for a screen.
COLUMN, PAGE = 3.5, 7.1

STYLE: Style = {
    "figure.dpi": 200,
    "savefig.dpi": 200,
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 8,
    "axes.labelsize": 8,
    "axes.titlesize": 8,
    "axes.linewidth": 0.6,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.use_mathtext": True,
    "axes.formatter.limits": (-3, 4),
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.xmargin": 0,
    "grid.color": "0.9",
    "grid.linewidth": 0.5,
    "lines.linewidth": 1.0,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "legend.fontsize": 7,
    "legend.frameon": False,
    "legend.handlelength": 1.4,
    "legend.columnspacing": 1.0,
    "legend.handletextpad": 0.4,
    "legend.borderaxespad": 0.2,
    "legend.borderpad": 0.1,
}

#: Okabe and Ito's colours, told apart by the colour-blind as well. Their yellow is lost on
#: white paper, and black is kept for what is desired and for bounds; the brown in their stead
#: is further from the others, however one sees, than those are from one another.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7A3B12")
BOUND: Style = {"color": "0.25", "linestyle": (0, (4, 2)), "linewidth": 0.8}
DESIRED: Style = {"color": "black", "linestyle": (0, (4, 2)), "linewidth": 0.9}
TARGET: Style = {"color": "black", "linestyle": (0, (1.5, 1.5)), "linewidth": 0.9}
TRACED: Style = {"color": COLOURS[5], "linewidth": 1.8}
NOTE: Style = {"color": "0.35", "fontsize": 6.5}
SHADE: Style = {"color": "0.93", "linewidth": 0, "zorder": 0}


def styled() -> AbstractContextManager[Any]:
    """What a user has set does not show in the figures, nor is it touched."""
    return matplotlib.style.context(["default", STYLE])


def save(figure: Figure, file: Path) -> None:
    """With a palette: a third of the size."""
    canvas: Any = FigureCanvasAgg(figure)
    # Fonts are looked up only now.
    with styled():
        canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())[..., :3].astype(int)
    packed, where = np.unique(pixels @ [1 << 16, 1 << 8, 1], return_inverse=True)
    colours = np.stack((packed >> 16, packed >> 8 & 255, packed & 255), axis=1)
    palette = _palette()
    # |c - p|^2 without the |c|^2 that all p share.
    nearest = np.argmin((palette**2).sum(axis=1) - 2 * colours @ palette.T, axis=1)
    image = Image.fromarray(nearest.astype(np.uint8)[where].reshape(pixels.shape[:2]))
    image.putpalette(palette.ravel().tolist())
    dots = round(figure.dpi)
    image.save(file, optimize=True, dpi=(dots, dots))


@cache
def _palette() -> NDArray[np.int_]:
    """Greys, and every colour on its way to white, which is how lines' edges are smoothed.

    A palette made to fit an image would merge the colours of which there is little.
    """
    shades = np.linspace(1.0, 0.0, 22, endpoint=False)[:, np.newaxis]
    tints = [255 + shades * (np.array(to_rgb(colour)) - 1) * 255 for colour in COLOURS]
    greys = np.linspace(0, 255, 256 - sum(map(len, tints)))[:, np.newaxis].repeat(3, axis=1)
    return np.concatenate((*tints, greys)).round().astype(int)


def single(height: float = 2.4) -> tuple[Figure, Axes]:
    """A figure of one panel, as wide as a column."""
    figure = Figure(figsize=(COLUMN, height), layout="constrained")
    return figure, figure.add_subplot()


def plot_joints(ax: Axes, time: Array, values: Array, **style: Any) -> None:
    """A curve for each column."""
    for k, column in enumerate(values.T):
        ax.plot(time, column, **joint_style(k), **style)


def joint_style(k: int) -> Style:
    """The same joint looks the same in every figure."""
    n = len(COLOURS)
    return {"color": COLOURS[k % n], "linestyle": ("-", "-.", ":")[k // n % 3]}


def joint_handles(n: int) -> list[Line2D]:
    """Of a legend in one line: the word, then numbers."""
    joints = [Line2D([], [], label=f"{k + 1}", **joint_style(k)) for k in range(n)]
    return [Line2D([], [], linestyle="none", label="joint"), *joints]


def legend(ax: Axes, handles: list[Line2D] | None = None) -> None:
    """Above the axes, where it covers nothing."""
    entries: list[Any] = ax.get_legend_handles_labels()[0] if handles is None else list(handles)
    if not entries:
        return
    many = len(entries) > 5
    ax.legend(
        handles=entries,
        loc="lower center",
        bbox_to_anchor=(0.5, 1.0),
        ncols=min(len(entries), 9),
        handlelength=1.0 if many else None,
        columnspacing=0.7 if many else None,
    )


def ticks(axis: Any, most: int) -> None:
    """Round numbers, and few of them."""
    axis.set_major_locator(MaxNLocator(most, steps=[1, 2, 5, 10]))


def time_axis(ax: Axes, result: Result) -> None:
    """From the first sample to the last."""
    ax.set_xlim(result.time[0], result.time[-1])
    ticks(ax.xaxis, 5)
    ax.set_xlabel("time [s]")


def shade_window(ax: Axes, result: Result) -> None:
    """Where errors are evaluated."""
    if result.experiment.document.window is not None:
        ax.axvspan(*result.experiment.document.window, label="window", **SHADE)


def log_axis(ax: Axes, curves: Iterable[Array]) -> None:
    """Whole decades, over all that is positive but for the dips of curves that reach zero.

    Those would otherwise take all decades there are.
    """
    positive = [curve[(curve > 0) & np.isfinite(curve)] for curve in curves]
    positive = [curve for curve in positive if curve.size]
    if not positive:
        return
    low = min(max(curve.min(), np.percentile(curve, 1) / 5) for curve in positive)
    high = max(curve.max() for curve in positive)
    # Limits first: to a logarithmic scale matplotlib would take none that are the same.
    ax.set_ylim(10 ** np.floor(np.log10(low)), 10 ** np.ceil(np.log10(high) + 0.01))
    ax.set_yscale("log")
    ax.yaxis.set_major_locator(LogLocator(numticks=7))
    ax.yaxis.set_minor_formatter(NullFormatter())


def finite(points: Array) -> Array:
    """Those rows that are."""
    return points[np.isfinite(points).all(axis=1)]


def largest(values: Array) -> float:
    """In magnitude; 0 of none."""
    return float(np.abs(values[np.isfinite(values)]).max(initial=0.0))


def noisy(values: Array) -> bool:
    """Whether curves go to and fro from sample to sample, and so would hide one another."""
    steps = np.diff(values, axis=0)
    return bool(np.nansum(np.abs(np.diff(steps, axis=0))) > 0.5 * np.nansum(np.abs(steps)))


def span(values: Array, least: float) -> tuple[float, float]:
    """From the least to the greatest value, or ``least`` about their middle if that is more."""
    sound = values[np.isfinite(values)]
    low, high = (float(sound.min()), float(sound.max())) if sound.size else (0.0, 0.0)
    widen = max(0.0, least - (high - low)) / 2
    return low - widen, high + widen


def prefixed(values: Array, unit: str) -> tuple[str, float]:
    """The unit in which small values read well, and how many of it one ``unit`` has."""
    peak = largest(values)
    return next(
        (name + unit, scale)
        for name, scale in (("", 1.0), ("m", 1e3), ("µ", 1e6))
        if peak * scale >= 0.1 or name == "µ"
    )


def unit(series: str) -> str:
    """Of a series, as it is printed."""
    return UNITS[series].replace("^2", "²").replace("^3", "³")


def label(text: str, series: str) -> str:
    """Of an axis that shows a series."""
    return f"{text} [{unit(series)}]"

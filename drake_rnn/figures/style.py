"""The common style of all figures, and helpers for axes.

Colours, dashes and widths of curves, by the meaning of the curves.

Curves with a meaning have its colour in `drake_rnn.colours`, as in playbacks. Joints, axes, laws
and other curves of one kind have a colour and a pattern of dashes each, from `nth`. All other
curves, such as errors, norms and singular values, are drawn in ink.

- What figures are drawn for: the format of the file, the width on the page, and the look.
- Labels of axes: names of metrics and of keys, with their units.
- Panels that fill a page: rows of nearly equal length, none half empty.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from io import BytesIO
from itertools import chain
from math import lcm
from pathlib import Path
from textwrap import wrap
from typing import Any, Literal, get_args

import matplotlib.style
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter, ScalarFormatter
from PIL import Image

from .. import colours
from ..errors import InvalidInputError
from ..inputs.fields import Array, checked, choice, number, optional
from ..measures import METRICS, UNITS, superscript
from ..runs.folder import replacing
from ..runs.result import Result

Style = dict[str, Any]

_DASHES = (0, (4, 2))
_DOTS = (0, (1.5, 1.5))

#: Colours of joints and of other curves that are told apart by number.
SERIES = colours.SERIES
#: Dashes of these curves. Colours and dashes repeat after seven and four: all of 28 curves differ.
DASHES: tuple[Any, ...] = ("-", (0, (6, 1.2)), (0, (6, 1.2, 1.2, 1.2)), (0, (1.8, 0.9)))

DESIRED: Style = {"color": colours.DESIRED, "linestyle": _DASHES, "linewidth": 1.0}
TRACED: Style = {"color": colours.TRACED, "linewidth": 1.8}
TARGET: Style = {"color": colours.TARGET, "linestyle": _DOTS, "linewidth": 1.0}
FORCE: Style = {"color": colours.FORCE}
BOUND: Style = {"color": colours.BOUND, "linestyle": _DASHES, "linewidth": 0.8}

#: Colour of errors, norms and other curves without a meaning of their own.
INK = colours.CURVE
#: Wide curves behind others: norms behind components, readings behind true values.
BEHIND: Style = {"color": "0.78", "linewidth": 2.2}
#: Values that a theory predicts or a law asks for, drawn over the values that were reached.
PREDICTION: Style = {"color": INK, "linestyle": _DASHES, "linewidth": 1.0}
#: A time at which something happened.
MOMENT: Style = {"color": INK, "linestyle": ":", "linewidth": 1.0}
#: A time for which something goes on.
SPAN: Style = {"color": colours.BOUND, "alpha": 0.15, "linewidth": 0, "zorder": 0}
NOTE: Style = {"color": "0.35", "fontsize": 6.5}
SHADE: Style = {"color": "0.93", "linewidth": 0, "zorder": 0}
#: Notes on broken bounds are red; a word or a sign always goes with the red.
BROKEN = colours.BROKEN
ALARM: Style = {"color": BROKEN, "fontsize": 6.5, "weight": "bold"}


def nth(k: int) -> Style:
    """Return colour and dashes of curve ``k`` of several; of a joint the same in all figures."""
    return {"color": SERIES[k % len(SERIES)], "linestyle": DASHES[k % len(DASHES)]}


#: Formats of files.
Form = Literal["png", "pdf", "svg"]
FORMS: tuple[Form, ...] = get_args(Form)
#: Looks: that of a screen, and serifs and fine lines as a journal's page has them.
Look = Literal["screen", "journal"]
LOOKS: tuple[Look, ...] = get_args(Look)

#: Units of a width [inch].
_UNITS = {"mm": 1 / 25.4, "cm": 1 / 2.54, "in": 1.0}
#: Least and largest width [mm].
_LEAST, _LARGEST = 40.0, 1000.0
_LENGTH = re.compile(rf"(\d+(?:\.\d+)?|\.\d+)\s*({'|'.join(_UNITS)})")


@checked(form=choice(FORMS), width=optional(number(above=0.0)), look=choice(LOOKS))
@dataclass(frozen=True)
class Paper:
    """What figures are drawn for.

    Attributes:
        form: Format of the files: ``png``, ``pdf`` or ``svg``.
        width: Width of each figure [inch]; None for that which suits the figure.
        look: ``screen``; or ``journal``, with serifs, fine lines and 600 dots per inch.
    """

    form: Form = "png"
    width: float | None = None
    look: Look = "screen"


def parse_width(text: str) -> float:
    """Return a width such as ``88mm``, ``8.8cm`` or ``3.5in`` in inches.

    Raises:
        InvalidInputError: If it is no such length, or none that a page has.
    """
    if (match := _LENGTH.fullmatch(text.strip())) is None:
        raise InvalidInputError(
            f"width: must be a length such as 88mm, 8.8cm or 3.5in, not {text!r}"
        )
    width = float(match[1]) * _UNITS[match[2]]
    if not _LEAST <= round(width / _UNITS["mm"], 6) <= _LARGEST:
        raise InvalidInputError(f"width: must be from {_LEAST:g} to {_LARGEST:g} mm, not {text!r}")
    return width


#: What figures are drawn for by default.
SCREEN = Paper()
_CURRENT: ContextVar[Paper] = ContextVar("paper", default=SCREEN)


@contextmanager
def drawn_for(paper: Paper) -> Iterator[None]:
    """Draw figures within the block for a paper, as with Matplotlib's own contexts of styles."""
    token = _CURRENT.set(paper)
    try:
        yield
    finally:
        _CURRENT.reset(token)


def current() -> Paper:
    """Return what figures are drawn for now; outside of all blocks, for a screen."""
    return _CURRENT.get()


def wide(own: float) -> float:
    """Return the width to draw a figure in: that of the paper, or else its own [inch]."""
    return current().width or own


#: Widths of a printed column and page [inch].
COLUMN, PAGE = 3.5, 7.1
#: The common style, in matplotlib's own format.
_STYLE = Path(__file__).with_name("figures.mplstyle")
#: What looks add to it.
_LOOKS = {"screen": (), "journal": (Path(__file__).with_name("journal.mplstyle"),)}
#: What a file says of itself; without a date, so that equal figures are equal files.
_METADATA = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}
#: Least width for two panels of joints beside one another [inch].
_TWO = 5.0
#: Room for names in a legend [characters] up to which it is that of a column.
_COLUMN_ROOM = 60
#: Entries of a legend from which on it is drawn together.
_MANY = 8
#: Share of the steps of noise that are against the one before; of white noise it is two thirds.
_REVERSALS = 0.2
#: Room for names above axes beside others, and for what is beside each name [characters].
_TITLES, _BESIDE = 64, 4
#: Least width of a line in a legend.
_LEGIBLE = 0.8


def common_style() -> AbstractContextManager[Any]:
    """Return a context with the common style; the user's settings neither matter nor change."""
    return matplotlib.style.context(["default", _STYLE, *_LOOKS[current().look]])


def save(figure: Figure, file: Path | BytesIO) -> None:
    """Write a figure in the format that the file's name ends in; to memory, as PNG.

    PNG files are in true colours: a palette of 256 colours would be a third of the size, but where
    curves are smoothed and overlap its colours are up to 50 of 255 off.

    Raises:
        InvalidInputError: If something else than a regular file has that name.
        OSError: If it cannot be written.
    """
    if isinstance(file, BytesIO):
        _write(figure, file, "png")
        return
    with replacing(file) as new:
        _write(figure, new, file.suffix.removeprefix("."))


def _write(figure: Figure, file: Path | BytesIO, form: str) -> None:
    canvas: Any = FigureCanvasAgg(figure)
    # Matplotlib looks fonts and formats of numbers up only now.
    with common_style():
        for child in chain.from_iterable(ax.get_children() for ax in figure.axes):
            if isinstance(child, Axis):
                _write_plainly(child)
        if form != "png":
            figure.savefig(file, format=form, metadata=_METADATA[form])
            return
        canvas.draw()
    image = Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy())
    dots = round(figure.dpi)
    # A higher level takes eight times as long for a tenth of the size.
    image.save(file, "PNG", compress_level=6, dpi=(dots, dots))


class _PlainNumbers(ScalarFormatter):
    """Numbers at ticks as plain text: they look as in a formula, which takes long to set."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        return super().__call__(x, pos).removeprefix(r"$\mathdefault{").removesuffix("}$")


def _write_plainly(axis: Any) -> None:
    """Write the numbers at an axis as plain text, but a power of ten that they share as before."""
    formula = axis.get_major_formatter()
    if type(formula) is ScalarFormatter:
        axis.set_major_formatter(_PlainNumbers(useOffset=formula.get_useOffset()))


def single(height: float = 2.4) -> tuple[Figure, Axes]:
    """Return a figure of the width of a column with one panel, and its axes."""
    figure, (ax,) = stack_panels(1, height)
    return figure, ax


def stack_panels(count: int, height: float | None = None, **layout: Any) -> tuple[Figure, Any]:
    """Return a figure with panels below one another, as wide as a column or the paper.

    Args:
        count: Number of panels.
        height: Height of the figure [inch]; by default what suits that number.
        **layout: Further arguments of `matplotlib.figure.Figure.subplots`.
    """
    size = (wide(COLUMN), 0.5 + 1.9 * count if height is None else height)
    figure = Figure(figsize=size, layout="constrained")
    return figure, figure.subplots(count, 1, squeeze=False, **layout).ravel()


def columns_within(width: float) -> int:
    """Return how many panels of joints fit beside one another in a width [inch]."""
    return 2 if width >= _TWO else 1


def plot_joints(ax: Axes, time: Array, values: Array, **style: Any) -> None:
    """Plot a curve for each joint; ``values`` have the shape (k, n).

    Curves that go up and down most are behind the others, and noise is thin and pale: no joint
    hides another.
    """
    hazy: Style = {"linewidth": 0.5, "alpha": 0.7} if noisy(values) else {}
    for k, (column, depth) in enumerate(zip(values.T, depths(values), strict=True)):
        ax.plot(time, column, zorder=depth, **{**nth(k), **hazy, **style})


def depths(values: Array) -> Array:
    """Return the order of drawing of each column of ``values``: the longest way up and down first.

    All are from 2 to 2.5, as lines are by default, so that other things stay before and behind.
    """
    # A run that diverged may contain infinite values.
    with np.errstate(invalid="ignore", over="ignore"):
        ways = np.nansum(np.abs(np.diff(values, axis=0)), axis=0)
    places = np.argsort(np.argsort(-ways, kind="stable"), kind="stable")
    return np.asarray(2.0 + 0.5 * places / max(1, places.size))


def joint_handles(n: int) -> list[Line2D]:
    """Return the entries of a one-line legend: the word "joint", then the numbers."""
    joints = [Line2D([], [], label=f"{k + 1}", **nth(k)) for k in range(n)]
    return [Line2D([], [], linestyle="none", label="joint"), *joints]


def legend(ax: Axes, handles: list[Line2D] | None = None) -> None:
    """Add a legend above the axes, where it covers nothing.

    Args:
        ax: The axes.
        handles: Entries; by default the labelled curves. Without entries there is no legend.
    """
    entries: list[Any] = ax.get_legend_handles_labels()[0] if handles is None else list(handles)
    if not entries:
        return
    many = len(entries) > 5
    box = ax.legend(
        handles=entries,
        loc="lower center",
        bbox_to_anchor=(0.5, 1.0),
        ncols=_columns([str(entry.get_label()) for entry in entries]),
        # Long enough for a pattern of dashes.
        handlelength=(1.4 if len(entries) > _MANY else 1.9) if many else 2.2,
        columnspacing=(0.4 if len(entries) > _MANY else 0.6) if many else None,
        handletextpad=0.3 if many else None,
    )
    for line in box.get_lines():
        # Those of noise are pale and thin.
        line.set_alpha(1.0)
        line.set_linewidth(max(_LEGIBLE, line.get_linewidth()))


def _columns(names: Sequence[str]) -> int:
    """Return how many columns of names fit above axes beside others."""

    def width(columns: int) -> int:
        parts = np.array_split([len(name) for name in names], columns)
        return sum(_BESIDE + int(part.max()) for part in parts)

    return next(k for k in range(min(len(names), 9), 0, -1) if k == 1 or width(k) <= _TITLES)


def legend_above(figure: Figure, ax: Axes, room: int = 110, beside: int = 0, **look: Any) -> None:
    """Add a legend above all axes of a figure, with the labelled curves of one of them.

    Args:
        figure: The figure.
        ax: The axes with the curves.
        room: Room for the names in a line of the legend [characters].
        beside: Room that each name needs besides its own characters [characters].
        **look: Further arguments of `matplotlib.figure.Figure.legend`.
    """
    handles, names = ax.get_legend_handles_labels()
    width = float(figure.get_figwidth())
    room = int(room * min(1.0, width / (PAGE if room > _COLUMN_ROOM else COLUMN)))
    columns = max(1, min(len(names), room // (beside + max(map(len, names)))))
    figure.legend(handles, names, loc="outside upper center", ncols=columns, **look)


def ticks(axis: Any, most: int) -> None:
    """Set round numbers as ticks of an axis, at most ``most`` intervals."""
    axis.set_major_locator(MaxNLocator(most, steps=[1, 2, 5, 10]))


def time_axis(ax: Axes, result: Result, ylabel: str = "") -> None:
    """Set the x-axis to time, from the first sample to the last, and label the y-axis if asked."""
    if ylabel:
        ax.set_ylabel(ylabel)
    ax.set_xlim(result.time[0], result.time[-1])
    ticks(ax.xaxis, 5)
    ax.set_xlabel("time [s]")


def plane_axes(ax: Axes, xlabel: str, ylabel: str, margin: float = 0.06) -> None:
    """Set plane axes to equal scales with some room round the curves, and label them."""
    ax.margins(margin)
    ax.set_aspect("equal", adjustable="datalim")
    for axis in (ax.xaxis, ax.yaxis):
        ticks(axis, 6)
    ax.set(xlabel=xlabel, ylabel=ylabel)


def corner_note(ax: Axes, text: str, look: Style = NOTE) -> None:
    """Write a note in the upper right corner of the axes."""
    place: Style = {"ha": "right", "va": "top", "transform": ax.transAxes}
    ax.text(0.99, 0.99, text, **place, **look)


def mark_times(ax: Axes, result: Result) -> None:
    """Shade the window of the errors and what goes on for a while; mark what happens to the arm."""
    experiment = result.experiment
    if (window := experiment.document.window) is not None:
        ax.axvspan(*window, label="window", **SHADE)
    names = set[str]()
    for moment in experiment.moments:
        if moment.of_arm:
            name = None if moment.name in names else moment.name
            ax.axvline(moment.time, label=name, **MOMENT)
            names.add(moment.name)
    for feature in experiment.document.features:
        for begin, end, name in feature.spans(result.series, result.time):
            ax.axvspan(begin, end, label=None if name in names else name, **SPAN)
            names.add(name)


def log_axis(ax: Axes, curves: Iterable[Array]) -> None:
    """Set a logarithmic y-axis of whole decades.

    They cover all positive values except narrow dips towards zero, which would take up most of the
    axis.
    """
    positive = [curve[(curve > 0) & np.isfinite(curve)] for curve in curves]
    positive = [curve for curve in positive if curve.size]
    if not positive:
        return
    low = min(max(curve.min(), np.percentile(curve, 1) / 5) for curve in positive)
    high = max(curve.max() for curve in positive)
    # Limits first: on a logarithmic scale, matplotlib refuses equal limits.
    ax.set_ylim(10 ** np.floor(np.log10(low)), 10 ** np.ceil(np.log10(high) + 0.01))
    ax.set_yscale("log")
    ax.yaxis.set_major_locator(LogLocator(numticks=7))
    ax.yaxis.set_minor_formatter(NullFormatter())


def finite(points: Array) -> Array:
    """Return the rows of ``points`` that are finite."""
    return points[np.isfinite(points).all(axis=1)]


def largest(values: Array) -> float:
    """Return the largest magnitude of the finite values; 0 if there are none."""
    return float(np.abs(values[np.isfinite(values)]).max(initial=0.0))


def noisy(values: Array) -> bool:
    """Return whether curves jump up and down from sample to sample, so that lines overlap.

    Single peaks are no noise: after most steps there is one in the same direction.
    """
    # A run that diverged may contain infinite values.
    with np.errstate(invalid="ignore", over="ignore"):
        steps = np.diff(values, axis=0)
        reversals = np.mean(steps[1:] * steps[:-1] < 0.0) if steps.shape[0] > 1 else 0.0
        is_noisy = np.nansum(np.abs(np.diff(steps, axis=0))) > 0.5 * np.nansum(np.abs(steps))
    return bool(is_noisy and reversals > _REVERSALS)


def span(values: Array, least: float) -> tuple[float, float]:
    """Return the range of the finite values, widened to ``least`` about its middle."""
    finite_values = values[np.isfinite(values)]
    low, high = (
        (float(finite_values.min()), float(finite_values.max()))
        if finite_values.size
        else (0.0, 0.0)
    )
    widen = max(0.0, least - (high - low)) / 2
    return low - widen, high + widen


def unit(series: str) -> str:
    """Return the unit of a series, with superscripts."""
    return superscript(UNITS[series])


def label(text: str, series: str) -> str:
    """Return a label with the unit of a series."""
    return f"{text} [{unit(series)}]"


_METRICS = METRICS.by_name
#: Width of a line of a label beside a small panel [characters].
_WIDTH = 26


def metric_label(name: str) -> str:
    """Return the name of a metric in words, with its unit; as it is if it is no known metric.

    The unit at the end of its name, as in ``joint_jerk_max_rad_s3``, is left out.
    """
    metric = _METRICS.get(name)
    if metric is None:
        return name
    unit_text = "-" if metric.unit == "1" else superscript(metric.unit)
    return "\n".join(wrap(f"{metric.words} [{unit_text}]", _WIDTH))


def key_label(key: str, unit: str) -> str:
    """Return a key of a document with its unit; without, if none is known."""
    return f"{key} [{superscript(unit)}]" if unit else key


#: Heights of a row, and of one that is a single panel, and room above all [inch].
_ROW, _ROW_ALONE, _ABOVE = 2.1, 1.7, 0.3
#: Width of a panel [inch], by which the number of panels in a row is chosen.
_PANEL = 2.4


def filled_page(count: int) -> tuple[Figure, list[Axes]]:
    """Return a figure with ``count`` panels in rows, and its axes in order.

    Each row is as wide as the figure; on a page, seven panels are rows of three, two and two. A
    single panel is as wide as a column of a printed page. A paper's width is that of the figure.
    """
    width = wide(PAGE if count > 1 else COLUMN)
    most = max(1, round(width / _PANEL))
    rows = -(-count // most)
    lengths = [count // rows + (row < count % rows) for row in range(rows)]
    height = _ROW if most > 1 else _ROW_ALONE
    figure = Figure(figsize=(width, height * rows + _ABOVE), layout="constrained")
    parts = lcm(*lengths)
    grid = figure.add_gridspec(rows, parts)
    return figure, [
        figure.add_subplot(grid[row, k * (parts // length) : (k + 1) * (parts // length)])
        for row, length in enumerate(lengths)
        for k in range(length)
    ]

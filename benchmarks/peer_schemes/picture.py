"""Error against cost of every scheme, as a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from drake_rnn.figures.style import PAGE, SERIES, common_style, save
from peer_schemes.rows import IN_C, Row

# Colours repeat after seven libraries: markers tell ours from others.
_MARKERS, _OUR_MARKERS = "osD^hd", "vP*X<>p"
_TICKS = (0.5, 1, 2, 5, 10, 20, 50, 100)


def draw(tables: Mapping[str, Sequence[Row]], file: Path) -> None:
    """Draw a panel for each task: one marker a scheme, hollow where a bound is exceeded.

    A law in C has the marker of the law, smaller.

    Args:
        tables: Rows by the name of the task.
        file: Picture to write.
    """
    names = list(dict.fromkeys(_base(row) for rows in tables.values() for row in rows))
    looks = _looks(names)
    shown: dict[str, Line2D] = {}
    with common_style():
        figure = Figure(figsize=(PAGE, 5.6), layout="constrained")
        panels = figure.subplots(1, len(tables), squeeze=False)[0]
        for panel, (task, rows) in zip(panels, tables.items(), strict=True):
            shown |= _plot(panel, rows, looks)
            panel.set(xscale="log", yscale="log", title=task, xlabel="cost of a step [u]")
            panel.set_xticks(_TICKS, labels=[f"{tick:g}" for tick in _TICKS])
            panel.set_xlim(0.7 * _TICKS[0], 1.2 * _TICKS[-1])
            panel.minorticks_off()
        panels[0].set_ylabel("largest position error [µm]")
        entries = [(shown[name], name) for name in names if name in shown]
        figure.legend(*zip(*entries, strict=True), loc="outside lower center", ncols=2)
        save(figure, file)


def _base(row: Row) -> str:
    """Return the name of a row without what says that it is compiled."""
    return row.name.removesuffix(IN_C)


def _looks(names: Sequence[str]) -> dict[str, tuple[str, str]]:
    """Return a colour for each library or law of ours, and a marker for each of its schemes."""
    libraries = [name.split(",")[0] for name in names]
    order = list(dict.fromkeys(libraries))
    looks = {}
    for number, (name, library) in enumerate(zip(names, libraries, strict=True)):
        markers = _OUR_MARKERS if name.startswith("ours") else _MARKERS
        which = libraries[:number].count(library) % len(markers)
        looks[name] = (SERIES[order.index(library) % len(SERIES)], markers[which])
    return looks


def _plot(
    panel: Axes, rows: Sequence[Row], looks: Mapping[str, tuple[str, str]]
) -> dict[str, Line2D]:
    """Draw a marker for each row that ran, and return the markers by name."""
    shown = {}
    for row in rows:
        if row.figures is None or not isfinite(row.cost):
            continue
        colour, marker = looks[_base(row)]
        (drawn,) = panel.plot(
            row.cost,
            1e6 * row.figures.error_max,
            marker,
            color=colour,
            markerfacecolor=colour if row.keeps_bounds else "none",
            markersize=4 if row.name.endswith(IN_C) else 6,
            alpha=0.85,
            linestyle="none",
        )
        shown.setdefault(_base(row), drawn)
    return shown

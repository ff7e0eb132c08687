"""Panels that fill a page: rows of nearly equal length, none half empty."""

from __future__ import annotations

from math import lcm

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .paper import wide
from .style import COLUMN, PAGE

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

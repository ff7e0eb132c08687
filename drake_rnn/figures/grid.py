"""Panels that fill a page: rows of nearly equal length, none half empty."""

from __future__ import annotations

from math import lcm

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .style import COLUMN, PAGE

#: Height of a row, and room above all [inch].
_ROW, _ABOVE = 2.1, 0.3


def filled_page(count: int, most: int = 3) -> tuple[Figure, list[Axes]]:
    """Return a figure with ``count`` panels in rows of at most ``most``, and its axes in order.

    Each row is as wide as the figure; seven panels are rows of three, two and two. A single panel
    is as wide as a column of a printed page.
    """
    rows = -(-count // most)
    lengths = [count // rows + (row < count % rows) for row in range(rows)]
    width = PAGE if count > 1 else COLUMN
    figure = Figure(figsize=(width, _ROW * rows + _ABOVE), layout="constrained")
    parts = lcm(*lengths)
    grid = figure.add_gridspec(rows, parts)
    return figure, [
        figure.add_subplot(grid[row, k * (parts // length) : (k + 1) * (parts // length)])
        for row, length in enumerate(lengths)
        for k in range(length)
    ]

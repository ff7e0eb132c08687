"""Markers of where a path begins and ends."""

from __future__ import annotations

from typing import Any

from ..inputs.fields import Array
from ..runs.result import Result
from .looks import Style
from .traits import open_end

_START: Style = {"marker": "o", "color": "black", "markersize": 3.5, "linestyle": "none"}
_END: Style = {**_START, "marker": "s", "markersize": 5.0, "markerfacecolor": "none"}


def mark_ends(ax: Any, result: Result, traced: Array, desired: Array) -> None:
    """Mark where the traced path starts and, if it is open, where the desired one ends.

    Args:
        ax: Axes, plane or in space.
        result: The run.
        traced: Points of the traced path in the coordinates of the axes, shape (k, 2) or (k, 3).
        desired: Those of the desired path, of the same shape.
    """
    ax.plot(*traced[:1].T, label="start", **_START)
    if (end := open_end(result)).any():
        ax.plot(*desired[end].T, label="end", **_END)

"""Axes that show the curves after a transient, with a note of how far the transient goes beyond."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from ..inputs.fields import Array
from ..measures import told
from ..runs.result import Result
from .looks import NOTE, Style
from .style import largest, span
from .traits import evaluated

#: Ratio of the values before to the values after from which on only the latter are in view.
_OUTSIZE = 4.0
#: Share of a run without a window that may be a transient.
_EARLY = 0.1
#: Room beyond the curves in view, as a share of their range.
_ROOM, _ROOM_FOR_NUMBERS = 0.15, 0.35


def keep_in_view(ax: Axes, result: Result, values: Array, unit: str, scale: float = 1.0) -> None:
    """Limit the y-axis to the values after a transient, if the transient would flatten them.

    After a transient is the window, or without one what follows the first tenth of the run. Where
    curves leave the view, an arrow and a number at its edge say how far they go, in a unit that
    suits the number.

    Args:
        ax: The axes, from the result's first sample to its last.
        result: The run.
        values: All that is drawn, shape (k,) or (k, m).
        unit: SI unit of the values.
        scale: Factor from it to the unit of the axis.
    """
    values = scale * values.reshape(result.time.size, -1)
    shown = in_view(result, values)
    if shown is values:
        return
    low, high = span(np.append(shown.ravel(), 0.0), least=0.0)
    room = high - low
    bottom = low - _ROOM_FOR_NUMBERS * room if low < 0.0 else 0.0
    top = high + (_ROOM_FOR_NUMBERS if high > 0.0 else _ROOM) * room
    ax.set_ylim(bottom, top)
    known = np.where(np.isfinite(values), values, 0.0)
    for extremes, edge, sign in ((known.max(axis=1), top, 1.0), (known.min(axis=1), bottom, -1.0)):
        if sign * (peak := extremes[np.argmax(sign * extremes)]) > sign * edge:
            time = float(result.time[np.argmax(sign * extremes)])
            _mark(ax, time, edge, told(float(peak) / scale, unit, 3))


def in_view(result: Result, values: Array) -> Array:
    """Return the ``values`` in view, shape (j, ..): all of them, or those after a transient.

    Args:
        result: The run.
        values: A series, shape (k, ..).
    """
    after = values[_after(result)]
    return after if largest(values) > _OUTSIZE * largest(after) > 0.0 else values


def _after(result: Result) -> NDArray[np.bool_]:
    """Return which samples come after a transient, shape (k,)."""
    if result.experiment.document.window is not None:
        return evaluated(result)
    start, end = result.time[0], result.time[-1]
    return np.asarray(result.time >= start + _EARLY * (end - start))


def _mark(ax: Axes, time: float, edge: float, peak: str) -> None:
    """Mark a peak beyond the edge of the view with an arrow and its value."""
    up = edge == ax.get_ylim()[1]
    start, end = ax.get_xlim()
    before = time < (start + end) / 2.0
    arrow: Style = {"marker": "^" if up else "v", "s": 16.0, "color": NOTE["color"]}
    ax.scatter([time], [edge], clip_on=False, zorder=6, **arrow)
    ax.annotate(
        f"{peak} at {time:.3g} s".replace("-", "−"),
        (time, edge),
        xytext=(5.0 if before else -5.0, -1.0 if up else 1.0),
        textcoords="offset points",
        ha="left" if before else "right",
        va="top" if up else "bottom",
        annotation_clip=False,
        zorder=6,
        bbox={"facecolor": "white", "alpha": 0.8, "linewidth": 0, "pad": 0.5},
        **NOTE,
    )

"""The panel of limits: how much of each limit a run uses, and which limits it breaks."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from ..runs.limit_use import uses
from ..runs.result import Result
from .derivative_panels import number
from .looks import ALARM, BOUND, BROKEN, INK, NOTE, Style

#: Ratio to a bound from which on the axis is logarithmic beyond the bound.
_FAR = 3.0
#: End of the axis that leaves room for a number, as a multiple of the largest ratio.
_ROOM, _ROOM_BEYOND = 1.25, 30.0


def plot_limits(ax: Axes, result: Result) -> None:
    """Plot a bar for each limit that applies; a broken one is red, with a cross and its ratio."""
    found = uses(result)
    for row, use in enumerate(found):
        look: Style = {"color": BROKEN, "hatch": "////", "edgecolor": "white"} if use.broken else {}
        ax.barh(row, use.share, height=0.62, **{"color": INK, "linewidth": 0.0, **look})
        sign, note = ("✗", ALARM) if use.broken else ("✓", NOTE)
        place: Style = {"xytext": (3, 0), "textcoords": "offset points", "va": "center"}
        ax.annotate(f"{sign} {_shown(use.share)}", (max(use.share, 0.0), row), **place, **note)
    ax.axvline(1.0, label="bound", **BOUND)
    _scale(ax, max(use.share for use in found))
    ax.set_yticks(range(len(found)), [use.name for use in found])
    ax.set_ylim(len(found) - 0.45, -0.55)
    ax.grid(visible=False, axis="y")
    ax.set(xlabel="largest ratio of any joint to its bound [-]", ylabel="limit [-]")


def _shown(share: float) -> str:
    """Return a ratio with three digits; with more where these would hide that it is not 1."""
    return f"{share:.3g}" if abs(share - 1.0) > 5e-3 or share == 1.0 else f"{share:.6g}"


def _scale(ax: Axes, most: float) -> None:
    """Set an axis that is linear up to the bound, and logarithmic beyond if a bar goes far."""
    if most < _FAR:
        ax.set_xlim(0.0, _ROOM * max(1.0, most))
        return
    decades = int(np.ceil(np.log10(most)))
    ax.set_xscale("symlog", linthresh=1.0, linscale=max(1.0, decades / 3))
    ax.set_xlim(0.0, _ROOM_BEYOND ** max(0.5, decades / 5) * most)
    step = max(1, decades // 4)
    ax.xaxis.set_major_locator(FixedLocator([0.0, 0.5, *(10.0 ** np.arange(0, decades + 1, step))]))
    ax.xaxis.set_minor_locator(NullLocator())
    ax.xaxis.set_major_formatter(FuncFormatter(lambda x, place: number(x)))

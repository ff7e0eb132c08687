"""Lines of bounds, in the one look of bounds; numbers beside them say of which joints they are."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from ..inputs.fields import Array
from ..runs.limit_use import EXCEEDED
from .looks import ALARM, BOUND, NOTE, Style

#: Smallest distance of two labels, as a share of the axis.
_APART = 0.07


def known_bounds(bounds: Array | None) -> Array:
    """Return the distinct values of finite bounds in ascending order; none for None."""
    return np.empty(0) if bounds is None else np.unique(bounds[np.isfinite(bounds)])


def draw_bounds(ax: Axes, bounds: Array) -> None:
    """Draw bounds of a magnitude, shape (k,), with both signs."""
    for bound in bounds:
        for sign in (-1, 1):
            ax.axhline(sign * bound, **BOUND)


def number_bounds(ax: Axes, bounds: Array | None) -> None:
    """Write at the right edge of which joints each bound in view is, if they differ.

    Args:
        ax: The axes, with their final limits.
        bounds: Bound of each joint, shape (n,); None if there are none.
    """
    if bounds is None or known_bounds(bounds).size < 2:
        return
    low, high = ax.get_ylim()
    labels: list[tuple[float, list[str]]] = []
    for bound in np.unique(bounds[(bounds > low) & (bounds < high)]):
        joints = [f"{k + 1}" for k in np.flatnonzero(bounds == bound)]
        if labels and bound - labels[-1][0] < _APART * (high - low):
            labels[-1][1].extend(joints)
        else:
            labels.append((float(bound), joints))
    for bound, joints in labels:
        place: Style = {"xytext": (2, 0), "textcoords": "offset points", "va": "center"}
        text = ", ".join(sorted(joints, key=int))
        ax.annotate(text, (1.0, bound), xycoords=ax.get_yaxis_transform(), **place, **NOTE)


def excess_note(ax: Axes, ratio: float) -> None:
    """Write above the axes how many times the bound the curves reach, as an alarm if beyond it."""
    broken = ratio > EXCEEDED
    text = f"{'✗ ' if broken else ''}up to {ratio:.3g} × bound"
    ax.set_title(text, loc="right", pad=2, **(ALARM if broken else NOTE))

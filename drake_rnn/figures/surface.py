"""The plane of the surface that a tool is pressed against, and what is drawn on it."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap, Normalize, to_rgb

from ..fields import Array
from ..result import Result
from .style import COLOURS, DESIRED, finite, legend, prefixed, span, ticks
from .traits import evaluated, first_lap

#: Share of the desired force by which it may be missed and still be near it.
NEAR = 0.05

#: How far the x-axis may lean towards the normal and still give the surface's first axis.
_STEEP = 0.9
#: Of forces, from pale to dark: tints of three of the colours, as a figure's palette has them.
_TINTS = ((4, 0.25), (4, 0.5), (4, 0.75), (4, 1.0), (1, 0.85), (1, 1.0), (6, 0.85), (6, 1.0))
#: Width of a curve that all but stands still [mm].
_LEAST = 1.0


def surface_axes(result: Result) -> tuple[Array, list[str]]:
    """Two axes along the surface, the second to the left of the first as seen from above.

    The first is the base's x-axis laid down on the surface, or its y-axis where x is all but
    the normal.

    Returns:
        The axes, of length 1, shape (2, 3), and for each the name of the base's axis it is
        closest to, with its sign.
    """
    contact = result.experiment.setup.contact
    assert contact is not None, "not drawn without one"
    n = contact.surface.normal_W
    base = np.eye(3)[0 if abs(n[0]) < _STEEP else 1]
    first = base - n.dot(base) * n
    first /= np.linalg.norm(first)
    axes = np.stack((first, np.cross(n, first)))
    closest = np.abs(axes).round(9).argmax(axis=1)
    signs = ["−" if axis[k] < 0 else "" for axis, k in zip(axes, closest, strict=True)]
    return axes, [sign + "xyz"[k] for sign, k in zip(signs, closest, strict=True)]


def on_surface(result: Result, points: Array) -> Array:
    """Points, shape (k, 3) [m], seen from above: from the desired path's start, shape (k, 2)."""
    axes, _ = surface_axes(result)
    return np.asarray((points - result.series["p_WE_desired"][0]) @ axes.T)


def plot_on_surface(ax: Axes, result: Result) -> None:
    """What is drawn on the surface, coloured by the force with which it is."""
    traced = 1e3 * on_surface(result, result.series["p_WE"])
    desired = 1e3 * on_surface(result, result.series["p_WE_desired"])
    unit, scale = prefixed(result.series["normal_force_desired"], "N")
    force = scale * result.series["normal_force"]
    low, high = _range(result, scale)
    curve = LineCollection(
        list(np.stack((traced[:-1], traced[1:]), axis=1)),
        array=(force[:-1] + force[1:]) / 2,
        norm=Normalize(low, high),
        cmap=_colours(),
        linewidth=3.2,
        capstyle="round",
    )
    ax.add_collection(curve)
    # Thin, and above: errors are seldom as wide as a curve whose colour can be told.
    lap = first_lap(result)
    ax.plot(*desired[lap].T, label="desired", zorder=3, **{**DESIRED, "linewidth": 0.6})
    ax.plot(*traced[:1].T, "o", color="black", markersize=3.5, label="start")
    shown = finite(np.concatenate((traced, desired)))
    ax.update_datalim(np.stack([span(values, least=_LEAST) for values in shown.T], axis=1))
    ax.margins(0.06)
    ax.set_aspect("equal", adjustable="datalim")
    ticks(ax.xaxis, 6)
    ticks(ax.yaxis, 6)
    across, up = (f"{name} along the surface [mm]" for name in surface_axes(result)[1])
    ax.set(xlabel=across, ylabel=up)
    figure: Any = ax.figure
    bar = figure.colorbar(curve, ax=ax, extend=_beyond(force, low, high), aspect=25, pad=0.02)
    bar.ax.axhline(scale * result.series["normal_force_desired"][-1], **DESIRED)
    ticks(bar.ax.yaxis, 6)
    bar.set_label(f"normal force [{unit}]")
    bar.outline.set_visible(False)
    legend(ax)


def _range(result: Result, scale: float) -> tuple[float, float]:
    """Of the forces told apart: those in the window, and what is near the desired one.

    From first contact on, all would have one colour.
    """
    within = evaluated(result)
    force, desired = (
        scale * result.series[name][within] for name in ("normal_force", "normal_force_desired")
    )
    low, high = span(np.concatenate((force, (1 - NEAR) * desired, (1 + NEAR) * desired)), least=0.0)
    return max(0.0, low), high


def _beyond(values: Array, low: float, high: float) -> str:
    """Which ends of the colour bar stand for more than their value."""
    # What touches nothing may press by less than nothing, by a rounding error.
    rounding = 1e-6 * (high - low)
    below, above = bool((values < low - rounding).any()), bool((values > high + rounding).any())
    return ("both" if above else "min") if below else ("max" if above else "neither")


def _colours() -> ListedColormap:
    tints = [1.0 - share * (1.0 - np.array(to_rgb(COLOURS[k]))) for k, share in _TINTS]
    return ListedColormap([tuple(tint) for tint in tints])

"""The plane of the surface that a tool is pressed against, and what is drawn on it."""

from __future__ import annotations

from math import ceil
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import BoundaryNorm, ListedColormap, to_rgb

from ..inputs.fields import Array
from ..runs.result import Result
from .style import COLOURS, DESIRED, Style, finite, legend, prefixed, span, ticks
from .traits import evaluated, first_lap

#: Share of the desired force by which it may be missed and still be near it.
NEAR = 0.05

#: How far the x-axis may lean towards the normal and still give the surface's first axis.
_STEEP = 0.9
#: Tints, as a figure's palette has them, of what is desired, and of less and more, ever
#: further off.
_DESIRED = (2, 1.0)
_LESS = ((5, 0.45), (5, 1.0), (0, 0.75), (0, 1.0))
_MORE = ((4, 0.45), (4, 1.0), (1, 1.0), (6, 1.0))
#: Share of the desired force that one colour stands for; finer ones would tell apart what is near.
_STEPS = (0.02, 0.05, 0.1, 0.2, 0.25, 0.5, 1.0)
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
    contact = result.experiment.contact
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


def brought_onto_surface(result: Result) -> Array:
    """The desired path as high above the surface as the tool is, shape (k, 3) [m].

    Along the normal the force rules, not the path. What is left of the distance to the tool is
    the position error.
    """
    contact = result.experiment.contact
    assert contact is not None, "not drawn without one"
    n = contact.surface.normal_W
    desired = result.series["p_WE_desired"]
    height = (result.series["p_WE"] - desired) @ n
    # A run that diverged has nowhere to bring it.
    return np.asarray(desired + np.outer(np.where(np.isfinite(height), height, 0.0), n))


def plot_on_surface(ax: Axes, result: Result) -> None:
    """What is drawn on the surface, coloured by the force with which it is."""
    traced = 1e3 * on_surface(result, result.series["p_WE"])
    desired = 1e3 * on_surface(result, result.series["p_WE_desired"])
    unit, scale = prefixed(result.series["normal_force_desired"], "N")
    force = scale * result.series["normal_force"]
    edges, colours = force_scale(result)
    edges = scale * edges
    curve = LineCollection(
        list(np.stack((traced[:-1], traced[1:]), axis=1)),
        array=(force[:-1] + force[1:]) / 2,
        norm=BoundaryNorm(edges.tolist(), colours.N),
        cmap=colours,
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
    place: Style = {"ax": ax, "aspect": 25, "pad": 0.02, "spacing": "proportional"}
    bar = figure.colorbar(curve, extend=_beyond(force, edges[0], edges[-1]), format="%.4g", **place)
    bar.ax.axhline(scale * _desired(result), **DESIRED)
    bar.set_label(f"normal force [{unit}]")
    bar.outline.set_visible(False)
    legend(ax)


def force_scale(result: Result) -> tuple[Array, ListedColormap]:
    """Forces [N] between which a colour each stands for what lies there, rising, and the colours.

    One colour has the desired force in its middle, and is the same in every run: what lies near
    it looks like it. The others reach over the forces in the window; from first contact on, all
    those would have one colour.
    """
    desired = _desired(result)
    low, high = _range(result)
    most = len(_LESS) + 0.5
    far = max(desired - low, high - desired)
    step = desired * next((s for s in _STEPS if far <= most * s * desired), far / (most * desired))
    less, more = (_steps_beyond(off / step) for off in (desired - low, high - desired))
    edges = desired + step * (np.arange(-less, more + 2) - 0.5)
    tints = (*_LESS[:less][::-1], _DESIRED, *_MORE[:more])
    colours = [1.0 - share * (1.0 - np.array(to_rgb(COLOURS[k]))) for k, share in tints]
    return edges.clip(min=0.0), ListedColormap([tuple(colour) for colour in colours])


def _steps_beyond(steps: float) -> int:
    """Colours beyond the middle one, which takes half a step; none for a rounding error."""
    return max(0, ceil(steps - 0.5 - 1e-9))


def _desired(result: Result) -> float:
    """Once it has risen [N]."""
    contact = result.experiment.contact
    assert contact is not None, "not drawn without one"
    return contact.force.value


def _range(result: Result) -> tuple[float, float]:
    """Of the forces told apart [N]: those in the window, and what is near the desired one."""
    force = result.series["normal_force"][evaluated(result)]
    near = _desired(result) * np.array([1 - NEAR, 1 + NEAR])
    low, high = span(np.concatenate((force, near)), least=0.0)
    return max(0.0, low), high


def _beyond(values: Array, low: float, high: float) -> str:
    """Which ends of the colour bar stand for more than their value."""
    # What touches nothing may press by less than nothing, by a rounding error.
    rounding = 1e-6 * (high - low)
    below, above = bool((values < low - rounding).any()), bool((values > high + rounding).any())
    return ("both" if above else "min") if below else ("max" if above else "neither")

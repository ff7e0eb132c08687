"""The path on the surface that a tool presses against, as seen from above."""

from __future__ import annotations

from math import ceil
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import BoundaryNorm, ListedColormap, to_rgb
from matplotlib.patheffects import withStroke

from ..inputs.fields import Array
from ..measures import prefixed
from ..runs.result import Result
from ..systems import Contact
from .ends import mark_ends
from .looks import DESIRED, FORCE, Style
from .style import finite, largest, legend, plane_axes, span
from .traits import evaluated, first_pass

#: Relative error up to which a force counts as near the desired one.
NEAR = 0.05

#: Vertical part of the normal below which a surface is a wall: it is read with its top up.
_WALL = 0.7
#: The desired force has the colour of forces, smaller ones are paler and larger ones darker: these
#: are the ends, and the ways towards them in the order of the distance from the desired force.
_PALE, _DARK = "#F3E9A6", "#06170F"
_WAYS = (0.42, 0.65, 0.85, 1.0)
#: Widths of a colour's range to choose from, relative to the desired force. None is narrower: that
#: would show differences between forces that are all near the desired one.
_STEPS = (0.02, 0.05, 0.1, 0.2, 0.25, 0.5, 1.0)
#: Smallest extent of the axes, for a curve that hardly moves [mm].
_LEAST = 1.0


def surface_axes(result: Result) -> tuple[Array, list[str]]:
    """Return two axes along the surface, to the right and up as its drawing is read.

    It is seen from where the tool is, against the normal. On a wall, up is the base's z-axis
    projected onto it. Elsewhere, as on a table, the first axis is the base's x-axis projected.

    Returns:
        Unit vectors, shape (2, 3), and for each the name of the closest axis of the base, with its
        sign.
    """
    n = _contact(result).surface.normal_W
    is_wall = abs(n[2]) < _WALL
    base = np.eye(3)[2 if is_wall else 0]
    along = base - n.dot(base) * n
    along /= np.linalg.norm(along)
    axes = np.stack((np.cross(along, n), along) if is_wall else (along, np.cross(n, along)))
    closest = np.abs(axes).round(9).argmax(axis=1)
    signs = ["−" if axis[k] < 0 else "" for axis, k in zip(axes, closest, strict=True)]
    return axes, [sign + "xyz"[k] for sign, k in zip(signs, closest, strict=True)]


def surface_coordinates(result: Result, points: Array) -> Array:
    """Return coordinates along the surface, shape (k, 2) [m], from the desired path's start.

    Args:
        result: The run.
        points: Shape (k, 3) [m].
    """
    axes, _ = surface_axes(result)
    return np.asarray((points - result.desired_position[0]) @ axes.T)


def desired_at_tool_height(result: Result) -> Array:
    """Return the desired path moved along the normal to the tool's height, shape (k, 3) [m].

    Along the normal, the force is controlled and not the position. The remaining distance to the
    tool is the position error.
    """
    n = _contact(result).surface.normal_W
    desired = result.desired_position
    height = (result.series["p_WE"] - desired) @ n
    # The height of a run that diverged may not be finite.
    return np.asarray(desired + np.outer(np.where(np.isfinite(height), height, 0.0), n))


def plot_on_surface(ax: Axes, result: Result) -> None:
    """Plot the path on the surface as seen from above, coloured by the normal force."""
    traced = 1e3 * surface_coordinates(result, result.series["p_WE"])
    desired = 1e3 * surface_coordinates(result, result.desired_position)
    unit, scale = prefixed(largest(result.series["normal_force_desired"]), "N")
    force = scale * result.series["normal_force"]
    edges, colours = force_scale(result)
    edges = scale * edges
    curve = LineCollection(
        list(np.stack((traced[:-1], traced[1:]), axis=1)),
        array=(force[:-1] + force[1:]) / 2,
        norm=BoundaryNorm(edges.tolist(), colours.N),
        cmap=colours,
        linewidth=4.4,
        capstyle="round",
    )
    ax.add_collection(curve)
    # A thin line on top: the error is usually smaller than the width of the coloured curve.
    once = first_pass(result)
    edge: Style = {"path_effects": [withStroke(linewidth=1.6, foreground="white")]}
    ax.plot(*desired[once].T, label="desired", zorder=3, **{**DESIRED, "linewidth": 0.8, **edge})
    mark_ends(ax, result, traced, desired)
    shown = finite(np.concatenate((traced, desired)))
    ax.update_datalim(np.stack([span(values, least=_LEAST) for values in shown.T], axis=1))
    across, up = surface_axes(result)[1]
    plane_axes(ax, f"{across} along the surface [mm]", f"{up} along the surface [mm]")
    figure: Any = ax.figure
    place: Style = {"ax": ax, "aspect": 25, "pad": 0.02, "spacing": "proportional"}
    bar = figure.colorbar(curve, extend=_beyond(force, edges[0], edges[-1]), format="%.4g", **place)
    bar.ax.axhline(scale * _desired(result), **DESIRED)
    bar.set_label(f"normal force [{unit}]")
    bar.outline.set_visible(False)
    legend(ax)


def force_scale(result: Result) -> tuple[Array, ListedColormap]:
    """Return the edges of the colours' ranges of force, ascending [N], and the colours.

    The desired force is in the middle of the range of one colour, which is the same in every run.
    The others cover the forces in the window; if they covered the first contact as well, all forces
    in the window would have one colour.
    """
    desired = _desired(result)
    # The range to tell apart: the forces in the window, and those near the desired one.
    near = desired * np.array([1 - NEAR, 1 + NEAR])
    force = result.series["normal_force"][evaluated(result)]
    low, high = span(np.concatenate((force, near)), least=0.0)
    low = max(0.0, low)
    most = len(_WAYS) + 0.5
    far = max(desired - low, high - desired)
    step = desired * next((s for s in _STEPS if far <= most * s * desired), far / (most * desired))
    # The colour in the middle takes half a step; a rounding error needs no further colour.
    beyond = ((off / step - 0.5 - 1e-9) for off in (desired - low, high - desired))
    less, more = (max(0, ceil(steps)) for steps in beyond)
    paler, darker = (_towards(end) for end in (_PALE, _DARK))
    edges = desired + step * (np.arange(-less, more + 2) - 0.5)
    tints = [*paler[:less][::-1], to_rgb(FORCE["color"]), *darker[:more]]
    return edges.clip(min=0.0), ListedColormap(tints)


def _towards(end: str) -> list[tuple[float, ...]]:
    """Return colours on the way from the colour of forces to another colour."""
    start, stop = (np.array(to_rgb(colour)) for colour in (FORCE["color"], end))
    return [tuple(start + way * (stop - start)) for way in _WAYS]


def _contact(result: Result) -> Contact:
    """Return the contact of a run that has one."""
    contact = result.experiment.contact
    assert contact is not None, "drawn only with a contact"
    return contact


def _desired(result: Result) -> float:
    """Return the desired force once it has risen [N]."""
    return _contact(result).force.value


def _beyond(values: Array, low: float, high: float) -> str:
    """Return which ends of the colour bar stand for values beyond them."""
    # Without contact, the force may be negative by a rounding error.
    rounding = 1e-6 * (high - low)
    below, above = bool((values < low - rounding).any()), bool((values > high + rounding).any())
    return ("both" if above else "min") if below else ("max" if above else "neither")

"""The path on the surface that a tool presses against, as seen from above."""

from __future__ import annotations

from math import ceil
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import BoundaryNorm, ListedColormap, to_rgb

from ..inputs.fields import Array
from ..runs.result import Result
from ..systems import Contact
from .ends import mark_ends
from .style import COLOURS, DESIRED, Style, finite, legend, prefixed, span, ticks
from .traits import evaluated, first_pass

#: Relative error up to which a force counts as near the desired one.
NEAR = 0.05

#: Cosine of the angle between normal and x-axis up to which the surface's first axis follows x.
_STEEP = 0.9
#: Colours of the desired force, and of smaller and larger ones in the order of their distance from
#: it: index in `COLOURS` and strength. They are in the palette of the file.
_DESIRED = (2, 1.0)
_LESS = ((5, 0.45), (5, 1.0), (0, 0.75), (0, 1.0))
_MORE = ((4, 0.45), (4, 1.0), (1, 1.0), (6, 1.0))
#: Widths of a colour's range to choose from, relative to the desired force. None is narrower: that
#: would show differences between forces that are all near the desired one.
_STEPS = (0.02, 0.05, 0.1, 0.2, 0.25, 0.5, 1.0)
#: Smallest extent of the axes, for a curve that hardly moves [mm].
_LEAST = 1.0


def surface_axes(result: Result) -> tuple[Array, list[str]]:
    """Return two axes along the surface, the second to the left of the first as seen from above.

    The first is the base's x-axis projected onto the surface, or the y-axis if x is nearly the
    normal.

    Returns:
        Unit vectors, shape (2, 3), and for each the name of the closest axis of the base, with its
        sign.
    """
    n = _contact(result).surface.normal_W
    base = np.eye(3)[0 if abs(n[0]) < _STEEP else 1]
    first = base - n.dot(base) * n
    first /= np.linalg.norm(first)
    axes = np.stack((first, np.cross(n, first)))
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
    return np.asarray((points - result.series["p_WE_desired"][0]) @ axes.T)


def desired_at_tool_height(result: Result) -> Array:
    """Return the desired path moved along the normal to the tool's height, shape (k, 3) [m].

    Along the normal, the force is controlled and not the position. The remaining distance to the
    tool is the position error.
    """
    n = _contact(result).surface.normal_W
    desired = result.series["p_WE_desired"]
    height = (result.series["p_WE"] - desired) @ n
    # The height of a run that diverged may not be finite.
    return np.asarray(desired + np.outer(np.where(np.isfinite(height), height, 0.0), n))


def plot_on_surface(ax: Axes, result: Result) -> None:
    """Plot the path on the surface as seen from above, coloured by the normal force."""
    traced = 1e3 * surface_coordinates(result, result.series["p_WE"])
    desired = 1e3 * surface_coordinates(result, result.series["p_WE_desired"])
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
    # A thin line on top: the error is usually smaller than the width of the coloured curve.
    once = first_pass(result)
    ax.plot(*desired[once].T, label="desired", zorder=3, **{**DESIRED, "linewidth": 0.6})
    mark_ends(ax, result, traced, desired)
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
    """Return the edges of the colours' ranges of force, ascending [N], and the colours.

    The desired force is in the middle of the range of one colour, which is the same in every run.
    The others cover the forces in the window; if they covered the first contact as well, all forces
    in the window would have one colour.
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


def _contact(result: Result) -> Contact:
    """Return the contact of a run that has one."""
    contact = result.experiment.contact
    assert contact is not None, "drawn only with a contact"
    return contact


def _steps_beyond(steps: float) -> int:
    """Return the number of colours on one side of the middle one, which takes half a step.

    A rounding error needs no further colour.
    """
    return max(0, ceil(steps - 0.5 - 1e-9))


def _desired(result: Result) -> float:
    """Return the desired force once it has risen [N]."""
    return _contact(result).force.value


def _range(result: Result) -> tuple[float, float]:
    """Return the range of force that colours distinguish [N].

    It covers the forces in the window and those near the desired one.
    """
    force = result.series["normal_force"][evaluated(result)]
    near = _desired(result) * np.array([1 - NEAR, 1 + NEAR])
    low, high = span(np.concatenate((force, near)), least=0.0)
    return max(0.0, low), high


def _beyond(values: Array, low: float, high: float) -> str:
    """Return which ends of the colour bar stand for values beyond them."""
    # Without contact, the force may be negative by a rounding error.
    rounding = 1e-6 * (high - low)
    below, above = bool((values < low - rounding).any()), bool((values > high + rounding).any())
    return ("both" if above else "min") if below else ("max" if above else "neither")

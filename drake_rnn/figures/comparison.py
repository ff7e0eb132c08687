"""The figure that compares laws: their errors, and how much of each bound they use.

- A figure of several runs for print: panels of choice, with a curve for each run.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator

from .. import colours
from ..errors import InvalidInputError
from ..inputs.fields import Array
from ..inputs.messages import nearest
from ..measures import prefix_unit
from ..robot.limits import DERIVATIVE_UNITS
from ..runs.limit_use import derivatives_of_motion, share_of_range
from ..runs.result import Result, name_with_ending
from ..signals import DESIRED_POSITION, TRACKING
from .joint_panels import leave_room
from .registry import first_pass, strokes_of
from .style import (
    BOUND,
    COLUMN,
    PAGE,
    Paper,
    Style,
    common_style,
    drawn_for,
    finite,
    largest,
    legend_above,
    log_axis,
    noisy,
    nth,
    plane_axes,
    save,
    ticks,
    time_axis,
    wide,
)

#: Times [s] and shares of bounds [-] for each order of derivative, shape (k,) both.
Shares = list[tuple[Array, Array]]

#: Share of a bound, and error [m], below which curves are not shown.
_LEAST, _LEAST_ERROR = 1e-3, 1e-10
#: Share of a bound up to which an axis is linear.
_MANY_TIMES = 5.0


def comparison_figure(groups: Mapping[str, Mapping[str, Result]], file: Path) -> Path:
    """Draw the runs of several laws over one another, a column of panels for each group of runs.

    The first panel of a column shows the position error. Each of the others shows, for one order of
    derivative that is bounded in any run, the largest share of its bound that any joint uses; 1 is
    the bound.

    Args:
        groups: Runs by law, in groups by path; each group has the same laws in the same order.
        file: File to write.

    Returns:
        The file.
    """
    shares = {
        title: [shares_of_bounds(run) for run in runs.values()] for title, runs in groups.items()
    }
    orders = bounded_orders([share for each in shares.values() for share in each])
    kinds = ("angle", *DERIVATIVE_UNITS)
    names = ["position error [m]", *(f"{kinds[order]} / bound [-]" for order in orders)]
    with common_style():
        figure = Figure(figsize=(wide(PAGE), 0.8 + 1.25 * len(names)), layout="constrained")
        axes: Any = figure.subplots(len(names), len(groups), squeeze=False, sharex="col")
        for column, (title, runs) in zip(axes.T, groups.items(), strict=True):
            column[0].set_title(title)
            plot_errors(column[0], runs)
            plot_shares(dict(zip(orders, column[1:], strict=True)), shares[title])
            time_axis(column[-1], max(runs.values(), key=lambda run: float(run.time[-1])))
            leave_room(column[-1])
        for ax, name in zip(axes[:, 0], names, strict=True):
            ax.set_ylabel(name)
        legend_above(figure, axes[0, 0])
        figure.align_ylabels()
        save(figure, file)
    return file


def shares_of_bounds(result: Result) -> Shares:
    """Return the largest share of its bound that any joint uses, for derivatives of order 0 to 5.

    Returns:
        Times [s] and shares [-] for each order, shape (k,) both.
    """
    limits = result.experiment.limits
    signals = derivatives_of_motion(result)
    shares = [(signals[0][0], share_of_range(signals[0][1], limits))]
    for (time, values), name in zip(signals[1:], DERIVATIVE_UNITS, strict=True):
        bound = limits.toward(name, values)
        share = np.full_like(values, np.nan) if bound is None else np.abs(values) / bound
        shares.append((time, share.max(axis=1)))
    return shares


def plot_errors(ax: Axes, runs: Mapping[str, Result]) -> None:
    """Plot the position error of every run."""
    for k, (name, result) in enumerate(runs.items()):
        label = name_with_ending(name, result)
        ax.plot(result.time, result.position_error, label=label, **nth(k))
    _log_axis_from(ax, _LEAST_ERROR, [result.position_error for result in runs.values()])


def bounded_orders(shares: Sequence[Shares]) -> list[int]:
    """Return the orders of derivatives that are bounded in any of some runs."""
    every = zip(*shares, strict=True)
    return [k for k, runs in enumerate(every) if any(np.isfinite(share).any() for _, share in runs)]


def plot_shares(axes: Mapping[int, Axes], shares: Sequence[Shares]) -> None:
    """Plot the share of its bound that each order of derivative uses, a panel for each order."""
    for order, ax in axes.items():
        curves = [each[order] for each in shares]
        for k, (time, share) in enumerate(curves):
            ax.plot(time, share, **nth(k))
        ax.axhline(1.0, **BOUND)
        # What matters is near the bound: a logarithmic axis is for what is far beyond it.
        most = max(1.0, *(largest(share) for _, share in curves))
        if most <= _MANY_TIMES:
            ax.set_ylim(0, 1.15 * most)
        else:
            _log_axis_from(ax, _LEAST, [*(share for _, share in curves), np.array([0.05, 2.0])])


def _log_axis_from(ax: Axes, least: float, curves: list[Array]) -> None:
    """Set a logarithmic y-axis for curves, which begins no lower than at ``least``."""
    log_axis(ax, curves)
    ax.set_ylim(bottom=max(ax.get_ylim()[0], least))
    ax.yaxis.set_minor_locator(NullLocator())


Runs = Mapping[str, Result]

#: Kinds of motion whose shares of bounds are panels, from the angle on.
_ORDERS = ("angle", *DERIVATIVE_UNITS)
#: Heights of a panel over time and of one with a path, and room for the legend [inch].
_TIME, _PATH, _ABOVE = 1.25, 2.3, 0.3
#: Width from which on panels are beside one another [inch].
_BESIDE = 5.0
#: How far two desired paths may be apart to be one, as a share of their size.
_SAME = 1e-3
#: Number of points by which they are compared.
_FEW = 200
#: How desired paths are drawn behind those traced, which they would hide: that of all runs, and
#: those that they have of their own.
_PALE: Style = {"linewidth": 4.0, "alpha": 0.3, "zorder": 1.2}
_ONE: Style = {**_PALE, "color": colours.DESIRED}
_EACH: Style = {**_PALE, "color": "0.3", "label": "desired of each"}


@dataclass(frozen=True)
class Panel:
    """A panel with a curve for each run.

    Attributes:
        plot: Function that draws it, with the label of its y-axis.
        needs: Series that each run must have.
    """

    plot: Callable[[Axes, Runs], None]
    needs: tuple[str, ...]


def compared_figure(runs: Runs, panels: Sequence[str], paper: Paper) -> Figure:
    """Return a figure of several runs.

    Args:
        runs: The runs by the names of the legend.
        panels: Names of the panels, keys of `PANELS`.
        paper: What it is drawn for; on a wide one, the panels are beside one another.

    Raises:
        InvalidInputError: If there is no such panel, or a run has no series for it.
    """
    _require_drawable(runs, panels)
    with drawn_for(paper), common_style():
        width = wide(COLUMN)
        heights = [_PATH if name == "path" else _TIME for name in panels]
        if width >= _BESIDE:
            shape, size = (1, len(panels)), (width, _PATH + _ABOVE)
            ratios: dict[str, Any] = {}
        else:
            shape, size = (len(panels), 1), (width, sum(heights) + _ABOVE)
            ratios = {"height_ratios": heights}
        figure = Figure(figsize=size, layout="constrained")
        axes = figure.subplots(*shape, squeeze=False, **ratios).ravel()
        for name, ax in zip(panels, axes, strict=True):
            PANELS[name].plot(ax, runs)
            _put_noise_behind(ax.lines[: len(runs)])
            if name != "path":
                time_axis(ax, max(runs.values(), key=lambda run: float(run.time[-1])))
        _legend(figure, axes[0], runs, "path" in panels)
        _share_time(axes, panels, shape)
        figure.align_ylabels()
    return figure


def _require_drawable(runs: Runs, panels: Sequence[str]) -> None:
    for panel in panels:
        if panel not in PANELS:
            raise InvalidInputError(f"panels: no {panel!r}; {nearest(panel, list(PANELS))}")
        if panels.count(panel) > 1:
            raise InvalidInputError(f"panels: {panel} is given twice")
    _require_series(runs, panels)
    orders = [_ORDERS[k] for k in bounded_orders([shares_of_bounds(run) for run in runs.values()])]
    for panel in panels:
        if panel in _ORDERS and panel not in orders:
            raise InvalidInputError(f"panels: {panel} is bounded in none of the runs")


def _require_series(runs: Runs, panels: Sequence[str]) -> None:
    for panel in panels:
        for name, run in runs.items():
            if run.time.size < 2:
                raise InvalidInputError(f"panels: {name} holds a single instant")
            if missing := [each for each in PANELS[panel].needs if each not in run.series]:
                raise InvalidInputError(
                    f"panels: {name} has no series {missing[0]}, which {panel} needs"
                )


def _legend(figure: Figure, ax: Axes, runs: Runs, with_path: bool) -> None:
    """Name the runs above all panels, and the desired path if it is drawn."""
    for k, (name, run) in enumerate(runs.items()):
        ax.plot([], [], label=name_with_ending(name, run), **nth(k))
    if with_path:
        one = _one_path([_desired_points(run) for run in runs.values()])
        ax.plot([], [], **({"label": "desired", **_ONE} if one else _EACH))
    room = 110 if figure.get_figwidth() >= _BESIDE else 50
    legend_above(figure, ax, room=room, beside=4)


def _put_noise_behind(lines: Sequence[Line2D]) -> None:
    """Put the curves that go up and down most behind the others, those of noise thin and pale."""
    curves = [np.asarray(line.get_ydata(), dtype=float) for line in lines]
    # A run that diverged may contain infinite values.
    with np.errstate(invalid="ignore", over="ignore"):
        ways = [-np.nansum(np.abs(np.diff(curve))) for curve in curves]
    places = np.argsort(np.argsort(ways, kind="stable"), kind="stable")
    for line, curve, place in zip(lines, curves, places, strict=True):
        line.set_zorder(1.5 + 0.4 * float(place) / len(curves))
        if noisy(curve[:, None]):
            line.set(linewidth=0.6, alpha=0.8)


def _share_time(axes: Sequence[Axes], panels: Sequence[str], shape: tuple[int, int]) -> None:
    """Leave out the labels of time of a panel that has another one over the same time below it."""
    if shape[1] > 1:
        return
    for ax, name, below in zip(axes, panels, panels[1:], strict=False):
        if "path" not in (name, below):
            ax.set_xlabel("")
            ax.tick_params(labelbottom=False)


def _plot_path(ax: Axes, runs: Runs) -> None:
    """Plot what each run traced, in the plane in which the desired paths vary most.

    Where runs have paths of their own, each desired path is pale and wide, in its run's colour.
    """
    curves = [_desired_points(run) for run in runs.values()]
    spread = np.ptp(finite(np.concatenate(curves)), axis=0)
    a, b = sorted(np.argsort(spread, kind="stable")[-2:].tolist())
    for k, run in enumerate(runs.values()):
        ax.plot(*strokes_of(run, "p_WE")[:, [a, b]].T, **nth(k))
    if _one_path(curves):
        whole = max(curves, key=lambda path: float(np.ptp(finite(path), axis=0).max()))
        ax.plot(*whole[:, [a, b]].T, **_ONE)
    else:
        for k, path in enumerate(curves):
            ax.plot(*path[:, [a, b]].T, color=nth(k)["color"], **_PALE)
    plane_axes(ax, f"{'xyz'[a]} [m]", f"{'xyz'[b]} [m]")


def _desired_points(run: Result) -> Array:
    """Return points of a run's desired path, passed once, shape (k, 3); NaN as in `strokes_of`."""
    return strokes_of(run, DESIRED_POSITION)[first_pass(run)]


def _one_path(paths: Sequence[Array]) -> bool:
    """Return whether paths are the same curve, at whatever times and however far it is passed.

    Args:
        paths: Points of each, shape (k, 3), NaN between strokes.
    """
    curves = [finite(path) for path in paths]
    if min(map(len, curves)) < 2:
        return len(curves) == 1
    whole = max(curves, key=lambda curve: float(np.ptp(curve, axis=0).max()))
    size = float(np.ptp(whole, axis=0).max())
    return all(_farthest(curve, whole) <= _SAME * size for curve in curves)


def _farthest(points: Array, curve: Array) -> float:
    """Return how far a point of the first curve is from the second, at most."""
    few = points[:: max(1, len(points) // _FEW)]
    begin, way = curve[:-1], np.diff(curve, axis=0)
    length = np.maximum((way**2).sum(axis=1), np.finfo(float).tiny)
    distances = []
    for point in few:
        along = np.clip(((point - begin) * way).sum(axis=1) / length, 0.0, 1.0)
        off = begin + along[:, None] * way - point
        distances.append(np.sqrt((off**2).sum(axis=1).min()))
    return float(max(distances))


def _plot_error(ax: Axes, runs: Runs) -> None:
    plot_errors(ax, runs)
    ax.set_ylabel("position error [m]")


def _plot_share(ax: Axes, runs: Runs, order: int) -> None:
    """Plot the largest share of a bound that any joint uses."""
    plot_shares({order: ax}, [shares_of_bounds(run) for run in runs.values()])
    ax.set_ylabel(f"{_ORDERS[order]}\n/ bound [-]")


def _plot_values(ax: Axes, runs: Runs, text: str, unit: str, of: Callable[[Result], Array]) -> None:
    """Plot a value of each run over time."""
    values = [of(run) for run in runs.values()]
    label, scale = prefix_unit(max(map(largest, values)), unit)
    for k, (run, curve) in enumerate(zip(runs.values(), values, strict=True)):
        ax.plot(run.time, scale * curve, **nth(k))
    ticks(ax.yaxis, 4)
    ax.set_ylabel(f"{text} [{label}]")


def _values(
    text: str, unit: str, *needs: str, of: Callable[[Result], Array] | None = None
) -> Panel:
    series = (lambda run: run.series[needs[0]]) if of is None else of
    return Panel(partial(_plot_values, text=text, unit=unit, of=series), needs)


def _speed(run: Result) -> Array:
    return np.asarray(np.linalg.norm(run.series["v_WE"], axis=1))


def _drift(run: Result) -> Array:
    return np.asarray(np.abs(run.series["position"] - run.series["position"][0]).max(axis=1))


#: Panels of a figure of several runs.
PANELS: dict[str, Panel] = {
    "path": Panel(_plot_path, TRACKING),
    "error": Panel(_plot_error, TRACKING),
    "orientation": _values("orientation error", "rad", "orientation_error"),
    "speed": _values("end-effector speed", "m/s", "v_WE", of=_speed),
    "drift": _values("largest way of a joint\nfrom its start", "rad", "position", of=_drift),
    "distance": _values("least distance", "m", "distance"),
    "force": _values("normal force", "N", "normal_force"),
    **{
        name: Panel(partial(_plot_share, order=order), ("position", "velocity"))
        for order, name in enumerate(_ORDERS)
    },
}

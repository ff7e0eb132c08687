"""The figures that apply to a result, for a notebook or written to a folder.

- Those that show one quantity each.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..errors import InvalidInputError
from ..inputs.fields import Array, checked, each, instance, optional
from ..inputs.messages import drawn_of, nearest
from ..runs.folder import make_folder, require_replaceable
from ..runs.result import Result
from ..signals import TASK_MEASURES, TRACKING
from .force_panels import (
    cameras_that_saw,
    plot_image,
    plot_jacobian_error,
    plot_pixel_error,
)
from .joint_panels import (
    plot_acceleration_norm,
    plot_angles,
    plot_bounded,
    plot_drift,
    plot_drift_left,
    plot_joint_error,
    plot_moving_bounds,
    plot_range,
    plot_torques,
)
from .overview import (
    arm_figure,
    frame_space,
    plot_postures,
    plot_stroboscope,
)
from .registry import FIGURES as FIGURES
from .registry import (
    apart,
    draws,
    first_pass,
    has_path,
    has_target,
    moving_bounds_matter,
    presses,
    returns,
)
from .style import (
    BOUND,
    COLUMN,
    DESIRED,
    NOTE,
    PAGE,
    SCREEN,
    TARGET,
    TRACED,
    Paper,
    Style,
    columns_within,
    drawn_for,
    finite,
    joint_handles,
    legend,
    nth,
    plot_joints,
    save,
    single,
    span,
    stack_panels,
    ticks,
    time_axis,
    unit,
    wide,
)
from .task_panels import (
    desired_at_tool_height,
    mark_ends,
    plot_distance,
    plot_end_effector,
    plot_orientation_error,
    plot_path,
    plot_position_error,
    plot_position_error_axes,
    plot_rotation,
    plot_velocity_error,
    task_panel,
)


def drawable(result: Result) -> list[str]:
    """Return the names of the figures that apply to a result; none to a single sample."""
    if result.time.size < 2:
        return []
    return [
        name
        for name, drawing in FIGURES.items()
        if drawing.needs <= result.series.keys() and drawing.applies(result)
    ]


def fitting(names: Sequence[str], paper: Paper) -> list[str]:
    """Return those of some figures that can be read in the width of a paper."""
    return [name for name in names if paper.width is None or paper.width >= FIGURES[name].least]


@checked(result=instance(Result), name=instance(str), paper=instance(Paper))
def figure(result: Result, name: str = "overview", paper: Paper = SCREEN) -> Figure:
    """Return a figure of a result, to show in a notebook or to change.

    Args:
        result: The run to show.
        name: Name of the figure, one of those that are `drawable`.
        paper: What it is drawn for.

    Raises:
        InvalidInputError: If there is no such figure of this result, or it cannot be read in the
            width of the paper.
    """
    if name not in (drawable_names := drawable(result)):
        what = nearest(name, drawable_names) if drawable_names else "a single instant has none"
        raise InvalidInputError(f"figure: no figure {name!r} of this result; {what}")
    if not fitting([name], paper):
        raise InvalidInputError(
            f"figure: {name} needs a width of {25.4 * FIGURES[name].least:.0f} mm or more"
        )
    with drawn_for(paper), drawn_of(f"figure {name}"):
        return FIGURES[name].draw(result)


@checked(
    result=instance(Result),
    folder=instance(str, Path),
    names=optional(each(str)),
    paper=instance(Paper),
)
def write_figures(
    result: Result,
    folder: str | Path,
    names: Sequence[str] | None = None,
    paper: Paper = SCREEN,
) -> list[Path]:
    """Write figures of a result, as ``<name>.png`` or in another format.

    Args:
        result: The run to show.
        folder: Folder to write to; created if it does not exist.
        names: Names of the figures; by default all that apply and can be read in the width of the
            paper.
        paper: What they are drawn for.

    Returns:
        The files.

    Raises:
        InvalidInputError: If the folder cannot be written to, ``result`` is none, or there is no
            such figure of it.
    """
    folder = Path(folder)
    names = names or fitting(drawable(result), paper)
    files = [folder / f"{name}.{paper.form}" for name in names]
    try:
        make_folder(folder)
        for file in files:
            require_replaceable(file)
        for file in files:
            with drawn_for(paper), drawn_of(f"figure {file.stem}"):
                save(figure(result, file.stem, paper), file)
    except OSError as error:
        raise InvalidInputError(f"figures folder {folder}: {error.strerror}") from None
    return files


def overview_in_notebook(result: Result) -> str:
    """Return the overview as HTML; nothing for a result that has none."""
    if "overview" not in drawable(result):
        return ""
    picture = BytesIO()
    save(figure(result, "overview"), picture)
    code = b64encode(picture.getvalue()).decode()
    return f'<img alt="overview" style="width: 100%" src="data:image/png;base64,{code}">'


def _alone(
    name: str,
    plot: Callable[[Axes, Result], None],
    *needs: str,
    applies: Callable[[Result], bool] = lambda result: True,
    height: float = 2.4,
) -> None:
    """Register a figure that consists of one panel alone.

    Args:
        name: Name of the figure.
        plot: Function that draws the panel.
        *needs: Names of the series that the panel needs.
        applies: Whether the figure is meaningful for a result that has these series.
        height: Height of the figure [inch].
    """

    def draw(result: Result) -> Figure:
        figure, ax = single(height)
        plot(ax, result)
        return figure

    draw.__name__, draw.__doc__ = name, plot.__doc__
    draws(*needs, applies=applies)(draw)


def _has_free_path(result: Result) -> bool:
    """Return whether the end effector moves along a path without pressing on a surface."""
    return has_path(result) and not presses(result)


_VELOCITIES = ("v_WE", "v_WE_desired")
_alone("path_plane", plot_path, *TRACKING, applies=_has_free_path, height=3.0)
_alone("position_error", plot_position_error, *TRACKING)
_alone("position_error_axes", plot_position_error_axes, *TRACKING, applies=has_path)
_alone("velocity_error", plot_velocity_error, *_VELOCITIES, applies=has_path)
_alone("pixel_error", plot_pixel_error, "pixels", "pixels_desired")
_alone("acceleration_norm", plot_acceleration_norm, "acceleration_peak")
_alone("joint_torques", plot_torques, "torque")
_alone("angles_to_target", plot_angles, "position", applies=has_target)
_alone("joint_error", plot_joint_error, "joint_error", applies=has_target)
_alone("jacobian_error", plot_jacobian_error, "J", "J_hat", "network_velocity")
_alone(
    "moving_bounds",
    plot_moving_bounds,
    *("velocity", "velocity_lower", "velocity_upper"),
    applies=moving_bounds_matter,
)


@draws("pixels", "pixels_desired")
def image(result: Result) -> Figure:
    """Draw what each camera sees of the points and of where they are to be, one below another."""
    cameras = cameras_that_saw(result)
    figure, axes = stack_panels(len(cameras), 0.3 + 2.7 * len(cameras))
    for number, ax in enumerate(axes):
        plot_image(ax, result, number)
    return figure


@draws(*TRACKING, applies=lambda r: has_path(r) and r.series["p_WE"].shape[1] == 3)
def path_3d(result: Result) -> Figure:
    """Draw the desired and the traced path in space."""
    figure = Figure(figsize=(wide(COLUMN), 3.2))
    ax: Any = figure.add_axes((0.02, 0.13, 0.84, 0.82), projection="3d")
    p_WE, p_desired, text = _traced_and_desired(result)
    ax.plot(*p_WE.T, label="traced", **TRACED)
    ax.plot(*p_desired[first_pass(result)].T, label=text, **DESIRED)
    mark_ends(ax, result, p_WE, p_desired)
    frame_space(ax, finite(np.concatenate((p_WE, p_desired))))
    figure.legend(*ax.get_legend_handles_labels(), loc="upper center", ncols=4)
    return figure


@draws("position")
def joint_angles(result: Result) -> Figure:
    """Draw a panel for each joint, and one of the joints' ranges within their bounds."""
    position, limits = result.series["position"], result.experiment.limits
    bounds = np.stack((limits.position_lower, limits.position_upper), axis=1)
    has_bounds = bool(np.isfinite(bounds).all(axis=1).any())
    n = position.shape[1]
    cells = n + has_bounds
    across = columns_within(width := wide(PAGE))
    rows = -(-cells // across)
    figure = Figure(figsize=(width, 0.4 + 1.25 * rows), layout="constrained")
    grid = figure.add_gridspec(rows, across)
    # A last panel that is alone in its row is as wide as both.
    places = [divmod(k, across) for k in range(across * (cells // across))]
    parts = [grid[place] for place in places] + [grid[rows - 1, :]] * (cells % across)
    axes = [figure.add_subplot(part) for part in parts]
    for k, ax in enumerate(axes[:n]):
        _plot_angle(ax, result, k, bounds[k])
        if k + across < n:
            ax.tick_params(labelbottom=False)
            ax.set_xlabel("")
    if has_bounds:
        plot_range(axes[n], position, bounds)
    if "joint_error" in result.series:
        handles = [Line2D([], [], label="target", **TARGET)]
        figure.legend(handles=handles, loc="outside upper center")
    figure.align_ylabels()
    return figure


def _plot_angle(ax: Axes, result: Result, k: int, bounds: Array) -> None:
    """Plot the angle of joint ``k``, with its target and its bounds, as far as they are near."""
    angle, error = result.series["position"][:, k], result.series.get("joint_error")
    ax.plot(result.time, angle, **nth(k))
    low, high = span(angle, least=0.02)
    if error is not None:
        target = angle - error[:, k]
        ax.plot(result.time, target, drawstyle="steps-post", **TARGET)
        low, high = np.nanmin(target, initial=low), np.nanmax(target, initial=high)
    for bound in bounds:
        # Near enough that the curve still fills half of its panel.
        if low - (high - low) <= bound <= high + (high - low):
            ax.axhline(bound, **BOUND)
            low, high = min(low, bound), max(high, bound)
    ax.set_ylim(low - 0.08 * (high - low), high + 0.08 * (high - low))
    ticks(ax.yaxis, 4)
    ax.set_ylabel(f"$q_{{{k + 1}}}$ [rad]")
    ax.set_title(_bounds_note(bounds), loc="right", pad=2, **NOTE)
    time_axis(ax, result)


@draws("velocity")
def joint_velocities(result: Result) -> Figure:
    """Draw the joint velocities with their bounds; if law and arm differ, a panel for each."""
    return _law_and_arm(result, "velocity")


@draws("acceleration")
def joint_accelerations(result: Result) -> Figure:
    """Draw the joint accelerations with their bounds; if law and arm differ, a panel for each."""
    return _law_and_arm(result, "acceleration")


@draws(*TRACKING)
def position(result: Result) -> Figure:
    """Draw the desired and the traced position of the end effector, a panel for each axis."""
    p_WE, p_desired, text = _traced_and_desired(result)
    m = p_WE.shape[1]
    figure, axes = stack_panels(m, height=0.6 + 1.1 * m, sharex=True)
    # If the end effector should rest, all panels have the scale of the axis that moves most.
    widest = max(
        np.ptp(span(values, 0.0)) for values in (p_desired if has_path(result) else p_WE).T
    )
    share = 0.05 if has_path(result) else 1.0
    for name, ax, is_at, should_be in zip("xyz", axes, p_WE.T, p_desired.T, strict=False):
        ax.plot(result.time, is_at, label="traced", **TRACED)
        ax.plot(result.time, should_be, label=text, **DESIRED)
        # Where the end effector should not move along an axis, micrometres need not be visible.
        low, high = span(np.concatenate((is_at, should_be)), least=max(share * widest, 1e-4))
        ax.set_ylim(low - 0.06 * (high - low), high + 0.06 * (high - low))
        ticks(ax.yaxis, 4)
        ax.ticklabel_format(axis="y", useOffset=False)
        ax.set_ylabel(f"{name} [m]")
    time_axis(axes[-1], result)
    legend(axes[0])
    figure.align_ylabels()
    return figure


@draws("position", applies=lambda r: has_path(r) and returns(r))
def joint_drift(result: Result) -> Figure:
    """Draw the drift of each joint from the start of the window, and what is left at its end."""
    figure, (above, below) = stack_panels(2, height=4.1, height_ratios=(3, 2))
    plot_drift(above, result)
    plot_drift_left(below, result)
    figure.align_ylabels()
    return figure


@draws("position", applies=has_target)
def postures(result: Result) -> Figure:
    """Draw the arm at the start, at the end, and in its target posture."""
    figure, ax = arm_figure(result)
    plot_postures(ax, result)
    return figure


@draws("position", "velocity", applies=has_target)
def stroboscope(result: Result) -> Figure:
    """Draw the arm at equal intervals of time while it moves, with a colour bar for the time."""
    figure, ax = arm_figure(result, below=0.5)
    times = plot_stroboscope(ax, result)
    if times is not None:
        place: Style = {"ax": ax, "shrink": 0.7, "aspect": 28}
        if ax.name == "3d":  # the layout does not account for the labels of such axes
            place = {"cax": ax.inset_axes((0.15, -0.16, 0.7, 0.035))}
        bar: Any = figure.colorbar(times, orientation="horizontal", **place)
        bar.set_label("time [s]")
        bar.outline.set_visible(False)
    return figure


@draws("position", "velocity", applies=has_path)
def motion(result: Result) -> Figure:
    """Draw the arm at equal intervals of time along its path."""
    return stroboscope(result)


@draws("p_WE", applies=has_target)
def end_effector(result: Result) -> Figure:
    """Draw the drift of the end effector from its start, and its rotation where that is known."""
    has_rotation = "orientation_error" in result.series
    figure, axes = stack_panels(1 + has_rotation, sharex=True)
    plot_end_effector(axes[0], result)
    if has_rotation:
        axes[0].set_xlabel("")
        plot_rotation(axes[1], result)
        figure.align_ylabels()
    return figure


@draws("J", "J_hat", least=5.0)
def jacobian(result: Result) -> Figure:
    """Draw every entry of J and of J_hat: a column of panels for each, a row for each axis."""
    J, J_hat = result.series["J"], result.series["J_hat"]
    m, camera = J.shape[1], result.experiment.document.camera
    turns, moves = (0, m) if camera is not None else (m - min(m, 3), min(m, 3))
    rows = [f"$\\omega_{axis}$" for axis in "xyz"[:turns]] + list("xyz"[:moves])
    units = ["1"] * turns + [unit("J")] * moves
    if camera is not None:
        rows = [f"${axis}_{k}$" for k in range(1, m // 2 + 1) for axis in "uv"]
    elif blocks := result.experiment.law_task.blocks:
        each = [block for block in blocks for _ in range(block.size)]
        rows = [f"{number}." for number in range(1, m + 1)]
        units = ["1" if block.turns else unit("J") for block in each]
    figure = Figure(figsize=(wide(PAGE), 0.7 + 1.35 * m), layout="constrained")
    axes: Any = figure.subplots(m, 2, sharex=True, sharey=True, squeeze=False)
    for column, (values, name) in enumerate(((J, "$J$"), (J_hat, r"$\hat J$"))):
        for row in range(m):
            ax = axes[row, column]
            plot_joints(ax, result.time, values[:, row])
            ax.set_ylabel(f"{rows[row]} row of {name} [{units[row]}]")
            if values is J_hat:
                # The initial estimate may last for one sample only, so a dot marks it.
                for k, entry in enumerate(J_hat[0, row]):
                    colour = nth(k)["color"]
                    ax.plot(0, entry, "o", color=colour, markersize=3, clip_on=False)
        time_axis(axes[-1, column], result)
    figure.legend(
        handles=joint_handles(J.shape[2]), loc="outside upper center", ncols=J.shape[2] + 1
    )
    return figure


def _traced_and_desired(result: Result) -> tuple[Array, Array, str]:
    """Return the paths to compare, shape (k, m) [m] both, and a label for the desired one."""
    if presses(result):
        return result.series["p_WE"], desired_at_tool_height(result), "desired, along the surface"
    return result.series["p_WE"], result.desired_position, "desired"


def _law_and_arm(result: Result, quantity: str) -> Figure:
    """Return a figure of a joint quantity, with a panel each for law and arm if they differ.

    Args:
        result: The run.
        quantity: ``velocity`` or ``acceleration``.
    """
    if apart(result, quantity):
        names = {f"network_{quantity}": f"{quantity}, law", quantity: f"{quantity}, arm"}
    else:
        names = {quantity: f"joint {quantity}"}
    figure, axes = stack_panels(len(names), sharex=True)
    sides = result.experiment.limits.known_sides(quantity)
    for ax, (name, text) in zip(axes, names.items(), strict=True):
        plot_bounded(ax, result, name, sides, text)
        if ax is not axes[-1]:
            ax.set_xlabel("")
    legend(axes[0], joint_handles(result.series[quantity].shape[1]))
    figure.align_ylabels()
    return figure


def _bounds_note(bounds: Array) -> str:
    """Return the two bounds of a joint as text."""
    if not np.isfinite(bounds).any():
        return "no bounds"
    low, high = (f"{bound:.3g}" if np.isfinite(bound) else "none" for bound in bounds)
    return f"bounds {low}, {high}".replace("-", "−")


def _follows(result: Result) -> bool:
    # Where the arm seeks a posture, the figure of its end effector shows the angle.
    return not has_target(result)


@draws("distance")
def distance(result: Result) -> Figure:
    """Draw the least distance of the arm from itself and from obstacles."""
    figure, ax = single()
    plot_distance(ax, result)
    return figure


@draws("orientation_error", applies=_follows)
def orientation_error(result: Result) -> Figure:
    """Draw the angle between the end effector and its desired orientation."""
    figure, ax = single()
    plot_orientation_error(ax, result)
    return figure


for _measure in TASK_MEASURES:
    _alone(_measure.name, task_panel(_measure), _measure.name)

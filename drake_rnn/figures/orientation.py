"""The figure of the end effector's orientation along a path."""

from __future__ import annotations

from matplotlib.figure import Figure

from ..runs.result import Result
from .registry import draws
from .style import single
from .task_panels import plot_orientation_error
from .traits import has_target


def _follows(result: Result) -> bool:
    # Where the arm seeks a posture, the figure of its end effector shows the angle.
    return not has_target(result)


@draws("orientation_error", applies=_follows)
def orientation_error(result: Result) -> Figure:
    """Draw the angle between the end effector and its desired orientation."""
    figure, ax = single()
    plot_orientation_error(ax, result)
    return figure

"""The figures of a tool that presses against a surface."""

from __future__ import annotations

from matplotlib.figure import Figure

from ..runs.result import Result
from ..signals import TRACKING
from .force_panels import plot_force, plot_force_error, plot_force_spectrum
from .registry import draws
from .style import single, stacked
from .surface import plot_on_surface
from .traits import presses


@draws("normal_force", "normal_force_desired", "normal_force_measured", applies=presses)
def normal_force(result: Result) -> Figure:
    """Draw the true and the desired normal force, and below how it settles before the window."""
    window = result.experiment.document.window
    settling = window is not None and result.time[1] <= window[0]
    figure, axes = stacked(1 + settling)
    plot_force(axes[0], result)
    if window is not None and settling:
        plot_force(axes[1], result, until=window[0])
        axes[1].get_legend().remove()
    figure.align_ylabels()
    return figure


@draws("normal_force", "normal_force_desired", "normal_force_measured", applies=presses)
def force_error(result: Result) -> Figure:
    """Draw the force error in the window and its spectrum."""
    figure, (above, below) = stacked(2)
    plot_force_error(above, result)
    plot_force_spectrum(below, result)
    figure.align_ylabels()
    return figure


@draws(*TRACKING, "normal_force", "normal_force_desired", applies=presses)
def path_on_surface(result: Result) -> Figure:
    """Draw the path on the surface as seen from above, coloured by the force."""
    figure, ax = single(height=3.0)
    plot_on_surface(ax, result)
    return figure

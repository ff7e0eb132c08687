"""Panels of J and its estimate; each draws on axes what it finds in a result."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from ..runs.result import Result
from .style import COLOURS, label, legend, log_axis, shade_window, time_axis


def plot_jacobian_error(ax: Axes, result: Result) -> None:
    """How far J_hat is from J, at large and along the motion."""
    difference = result.series["J"] - result.series["J_hat"]
    v = result.series["network_velocity"]
    size = np.linalg.norm(difference, axis=(1, 2))
    speed = np.linalg.norm(v, axis=1)
    along = np.linalg.norm(np.einsum("kmn,kn->km", difference, v), axis=1)
    # At rest there is no direction of motion.
    along = np.divide(along, speed, out=np.full(size.shape, np.nan), where=speed > 1e-6)
    ax.plot(result.time, along, color=COLOURS[4], linewidth=0.7, label="along the motion")
    ax.plot(result.time, size, color=COLOURS[0], label="Frobenius norm")
    shade_window(ax, result)
    log_axis(ax, [size, along])
    ax.set_ylabel(label(r"error of $\hat J$", "J"))
    time_axis(ax, result)
    legend(ax)


def plot_singular_value(ax: Axes, result: Result) -> None:
    """How far J is from losing rank."""
    J = result.series["J"]
    smallest = np.full(J.shape[0], np.nan)
    sound = np.isfinite(J).all(axis=(1, 2))
    smallest[sound] = np.linalg.svd(J[sound], compute_uv=False)[:, -1]
    ax.plot(result.time, smallest, color=COLOURS[0])
    ax.set_ylim(bottom=0)
    ax.set_ylabel(label("smallest singular value of $J$", "J"))
    time_axis(ax, result)


def plot_least_known(ax: Axes, result: Result) -> None:
    """What is least certain of J: its estimate, or else its rank."""
    (plot_jacobian_error if "J_hat" in result.series else plot_singular_value)(ax, result)

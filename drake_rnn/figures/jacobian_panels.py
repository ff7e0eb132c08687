"""Panels of the Jacobian J and its estimate; each function draws on given axes."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from ..runs.result import Result
from .looks import INK, nth
from .style import label, legend, log_axis, mark_times, time_axis

#: Number of the colour of the error along the motion.
_ALONG = 2


def plot_jacobian_error(ax: Axes, result: Result) -> None:
    """Plot the error of the estimate: its Frobenius norm, and its norm along the motion."""
    difference = result.series["J"] - result.series["J_hat"]
    v = result.series["network_velocity"]
    size = np.linalg.norm(difference, axis=(1, 2))
    speed = np.linalg.norm(v, axis=1)
    along = np.linalg.norm(np.einsum("kmn,kn->km", difference, v), axis=1)
    # At rest there is no direction of motion.
    along = np.divide(along, speed, out=np.full(size.shape, np.nan), where=speed > 1e-6)
    ax.plot(result.time, along, color=nth(_ALONG)["color"], linewidth=0.7, label="along the motion")
    ax.plot(result.time, size, color=INK, label="Frobenius norm")
    mark_times(ax, result)
    log_axis(ax, [size, along])
    time_axis(ax, result, label(r"error of $\hat J$", "J"))
    legend(ax)


def plot_singular_value(ax: Axes, result: Result) -> None:
    """Plot the smallest singular value of J, which is zero where J loses rank."""
    J = result.series["J"]
    smallest = np.full(J.shape[0], np.nan)
    known = np.isfinite(J).all(axis=(1, 2))
    smallest[known] = np.linalg.svd(J[known], compute_uv=False)[:, -1]
    ax.plot(result.time, smallest, color=INK)
    ax.set_ylim(bottom=0)
    time_axis(ax, result, label("smallest singular value of $J$", "J"))


def plot_jacobian(ax: Axes, result: Result) -> None:
    """Plot the error of the estimate of J, or without an estimate its smallest singular value."""
    (plot_jacobian_error if "J_hat" in result.series else plot_singular_value)(ax, result)

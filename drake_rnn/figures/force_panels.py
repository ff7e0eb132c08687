"""Panels of forces, pixels and the Jacobian; each function draws on given axes.

- Panels of the normal force; each function draws on given axes.
- The figures of a tool that presses against a surface.
- Panels of what a camera sees of points on a tool; each function draws on given axes.
- Panels of the Jacobian J and its estimate; each function draws on given axes.
"""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..inputs.fields import Array
from ..measures import NEAR_PX, prefix_unit
from ..runs.result import Result
from ..signals import TRACKING
from .registry import draws, presses, samples_in_window
from .style import (
    BEHIND,
    BOUND,
    DESIRED,
    FORCE,
    INK,
    MOMENT,
    TRACED,
    Style,
    corner_note,
    label,
    largest,
    legend,
    log_axis,
    mark_times,
    noisy,
    nth,
    plane_axes,
    single,
    span,
    stack_panels,
    time_axis,
)
from .task_panels import NEAR, plot_on_surface

_BAND: Style = {"color": DESIRED["color"], "alpha": 0.15, "linewidth": 0}
_MEASUREMENT: Style = {**BEHIND, "color": "0.6", "zorder": 1}
#: Root mean square of the sensor's error above which its readings are drawn, as a share of the
#: largest force, and of the largest force error in the panel of that error.
_APART, _APART_OF_ERROR = 0.01, 0.05
#: Metrics that are written above the force error, by what they are called there.
_ERROR_METRICS = {
    "mean": "force_error_mean_N",
    "rms": "force_error_rms_N",
    "largest": "force_error_max_N",
}
#: Smallest number of samples that a spectrum is computed from.
_FEWEST = 16
#: Decades below the peak that a spectrum is shown down to; what is lower is rounding.
_DECADES = 6


def plot_force(ax: Axes, result: Result, until: float | None = None) -> None:
    """Plot true, desired and, if it differs visibly, measured normal force.

    Args:
        ax: The axes.
        result: The run.
        until: Time up to which to plot [s]; None for the whole run.
    """
    samples = slice(None)
    if until is not None:
        samples = slice(0, max(2, int(np.searchsorted(result.time, until, side="right"))))
    time = result.time[samples]
    true, force_desired, force_measured = (
        result.series[f"normal_force{name}"][samples] for name in ("", "_desired", "_measured")
    )
    unit, scale = prefix_unit(largest(force_desired), "N")
    levels = [scale * true, (1 + NEAR) * scale * force_desired, np.zeros(1)]
    low, high = ((1 + sign * NEAR) * scale * force_desired for sign in (-1, 1))
    ax.fill_between(time, low, high, label=f"±{100 * NEAR:g} %", **_BAND)
    ax.plot(time, scale * force_desired, label="desired", **DESIRED)
    (curve,) = ax.plot(time, scale * true, label="force", **FORCE)
    if _root_mean_square(force_measured - true) > _APART * largest(true):
        curve.set_label("true")
        _plot_measured(ax, time, scale * force_measured, scale * true)
        levels.append(scale * force_measured)
    contact = result.experiment.contact
    bound = None if contact is None else contact.force.largest
    if bound is not None and "admittance_offset" in result.series:
        ax.axhline(scale * bound, label="largest", **BOUND)
        levels.append(np.array([scale * bound]))
    mark_times(ax, result)
    lost_time = result.metrics.get("contact_lost_time_s")
    if lost_time is not None and lost_time <= time[-1]:
        ax.axvline(lost_time, label="contact lost", **MOMENT)
    least, most = span(np.concatenate(levels), least=1e-9)
    room = 0.06 * (most - least)
    # Without contact, the force is zero up to rounding: no room below for that.
    ax.set_ylim(least - room if least < -0.01 * room else 0.0, most + room)
    time_axis(ax, result, f"normal force [{unit}]")
    ax.set_xlim(time[0], time[-1])
    legend(ax)


def plot_force_error(ax: Axes, result: Result) -> None:
    """Plot the force error in the window, with its metrics.

    The measured error is drawn behind the true one if it differs visibly, but not so much that it
    would hide it.
    """
    within = samples_in_window(result)
    time, error = result.time[within], _force_error(result)
    unit, scale = prefix_unit(largest(error), "N")
    ax.plot(time, scale * error, label="true", **FORCE)
    misread = (result.series["normal_force_measured"] - result.series["normal_force"])[within]
    if _APART_OF_ERROR * largest(error) < _root_mean_square(misread) < largest(error):
        _plot_measured(ax, time, scale * (error + misread), scale * error)
        legend(ax)
    ax.axhline(0.0, **DESIRED)
    low, high = span(np.concatenate([line.get_ydata() for line in ax.lines]), least=1e-9)
    note = ", ".join(
        f"{text} {scale * result.metrics[metric]:.3g}"
        for text, metric in _ERROR_METRICS.items()
        if metric in result.metrics
    )
    if note:
        corner_note(ax, f"{note} {unit}".replace("-", "−"))
    ax.set_ylim(low - 0.06 * (high - low), high + 0.18 * (high - low))
    time_axis(ax, result, f"force error [{unit}]")
    ax.set_xlim(time[0], time[-1])


def plot_force_spectrum(ax: Axes, result: Result) -> None:
    """Plot the amplitude spectrum of the force error without its mean.

    Frequencies above half the sampling rate appear as lower ones.
    """
    frequency, amplitude = force_spectrum(result)
    ax.plot(frequency, amplitude, linewidth=0.8, **FORCE)
    rate = 1.0 / result.experiment.document.log_period
    if frequency.size:
        ax.set_xlim(frequency[0], rate / 2)
    ax.set_xscale("log")
    log_axis(ax, [amplitude])
    if (peak := largest(amplitude)) > 0:
        ax.set_ylim(bottom=max(ax.get_ylim()[0], peak / 10**_DECADES))
    corner_note(ax, f"samples at {rate:.4g} Hz")
    ax.set(xlabel="frequency [Hz]", ylabel="amplitude of the force error [N]")


def force_spectrum(result: Result) -> tuple[Array, Array]:
    """Return the amplitude spectrum of the force error in the window, with a Hann window.

    Returns:
        Frequencies [Hz] and amplitudes [N], shape (k,) both; empty if there are too few samples or
        some are not finite. A sine appears with its amplitude.
    """
    period = result.experiment.document.log_period
    # The last sample is at the end of the run, perhaps less than a period after the one before.
    even = np.diff(result.time[samples_in_window(result)], prepend=-np.inf) > 0.5 * period
    error = _force_error(result)[even]
    if error.size < _FEWEST or not np.isfinite(error).all():
        return np.empty(0), np.empty(0)
    taper = np.hanning(error.size + 1)[:-1]
    amplitude = 2.0 / taper.sum() * np.abs(np.fft.rfft(taper * (error - error.mean())))
    frequency = np.fft.rfftfreq(error.size, period)
    # Half the sampling rate is left out: there, the amplitude depends on the phase.
    inner = (frequency > 0.0) & (frequency < 0.5 / period * (1 - 1e-9))
    return np.asarray(frequency[inner]), np.asarray(amplitude[inner])


def _plot_measured(ax: Axes, time: Array, values: Array, true: Array) -> None:
    """Plot a measured force behind the true one: thin if it is noisy, otherwise wide and pale."""
    noise = noisy(values - true)
    look: Style = {"linewidth": 0.6, "alpha": 0.8} if noise else {"linewidth": 3.2, "alpha": 0.45}
    ax.plot(time, values, label="measured", **{**_MEASUREMENT, **look})


def _root_mean_square(values: Array) -> float:
    """Return the root mean square of the finite values; 0 if there are none."""
    finite = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(finite**2))) if finite.size else 0.0


def _force_error(result: Result) -> Array:
    """Return true minus desired normal force in the window, shape (k,) [N]."""
    within = samples_in_window(result)
    error = result.series["normal_force"] - result.series["normal_force_desired"]
    return np.asarray(error[within])


@draws("normal_force", "normal_force_desired", "normal_force_measured", applies=presses)
def normal_force(result: Result) -> Figure:
    """Draw the true and the desired normal force, and below how it settles before the window."""
    window = result.experiment.document.window
    settling = window is not None and result.time[1] <= window[0]
    figure, axes = stack_panels(1 + settling)
    plot_force(axes[0], result)
    if window is not None and settling:
        plot_force(axes[1], result, until=window[0])
        axes[1].get_legend().remove()
    figure.align_ylabels()
    return figure


@draws("admittance_offset", "admittance_speed", applies=presses)
def admittance(result: Result) -> Figure:
    """Draw how far the path has given way along the normal, and its speed out of the surface."""
    figure, axes = stack_panels(2)
    for ax, name, words, unit in (
        (axes[0], "admittance_offset", "given way", "m"),
        (axes[1], "admittance_speed", "speed", "m/s"),
    ):
        values = result.series[name]
        prefixed, scale = prefix_unit(largest(values), unit)
        ax.plot(result.time, scale * values, **FORCE)
        mark_times(ax, result)
        time_axis(ax, result, f"{words} [{prefixed}]")
    figure.align_ylabels()
    return figure


@draws("normal_force", "normal_force_desired", "normal_force_measured", applies=presses)
def force_error(result: Result) -> Figure:
    """Draw the force error in the window and its spectrum."""
    figure, (above, below) = stack_panels(2)
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


_START: Style = {"marker": "o", "color": "black", "markersize": 3.5, "linestyle": "none"}


def plot_image(ax: Axes, result: Result, number: int = -1) -> None:
    """Plot traced and desired pixels of all points in the image of one camera.

    Args:
        ax: The axes.
        result: The run.
        number: Number of the camera among those that saw; the last one by default.
    """
    steps = _steps_of_cameras(result)[cameras_that_saw(result)[number]]
    pixels, pixels_desired = (_points(result, name)[steps] for name in ("pixels", "pixels_desired"))
    for k in range(pixels.shape[1]):
        several: Style = {"color": nth(k)["color"]} if pixels.shape[1] > 1 else {}
        first = k == 0
        label = "traced" if first else None
        ax.plot(*pixels[:, k].T, label=label, **{**TRACED, **several})
        ax.plot(*pixels_desired[:, k].T, label="desired" if first else None, **DESIRED)
        ax.plot(*pixels[:1, k].T, label="start" if first else None, **_START)
    cameras = cameras_that_saw(result)
    which = "" if len(cameras) == 1 else f" of camera {cameras[number] + 1}"
    plane_axes(ax, f"$u${which} [px]", f"$v${which} [px]")
    ax.yaxis.set_inverted(True)
    legend(ax)


def plot_pixel_error(ax: Axes, result: Result) -> None:
    """Plot how far the point that is farthest off is from where it is to be seen."""
    error = result.pixel_error
    ax.plot(result.time, error, color=INK)
    ax.axhline(NEAR_PX, label=f"{NEAR_PX:g} px", **BOUND)
    swaps = () if (camera := result.experiment.document.camera) is None else camera.swaps
    for swap in swaps:
        ax.axvline(swap.time, label="another camera", **MOMENT)
    mark_times(ax, result)
    log_axis(ax, [error, NEAR_PX * np.array([0.6, 1.6])])
    time_axis(ax, result, "error in the image [px]")
    legend(ax)


def cameras_that_saw(result: Result) -> list[int]:
    """Return the numbers of the cameras of which the run has samples."""
    return [number for number, steps in enumerate(_steps_of_cameras(result)) if steps.any()]


def _points(result: Result, name: str) -> Array:
    """Return pixels as points, shape (k, points, 2) [px]."""
    return result.series[name].reshape(len(result.time), -1, 2)


def _steps_of_cameras(result: Result) -> list[Array]:
    """Return at which samples each camera sees, shape (k,) each."""
    camera = result.experiment.document.camera
    assert camera is not None
    seeing = [camera.cameras.index(camera.at(t)) for t in result.time.tolist()]
    return [np.array(seeing) == number for number in range(len(camera.cameras))]


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
    finite = np.isfinite(J).all(axis=(1, 2))
    smallest[finite] = np.linalg.svd(J[finite], compute_uv=False)[:, -1]
    ax.plot(result.time, smallest, color=INK)
    ax.set_ylim(bottom=0)
    time_axis(ax, result, label("smallest singular value of $J$", "J"))


def plot_jacobian(ax: Axes, result: Result) -> None:
    """Plot the error of the estimate of J, or without an estimate its smallest singular value."""
    (plot_jacobian_error if "J_hat" in result.series else plot_singular_value)(ax, result)

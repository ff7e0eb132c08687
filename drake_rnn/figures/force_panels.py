"""Panels of the normal force; each function draws on given axes."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from ..inputs.fields import Array
from ..measures import prefixed
from ..runs.result import Result
from .looks import BEHIND, DESIRED, FORCE, MOMENT, Style
from .style import corner_note, largest, legend, log_axis, mark_times, noisy, span, time_axis
from .surface import NEAR
from .traits import evaluated

_BAND: Style = {"color": DESIRED["color"], "alpha": 0.15, "linewidth": 0}
_MEASURED: Style = {**BEHIND, "color": "0.6", "zorder": 1}
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
    shown = slice(None)
    if until is not None:
        shown = slice(0, max(2, int(np.searchsorted(result.time, until, side="right"))))
    time = result.time[shown]
    true, desired, measured = (
        result.series[f"normal_force{name}"][shown] for name in ("", "_desired", "_measured")
    )
    unit, scale = prefixed(largest(desired), "N")
    levels = [scale * true, (1 + NEAR) * scale * desired, np.zeros(1)]
    low, high = ((1 + sign * NEAR) * scale * desired for sign in (-1, 1))
    ax.fill_between(time, low, high, label=f"±{100 * NEAR:g} %", **_BAND)
    ax.plot(time, scale * desired, label="desired", **DESIRED)
    (curve,) = ax.plot(time, scale * true, label="force", **FORCE)
    if _root_mean_square(measured - true) > _APART * largest(true):
        curve.set_label("true")
        _plot_measured(ax, time, scale * measured, scale * true)
        levels.append(scale * measured)
    mark_times(ax, result)
    lost = result.metrics.get("contact_lost_time_s")
    if lost is not None and lost <= time[-1]:
        ax.axvline(lost, label="contact lost", **MOMENT)
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
    within = evaluated(result)
    time, error = result.time[within], _force_error(result)
    unit, scale = prefixed(largest(error), "N")
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
    even = np.diff(result.time[evaluated(result)], prepend=-np.inf) > 0.5 * period
    error = _force_error(result)[even]
    if error.size < _FEWEST or not np.isfinite(error).all():
        return np.empty(0), np.empty(0)
    taper = np.hanning(error.size + 1)[:-1]
    amplitude = 2.0 / taper.sum() * np.abs(np.fft.rfft(taper * (error - error.mean())))
    frequency = np.fft.rfftfreq(error.size, period)
    # Half the sampling rate is left out: there, the amplitude depends on the phase.
    inner = (frequency > 0.0) & (frequency < 0.5 / period * (1 - 1e-9))
    return np.asarray(frequency[inner]), np.asarray(amplitude[inner])


def _plot_measured(ax: Axes, time: Array, measured: Array, true: Array) -> None:
    """Plot a measured force behind the true one: thin if it is noisy, otherwise wide and pale."""
    noise = noisy(measured - true)
    look: Style = {"linewidth": 0.6, "alpha": 0.8} if noise else {"linewidth": 3.2, "alpha": 0.45}
    ax.plot(time, measured, label="measured", **{**_MEASURED, **look})


def _root_mean_square(values: Array) -> float:
    """Return the root mean square of the finite values; 0 if there are none."""
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if known.size else 0.0


def _force_error(result: Result) -> Array:
    """Return true minus desired normal force in the window, shape (k,) [N]."""
    within = evaluated(result)
    error = result.series["normal_force"] - result.series["normal_force_desired"]
    return np.asarray(error[within])

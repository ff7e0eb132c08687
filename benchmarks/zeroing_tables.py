"""Print the tables of the zeroing networks as Markdown: order, noise, activations, gains, times.

`python benchmarks/zeroing_tables.py` prints all of them, `python benchmarks/zeroing_tables.py
order` one. Every row is a change of the shipped experiment `zeroing_noise`, a circle of a Panda; of
`times` it is the design formula alone.
"""

from __future__ import annotations

import math
import sys
from typing import Any, get_args

import numpy as np

from drake_rnn import Result, SimulationError, load_experiment, simulate
from drake_rnn.laws.zeroing_design import (
    FIXED_TIME,
    FORMULAS,
    Activation,
    Design,
    Shape,
    activation,
)
from markdown_table import head, row

_BASE = "zeroing_noise"
_QUIET = {"law.noise": None, "law.integral_gain": 0}
_PERIODS = (8e-3, 4e-3, 2e-3, 1e-3)
_NOISES = ("constant", "ramp", "sine", "random")
# Product of gain and period of the table of orders.
_SHARE = 0.3


def made(changes: dict[str, Any]) -> Result:
    """Return the result of the base with changes, judged over its second half."""
    return simulate(load_experiment(_BASE, {"accept": None, **changes}))


def left(result: Result) -> float:
    """Return the largest entry of the network's error from 2 s on."""
    return float(result.series["residual"][result.time > 2.0].max())


def order_table() -> None:
    """Print errors against the period at a fixed product of gain and period."""
    head("`discretization`", "period [ms]", "network's error", "ratio", "path [m]", "ratio")
    for form in ("implicit", *FORMULAS):
        before = None
        for period in _PERIODS:
            own = {"law.discretization": form, "law.gain": _SHARE / period, "law.damping": 1e-6}
            result = made({**_QUIET, **own, "period": period})
            now = left(result), result.metrics["position_error_max_m"]
            pairs = zip(before or now, now, strict=True)
            ratios = [f"{old / new:.2f}" if before else "" for old, new in pairs]
            cells = [f"{now[0]:.2g}", ratios[0], f"{now[1]:.2g}", ratios[1]]
            row(f"`{form}`", f"{1e3 * period:g}", *cells)
            before = now


def noise_table() -> None:
    """Print what each kind of noise leaves, of the plain and of the noise-tolerant network."""
    head("`noise`, size 5", "`integral_gain`", "network's error", "path, largest [m]")
    for kind in _NOISES:
        for gain in (0.0, 200.0):
            result = made({"law.noise": {"kind": kind, "size": 5.0}, "law.integral_gain": gain})
            error = result.metrics["position_error_max_m"]
            row(f"`{kind}`", f"{gain:g}", f"{left(result):.2g}", f"{error:.2g}")


def activation_table() -> None:
    """Print what each activation leaves, without and with noise, implicit and by Euler."""
    head("`activation`", "alone", "constant noise", "random noise", "alone, `euler`")
    for shape in get_args(Shape):
        cells = []
        for noise, form in (
            (None, "implicit"),
            ({"kind": "constant", "size": 5.0}, "implicit"),
            ({"kind": "random", "size": 5.0}, "implicit"),
            (None, "euler"),
        ):
            own = {"law.activation": shape, "law.discretization": form, "law.noise": noise}
            cells.append(f"{left(made({**_QUIET, **own})):.2g}")
        row(f"`{shape}`", *cells)


def growth_table() -> None:
    """Print when a gain of gamma e^t breaks at a period, against ln(2 / (gamma h))."""
    head(
        "gamma [1/s]", "period [ms]", "ln(2/(gamma h)) [s]", "1 mm off its path at [s]", "implicit"
    )
    for gain, period in ((200.0, 1e-3), (400.0, 1e-3), (200.0, 2e-3), (100.0, 4e-3)):
        own = {"law.gain": gain, "law.growth": "exponential", "period": period}
        broken = _broken_at({**_QUIET, **own, "law.discretization": "euler"})
        implicit = made({**_QUIET, **own}).metrics["position_error_max_m"]
        until = math.log(2.0 / (gain * period))
        cells = [f"{until:.2f}", f"{broken:.2f}", f"{implicit:.2g} m off"]
        row(f"{gain:g}", f"{1e3 * period:g}", *cells)


def _broken_at(changes: dict[str, Any]) -> float:
    """Return when a run is 1 mm off its path [s]; infinite if it never is."""
    try:
        result = made({**changes, "log_period": 0.01})
    except SimulationError as failure:
        result = failure.result
    off = ((result.series["p_WE"] - result.series["p_WE_desired"]) ** 2).sum(axis=1) > 1e-6
    return float(result.time[off.argmax()]) if off.any() else math.inf


def time_table() -> None:
    """Print when errors have vanished, against the bound, in continuous time and at 1 ms."""
    head(
        *("`activation`", "gain [1/s]", "error at first", "bound [s]", "continuous [s]"),
        *("`implicit`, 1 ms [s]", "`euler`, 1 ms"),
    )
    for shape in FIXED_TIME:
        phi = activation(shape, None, None)
        for gain in (100.0, 1000.0):
            for first in (1e-2, 1.0, 1e6):
                cells = [f"{phi.time_bound(gain):.2g}", f"{_continuous(phi, gain, first):.2g}"]
                cells += [f"{_implicit(phi, gain, first):.2g}", _explicit(phi, gain, first)]
                row(f"`{shape}`", f"{gain:g}", f"{first:g}", *cells)


# An error that has vanished, a sample [s], and samples that are looked at.
_ZERO, _SAMPLE, _COUNT = 1e-9, 1e-3, 400


def _continuous(phi: Activation, gain: float, first: float) -> float:
    """Return when dE/dt = -gain phi(E) has vanished [s]: the integral of dE/phi, over ln E."""
    logs = np.linspace(math.log(_ZERO), math.log(first), 200001)
    sizes = np.exp(logs)
    return float(np.trapezoid(sizes / phi(sizes), logs) / gain)


def _implicit(phi: Activation, gain: float, first: float) -> float:
    """Return when implicit steps of 1 ms have made the error vanish [s]; infinite if never."""
    E, design = np.array([first]), Design(phi, 0.0)
    for k in range(1, _COUNT):
        E = design.after(E, None, gain, 0.0, _SAMPLE)
        if abs(E[0]) <= _ZERO:
            return k * _SAMPLE
    return math.inf


def _explicit(phi: Activation, gain: float, first: float) -> str:
    """Return what explicit steps of 1 ms leave in the end."""
    E, left = np.array([first]), []
    for _ in range(_COUNT):
        E = E - _SAMPLE * gain * phi(E)
        left.append(abs(float(E[0])))
        if left[-1] > 1e6 * max(first, 1.0):
            return "diverges"
    return f"{max(left[_COUNT // 2 :]):.2g} left"


TABLES = {
    "order": order_table,
    "noise": noise_table,
    "activations": activation_table,
    "growth": growth_table,
    "times": time_table,
}

if __name__ == "__main__":
    for name in sys.argv[1:] or TABLES:
        TABLES[name]()

r"""Activation functions of zeroing networks: odd, increasing, applied to each entry.

=====================  ==============================================  =====================
name                   phi(x) for x >= 0                               p, z by default
=====================  ==============================================  =====================
``linear``             x
``power``              x^p, p odd                                      p = 3
``bipolar_sigmoid``    (1 + e^-z)/(1 - e^-z) (1 - e^-zx)/(1 + e^-zx)   z = 2
``power_sigmoid``      the sigmoid below 1, x^p, p odd, beyond         p = 3, z = 4
``hyperbolic_sine``    (e^zx - e^-zx)/2                                z = 2
``power_sum``          x + x^3 + ... + x^(2p - 1)                      p = 2
``sign_bi_power``      (x^p + x^(1/p))/2, 0 < p < 1                    p = 0.5
``fixed_time``         x^p + x^(1/p) + x, 0 < p < 1                    p = 0.5
=====================  ==============================================  =====================

All but the last were read in public code (``vp-rnn`` and ``ZNN_Optimal_Control``), with these
defaults; the last is the tunable one of Zhang, Kong, Zheng, IEEE Transactions on Neural Networks
and Learning Systems 30 (2019), whose p is not given.

With dE/dt = -gamma phi(E), an error of any size is zero within a fixed time under those of the last
two, for x^p takes less than 1/(1 - p) to go from 1 to 0, and x^(1/p) less than p/(1 - p) to come
from infinity to 1, both over gamma and the weight of the power.
"""

from __future__ import annotations

from collections.abc import Callable
from math import exp, inf
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from ...arrays.algebra import functions_of
from ...inputs.fields import Array

Shape = Literal[
    "linear",
    "power",
    "bipolar_sigmoid",
    "power_sigmoid",
    "hyperbolic_sine",
    "power_sum",
    "sign_bi_power",
    "fixed_time",
]

# Largest value: an implicit step looks for an error between far ends, where a steep function would
# exceed what a computer can hold.
_LARGEST = 1e100
# What is computed of |x|, the exponent p and the steepness z.
_Half = Callable[[Any, Any, float, float], Any]


def _sigmoid(xp: Any, x: Any, z: float) -> Any:
    return xp.tanh(0.5 * z * x) * ((1.0 + exp(-z)) / (1.0 - exp(-z)))


def _power_sigmoid(xp: Any, x: Any, p: float, z: float) -> Any:
    return xp.where(x < 1.0, _sigmoid(xp, x, z), x**p)


def _power_sum(xp: Any, x: Any, p: float, z: float) -> Any:
    square, total = x * x, x
    for _ in range(1, round(p)):
        total = x + square * total
    return total


_HALVES: dict[str, _Half] = {
    "linear": lambda xp, x, p, z: x,
    "power": lambda xp, x, p, z: x**p,
    "bipolar_sigmoid": lambda xp, x, p, z: _sigmoid(xp, x, z),
    "power_sigmoid": _power_sigmoid,
    "hyperbolic_sine": lambda xp, x, p, z: xp.sinh(z * x),
    "power_sum": _power_sum,
    "sign_bi_power": lambda xp, x, p, z: 0.5 * (x**p + x ** (1.0 / p)),
    "fixed_time": lambda xp, x, p, z: x**p + x ** (1.0 / p) + x,
}
_EXPONENTS = {"power": 3.0, "power_sigmoid": 3.0, "power_sum": 2.0}
_EXPONENTS |= {"sign_bi_power": 0.5, "fixed_time": 0.5}
_STEEPNESSES = {"bipolar_sigmoid": 2.0, "power_sigmoid": 4.0, "hyperbolic_sine": 2.0}
#: Those under which an error is zero within a fixed time, with the weight of its powers.
FIXED_TIME = {"sign_bi_power": 0.5, "fixed_time": 1.0}


class Activation(NamedTuple):
    """An activation function with its numbers.

    Attributes:
        shape: Its name.
        exponent: The number p, of those that have one.
        steepness: The number z, of those that have one.
    """

    shape: Shape
    exponent: float
    steepness: float

    def __call__(self, x: Array) -> Array:
        """Return phi of each entry, of the shape of x."""
        if self.shape == "linear":
            return x
        xp = functions_of(x)
        with np.errstate(over="ignore"):
            half = _HALVES[self.shape](xp, xp.abs(x), self.exponent, self.steepness)
        return xp.sign(x) * xp.minimum(half, _LARGEST)

    @property
    def is_linear(self) -> bool:
        """Whether it is the identity."""
        return self.shape == "linear"

    @property
    def slope_at_zero(self) -> float:
        """Its slope at 0, where an error ends up; infinite for those that end in a fixed time."""
        z = self.steepness
        if self.shape in ("bipolar_sigmoid", "power_sigmoid"):
            return 0.5 * z * (1.0 + exp(-z)) / (1.0 - exp(-z))
        if self.shape == "hyperbolic_sine":
            return z
        return {"power": 0.0, "sign_bi_power": inf, "fixed_time": inf}.get(self.shape, 1.0)

    def time_bound(self, gain: float) -> float:
        """Return the time within which dE/dt = -gain phi(E) brings any E to 0 [s]."""
        if self.shape not in FIXED_TIME:
            return inf
        return (1.0 + self.exponent) / (1.0 - self.exponent) / (gain * FIXED_TIME[self.shape])


def activation(shape: Shape, exponent: float | None, steepness: float | None) -> Activation:
    """Return an activation function, with the numbers given or those of the table.

    Args:
        shape: Its name.
        exponent: The number p; None for the one of the table.
        steepness: The number z; likewise.

    Raises:
        ValueError: If a number is given that it does not have, or is none that it can have.
    """
    return Activation(
        shape,
        _number("exponent", shape, exponent, _EXPONENTS),
        _number("steepness", shape, steepness, _STEEPNESSES),
    )


def _number(name: str, shape: str, given: float | None, defaults: dict[str, float]) -> float:
    if given is None:
        return defaults.get(shape, 1.0)
    if shape not in defaults:
        able = ", ".join(each for each in get_args(Shape) if each in defaults)
        raise ValueError(f"{name}: is a number of {able}; leave it out with activation: {shape}")
    if name == "exponent":
        _check_exponent(shape, given)
    return given


def _check_exponent(shape: str, p: float) -> None:
    if shape in FIXED_TIME:
        if not 0.0 < p < 1.0:
            raise ValueError(
                f"exponent: must be between 0 and 1 with activation: {shape}, not {p:g}"
            )
    elif shape == "power_sum":
        if p not in range(1, 10):
            raise ValueError(f"exponent: must be 1 to 9, the number of its terms, not {p:g}")
    elif p not in range(1, 20, 2):
        raise ValueError(f"exponent: must be odd, 1 to 19, with activation: {shape}, not {p:g}")

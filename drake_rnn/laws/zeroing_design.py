r"""The parts of zeroing networks: design formula, activations, gains, discretization and noise.

The design formula of zeroing networks: how an error E that should vanish changes.

.. math::
    \dot E = -\gamma \Phi(E) + \Delta, \qquad
    \text{noise-tolerant:} \quad
    \dot E = -\eta \Phi(E) - \gamma \Phi(E + \eta \Phi(z)) + \Delta, \quad \dot z = E,

with a noise Delta. If Phi is linear, the second is
:math:`\dot E = -(\eta + \gamma) E - \gamma \eta z + \Delta`, whose integral takes a constant noise
back; the first one leaves :math:`\Delta / \gamma`.

Sources:
    The first formula is that of all zeroing networks. The second was read in public code that
    names Jin, Zhang, Li, Zhang, "Modified ZNN for time-varying quadratic programming with inherent
    tolerance to noises and its application to kinematic redundancy resolution of robot
    manipulators", IEEE Transactions on Industrial Electronics 63 (2016).

Activation functions of zeroing networks: odd, increasing, applied to each entry.

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

Gains of zeroing networks as functions of time: fixed, or growing.

=================  ===========================  ===================================================
``growth``         gain at the time t
=================  ===========================  ===================================================
``none``           gamma                        fixed-parameter networks
``exponential``    gamma e^(a t)                varying-parameter networks; read in public code
``power``          gamma (1 + a t)^3            ours, of any gain
``power_of_gain``  gamma + (a t)^gamma          power-type varying-parameter networks: Zhang, Kong,
                                                Zheng, IEEE Transactions on Neural Networks and
                                                Learning Systems 30 (2019), (21)
=================  ===========================  ===================================================

How the state y of a network is carried on from sample to sample.

================  ====================================================  =======  ==============
name              y at the next sample                                  order    gain h below
================  ====================================================  =======  ==============
``implicit``      one Newton step to what the design formula asks for   2        any
``euler``         y + h y'                                              2        2
``taylor``        3/2 y - y_1 + 1/2 y_2 + h y'                          3        1
``four_step``     3/5 y + 1/5 y_1 + 1/5 y_2 + 8/5 h y'                  3        1
================  ====================================================  =======  ==============

y_1 and y_2 are the states of the last two samples. The order is that of the error that is left at
a fixed product of gain and period h: halving the period divides it by 4 or by 8. The last column
is where a linear activation becomes unstable, see `ExplicitFormula.stable_below`.

Sources:
    ``four_step`` was read in public code (``ZNN_Optimal_Control``); ``taylor`` is from memory of
    the papers on discrete zeroing networks of Taylor type. Both follow from Taylor's series:
    tests hold the order. ``implicit`` is ours.

A noise that is added to the rate of a network's error, as papers on noise tolerance do.

=============  =================================================================
kind           noise of each entry at the time t
=============  =================================================================
``constant``   size
``ramp``       size t
``sine``       size sin(2 pi t), one turn a second
``random``     uniform in [-size, size], another number at each sample
=============  =================================================================

The random numbers are those of a multiplicative congruential generator,
:math:`s \leftarrow 26590841\, s \bmod (2^{26} - 5)`, one for each entry, which the experiment's
seed begins: its integers are exact in floating-point numbers, so that they are the same in any
array and on any machine (L'Ecuyer, "Tables of linear congruential generators of different sizes and
good lattice structure", Mathematics of Computation 68 (1999); tests hold its full period).
"""

from __future__ import annotations

from collections.abc import Callable
from math import exp, inf, log
from typing import Annotated, Any, Literal, NamedTuple, get_args

import numpy as np

from ..arrays.algebra import Parts, functions_of, repeat
from ..inputs.fields import Array, GainOrZero, validated
from ..inputs.keys import Meaning

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


def _fraction(xp: Any, x: Any, p: float) -> Any:
    """Return x^p, 0 < p < 1, whose infinite slope at 0 counts as 0 in derivatives.

    An error of exactly 0 stays so whatever the gains are, where an infinite slope times its
    derivative, 0, would be no number.
    """
    rests = x == 0.0
    return xp.where(rests, 0.0, xp.where(rests, 1.0, x) ** p)


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
    "sign_bi_power": lambda xp, x, p, z: 0.5 * (_fraction(xp, x, p) + x ** (1.0 / p)),
    "fixed_time": lambda xp, x, p, z: _fraction(xp, x, p) + x ** (1.0 / p) + x,
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


def _number(name: str, shape: str, value: float | None, defaults: dict[str, float]) -> float:
    if value is None:
        return defaults.get(shape, 1.0)
    if shape not in defaults:
        able = ", ".join(each for each in get_args(Shape) if each in defaults)
        raise ValueError(f"{name}: is a number of {able}; leave it out with activation: {shape}")
    if name == "exponent":
        _check_exponent(shape, value)
    return value


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


# Rounds that find an error; each halves the bracket at least, and mostly a few are made.
_ROUNDS = 64
# How far an error may be off, as a share of what is known.
_NARROW = 1e-15


class Design(NamedTuple):
    """The design formula.

    Attributes:
        activation: The function Phi.
        integral: The gain eta of the noise-tolerant formula [1/s]; 0 for the plain one.
    """

    activation: Activation
    integral: Any

    def rate(self, E: Array, z: Array | None, gain: Any) -> Array:
        """Return the rate of the error without noise, shape (..., k).

        Args:
            E: The error, shape (..., k).
            z: Its integral, of the same shape; None without one.
            gain: The gain gamma [1/s].
        """
        phi = self.activation
        if z is None:
            return -gain * phi(E)
        eta = self.integral
        return -eta * phi(E) - gain * phi(E + eta * phi(z))

    def after(self, E: Array, z: Array | None, gain: Any, noise: Any, h: float) -> Array:
        """Return the error a time h later by Euler's implicit method, shape (..., k).

        It solves e = E + h (rate(e, z + h e) + noise), which increases with e and so has one
        solution, at any gain.

        Args:
            E: The error, shape (..., k).
            z: Its integral, of the same shape; None without one.
            gain: The gain gamma at the end of that time [1/s].
            noise: The noise Delta, shape (..., k), or a number.
            h: The time [s].
        """
        rates, eta = E + h * noise, self.integral
        if not self.activation.is_linear:
            return self._find_root(rates, z, gain, h)
        if z is None:
            return rates / (1.0 + h * gain)
        return (rates - h * gain * eta * z) / (1.0 + h * (eta + gain * (1.0 + h * eta)))

    def _find_root(self, constant: Array, z: Array | None, gain: Any, h: float) -> Array:
        """Return where e - h rate(e, z + h e) is ``constant``, by secants within a bracket."""
        xp = functions_of(constant)

        def short(e: Array) -> Array:
            return e - h * self.rate(e, None if z is None else z + h * e, gain) - constant

        at_zero = short(0.0 * constant)
        # The slope is 1 or more, so the solution is between 0 and -at_zero.
        end = -at_zero
        size = xp.abs(constant) + xp.abs(end)

        def advance(parts: Parts) -> Parts:
            *bracket, is_done = parts
            a, b, f_a, f_b = bracket
            spread = f_b - f_a
            secant = a - f_a * (b - a) / xp.where(spread == 0.0, 1.0, spread)
            inside = (xp.minimum(a, b) <= secant) & (secant <= xp.maximum(a, b))
            e = xp.where(inside, secant, 0.5 * (a + b))
            a, b, f_a, f_b = _narrow(xp, (a, b, f_a, f_b), e, short(e))
            e = 0.5 * (a + b)
            after = _narrow(xp, (a, b, f_a, f_b), e, short(e))
            # What is done stays as it is, whatever other entries need.
            values = [xp.where(is_done, old, new) for old, new in zip(bracket, after, strict=True)]
            width = xp.abs(values[1] - values[0])
            least = xp.minimum(xp.abs(values[2]), xp.abs(values[3]))
            # The slope is 1 or more: an end is no farther from the solution than it is short.
            return *values, is_done | (xp.minimum(width, least) <= _NARROW * size)

        start = (0.0 * constant, end, at_zero, short(end), size == 0.0)
        a, b, f_a, f_b, _ = repeat(advance, start, _ROUNDS)
        return xp.where(xp.abs(f_b) <= xp.abs(f_a), b, a)


def _narrow(xp: Any, bracket: Parts, e: Array, f: Array) -> Parts:
    """Return a bracket (a, b, f_a, f_b) whose end of the sign of f is moved to e."""
    a, b, f_a, f_b = bracket
    on_a = (f > 0.0) == (f_a > 0.0)
    return (
        xp.where(on_a, e, a),
        xp.where(on_a, b, e),
        xp.where(on_a, f, f_a),
        xp.where(on_a, f_b, f),
    )


Growth = Literal["none", "exponential", "power", "power_of_gain"]

_POWER = 3.0
# Growth beyond which a gain is no number that a computer can hold.
_LARGEST_FACTOR = 1e250
# Power of e from which on a time is none that a run could last.
_LARGEST_POWER = 500.0


class GrowingGain(NamedTuple):
    """A gain that may grow.

    Attributes:
        first: The gain gamma at the time 0 [1/s].
        growth: How it grows.
        rate: The rate a of its growth [1/s].
    """

    first: Any
    growth: Growth
    rate: Any

    def at(self, t: Any) -> Any:
        """Return the gain at a time [s], a number or of the shape of a time or of gains."""
        if self.growth == "none":
            return self.first
        if self.growth == "power":
            return self.first * (1.0 + self.rate * t) ** _POWER
        if self.growth == "power_of_gain":
            return self.first + functions_of(t, self.first).power(self.rate * t, self.first)
        return self.first * functions_of(t, self.rate).exp(self.rate * t)

    def reaches(self, gain: float) -> float:
        """Return when a single robot's gain comes to a value [s]; infinite if it never does."""
        ratio = gain / self.first
        if ratio <= 1.0:
            return 0.0
        if self.growth == "none":
            return inf
        if self.growth == "power":
            return float((ratio ** (1.0 / _POWER) - 1.0) / self.rate)
        if self.growth == "power_of_gain":
            power = log(gain - self.first) / self.first
            return exp(power) / self.rate if power < _LARGEST_POWER else inf
        return float(log(ratio) / self.rate)

    @property
    def lasts(self) -> float:
        """How long a single robot's gain is a number that a computer can hold [s]."""
        return self.reaches(self.first * _LARGEST_FACTOR)


Discretization = Literal["implicit", "euler", "taylor", "four_step"]

# Largest modulus of a stable formula's roots, but for rounding.
_UNIT = 1.0 + 1e-12


class ExplicitFormula(NamedTuple):
    """A formula y_next = a_0 y + a_1 y_1 + a_2 y_2 + s h y'.

    Attributes:
        weights: The numbers a_0, a_1 and a_2.
        step: The number s.
    """

    weights: tuple[float, float, float]
    step: float

    def after(self, y: Array, before: Array, rate: Array, count: Array, h: float) -> Array:
        """Return the state a sample later, shape (..., k); of the first two by Euler's formula.

        Args:
            y: State now, shape (..., k).
            before: States of the last two samples, the newer one first, shape (..., 2, k).
            rate: Rate of the state, shape (..., k).
            count: Number of samples so far, shape (..., 1).
            h: Period [s].
        """
        first = y + h * rate
        if self.weights[1:] == (0.0, 0.0):
            return first
        now, one, two = self.weights
        later = now * y + one * before[..., 0, :] + two * before[..., 1, :] + self.step * h * rate
        return functions_of(y).where(count >= 2.0, later, first)

    def stable_below(self) -> float:
        """Return the product of gain and period from which on y' = -gain y is unstable."""
        low, high = 0.0, 4.0
        for _ in range(60):
            middle = 0.5 * (low + high)
            now, one, two = self.weights
            roots = np.roots([1.0, self.step * middle - now, -one, -two])
            if np.abs(roots).max() <= _UNIT:
                low = middle
            else:
                high = middle
        return round(low, 9)


FORMULAS = {
    "euler": ExplicitFormula((1.0, 0.0, 0.0), 1.0),
    "taylor": ExplicitFormula((1.5, -1.0, 0.5), 1.0),
    "four_step": ExplicitFormula((0.6, 0.2, 0.2), 1.6),
}


#: Modulus and multiplier of the generator.
MODULUS, MULTIPLIER = 67108859.0, 26590841.0


@validated
class NetworkNoise:
    """A noise in the equations of a network."""

    kind: Annotated[
        Literal["constant", "ramp", "sine", "random"],
        Meaning("How it varies in time: ``constant``, ``ramp``, ``sine`` or ``random``."),
    ] = "constant"
    size: Annotated[
        GainOrZero,
        Meaning(
            "Its size; of a ramp that after a second. In units of the network's error a second: "
            "rad/s^2 in the rows of the joints, m/s^2 in those of the task.",
        ),
    ] = 1.0

    def init(self, rng: np.random.Generator, count: int) -> Array:
        """Return the generators' initial numbers, shape (count,).

        Args:
            rng: Random generator with the experiment's seed.
            count: Number of entries.
        """
        return rng.integers(1, int(MODULUS), count).astype(float)

    def step(self, numbers: Array, t: Any) -> tuple[Array, Array]:
        """Return the noise at a time [s] and the generators' next numbers, shape (..., k) each.

        Args:
            numbers: The generators' numbers, shape (..., k).
            t: The time [s].
        """
        if self.kind == "random":
            after = functions_of(numbers).fmod(MULTIPLIER * numbers, MODULUS)
            return self.size * (2.0 * after / MODULUS - 1.0), after
        course = {"constant": 1.0, "ramp": t}
        share = course[self.kind] if self.kind in course else functions_of(t).sin(2.0 * np.pi * t)
        return self.size * share + 0.0 * numbers, numbers

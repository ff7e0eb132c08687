r"""Gains of zeroing networks as functions of time: fixed, or growing.

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
"""

from __future__ import annotations

from math import exp, inf, log
from typing import Any, Literal, NamedTuple

from ...arrays.algebra import functions_of

Growth = Literal["none", "exponential", "power", "power_of_gain"]

_POWER = 3.0
# Growth beyond which a gain is no number that a computer can hold.
_LARGEST = 1e250
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
        return self.reaches(self.first * _LARGEST)

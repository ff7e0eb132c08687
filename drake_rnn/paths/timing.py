r"""Time laws: the motion of a point along a segment of its path.

Each law maps the fraction of the segment's time, tau in [0, 1], to the fraction of its phase,
s(tau), with s(0) = 0 and s(1) = 1, and to the two derivatives of s.

========  ==========================================  ==============================
law       s(tau)                                      at both ends
========  ==========================================  ==============================
uniform   tau                                         moves at constant speed
sin2      sin^2(pi tau / 2)                           at rest; acceleration jumps
quintic   10 tau^3 - 15 tau^4 + 6 tau^5               at rest, zero acceleration
cycloid   tau - sin(2 pi tau) / (2 pi)                at rest, zero acceleration
ramps     speed rises as S7, is constant, falls       at rest, s'' to s'''' zero
========  ==========================================  ==============================

S7(u) = u^4 (35 - 84 u + 70 u^2 - 20 u^3) rises from 0 to 1 with three derivatives zero at
both ends, so that the motion has four continuous derivatives and a bounded fifth.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import cos, pi, sin
from typing import Literal

Timing = Literal["uniform", "sin2", "quintic", "cycloid", "ramps"]
TimeLaw = Callable[[float], tuple[float, float, float]]


def _uniform(tau: float) -> tuple[float, float, float]:
    return tau, 1.0, 0.0


def _sin2(tau: float) -> tuple[float, float, float]:
    s = sin(pi / 2 * tau)
    return s * s, pi / 2 * sin(pi * tau), pi * pi / 2 * cos(pi * tau)


def _quintic(tau: float) -> tuple[float, float, float]:
    left = 1.0 - tau
    s = tau**3 * (10.0 + tau * (6.0 * tau - 15.0))
    return s, 30.0 * (tau * left) ** 2, 60.0 * tau * left * (1.0 - 2.0 * tau)


def _cycloid(tau: float) -> tuple[float, float, float]:
    turn = 2.0 * pi * tau
    return tau - sin(turn) / (2.0 * pi), 2.0 * sin(pi * tau) ** 2, 2.0 * pi * sin(turn)


def _ramps(ramp: float, tau: float) -> tuple[float, float, float]:
    speed = 1.0 / (1.0 - ramp)
    u = min(tau, 1.0 - tau) / ramp
    if u < 1.0:
        way = speed * ramp * u**5 * (7.0 + u * (-14.0 + u * (10.0 - 2.5 * u)))
        rate = speed * u**4 * (35.0 + u * (-84.0 + u * (70.0 - 20.0 * u)))
        rise = speed / ramp * 140.0 * (u * (1.0 - u)) ** 3
        return (way, rate, rise) if tau < 0.5 else (1.0 - way, rate, -rise)
    return speed * (tau - ramp / 2.0), speed, 0.0


def time_law(timing: Timing, ramp: float) -> TimeLaw:
    """Return the time law of this name: tau -> (s, s', s'').

    Args:
        timing: Name of the law.
        ramp: Fraction of the time taken by each of the two ramps of "ramps", in (0, 0.5].
    """
    laws: dict[Timing, TimeLaw] = {
        "uniform": _uniform,
        "sin2": _sin2,
        "quintic": _quintic,
        "cycloid": _cycloid,
        "ramps": partial(_ramps, ramp),
    }
    return laws[timing]


def time_at(law: TimeLaw, share: float) -> float:
    """Return the tau at which s(tau) is ``share``, by bisection."""
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if law(middle)[0] < share else (low, middle)
    return low

r"""The speed at which an error is reduced: in proportion to it, and so that it can be braked.

.. math:: s(e) = \min(\kappa |e|, \sqrt{2 a |e|}, s_{max}) \frac{e}{|e|}
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from ...arrays.algebra import dot, functions_of, is_one, root
from ...inputs.fields import Array

# Errors below this have no direction worth the name [m or rad].
_TINY = 1e-12


def approach(error: Array, gain: Any, deceleration: Any, limit: Any) -> Array:
    """Return the velocity that reduces an error, shape (..., m).

    Args:
        error: The way to go, shape (..., m) [m or rad].
        gain: Gain kappa [1/s].
        deceleration: Deceleration a at the end of the way [m/s^2 or rad/s^2].
        limit: Largest speed [m/s or rad/s].
    """
    square = dot(error, error)
    if is_one(error):
        length = sqrt(square)
        if length < _TINY:
            return gain * error
        return error * (min(gain * length, sqrt(2.0 * deceleration * length), limit) / length)
    xp = functions_of(error)
    length = root(square)
    far = length >= _TINY
    way = xp.where(far, length, 1.0)
    speed = xp.minimum(xp.minimum(gain * way, xp.sqrt(2.0 * deceleration * way)), limit)
    return error * xp.where(far, speed / way, gain)


def gain_within_jerk(jerk: float, deceleration: float) -> float:
    """Return the largest gain whose changes of speed a bounded jerk can follow [1/s].

    Where the speed begins to fall in proportion to the error, which is 2 a / kappa^2 then, it has
    the second derivative kappa^3 |e| = 2 a kappa. A gain that asks for more leads beyond the target
    and back, for long or without end.

    Args:
        jerk: Largest jerk of the end effector [m/s^3 or rad/s^3].
        deceleration: Deceleration a at the end of the way [m/s^2 or rad/s^2].
    """
    return jerk / (2.0 * deceleration)

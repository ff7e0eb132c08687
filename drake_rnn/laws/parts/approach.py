r"""The speed at which an error is reduced: in proportion to it, and so that it can be braked.

.. math:: s(e) = \min(\kappa |e|, \sqrt{2 a |e|}, s_{max}) \frac{e}{|e|}
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from ...arrays.algebra import dot, functions_of, is_one, root
from ...inputs.fields import Array


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


# Errors below this have no direction worth the name [m or rad].
_TINY = 1e-12

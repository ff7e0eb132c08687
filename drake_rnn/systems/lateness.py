"""Time in whole samples: delays, and which sample a time belongs to."""

from __future__ import annotations

import math

from ..errors import InvalidInputError


def late_samples(key: str, delay: float, period: float) -> int:
    """Return the number of samples that a delay lasts.

    Args:
        key: Name of the delay, for the message.
        delay: The delay [s].
        period: Sampling period [s].

    Raises:
        InvalidInputError: If the delay is not a multiple of the period.
    """
    late = round(delay / period)
    if abs(late * period - delay) > 1e-6 * period:
        raise InvalidInputError(
            f"{key}: must be a multiple of the period, {period:g} s, not {delay:g}"
        )
    return late


def sample_number(time: float, period: float) -> int:
    """Return the number of the sample at a time, or of the next one after it.

    Args:
        time: The time [s].
        period: Sampling period [s].
    """
    # Times of samples carry rounding errors.
    return math.ceil(time / period - 1e-6)

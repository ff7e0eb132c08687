"""Delays in whole samples."""

from __future__ import annotations

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

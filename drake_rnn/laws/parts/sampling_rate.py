"""A check that a law is sampled fast enough for its feedback not to overshoot."""

from __future__ import annotations

from collections.abc import Mapping

from ...errors import InvalidInputError


def check_sampling_rate(period: float, rates: Mapping[str, float]) -> None:
    """Raise an InvalidInputError if a rate of a law is too high for the sampling period.

    Args:
        period: Sampling period [s].
        rates: Rates by the law's keys [1/s]; the period must be below the inverse of each.
    """
    name, rate = max(rates.items(), key=lambda item: item[1])
    if period * rate >= 1.0:
        raise InvalidInputError(
            f"period: must be below {1.0 / rate:g} s with law.{name} at {rate:g} /s, not {period:g}"
        )

"""How seldom a law may be sampled before what it feeds back overshoots."""

from __future__ import annotations

from collections.abc import Mapping

from ...errors import InvalidInputError


def check_sampling_rate(period: float, rates: Mapping[str, float]) -> None:
    """Raise an InvalidInputError if a rate of a law is beyond what a period admits.

    Args:
        period: Of the samples [s].
        rates: What it must be shorter than the inverse of, by the law's keys [1/s].
    """
    name, rate = max(rates.items(), key=lambda item: item[1])
    if period * rate >= 1.0:
        raise InvalidInputError(
            f"period: must be below {1.0 / rate:g} s with law.{name} at {rate:g} /s, not {period:g}"
        )

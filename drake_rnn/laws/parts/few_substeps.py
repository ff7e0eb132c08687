"""A check that a network does not need more steps per sample than a machine can make."""

from __future__ import annotations

from ...errors import InvalidInputError

#: Steps that a sample may take; at some 10 us each, a tenth of a second.
MOST_SUBSTEPS = 10_000


def check_substeps(period: float, rate: float, told: str) -> None:
    """Raise an InvalidInputError if a network is too fast for the sampling period.

    Args:
        period: Sampling period [s].
        rate: Rate of the network's fastest part [1/s]; a stable step is at most its inverse.
        told: What the rate follows from, for the message: key and value.
    """
    count = period * rate
    if count > MOST_SUBSTEPS:
        raise InvalidInputError(
            f"law.{told}: the network would need about {count:.3g} substeps per period of "
            f"{period:g} s; it may take at most {MOST_SUBSTEPS}"
        )

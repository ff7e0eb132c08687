"""A check that a network does not need more steps per sample than a machine can make."""

from __future__ import annotations

from ...errors import InvalidInputError

#: Steps that a sample may take; at some 10 us each, a tenth of a second.
MOST_SUBSTEPS = 10_000


def check_substeps(count: float, told: str, most: int = MOST_SUBSTEPS) -> None:
    """Raise an InvalidInputError if a network is too fast for the sampling period.

    Args:
        count: Number of stable steps in a period.
        told: What it follows from, for the message: key and value.
        most: Number of steps that are allowed.
    """
    if count > most:
        raise InvalidInputError(
            f"law.{told}: the network would need about {count:.3g} substeps per period; it may "
            f"take at most {most}"
        )

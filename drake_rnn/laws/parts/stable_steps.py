"""How many Euler or Heun steps keep a network stable for a period, and whether they can be made."""

from __future__ import annotations

from math import ceil
from typing import Any

import numpy as np

from ...arrays.algebra import larger, square_sum
from ...arrays.substeps import rounded_up
from ...errors import InvalidInputError
from ...inputs.fields import Array

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


def stable_steps(turns: Any, J: Array) -> Any:
    """Return the number of steps in a period: an int, or one for each of many robots.

    Args:
        turns: Period, in time constants of the network.
        J: Jacobian of its constraints, shape (..., m, n); where its norm exceeds 1, it makes the
            network faster.
    """
    if type(J) is np.ndarray and J.ndim == 2:
        # The same for one robot, without the calls.
        entries = J.ravel()
        return max(1, ceil(turns * max(1.0, entries.dot(entries)) - 1e-9))
    return rounded_up(turns * larger(1.0, square_sum(J)))

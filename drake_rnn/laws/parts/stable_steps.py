"""How many Euler or Heun steps keep a primal-dual network stable for a period."""

from __future__ import annotations

from math import ceil
from typing import Any

import numpy as np

from ...arrays.algebra import larger, square_sum
from ...arrays.substeps import rounded_up
from ...inputs.fields import Array


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

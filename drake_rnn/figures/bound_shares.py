"""How much of each bound a run uses over time."""

from __future__ import annotations

import numpy as np

from ..inputs.fields import Array
from ..robot.limits import DERIVATIVE_UNITS
from ..runs.limit_use import share_of_range
from ..runs.result import Result
from .derivative_panels import derivatives_of_motion

#: Times [s] and shares of bounds [-] for each order of derivative, shape (k,) both.
Shares = list[tuple[Array, Array]]


def shares_of_bounds(result: Result) -> Shares:
    """Return the largest share of its bound that any joint uses, for derivatives of order 0 to 5.

    Returns:
        Times [s] and shares [-] for each order, shape (k,) both.
    """
    limits = result.experiment.limits
    signals = derivatives_of_motion(result)
    shares = [(signals[0][0], share_of_range(signals[0][1], limits))]
    for (time, values), name in zip(signals[1:], DERIVATIVE_UNITS, strict=True):
        bound = limits.bounds[name]
        share = np.full_like(values, np.nan) if bound is None else np.abs(values) / bound
        shares.append((time, share.max(axis=1)))
    return shares

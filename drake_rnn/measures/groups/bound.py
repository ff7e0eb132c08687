"""The ratio of a derivative of the joint positions to its bound, and the excess over it."""

from __future__ import annotations

import numpy as np

from ...inputs.fields import Array
from ...robot.limits import DERIVATIVE_UNITS
from ..metrics import violation_metric
from ..running import Largest
from .group import Found


class BoundMetrics:
    """How a derivative keeps its bound.

    Args:
        name: Name of the derivative.
        bound: Bound of each joint, shape (n,); None without one.
    """

    def __init__(self, name: str, bound: Array | None) -> None:
        self._name = name
        self._bound = bound if bound is not None and np.isfinite(bound).any() else None
        self._ratio, self._excess = Largest(), Largest()

    def add(self, values: Array) -> None:
        """Add magnitudes, shape (k, n)."""
        if self._bound is not None and values.size:
            self._ratio.add(values / self._bound)
            self._excess.add(values - self._bound)

    def found(self) -> Found:
        """Return the metrics, by name; none without a bound."""
        if self._ratio.value is None or self._excess.value is None:
            return {}
        order = 1 + list(DERIVATIVE_UNITS).index(self._name)
        return {
            f"limit_ratio_{order}_max": self._ratio.value,
            violation_metric(self._name): np.maximum(0.0, self._excess.value),
        }

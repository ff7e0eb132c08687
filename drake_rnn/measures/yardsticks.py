"""What the motion of a run is measured against."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays.namespace import AnyArray
from ..inputs.fields import Array
from ..robot.limits import JointLimits


@dataclass(frozen=True)
class Yardsticks:
    """What motions are measured against; ``...`` is nothing for one run, or the number of robots.

    Attributes:
        limits: Limits of the joints by the names of the fields of `JointLimits`, each of shape
            (..., n); infinite where a joint has none, None where no joint has one.
        window: Start and end of the time in which errors count [s]; None for the whole run.
        settling_tolerance: Position error below which an arm has settled, shape (...) [m].
    """

    limits: Mapping[str, AnyArray | None]
    window: tuple[float, float] | None
    settling_tolerance: AnyArray

    @classmethod
    def of(
        cls, limits: JointLimits, window: tuple[float, float] | None, settling_tolerance: float
    ) -> Yardsticks:
        """Return those of one run.

        Args:
            limits: Limits of the experiment.
            window: Start and end of the window [s]; None for the whole run.
            settling_tolerance: Position error below which the arm has settled [m].
        """
        known = {name: _finite(bound) for name, bound in limits.bounds.items()}
        return cls(known, window, settling_tolerance)

    @classmethod
    def side_by_side(cls, each: Sequence[Yardsticks]) -> Yardsticks:
        """Return those of several runs with the same window."""
        first = each[0]
        limits = {name: _stacked([one.limits[name] for one in each]) for name in first.limits}
        tolerances = np.array([one.settling_tolerance for one in each])
        return cls(limits, first.window, tolerances)


def _finite(bound: Array | None) -> Array | None:
    return bound if bound is not None and np.isfinite(bound).any() else None


def _stacked(bounds: Sequence[Array | None]) -> Array | None:
    """Return bounds of robots, shape (robots, n), which lie side by side in memory."""
    known = [bound for bound in bounds if bound is not None]
    if not known:
        return None
    none = np.full_like(known[0], np.inf)
    return np.stack([none if bound is None else bound for bound in bounds], axis=-1).T

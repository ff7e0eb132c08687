"""How the derivatives of the joint positions keep their bounds."""

from __future__ import annotations

import numpy as np

from ...arrays.namespace import AnyArray
from ...robot.limits import DERIVATIVE_UNITS
from ..gathering import Largest, Mean, State, excess
from ..metric import violation_metric
from ..motion import Motion
from ..yardsticks import Yardsticks
from .group import Found

#: Share of a bound at which a joint is said to be at it: laws approach their bounds smoothly.
AT_BOUND = 0.99


class Bound:
    """The ratio of a derivative to its bound, and the excess over it.

    Args:
        name: Name of the derivative.
        bound: Bound of each joint, shape (..., n); None without one.
    """

    def __init__(self, name: str, bound: AnyArray | None) -> None:
        self._name, self.bound = name, bound
        self._ratio: State = Largest.start
        self._excess: State = Largest.start

    def add(self, values: AnyArray, time: AnyArray) -> None:
        """Add magnitudes, shape (k, ..., n), at times, shape (k,) [s]."""
        if self.bound is not None and len(values):
            self._ratio = Largest().added(self._ratio, (values / self.bound).max(axis=-1), time)
            self._excess = Largest().added(self._excess, (values - self.bound).max(axis=-1), time)

    def found(self) -> Found:
        """Return the metrics, by name; none without a bound, NaN for robots without one."""
        if self.bound is None:
            return {}
        order = 1 + list(DERIVATIVE_UNITS).index(self._name)
        beyond = excess(Largest().value(self._excess))
        ratio = np.where(np.isnan(beyond), np.nan, Largest().value(self._ratio))
        return {f"limit_ratio_{order}_max": ratio, violation_metric(self._name): beyond}


class BoundMetrics:
    """How velocity and acceleration keep their bounds, and how often some joint is at one.

    Args:
        against: Limits of the joints.
    """

    def __init__(self, against: Yardsticks) -> None:
        self._velocity = _Reached("velocity", against.limits["velocity"])
        self._acceleration = _Reached("acceleration", against.limits["acceleration"])

    def add(self, motion: Motion) -> None:
        """Add the next part of the run."""
        self._velocity.add(motion.speed[motion.fresh], motion.time[motion.fresh])
        if motion.time.size > 1:
            self._acceleration.add(motion.acceleration_magnitude, motion.time[1:])

    def found(self) -> Found:
        """Return the metrics, by name."""
        return self._velocity.found() | self._acceleration.found()


class _Reached:
    """What there is to say of a bound, and how often some joint is at it."""

    def __init__(self, name: str, bound: AnyArray | None) -> None:
        self._name = name
        self._beyond = Bound(name, bound)
        self._near = None if bound is None else AT_BOUND * bound
        self._any: State = Mean.start
        self._often: AnyArray = 0

    def add(self, values: AnyArray, time: AnyArray) -> None:
        self._beyond.add(values, time)
        if self._near is not None and len(values):
            at = values >= self._near
            self._any = Mean().added(self._any, at.any(axis=-1).astype(float), time)
            self._often = self._often + at.sum(axis=0)

    def found(self) -> Found:
        if not (found := self._beyond.found()):
            return {}
        bounded = ~np.isnan(found[violation_metric(self._name)])
        reached = np.any(self._often, axis=-1)
        often = 1.0 + np.argmax(self._often, axis=-1)
        return found | {
            f"{self._name}_bound_fraction": np.where(bounded, Mean().value(self._any), np.nan),
            f"{self._name}_bound_joint": np.where(reached, often, np.nan),
        }

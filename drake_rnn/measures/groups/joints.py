"""Joint positions, velocities and accelerations, and the limits of these."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...inputs.fields import Array
from ...robot.limits import JointLimits
from ..metrics import violation_metric
from ..motion import Motion
from ..running import Largest, Mean, Smallest
from .bound import BoundMetrics
from .group import Found

#: Share of a bound at which a joint is said to be at it: laws approach their bounds smoothly.
AT_BOUND = 0.99


class JointMetrics:
    """Speeds, accelerations and margins of the joints over the whole run.

    Args:
        limits: Limits of the experiment.
    """

    def __init__(self, limits: JointLimits) -> None:
        self._limits = limits
        self._speed, self._margin, self._singular = Largest(), Smallest(), Smallest()
        self._acceleration, self._network = Largest(), Largest()
        self._bounded = False
        self._network_differs = False
        self._initial: Found = {}
        self._bounds = {
            name: _Reached(name, limits.bounds[name]) for name in ("velocity", "acceleration")
        }

    def add(self, motion: Motion) -> None:
        """Add the next part of the run."""
        position, speed = motion.position, np.abs(motion.velocity)
        margin: Array = np.minimum(
            position - self._limits.position_lower, self._limits.position_upper - position
        )
        gram = motion.J @ np.swapaxes(motion.J, 1, 2)
        self._speed.add(speed)
        self._margin.add(margin)
        self._bounded |= bool(np.isfinite(margin).any())
        self._singular.add(np.linalg.eigvalsh(gram)[:, 0].astype(float, copy=False))
        self._bounds["velocity"].add(speed[motion.fresh])
        if motion.time.size > 1:
            acceleration = np.abs(motion.joint_acceleration)
            self._acceleration.add(acceleration)
            self._network.add(np.abs(motion.network_acceleration))
            self._bounds["acceleration"].add(acceleration)
            if motion.origin is None:
                self._initial = {
                    "joint_velocity_initial_rad_s": speed[1].max(),
                    "joint_acceleration_initial_rad_s2": acceleration[0].max(),
                }
            # A ramp ends at its law's velocity except for rounding.
            self._network_differs |= not np.allclose(
                motion.network_velocity, motion.velocity, rtol=1e-9, atol=1e-12
            )

    def found(self) -> Found:
        """Return the metrics, by name."""
        margin, singular = self._margin.value, self._singular.value
        found: Found = {
            "joint_velocity_max_rad_s": self._speed.value,
            "joint_limit_margin_min_rad": margin,
            "singular_value_min": None if singular is None else np.sqrt(np.maximum(0.0, singular)),
            "joint_acceleration_max_rad_s2": self._acceleration.value,
            **self._initial,
        }
        if self._network_differs:
            found["network_acceleration_max_rad_s2"] = self._network.value
        if self._bounded and margin is not None:
            found[violation_metric("position")] = np.maximum(0.0, -margin)
        for bound in self._bounds.values():
            found |= bound.found()
        return found


class _Reached:
    """What there is to say of a bound, and how often some joint is at it.

    Args:
        name: Name of the derivative.
        bound: Bound of each joint, shape (n,); None without one.
    """

    def __init__(self, name: str, bound: Array | None) -> None:
        self._name, self._bound = name, bound
        self._beyond = BoundMetrics(name, bound)
        self._any = Mean()
        self._often: NDArray[np.int_] | None = None

    def add(self, values: Array) -> None:
        """Add magnitudes, shape (k, n)."""
        self._beyond.add(values)
        if self._bound is not None:
            at = values >= AT_BOUND * self._bound
            self._any.add(np.any(at, axis=1))
            often = at.sum(axis=0)
            self._often = often if self._often is None else self._often + often

    def found(self) -> Found:
        """Return the metrics, by name; none without a bound."""
        if not (found := self._beyond.found()):
            return {}
        found[f"{self._name}_bound_fraction"] = self._any.value
        if self._often is not None and self._often.any():
            found[f"{self._name}_bound_joint"] = 1 + int(np.argmax(self._often))
        return found

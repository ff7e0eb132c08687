r"""The stiffness of a contact: given, or learned from the force and the depth of the tip.

A ball pressed into a plane is not a linear spring: its force F grows as d^p with the depth d,
where p is 2 for Drake's hydroelastic contact and 3/2 for Hertz's. F^(1/p) is then proportional to
d, with one slope s for all forces, and

.. math:: d - d_d = (F^{1/p} - F_d^{1/p}) / s

is how much too deep the tip is, however far F is from F_d. With p = 1, s is a stiffness.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from ...arrays.algebra import functions_of, is_one, joined
from ...inputs.fields import Array, Positive, Stiffness, validated
from ...inputs.keys import Meaning

# Marks a missing last sample; the root of a real one is positive.
_NONE = -1.0


@validated
class OnlineStiffness:
    """Recursive least squares for the slope s of F^(1/p) over the depth."""

    initial: Annotated[
        Stiffness,
        Meaning(
            "Stiffness assumed at first, at ``initial_force``. If it is too high, the force "
            "converges slowly; if it is too low, the force overshoots.",
            unit="N/m",
        ),
    ] = 1e4
    initial_force: Annotated[
        Positive,
        Meaning("Force at which ``initial`` holds; unused for an exponent of 1.", unit="N"),
    ] = 5.0
    floor: Annotated[
        float,
        Field(strict=True, gt=0, le=1),
        Meaning("Lower bound of the estimate, as a fraction of its initial value."),
    ] = 0.1
    exponent: Annotated[
        float,
        Field(strict=True, ge=1, le=3),
        Meaning("Exponent p."),
    ] = 2.0
    forgetting: Annotated[
        float,
        Field(strict=True, gt=0, le=1),
        Meaning("Forgetting factor of the least squares, applied at each sample."),
    ] = 0.9
    step: Annotated[
        Positive,
        Meaning("Smallest change of depth that makes a new sample.", unit="m"),
    ] = 2e-6
    learn_above: Annotated[
        float,
        Field(strict=True, ge=0, lt=1),
        Meaning(
            "Fraction of the desired force above which it learns; the first touch is softer than "
            "the rest, even in terms of F^(1/p).",
        ),
    ] = 0.2

    #: Size of the state: slope [N^(1/p)/m], its covariance, and of the last sample the root of
    #: the force [N^(1/p)], -1 without contact, and the depth [m].
    size = 4

    @property
    def _initial_slope(self) -> Any:
        p = self.exponent
        return self.initial / (p * self.initial_force ** ((p - 1.0) / p))

    def start(self) -> Array:
        """Return the initial state, shape (4,)."""
        return np.array([self._initial_slope, 1.0, _NONE, 0.0])

    def update(self, state: Array, force: Any, desired: Any, depth: Any) -> Array:
        """Return the state after one more sample, shape (..., 4).

        Args:
            state: State, shape (..., 4).
            force: Measured force [N], a float, or one for each robot, shape (..., 1); without
                contact nothing is learned.
            desired: Desired force [N], likewise.
            depth: Depth of the tip in the surface, from an arbitrary zero [m], likewise.
        """
        if not is_one(state):
            return self._update(state, force, desired, depth)
        slope, covariance, last_root, last_depth = state.tolist()
        if force <= self.learn_above * desired:
            return np.array([slope, covariance, _NONE, 0.0])
        root = force ** (1.0 / self.exponent)
        if last_root == _NONE:
            return np.array([slope, covariance, root, depth])
        if abs(depth - last_depth) < self.step:
            return state
        slope, covariance = self._fitted(slope, covariance, root - last_root, depth - last_depth)
        slope = max(slope, self.floor) * self._initial_slope
        return np.array([slope, covariance, root, depth])

    def _update(self, state: Array, force: Any, desired: Any, depth: Any) -> Array:
        """Return what `update` does, of many robots."""
        xp = functions_of(state, force)
        slope, covariance, last_root, last_depth = (state[..., k, None] for k in range(4))
        presses = force > self.learn_above * desired
        root = xp.where(presses, force, 1.0) ** (1.0 / self.exponent)
        relative, narrower = self._fitted(slope, covariance, root - last_root, depth - last_depth)
        still = (last_root != _NONE) & (xp.abs(depth - last_depth) < self.step)
        learns = presses & (last_root != _NONE) & ~still
        kept = presses & still
        return joined(
            (
                xp.where(learns, xp.maximum(relative, self.floor) * self._initial_slope, slope),
                xp.where(learns, narrower, covariance),
                xp.where(kept, last_root, xp.where(presses, root, _NONE)),
                xp.where(kept, last_depth, xp.where(presses, depth, 0.0)),
            )
        )

    def _fitted(self, slope: Any, covariance: Any, rise: Any, way: Any) -> tuple[Any, Any]:
        """Return the slope, relative to its initial value, and its covariance after a sample.

        Args:
            slope: Slope before [N^(1/p)/m].
            covariance: Its covariance before.
            rise: Change of the root of the force [N^(1/p)].
            way: Change of depth [m].
        """
        # Scaled by the step and the initial slope, so that neither affects the tuning.
        x = way / self.step
        y = rise / (self.step * self._initial_slope)
        gain = covariance * x / (self.forgetting + covariance * x * x)
        relative = slope / self._initial_slope
        relative = relative + gain * (y - relative * x)
        # At most 1, as x is at least 1 in size.
        return relative, (covariance - gain * x * covariance) / self.forgetting

    def retreat_speed(self, state: Array, force: Any, desired: Any, gain: Any) -> Any:
        """Return the speed out of the surface that corrects the force error [m/s].

        Args:
            state: State, shape (..., 4).
            force: Measured force [N].
            desired: Desired force [N].
            gain: Gain of the feedback [1/s].
        """
        return gain * self.depth_error(state, force, desired)

    def depth_error(self, state: Array, force: Any, desired: Any) -> Any:
        """Return how much too deep the tip is for the desired force [m]."""
        inverse = 1.0 / self.exponent
        if not is_one(state):
            return (_power(force, inverse) - _power(desired, inverse)) / state[..., :1]
        return float((max(force, 0.0) ** inverse - max(desired, 0.0) ** inverse) / state[0])


def _power(force: Any, exponent: Any) -> Any:
    """Return forces, shape (..., 1), to a power; 0 where they pull."""
    where = functions_of(force).where
    # No derivative of a root at 0.
    return where(force > 0.0, where(force > 0.0, force, 1.0) ** exponent, 0.0)


@dataclass(frozen=True)
class FixedStiffness:
    """A linear spring: force is proportional to depth.

    Args:
        value: Stiffness [N/m].
    """

    value: Any

    #: Size of the state: nothing is stored.
    size = 0

    def start(self) -> Array:
        """Return the initial state, shape (0,)."""
        return np.zeros(0)

    def update(self, state: Array, force: Any, desired: Any, depth: Any) -> Array:
        """Return the state unchanged, because nothing is learned."""
        return state

    def retreat_speed(self, state: Array, force: Any, desired: Any, gain: Any) -> Any:
        """Return the speed out of the surface that corrects the force error [m/s].

        Args:
            state: State, shape (..., 0).
            force: Measured force [N].
            desired: Desired force [N].
            gain: Gain of the feedback [1/s].
        """
        return gain * (force - desired) / self.value

    def depth_error(self, state: Array, force: Any, desired: Any) -> Any:
        """Return how much too deep the tip is for the desired force [m]."""
        return (force - desired) / self.value

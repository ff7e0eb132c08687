r"""Learning how stiff a contact is, from how its force answers to what the tip sinks in.

A ball pressed into a plane does not answer like a spring: its force F grows as d^p with the
depth d; p is 2 for Drake's hydroelastic contact, 3/2 for Hertz's. Then F^(1/p) is proportional
to d, with one slope s for all forces, and

.. math:: d - d_d = (F^{1/p} - F_d^{1/p}) / s

tells how much deeper the tip has to be, however far F is from F_d. With p = 1, s is a stiffness.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field

from ...inputs.fields import Array, Positive, validated

# In place of the last sample's root, which is positive, where there was none.
_NONE = -1.0


@validated
class OnlineStiffness:
    """Recursive least squares for the slope s of F^(1/p) over the depth.

    Args:
        initial: Stiffness assumed at ``initial_force`` until it is known [N/m]; rather too
            stiff, which is slow, than too soft, which overshoots.
        initial_force: Force at which that holds [N]; it does not matter for an exponent of 1.
        floor: Share of ``initial`` below which no estimate is believed.
        exponent: p.
        forgetting: Weight of what is known against what is new, at each of its steps.
        step: Change of depth that makes a new sample [m].
        learn_above: Share of the desired force from which on it learns: first touch is softer
            than what follows, more so than F^(1/p) tells.
    """

    initial: Positive = 1e4
    initial_force: Positive = 5.0
    floor: Annotated[float, Field(strict=True, gt=0, le=1)] = 0.1
    exponent: Annotated[float, Field(strict=True, ge=1, le=3)] = 2.0
    forgetting: Annotated[float, Field(strict=True, gt=0, le=1)] = 0.9
    step: Positive = 2e-6
    learn_above: Annotated[float, Field(strict=True, ge=0, lt=1)] = 0.2

    #: Entries of its state: slope [N^(1/p)/m], its covariance, and the last sample's root of
    #: the force [N^(1/p)], -1 without contact, and depth [m].
    size = 4

    @property
    def _initial_slope(self) -> float:
        p = self.exponent
        return float(self.initial / (p * self.initial_force ** ((p - 1.0) / p)))

    def start(self) -> Array:
        """Its first state, shape (4,)."""
        return np.array([self._initial_slope, 1.0, _NONE, 0.0])

    def update(self, state: Array, force: float, desired: float, depth: float) -> Array:
        """The state once more is known, shape (4,).

        Args:
            state: Shape (4,).
            force: Measured [N]; without contact nothing is learned.
            desired: Force asked for [N].
            depth: How far the tip has moved into the surface, from anywhere [m].
        """
        slope, covariance, last_root, last_depth = state.tolist()
        if force <= self.learn_above * desired:
            return np.array([slope, covariance, _NONE, 0.0])
        root = force ** (1.0 / self.exponent)
        if last_root == _NONE:
            return np.array([slope, covariance, root, depth])
        if abs(depth - last_depth) < self.step:
            return state
        # In units of the step, and of the slope assumed, so that neither has to be tuned.
        x = (depth - last_depth) / self.step
        y = (root - last_root) / (self.step * self._initial_slope)
        gain = covariance * x / (self.forgetting + covariance * x * x)
        relative = slope / self._initial_slope
        relative += gain * (y - relative * x)
        covariance = (covariance - gain * x * covariance) / self.forgetting
        relative = max(relative, self.floor)
        return np.array([relative * self._initial_slope, min(covariance, 1.0), root, depth])

    def retreat_speed(self, state: Array, force: float, desired: float, gain: float) -> float:
        """Return the speed out of the surface that mends the force error [m/s].

        Args:
            state: Shape (4,).
            force: Measured force [N].
            desired: Force to press with [N].
            gain: Of the feedback [1/s].
        """
        return gain * self.depth_error(state, force, desired)

    def depth_error(self, state: Array, force: float, desired: float) -> float:
        """Return how much too deep the tip is for the desired force [m]."""
        inverse = 1.0 / self.exponent
        return float((max(force, 0.0) ** inverse - max(desired, 0.0) ** inverse) / state[0])

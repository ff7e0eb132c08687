r"""The pseudoinverse with feed-forward: what one would do without a network.

.. math::
    v = J^+ \left( \frac{p_d(t + h) - p_d(t)}{h} + k (p_d - p) \right), \qquad
    J^+ = J^T (J J^T + \mu^2 I)^{-1}.

Its feed-forward is the secant of the desired positions over the sample for which v is held: with
the derivative instead, the error of a fast path is several times as large. It knows of no bounds.
"""

from __future__ import annotations

from functools import cached_property
from typing import Literal

import numpy as np

from ..fields import Array, NonNegative, Positive, validated
from ..limits import JointLimits
from .law import Layout, Signals
from .sampling_rate import check_sampling_rate


@validated
class Pseudoinverse:
    """A sampled law without memory; its state is the velocity it asks for.

    Args:
        limits: Of the joints; it takes only their number from them.
        task_size: Rows of J.
        feedback: Of the position error [1/s].
        feed_forward: Whether the path's own velocity is asked for as well.
        damping: Of the pseudoinverse [m].
    """

    kind: Literal["pseudoinverse"] = "pseudoinverse"
    limits: JointLimits
    task_size: Literal[2, 3] = 3
    feedback: NonNegative = 10.0
    feed_forward: bool = True
    damping: Positive = 1e-6

    @property
    def holds_command(self) -> bool:
        return True

    @cached_property
    def state(self) -> Layout:
        return Layout(v=(self.limits.size,))

    @cached_property
    def inputs(self) -> Layout:
        m = self.task_size
        ahead = {"p_preview": (m,)} if self.feed_forward else {}
        return Layout(p_WE=(m,), p_WE_desired=(m,), J=(m, self.limits.size), **ahead)

    @cached_property
    def observables(self) -> Layout:
        return Layout()

    def check_period(self, period: float) -> None:
        """Raise an InvalidInputError if the feedback would overshoot; ``period`` in [s]."""
        check_sampling_rate(period, {"feedback": self.feedback})

    def initial_state(self, rng: np.random.Generator, u: Signals) -> Array:
        return np.zeros(self.state.size)

    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        J, desired = u["J"], u["p_WE_desired"]
        asked = self.feedback * (desired - u["p_WE"])
        if self.feed_forward:
            asked = asked + (u["p_preview"] - desired) / period
        gram = J @ J.T + self.damping**2 * np.eye(self.task_size)
        return np.asarray(J.T @ np.linalg.solve(gram, asked))

    def commanded_velocity(self, t: float, x: Array) -> Array:
        return x

    def diagnostics(self, t: float | Array, x: Array, u: Signals) -> Signals:
        return {}

r"""The pseudoinverse with feed-forward: the usual method, without a network.

.. math::
    v = J^+ \left( \frac{p_d(t + h) - p_d(t)}{h} + k (p_d - p) \right), \qquad
    J^+ = J^T (J J^T + \mu^2 I)^{-1}.

The feed-forward is the secant of the desired positions over the sample for which v is held; with
the derivative instead, the error on a fast path is several times as large. Joint limits are
ignored.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Literal

from ..inputs.fields import Array, NonNegative, Positive, validated
from ..robot.limits import JointLimits
from .law import Layout, SampledLaw, SampledReading, Signals
from .parts.damped_inverse import damped_joint_velocity
from .parts.sampling_rate import check_sampling_rate


@validated
class Pseudoinverse(SampledLaw):
    """A sampled law without memory; its state is the commanded velocity.

    Args:
        limits: Joint limits; only the number of joints is used.
        task_size: Number of rows of J.
        feedback: Gain of the position feedback [1/s].
        feed_forward: Whether the velocity of the path is added.
        damping: Damping mu of the pseudoinverse [m].
    """

    kind: Literal["pseudoinverse"] = "pseudoinverse"
    limits: JointLimits
    task_size: Literal[2, 3] = 3
    feedback: NonNegative = 10.0
    feed_forward: bool = True
    damping: Positive = 1e-6

    stays_on_path = True

    @cached_property
    def state(self) -> Layout:
        return Layout(v=(self.limits.size,))

    @cached_property
    def inputs(self) -> Layout:
        m = self.task_size
        ahead = {"p_preview": (m,)} if self.feed_forward else {}
        return Layout(p_WE=(m,), p_WE_desired=(m,), J=(m, self.limits.size), **ahead)

    @property
    def loop_gains(self) -> Mapping[str, float]:
        return {"feedback": self.feedback}

    def sampled(self, period: float) -> SampledReading:
        """Return the law itself.

        Raises:
            InvalidInputError: If the feedback would overshoot at this period.
        """
        check_sampling_rate(period, self.loop_gains)
        return super().sampled(period)

    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        J, desired = u["J"], u["p_WE_desired"]
        asked = self.feedback * (desired - u["p_WE"])
        if self.feed_forward:
            asked = asked + (u["p_preview"] - desired) / period
        return damped_joint_velocity(J, asked, self.damping)

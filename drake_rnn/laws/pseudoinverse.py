r"""The pseudoinverse with feed-forward: the usual method, without a network.

.. math::
    v = J^+ \left( \frac{p_d(t + h) - p_d(t)}{h} + k (p_d - p) \right), \qquad
    J^+ = J^T (J J^T + \mu^2 I)^{-1}.

The feed-forward is the secant of the desired positions over the sample for which v is held; with
the derivative instead, the error on a fast path is several times as large. Joint limits are
ignored.

The damped pseudoinverse :math:`J^T (J J^T + \mu^2 I)^{-1}`, which always exists.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np

from ..arrays.algebra import join, matmul, matvec, scale, solved_for, transpose
from ..inputs.fields import Array, Flag, GainOrZero, Weight, validated
from ..inputs.keys import Meaning
from ..robot.limits import JointLimits
from ..robot.rotation import rotation_error
from .law import Layout, SampledLaw, Signals


def damped_joint_velocity(J: Array, v_WE: Array, damping: Any) -> Array:
    """Return the joint velocities that produce ``v_WE``, up to the damping, shape (..., n) [rad/s].

    Args:
        J: Jacobian, shape (..., m, n) [m].
        v_WE: Desired velocity of the end effector, shape (..., m) [m/s].
        damping: Damping mu [m].
    """
    J_T = transpose(J)
    gram = matmul(J, J_T) + scale(damping**2, np.eye(J.shape[-2]))
    return matvec(J_T, solved_for(gram, v_WE))


@validated
class Pseudoinverse(SampledLaw):
    """A sampled law without memory; its state is the commanded velocity."""

    kind: Literal["pseudoinverse"] = "pseudoinverse"
    summary = "The pseudoinverse with feed-forward: the usual method, without a network."
    limits: Annotated[JointLimits, Meaning("Joint limits; only the number of joints is used.")]
    task_size: Annotated[
        Literal[1, 2, 3, 4, 5, 6],
        Meaning("Number of rows of J; of 6 rows the first three are rotation."),
    ] = 3
    feedback: Annotated[
        GainOrZero,
        Meaning("Gain of the feedback of position and orientation.", unit="1/s"),
    ] = 10.0
    feed_forward: Annotated[Flag, Meaning("Whether the velocity of the path is added.")] = True
    damping: Annotated[Weight, Meaning("Damping mu of the pseudoinverse.", unit="m")] = 1e-6

    stays_on_path = True
    follows_objectives = True
    takes_many = True

    @cached_property
    def state(self) -> Layout:
        return Layout(v=(self.limits.size,))

    @cached_property
    def inputs(self) -> Layout:
        shapes: dict[str, tuple[int, ...]] = {"p": (3 if self._turns else self.task_size,)}
        if self._turns:
            shapes["R"] = (3, 3)
        names = ["WE", "WE_desired", *(["preview"] if self.feed_forward else [])]
        parts = {f"{letter}_{name}": shape for letter, shape in shapes.items() for name in names}
        return Layout(J=(self.task_size, self.limits.size), **parts)

    @property
    def _turns(self) -> bool:
        return self.task_size == 6

    @property
    def loop_gains(self) -> Mapping[str, float]:
        return {"feedback": self.feedback}

    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        p_desired = u["p_WE_desired"]
        demand = self.feedback * (p_desired - u["p_WE"])
        if self.feed_forward:
            demand = demand + (u["p_preview"] - p_desired) / period
        if self._turns:
            demand = join((self._turning(u, period), demand))
        return damped_joint_velocity(u["J"], demand, self.damping)

    def _turning(self, u: Signals, period: float) -> Array:
        """Return the angular velocity that is asked for, shape (..., 3) [rad/s]."""
        R_desired = u["R_WE_desired"]
        demand = self.feedback * rotation_error(u["R_WE"], R_desired)
        if self.feed_forward:
            demand = demand + rotation_error(R_desired, u["R_preview"]) / period
        return demand

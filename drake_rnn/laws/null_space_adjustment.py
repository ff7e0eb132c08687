r"""Null-space adjustment: the arm moves to a target posture while feedback holds the end effector.

Not in any paper: the equilibrium of the network of state adjustment (see `state_adjustment`), plus
feedback of the end effector's position. Without this feedback the errors that a sampled law makes
in each sample would never be corrected. At each sample

.. math::
    v = J^+ k (p_d - p) - S(t)\, r\, (I - J^+ J)(q - q_d), \qquad
    J^+ = J^T (J J^T + \mu^2 I)^{-1},

where S rises smoothly from 0 to 1: the pull is ramped, not the bounds. Joints that would exceed
their bounds are held at them, the worst first, and the others compensate; where too few are left,
the whole motion is slowed down.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Annotated, Any, Literal

from ..arrays.algebra import functions_of, joined
from ..inputs.fields import Array, GainOrZero, Time, Weight, validated
from ..inputs.keys import Meaning
from ..robot.rotation import rotation_error
from .layout import Layout, Signals
from .parts.held_joints import velocity_within
from .parts.rise import column, smooth_rise
from .posture_law import PostureLaw


@validated
class NullSpaceAdjustment(PostureLaw):
    """A sampled law without memory; its state is the commanded velocity.

    It holds a fixed point and does not track a moving one, because it has no feed-forward.
    """

    kind: Literal["null_space_adjustment"] = "null_space_adjustment"
    summary = (
        "Null-space adjustment: the arm moves to a target posture while feedback holds the end "
        "effector."
    )
    ramp_time: Annotated[
        Time,
        Meaning("Time over which the pull towards the target rises.", unit="s"),
    ] = 0.75
    feedback: Annotated[
        GainOrZero,
        Meaning("Gain of the feedback of the end effector's displacement.", unit="1/s"),
    ] = 50.0
    damping: Annotated[
        Weight,
        Meaning(
            "Damping mu of the pseudoinverse; small compared to the singular values of J.",
            unit="m",
        ),
    ] = 1e-3

    takes_many = True

    @property
    def sampled_gains(self) -> Mapping[str, float]:
        return {**super().sampled_gains, "feedback": self.feedback}

    @property
    def keeps(self) -> tuple[str, ...]:
        return ("position", "velocity")

    @cached_property
    def state(self) -> Layout:
        return Layout(v=(self.limits.size,))

    @cached_property
    def inputs(self) -> Layout:
        n, m = self.limits.size, self.task_size
        position = {"p_WE": (min(m, 3),), "p_WE_desired": (min(m, 3),)}
        rotation = {"R_WE": (3, 3), "R_WE_desired": (3, 3)} if m == 6 else {}
        return Layout(position=(n,), J=(m, n), **position, **rotation)

    @cached_property
    def observables(self) -> Layout:
        n = self.limits.size
        return Layout(velocity_lower=(n,), velocity_upper=(n,), saturated=(1,))

    def velocity_box(self, t: Any, q: Array) -> tuple[Array, Array]:
        """Return the velocities allowed at a time: lower and upper, shape (..., n) [rad/s].

        A joint that starts outside its limits is brought back gradually, like the pull.

        Args:
            t: The time, a number or of shape (..., 1) [s].
            q: Joint positions, shape (..., n) [rad].
        """
        lower, upper = self.limits.velocity_box(q, self.limit_stiffness)
        share = smooth_rise(t, self.ramp_time)
        where = functions_of(q).where
        return where(lower > 0, share * lower, lower), where(upper < 0, share * upper, upper)

    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        q = u["position"]
        error = u["p_WE_desired"] - u["p_WE"]
        if self.task_size == 6:
            error = joined((rotation_error(u["R_WE"], u["R_WE_desired"]), error))
        pull = smooth_rise(t, self.ramp_time) * self.rate * (self.target - q)
        bounds = self.velocity_box(t, q)
        return velocity_within(u["J"], self.feedback * error, pull, bounds, self.damping)

    def diagnostics(self, t: float | Array, x: Array, u: Signals) -> Signals:
        lower, upper = self.velocity_box(column(t), u["position"])
        at_bound = (x <= lower + 1e-9) | (x >= upper - 1e-9)
        at_bound &= upper - lower > 1e-9
        return {
            "velocity_lower": lower,
            "velocity_upper": upper,
            "saturated": at_bound.any(axis=-1, keepdims=True).astype(float),
        }

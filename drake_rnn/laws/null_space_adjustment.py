r"""Null-space adjustment: the arm goes to a target posture, the end effector held by feedback.

Not in any paper: what state adjustment (see `state_adjustment`) comes to when its network has
settled, and what it lacks added, a feedback of the end effector's position. Without it, what a
sampled law loses in every sample is lost for good. Per sample

.. math::
    v = J^+ k (p_d - p) - S(t)\, r\, (I - J^+ J)(q - q_d), \qquad
    J^+ = J^T (J J^T + \mu^2 I)^{-1},

where S rises smoothly from 0 to 1: the pull sets in, rather than the bounds opening. Joints that
would leave their bounds are held at them, the worst first, and the others make up for them;
where too few are left, the whole motion is slowed.
"""

from __future__ import annotations

from functools import cached_property
from typing import Literal

import numpy as np

from ..fields import Array, NonNegative, Positive, Vector, validated
from ..limits import JointLimits
from .law import Layout, Signals
from .rise import smooth_rise
from .rotation_error import rotation_error
from .target import check_target


@validated
class NullSpaceAdjustment:
    """A sampled law without memory; its state is the velocity it asks for.

    Args:
        target: Posture to reach, shape (n,) [rad].
        limits: Position and velocity limits of the joints.
        rate: Speed of convergence to the target [1/s].
        ramp_time: Time over which the pull towards the target sets in [s].
        feedback: Of the end effector's displacement [1/s]; times the period it must stay
            below 1.
        damping: Of the pseudoinverse [m]; small beside the singular values of J.
        limit_stiffness: Velocity allowed per radian left to a position limit [1/s].
        task_size: Rows of J, all of which are held; of 6 the first three are rotation.
    """

    kind: Literal["null_space_adjustment"] = "null_space_adjustment"
    target: Vector
    limits: JointLimits
    rate: Positive = 4.0
    ramp_time: Positive = 0.75
    feedback: NonNegative = 50.0
    damping: Positive = 1e-3
    limit_stiffness: Positive = 20.0
    task_size: Literal[2, 3, 6] = 3

    def __post_init__(self) -> None:
        check_target(self.target, self.limits)

    @property
    def holds_command(self) -> bool:
        return True

    @property
    def longest_period(self) -> float:
        """Between two samples, beyond which the feedback overshoots [s]."""
        return 1.0 / self.feedback if self.feedback else np.inf

    @cached_property
    def state(self) -> Layout:
        return Layout(v=self.target.shape)

    @cached_property
    def inputs(self) -> Layout:
        n, m = self.target.size, self.task_size
        position = {"p_WE": (min(m, 3),), "p_WE_desired": (min(m, 3),)}
        rotation = {"R_WE": (3, 3), "R_WE_desired": (3, 3)} if m == 6 else {}
        return Layout(position=(n,), J=(m, n), **position, **rotation)

    @cached_property
    def observables(self) -> Layout:
        n = self.target.size
        return Layout(velocity_lower=(n,), velocity_upper=(n,), saturated=(1,))

    def initial_state(self, rng: np.random.Generator, u: Signals) -> Array:
        return np.zeros(self.state.size)

    def velocity_box(self, t: float | Array, q: Array) -> tuple[Array, Array]:
        """Velocities allowed at time ``t``: lower and upper, shape (..., n) [rad/s].

        A joint that starts outside its limits is brought back as the pull sets in.
        """
        lower, upper = self.limits.velocity_box(q, self.limit_stiffness)
        share = np.asarray(smooth_rise(t, self.ramp_time))[..., np.newaxis]
        return np.where(lower > 0, share * lower, lower), np.where(upper < 0, share * upper, upper)

    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        q = u["position"]
        error = u["p_WE_desired"] - u["p_WE"]
        if self.task_size == 6:
            error = np.concatenate((rotation_error(u["R_WE"], u["R_WE_desired"]), error))
        pull = smooth_rise(t, self.ramp_time) * self.rate * (self.target - q)
        return self._bounded(u["J"], self.feedback * error, pull, *self.velocity_box(t, q))

    def commanded_velocity(self, t: float, x: Array) -> Array:
        return x

    def diagnostics(self, t: float | Array, x: Array, u: Signals) -> Signals:
        lower, upper = self.velocity_box(t, u["position"])
        at_bound = (x <= lower + 1e-9) | (x >= upper - 1e-9)
        at_bound &= upper - lower > 1e-9
        return {
            "velocity_lower": lower,
            "velocity_upper": upper,
            "saturated": at_bound.any(axis=-1, keepdims=True).astype(float),
        }

    def _bounded(
        self, J: Array, task_velocity: Array, pull: Array, lower: Array, upper: Array
    ) -> Array:
        """Nearest to ``pull`` of the velocities that bring about ``task_velocity``."""
        m, n = J.shape
        damping = self.damping**2 * np.eye(m)
        free = np.ones(n)
        held = np.zeros(n)
        while True:
            J_free = J * free
            v = held + free * pull
            v = v + J_free.T @ np.linalg.solve(J_free @ J_free.T + damping, task_velocity - J @ v)
            excess = np.maximum(lower - v, v - upper) * free
            worst = int(np.argmax(excess))
            if excess[worst] <= 0.0:
                return v
            if free.sum() <= m:
                break
            free[worst] = 0.0
            held[worst] = min(max(v[worst], lower[worst]), upper[worst])
        # From the velocity nearest to rest towards that one, as far as all bounds admit.
        rest = np.minimum(np.maximum(0.0, lower), upper)
        change = v - rest
        room = np.where(change > 0, upper - rest, rest - lower)
        share = np.divide(room, np.abs(change), out=np.ones(n), where=np.abs(change) > room)
        return rest + float(share.min()) * change

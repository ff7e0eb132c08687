r"""State adjustment: the arm moves to a target posture while its end effector stays in place.

Source:
    Jin, He, Huang, Wang, "Recurrent neural network for state adjustment of redundant
    manipulators", IEEE Access 8 (2020). SA is (9) with (19), MSA is (10), (11) with (18).

At every instant the network tracks the solution of

.. math::
    \min_v \tfrac12 v^T v + r (q - q_d)^T v \quad \text{s.t.} \quad J v = 0, \quad
    s(t)\, \underline{v}(q) \le v \le s(t)\, \overline{v}(q)

by the projected primal-dual dynamics

.. math::
    \epsilon \dot v = -v + P(-r (q - q_d) - J^T \lambda), \qquad
    \epsilon \dot \lambda = J v.

========  =====================  ==========================================
paper     here                   meaning
========  =====================  ==========================================
sigma     position               joint positions q
sigma_s   target                 target posture q_d
omega     v                      joint velocities (state)
gamma     multipliers            multipliers of J v = 0 (state)
r         rate                   rate of convergence [1/s]
T         rise_time              time over which the velocity bounds open [s]
epsilon   time_constant          time constant of the network [s]
lambda    limit_stiffness        velocity per radian to a position limit [1/s]
========  =====================  ==========================================

Corrected: the paper's envelope sin(pi t / 2T) turns negative after 2T and inverts the
bounds; here it stays at 1 after T. Its (23) lacks a factor 1/2, which changes nothing. Its
text names two joints that start at their speed limit in SA; in fact three do.

Not in the paper:
    J v = epsilon d(multipliers)/dt, so the end effector's displacement is exactly epsilon
    times the change of the multipliers: integral action holds the end effector, which moves
    during the adjustment and returns only if the target lies on the self-motion manifold of
    the start. While the opening bounds of MSA are tight the multipliers wind up, and MSA moves
    the end effector ten times as far as SA. ``ramp_time`` ramps the pull instead of the bounds
    and causes no wind-up. The paper gives no initial v and multipliers; zero reproduces its
    seventh joint.
"""

from __future__ import annotations

from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np

from ..arrays.algebra import clipped, functions_of, matvec, vecmat
from ..arrays.substeps import Parts, in_steps
from ..inputs.fields import Array, Time, TimeConstant, validated
from ..inputs.keys import Meaning
from .law import ContinuousLaw, SampledReading
from .layout import Layout, Signals
from .parts.kept_limits import kept_with_lag
from .parts.rise import column, sine_rise, smooth_rise
from .parts.stable_steps import check_substeps, stable_steps
from .posture_law import PostureLaw


@validated
class StateAdjustment(PostureLaw, ContinuousLaw):
    """SA; with a ``rise_time`` MSA, which starts from rest; with a ``ramp_time`` a smoother SA."""

    kind: Literal["state_adjustment"] = "state_adjustment"
    summary = (
        "State adjustment: the arm moves to a target posture while its end effector stays in place."
    )
    rise_time: Annotated[
        Time | None,
        Meaning("Time over which the velocity bounds open; None keeps them open.", unit="s"),
    ] = None
    ramp_time: Annotated[
        Time | None,
        Meaning(
            "Time over which the pull towards the target rises, without a jump of velocity or "
            "acceleration; None for the full pull at once. Not in the paper.",
            unit="s",
        ),
    ] = None
    time_constant: Annotated[
        TimeConstant,
        Meaning(
            "Time constant of the network; the end effector's drift is proportional to it.",
            unit="s",
        ),
    ] = 1e-3

    takes_many = True

    def __post_init__(self) -> None:
        super().__post_init__()
        unbounded = ~np.isfinite(self.limits.velocity)
        if self.rise_time is not None and unbounded.any():
            raise ValueError(
                "rise_time: needs a velocity limit for every joint, but joint "
                f"{int(np.argmax(unbounded)) + 1} has none; give limits.velocity"
            )

    @property
    def keeps(self) -> tuple[str, ...]:
        return kept_with_lag(self.limit_stiffness, self.time_constant)

    @cached_property
    def state(self) -> Layout:
        return Layout(v=(self.limits.size,), multipliers=(self.task_size,))

    @cached_property
    def inputs(self) -> Layout:
        n = self.limits.size
        return Layout(position=(n,), J=(self.task_size, n))

    @cached_property
    def observables(self) -> Layout:
        n = self.limits.size
        return Layout(
            velocity_lower=(n,),
            velocity_upper=(n,),
            saturated=(1,),
            displacement=(min(self.task_size, 3),),
        )

    def velocity_box(self, t: Any, q: Array) -> tuple[Array, Array]:
        """Return the velocities allowed at a time: lower and upper, shape (..., n) [rad/s].

        Args:
            t: The time, a number or of shape (..., 1) [s].
            q: Joint positions, shape (..., n) [rad].
        """
        lower, upper = self.limits.velocity_box(q, self.limit_stiffness)
        if self.rise_time is None:
            return lower, upper
        opening = sine_rise(t, self.rise_time)
        return opening * lower, opening * upper

    def derivatives(self, t: float, x: Array, u: Signals) -> Array:
        """Return the right-hand side of (18) and (19)."""
        return self._rates(t, x, u)

    def _rates(self, t: Any, x: Array, u: Signals) -> Array:
        """Return the right-hand side at a time, a number or of shape (..., 1)."""
        v, multipliers = self.state.split(x)
        J, q = u["J"], u["position"]
        sought = self._pull(t, q) - vecmat(multipliers, J)
        lower, upper = self.velocity_box(t, q)
        v_dot = clipped(sought, lower, upper) - v
        return self.state.join(v_dot, matvec(J, v)) / self.time_constant

    def sampled(self, period: float) -> SampledReading:
        """Return the law itself.

        Raises:
            InvalidInputError: If the law would overshoot at this period, or its network would take
                too many substeps.
        """
        check_substeps(period / self.time_constant, f"time_constant: {self.time_constant:g} s")
        return super().sampled(period)

    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        """Integrate by Heun's method, with inputs held, in steps that keep the network stable."""

        def advance(parts: Parts, k: Any, h: Any) -> Parts:
            (x,) = parts
            begin = t + k * h
            k1 = self._rates(begin, x, u)
            k2 = self._rates(begin + h, x + h * k1, u)
            return (x + h / 2 * (k1 + k2),)

        count = stable_steps(period / self.time_constant, u["J"])
        (x,) = in_steps(advance, (x,), period, count)
        return x

    def diagnostics(self, t: float | Array, x: Array, u: Signals) -> Signals:
        multipliers = self.state.part(x, "multipliers")
        lower, upper = self.velocity_box(column(t), u["position"])
        drawn = functions_of(x).einsum("...m,...mn->...n", multipliers, u["J"])
        sought = self._pull(column(t), u["position"]) - drawn
        outside = ((sought < lower) | (sought > upper)).any(axis=-1, keepdims=True)
        return {
            "velocity_lower": lower,
            "velocity_upper": upper,
            "saturated": outside.astype(float),
            "displacement": self.time_constant * multipliers[..., -3:],
        }

    def _pull(self, t: Any, q: Array) -> Array:
        pull = self.rate * (self.target - q)
        if self.ramp_time is None:
            return pull
        return smooth_rise(t, self.ramp_time) * pull

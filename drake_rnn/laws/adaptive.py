r"""Every bound to the jerk, by construction, with a Jacobian that is known or learned.

At each sample the law chooses the joint velocity v to hold for the next period h,

.. math::
    \min_v \tfrac12 |v - g|^2 + \frac{1}{2 \mu} |W^{1/2} (J v - b)|^2 \quad \text{s.t.} \quad
    \underline v \le v \le \overline v,

    b = \frac{p_d(t + h) - p_d(t)}{h} + s(p_d - p), \qquad
    s(e) = \min(\kappa |e|, \sqrt{2 a |e|}, s_{max}) \frac{e}{|e|}.

The feed-forward is the secant to the next sample, and the feedback is one that can be braked. With
the orientation held, the rotation vector from R_d(t) to R_d(t + h) and that from R to R_d do the
same for the rows of the rotation, which W weighs by the square of a lever.

============  ======================  =================================================
symbol        here                    meaning
============  ======================  =================================================
h             period                  time for which a velocity is held [s]
kappa         kappa                   gain of the feedback [1/s]
a             braking                 deceleration at the end of the way [m/s^2]
s_max         feedback_limit          largest speed of the feedback [m/s]
mu            softness                price of the task's error against |v - g|^2 [m^2]
W             lever                   1 for positions, lever^2 for rotations
g             secondary               velocities preferred among those that do the task
J             J or J_hat              Jacobian, at the middle of the sample if it is known
C, R, q_n     covariance, variance,   of the learned rows; see `drake_rnn.laws.parts.kalman`
              wander
============  ======================  =================================================

**Why the box is never empty.** It holds the velocities from which a joint can still stop within its
position limits, if it brakes as hard as acceleration, and jerk if that is bounded, allow. The first
step of the stop that was possible a sample ago is one of them, for what is left of a stop after its
first step is a stop again. At rest within the limits, standing still is one. So by induction the
box has a point at every sample, whatever J, the target or a measurement are, up to rounding; tests
find 1e-13 of a bound. The joints' own commands are integrated for this: a measured position does
not enter the box.

**What is not guaranteed.** That the path is tracked. The program is soft, so where box and path
disagree the bounds win. A local law does not plan: an arm may run into a position limit or a
singular posture that another posture would avoid. A learned Jacobian is right along the directions
that the arm has moved in, and need not be elsewhere. With motors the commands keep the bounds, the
arm itself does not.

The idea of pricing the task in a program with bounds on velocities is common to inverse kinematics
by quadratic programming (Kanoun, Lamiraux, Wieber, "Kinematic control of redundant manipulators:
generalizing the task-priority framework to inequality task", IEEE Transactions on Robotics 27,
2011); bounds that anticipate braking are those of Del Prete, "Joint position and velocity bounds in
discrete-time acceleration/torque control of robot manipulators", IEEE Robotics and Automation
Letters 3 (2018), here for velocities that are held, and with the jerk.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ..arrays.algebra import joined
from ..inputs.fields import (
    Array,
    Gain,
    GainOrZero,
    Length,
    Positive,
    Speed,
    Vector,
    Weight,
    validated,
)
from ..robot.limits import JointLimits
from ..robot.rotation import rotation_error
from .law import SampledLaw, SampledReading
from .layout import Layout, Signals
from .parts.approach import approach
from .parts.held_within import Program, WithinAcceleration, WithinJerk, unlimited_like
from .parts.known_jacobian import MiddleJacobian
from .parts.learned_jacobian import LearnedJacobian
from .parts.sampling_rate import check_sampling_rate


@validated
class Adaptive(SampledLaw):
    kind: Literal["adaptive"] = "adaptive"
    limits: JointLimits
    home: Vector
    task_size: Literal[2, 3, 6] = 3
    jacobian: Literal["known", "learned"] = "known"
    kappa: Gain = 100.0
    braking: Gain = 0.05
    feedback_limit: Speed = 0.1
    turn_braking: Gain = 0.25
    turn_limit: Gain = 0.5
    lever: Length = 0.3
    softness: Weight = 1e-6
    posture: GainOrZero = 1.0
    limits_push: GainOrZero = 3.0
    limits_range: Positive = 0.3
    samples: Annotated[int, Field(strict=True, ge=1, le=1000)] = 1
    wander: Weight = 1.0
    variance: Weight = 1e-5
    smoothing: Positive = 1.0
    J_hat_initial: Literal["uniform", "zero", "exact"] = "uniform"

    takes_many = True

    @property
    def keeps(self) -> tuple[str, ...]:
        known = [
            name for name in ("acceleration", "jerk") if self.limits.bounds[name] is not None
        ]
        return ("position", "velocity", *known)

    @property
    def loop_gains(self) -> Mapping[str, float]:
        return {"kappa": self.kappa}

    def sampled(self, period: float) -> SampledReading:
        check_sampling_rate(period, self.loop_gains)
        if self.limits.jerk is None:
            return self
        # Whatever the acceleration does within its bounds, its jerk is less than this.
        most = 2.0 * unlimited_like(self.limits).acceleration / period
        jerk = None if (self.limits.jerk >= most).all() else np.minimum(self.limits.jerk, most)
        return replace(self, limits=self.limits.replace(jerk=jerk))

    @cached_property
    def state(self) -> Layout:
        n = self.limits.size
        own = {"v": (n,), "commanded": (n,)}
        return Layout(**own, **self._within.shapes, **self._source.shapes)

    @cached_property
    def inputs(self) -> Layout:
        m, n = self.task_size, self.limits.size
        shapes: dict[str, tuple[int, ...]] = {"p": (min(m, 3),)}
        if self._turns:
            shapes["R"] = (3, 3)
        names = ("WE", "WE_desired", "preview")
        parts = {f"{letter}_{name}": shape for letter, shape in shapes.items() for name in names}
        known = {"J": (m, n)} if self.jacobian == "known" else {}
        return Layout(position=(n,), **known, **parts)

    @property
    def _turns(self) -> bool:
        return self.task_size == 6

    @cached_property
    def _source(self) -> MiddleJacobian | LearnedJacobian:
        m, n = self.task_size, self.limits.size
        if self.jacobian == "known":
            return MiddleJacobian(m, n)
        return LearnedJacobian(
            m, n, self.samples, self.wander, self.variance, self.J_hat_initial
        )

    @cached_property
    def _within(self) -> WithinAcceleration | WithinJerk:
        limits = unlimited_like(self.limits)
        if limits.jerk is None:
            return WithinAcceleration(limits)
        return WithinJerk(limits, self.smoothing)

    @cached_property
    def _softness(self) -> Array:
        rows = np.ones(self.task_size)
        if self._turns:
            rows[:3] = self.lever**-2
        return self.softness * rows

    def initial_state(self, rng: np.random.Generator, u: Signals) -> Array:
        n = self.limits.size
        start = {name: np.zeros(shape) for name, shape in self._within.shapes.items()}
        start |= {"v": np.zeros(n), "commanded": u["position"]}
        start |= self._source.start(rng, u)
        return self._joined(start)

    def _joined(self, parts: Mapping[str, Array]) -> Array:
        return self.state.join(*(parts[name] for name in self.state.parts))

    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        kept = dict(zip(self.state.parts, self.state.split(x), strict=True))
        v, q = kept["v"], kept["commanded"]
        J, learned = self._source.advanced(kept, u, period)
        along, feedback = self._asked(u, period)
        program = Program(J, along + feedback, along, self._preferred(q), self._softness)
        v, held = self._within.chosen(program, q, v, kept, period)
        return self._joined({"v": v, "commanded": q + period * v, **held, **learned})

    def _asked(self, u: Signals, period: float) -> tuple[Array, Array]:
        """Return the task velocities of the path and of the feedback, shape (..., m)."""
        desired = u["p_WE_desired"]
        along = (u["p_preview"] - desired) / period
        back = approach(desired - u["p_WE"], self.kappa, self.braking, self.feedback_limit)
        if not self._turns:
            return along, back
        R_desired = u["R_WE_desired"]
        turning = rotation_error(R_desired, u["R_preview"]) / period
        error = rotation_error(u["R_WE"], R_desired)
        back_turning = approach(error, self.kappa, self.turn_braking, self.turn_limit)
        return joined((turning, along)), joined((back_turning, back))

    def _preferred(self, q: Array) -> Array:
        return self.posture * (self.home - q)

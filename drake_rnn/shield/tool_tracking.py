"""Joint velocities that move a tool to a pose, or along a twist, by the adaptive law."""

from __future__ import annotations

import numpy as np

from ..compiled.builds import Steps
from ..inputs.fields import Array
from ..laws import Adaptive
from ..laws.guard import StreamGuard
from ..laws.parts.jacobian import LEVER
from ..laws.parts.reach_edge import out_of_reach
from ..robot.arm import Arm
from ..robot.limits import JointLimits
from ..robot.rotation import rotation_error
from .progress import Progress, is_another_twist
from .twist_lead import Feedback, TwistLead

#: A tool that is this far off its pose wants to get on [m, rad].
OFF, TURNED = 0.01, 0.03
#: A tool that is nearer than this is at its pose [m].
AT = 1e-3
# Deceleration and largest speed with which a tool joins poses [m/s^2, m/s].
_BRAKING, _JOINING = 1.0, 0.5
# Time without progress after which the tool wants less speed [s]: to a pose it may first go astray.
_PATIENCE = {"twists": 0.25, "poses": 0.8}
# What makes the rows of a twist lengths a second.
_LENGTHS = np.array([LEVER] * 3 + [1.0] * 3)


class ToolTracking:
    """Joint velocities that move the tool from where it is to a pose, by the adaptive law.

    Args:
        arm: The arm.
        limits: Limits of the joints.
        home: Posture that joints which the task leaves free are pulled to, shape (n,) [rad].
        period: Time for which a velocity is held [s].
        steps: How the steps of the law are made.
    """

    def __init__(
        self, arm: Arm, limits: JointLimits, home: Array, period: float, steps: Steps
    ) -> None:
        self._kinematics, self._period, self._limits = arm.kinematics(), period, limits
        law = Adaptive(
            limits=limits,
            home=home,
            jacobian="known",
            task_size=6,
            braking=_BRAKING,
            feedback_limit=_JOINING,
            turn_braking=4.0 * _BRAKING,
            turn_limit=4.0 * _JOINING,
        )
        self._reading = reading = law.sampled(period)
        self._step = steps.bind(reading, period)
        own = reading.law
        assert own.kappa is not None
        turn = Feedback(own.kappa, own.turn_braking, own.turn_limit)
        self._feedbacks = turn, Feedback(own.kappa, own.braking, own.feedback_limit)
        self._lead = TwistLead(*self._feedbacks, period)
        self._has_begun = False
        self._progress = Progress()
        # What is followed since progress is counted.
        self._twist: Array | None = None
        self._pose: tuple[Array, Array] | None = None

    def clear(self) -> None:
        """Have the next twist or pose begin where the tool is then."""
        self._lead.clear()
        self._progress.clear()

    def follow_twist(self, t: float, guard: StreamGuard, V_WE: Array) -> Array:
        """Return the velocities of the next period that move the tool, shape (n,) [rad/s].

        Args:
            t: Time now [s].
            guard: What commands the arm.
            V_WE: Twist that is asked for, shape (6,) [rad/s, m/s].
        """
        q, kinematics = guard.position, self._kinematics
        wanted, V_tool = _LENGTHS * V_WE, self._tool_velocity(guard)
        if self._twist is None or is_another_twist(wanted, self._twist):
            self._progress.clear()
            self._twist = wanted
        self._pose = None
        here = kinematics.R_WE(q), kinematics.p_WE(q)
        v = self._velocity(t, guard, *self._lead.pose(t, V_WE, V_tool, here))
        self._progress.note(wanted, _LENGTHS * V_tool, self._period, _PATIENCE["twists"])
        return self._progress.share * v

    def follow_pose(
        self, t: float, guard: StreamGuard, here: tuple[Array, Array], ahead: tuple[Array, Array]
    ) -> Array:
        """Return the velocities of the next period that lead to a pose, shape (n,) [rad/s].

        Args:
            t: Time now [s].
            guard: What commands the arm.
            here: Orientation and position of E that are wanted now, in W.
            ahead: The same a period later.
        """
        (R, p), before = here, self._pose
        if before is None or (
            float(np.linalg.norm(p - before[1])) > OFF or angle_between(before[0], R) > TURNED
        ):
            self._progress.clear()
            self._pose = here
        self._twist = None
        v = self._velocity(t, guard, here, ahead)
        V_tool = _LENGTHS * self._tool_velocity(guard)
        self._progress.note(self._wanted(), V_tool, self._period, _PATIENCE["poses"])
        return self._progress.share * v

    @property
    def blocked(self) -> float:
        """Time for which the tool has not got on [s]."""
        return self._progress.blocked

    @property
    def out_of_reach(self) -> tuple[int, ...] | None:
        """Joints at their ends without which no motion brings the tool nearer; None if one does."""
        u, limits = self._step.u, self._limits
        turn = rotation_error(u["R_WE"], u["R_WE_desired"])
        error = _LENGTHS * np.concatenate((turn, u["p_WE_desired"] - u["p_WE"]))
        return out_of_reach(_LENGTHS[:, None] * u["J"], error, u["position"], limits)

    def _wanted(self) -> Array:
        """Return the task velocity that the law wants, of rows that are lengths, (6,) [m/s]."""
        u, (of_turn, of_way) = self._step.u, self._feedbacks
        turning = rotation_error(u["R_WE_desired"], u["R_preview"]) / self._period
        moving = (u["p_preview"] - u["p_WE_desired"]) / self._period
        turning = turning + of_turn.velocity(rotation_error(u["R_WE"], u["R_WE_desired"]))
        moving = moving + of_way.velocity(u["p_WE_desired"] - u["p_WE"])
        return _LENGTHS * np.concatenate((turning, moving))

    def _tool_velocity(self, guard: StreamGuard) -> Array:
        """Return the twist of the tool now, shape (6,) [rad/s, m/s]."""
        q, v = guard.position, guard.velocity
        return np.concatenate((self._kinematics.J_omega(q) @ v, self._kinematics.J(q) @ v))

    def _velocity(
        self, t: float, guard: StreamGuard, here: tuple[Array, Array], ahead: tuple[Array, Array]
    ) -> Array:
        """Return the velocities that the law chooses, shape (n,) [rad/s]; see `follow_pose`."""
        q, kinematics = guard.position, self._kinematics
        step, reading, u = self._step, self._reading, self._step.u
        u["position"][:], u["p_WE"][:] = q, kinematics.p_WE(q)
        u["R_WE"][:], u["J"][:3], u["J"][3:] = (
            kinematics.R_WE(q),
            kinematics.J_omega(q),
            kinematics.J(q),
        )
        u["R_WE_desired"][:], u["p_WE_desired"][:] = here
        u["R_preview"][:], u["p_preview"][:] = ahead
        if not self._has_begun:
            step.x[:] = reading.initial_state(np.random.default_rng(0), u)
            self._has_begun = True
        step.x[:] = reading.resumed(step.x, q, guard.velocity, guard.acceleration)
        step.make()
        return np.array(reading.commanded_velocity(t, step.x))


def angle_between(R: Array, S: Array) -> float:
    """Return the angle between two orientations [rad]."""
    return float(np.arccos(np.clip(0.5 * (np.trace(R.T @ S) - 1.0), -1.0, 1.0)))

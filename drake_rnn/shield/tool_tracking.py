"""Joint velocities that move a tool to a pose, or along a twist, by the adaptive law."""

from __future__ import annotations

import numpy as np

from ..compiled.builds import Steps
from ..inputs.fields import Array
from ..laws import Adaptive
from ..laws.guard import StreamGuard
from ..laws.parts.jacobian import LEVER
from ..laws.parts.progress import (
    LEAST,
    NO_PROGRESS,
    POSE_PATIENCE,
    advance,
    asks_for_nothing,
    fastest_tool,
)
from ..laws.parts.reach_edge import out_of_reach
from ..robot.arm import Arm
from ..robot.limits import JointLimits
from ..robot.rotation import rotation_error
from .progress import WayBack, is_another_twist
from .twist_lead import Feedback, TwistLead

#: A tool that is this far off its pose wants to get on [m, rad].
OFF, TURNED = 0.01, 0.03
#: A tool that is nearer than this is at its pose [m].
AT = 1e-3
# What a motion of the joints brings a tool at the end of its reach at least [m]; the share of what
# is wanted beyond which a tool that joints cannot give it does not follow; motions that bring it
# less than the last count as none [m].
_LITTLE, _MISSED, _FLAT = 0.2, 0.5, 0.05
# Deceleration and largest speed with which a tool joins poses [m/s^2, m/s]; the first is no more
# than joints that are slow to brake can make of it, this far from the tool [m].
_BRAKING, _JOINING, _ARM = 1.0, 0.5, 0.5
#: Time without progress after which less speed is wanted [s].
PATIENCE = {"velocities": 0.25, "twists": 0.25, "poses": POSE_PATIENCE}
# Joints of a tool that does not get on are no faster than a share of this [rad/s].
_CALM = 1.0
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
        braking = _BRAKING
        if limits.acceleration is not None:
            braking = min(braking, _ARM * float(limits.sides("acceleration").least.min()))
        law = Adaptive(
            limits=limits,
            home=home,
            jacobian="known",
            task_size=6,
            braking=braking,
            feedback_limit=_JOINING,
            turn_braking=4.0 * braking,
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
        self._progress, self._way_back = NO_PROGRESS, WayBack()
        # Whether the tool wants less than all of its speed, as of the last that led it anywhere.
        self._is_at_end = False
        # The twist since which progress is counted; the pose as the tool last got on or came to
        # rest, where the tool was then, and the velocity that it asked for.
        self._twist: Array | None = None
        self._pose: tuple[Array, Array] | None = None
        self._place = np.eye(3), np.zeros(3)
        self._asked = np.zeros(6)
        #: Velocities that the law chose last, of which the tool wants a share, shape (n,) [rad/s].
        self.whole_velocity = np.zeros(arm.n)

    def clear(self) -> None:
        """Have the next twist or pose begin where the tool is then."""
        self._lead.clear()
        self._progress = NO_PROGRESS
        self._way_back.clear()
        # The law too: what it wanted before is no longer wanted.
        self._has_begun = False

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
            self._turn(q, wanted, self._twist)
            self._twist = wanted
        self._pose = None
        here = kinematics.R_WE(q), kinematics.p_WE(q)
        v = self._velocity(t, guard, *self._lead.pose(t, V_WE, V_tool, here))
        return self._within_progress(guard, v, wanted, PATIENCE["twists"])

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
        v = self._velocity(t, guard, here, ahead)
        u = self._step.u
        place = np.array(u["R_WE"]), np.array(u["p_WE"])
        wanted = self._wanted(place)
        if is_new := self._pose is None or self._leads_elsewhere(here):
            self._turn(guard.position, wanted, None if self._pose is None else self._asked)
        self._twist = None
        share = self._progress.share
        v = self._within_progress(guard, v, wanted, PATIENCE["poses"])
        if is_new or not self._progress.blocked or self._progress.share == LEAST < share:
            self._pose, self._place, self._asked = here, place, wanted
        return v

    def _turn(self, q: Array, wanted: Array, before: Array | None) -> None:
        """Count progress anew from a posture, of another task velocity than before [m/s].

        A tool at an end that hardly any motion of joints takes back leaves it by the way it came.
        """
        is_back = before is not None and self._is_at_end and wanted @ before < 0.0
        if is_back:
            # What it strayed from its line while something held it is not taken back on the way.
            self._lead.clear()
        if is_back and self._hardly_goes(wanted):
            self._way_back.turn(q)
        else:
            self._way_back.clear()
        self._progress = NO_PROGRESS

    def _hardly_goes(self, wanted: Array) -> bool:
        """Return whether joints hardly make a task velocity, shape (6,) [m/s], or most of it not.

        So it is at the end of reach, and for an arm of few joints that would have to turn its tool.
        """
        J, size = _LENGTHS[:, None] * self._step.u["J"], float(np.linalg.norm(wanted))
        if float(np.linalg.norm(wanted @ J)) < _LITTLE * size:
            return True
        made = J @ J.T
        missed = _FLAT**2 * np.linalg.solve(made + _FLAT**2 * np.eye(6), wanted)
        return float(np.linalg.norm(missed)) > _MISSED * size

    def _leads_elsewhere(self, here: tuple[Array, Array]) -> bool:
        """Return whether a pose leads elsewhere than it did as the tool last got on, from there.

        One that goes on behind what stands in the way does not; nor where the tool slides aside.

        Args:
            here: See `follow_pose`.
        """
        assert self._pose is not None
        (R, p), (R_before, p_before) = here, self._pose
        if np.linalg.norm(p - p_before) <= OFF and angle_between(R_before, R) <= TURNED:
            return False
        wanted = self._wanted(self._place)
        return asks_for_nothing(self._asked) or is_another_twist(wanted, self._asked)

    def _within_progress(
        self, guard: StreamGuard, v: Array, wanted: Array, patience: float
    ) -> Array:
        """Return velocities for a tool that wants less of them where it does not get on, (n,).

        Args:
            guard: What commands the arm.
            v: Velocities that the law chooses, shape (n,) [rad/s].
            wanted: Task velocity that is wanted, of rows that are lengths, shape (6,) [m/s].
            patience: See `drake_rnn.laws.parts.progress.advance`.
        """
        self.whole_velocity = v
        q, limits, period = guard.position, self._limits, self._period
        speed = float(np.linalg.norm(wanted))
        if (back := self._way_back.velocity(q, speed, period)) is not None:
            # What leads it on begins where that ends.
            self._lead.clear()
            return back / max(float((np.abs(back) / limits.toward("velocity", back)).max()), 1.0)

        if asks_for_nothing(wanted):
            self._progress = NO_PROGRESS
            return v

        def fastest(age: float) -> float:
            return float(fastest_tool(_LENGTHS[:, None] * self._step.u["J"], limits, age))

        V_tool = _LENGTHS * self._tool_velocity(guard)
        progress = advance(self._progress, wanted, V_tool, period, patience, fastest)
        self._progress, self._is_at_end = progress, progress.share < 1.0
        self._way_back.note(q, progress.gained)
        return progress.share * v

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

    def _wanted(self, place: tuple[Array, Array]) -> Array:
        """Return the task velocity that the law wants, of rows that are lengths, (6,) [m/s].

        Args:
            place: Orientation and position of the tool from which it is wanted, in W.
        """
        u, (of_turn, of_way), (R, p) = self._step.u, self._feedbacks, place
        turning = rotation_error(u["R_WE_desired"], u["R_preview"]) / self._period
        moving = (u["p_preview"] - u["p_WE_desired"]) / self._period
        turning = turning + of_turn.velocity(rotation_error(R, u["R_WE_desired"]))
        moving = moving + of_way.velocity(u["p_WE_desired"] - p)
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
        step.x[:] = reading.resumed(step.x, q, *self._motion_at_speed(guard))
        step.make()
        return np.array(reading.commanded_velocity(t, step.x))

    def _motion_at_speed(self, guard: StreamGuard) -> tuple[Array, Array]:
        """Return velocities and accelerations of the arm if its tool could have all of its speed.

        Of a tool that wants a share of its speed, time goes by as much more slowly. Without that,
        the law would go on from a share of what it can add to the velocity in a sample, and the arm
        would not feel its way.
        """
        share, limits = self._progress.share, self._limits
        v, a = guard.velocity, guard.acceleration
        if share == 1.0:
            return v, a
        fastest = np.minimum(np.maximum(np.abs(v), _CALM), limits.sides("velocity").toward(v > 0.0))
        v = (v / share).clip(-fastest, fastest)
        return v, a if limits.acceleration is None else limits.sides("acceleration").clip(a / share)


def angle_between(R: Array, S: Array) -> float:
    """Return the angle between two orientations [rad]."""
    return float(np.arccos(np.clip(0.5 * (np.trace(R.T @ S) - 1.0), -1.0, 1.0)))

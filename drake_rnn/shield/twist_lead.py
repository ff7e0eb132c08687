r"""The pose that a twist leads the tool to, at rest once the tool makes no more progress.

A twist asks for a velocity and names no place. Followed as a velocity, one that is held past the
end of reach wants the more of the joints the less they can give, and the arm swings there for ever.
A pose out of reach is different: the law finds the posture that is nearest to it, and rests there
(`drake_rnn.laws.parts.reach_edge`). So a twist is followed as a pose.

The pose is ahead of the tool along the twist, just as far as the feedback of the law goes to it
with the speed that is asked for: v = s(e). So where the twist can be followed, its velocity is what
the law wants, without a lag. The pose goes on only as far as the tool does, and not back with it:
it moves if the tool has come farther along the twist than ever before. Where it comes no farther,
the pose rests, and so does the arm. Reversed, the pose is at once as far on the other side.

What the tool strays from the line that it is led along, and from the orientation, is taken back, up
to a bound. A tool that limits keep farther off takes its line with it.

A speed beyond the largest one of the feedback is asked for by moving the pose, once the tool has
come near to that largest speed; where the tool stops, so does the pose.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..inputs.fields import Array
from ..laws.parts.path_task import approach
from ..robot.rotation import rotation_by, rotation_error

# How far the tool may stray from its line and be led back [rad, m].
_STRAY_TURN, _STRAY = 0.2, 0.05
# Periods without a twist after which a new line begins.
_PAUSE = 1.5
# Share of the largest speed of the feedback from which on more is asked for.
_NEAR = 0.5


class Feedback(NamedTuple):
    """Speed s(e) = min(kappa e, sqrt(2 a e), limit) of a feedback.

    Attributes:
        gain: Gain kappa [1/s].
        braking: Deceleration a [m/s^2 or rad/s^2].
        limit: Largest speed [m/s or rad/s].
    """

    gain: float
    braking: float
    limit: float

    def error(self, speed: float) -> float:
        """Return the error at which it has a speed, at most its limit [m or rad]."""
        return max(speed / self.gain, speed * speed / (2.0 * self.braking))

    def velocity(self, error: Array) -> Array:
        """Return the velocity that reduces an error, shape (3,)."""
        return approach(error, self.gain, self.braking, self.limit)


class TwistLead:
    """The pose that a twist leads the tool to.

    Args:
        turn: Feedback of the orientation.
        way: Feedback of the position.
        period: Time between two calls [s].
    """

    def __init__(self, turn: Feedback, way: Feedback, period: float) -> None:
        self._feedbacks, self._period = (turn, way), period
        # Where the tool has come to along its line, and when that was.
        self._line: tuple[Array, Array] = np.eye(3), np.zeros(3)
        self._last = -np.inf

    def clear(self) -> None:
        """Begin a new line with the next twist."""
        self._last = -np.inf

    def pose(
        self, t: float, V_WE: Array, V_tool: Array, here: tuple[Array, Array]
    ) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        """Return the pose to lead the tool to, and that a period later: orientation and position.

        Args:
            t: Time now [s].
            V_WE: Twist that is asked for, shape (6,) [rad/s, m/s].
            V_tool: That of the tool now, likewise.
            here: Orientation and position of the tool now, in W.
        """
        (R, p), period = here, self._period
        if not V_WE.any() or t - self._last > _PAUSE * period:
            self._line = here
        self._last = t
        R_line, p_line = self._line
        turn = self._along(0, V_WE[:3], V_tool[:3], rotation_error(R, R_line))
        way = self._along(1, V_WE[3:], V_tool[3:], p_line - p)
        self._line = rotation_by(turn.off) @ R, p + way.off
        R_lead, p_lead = rotation_by(turn.off + turn.lead) @ R, p + way.off + way.lead
        later = rotation_by(period * turn.velocity) @ R_lead, p_lead + period * way.velocity
        return (R_lead, p_lead), later

    def _along(self, part: int, wanted: Array, v_tool: Array, off: Array) -> _Lead:
        """Return where a part of the pose is, as seen from the tool.

        Args:
            part: 0 for the orientation, 1 for the position.
            wanted: Velocity that is asked for, shape (3,).
            v_tool: That of the tool.
            off: Way from the tool to where it has come to along its line.
        """
        feedback, stray = self._feedbacks[part], (_STRAY_TURN, _STRAY)[part]
        lead = velocity = np.zeros(3)
        if speed := float(np.linalg.norm(wanted)):
            axis = wanted / speed
            off = off - min(float(axis @ off), 0.0) * axis
            lead = feedback.error(min(speed, feedback.limit)) * axis
            if (more := speed - feedback.limit) > 0.0:
                reached = float(axis @ v_tool) - _NEAR * feedback.limit
                velocity = min(more, max(reached, 0.0)) * axis
        far = float(np.linalg.norm(off))
        return _Lead(off if far <= stray else stray / far * off, lead, velocity)


class _Lead(NamedTuple):
    """A part of a pose that leads, as seen from the tool.

    Attributes:
        off: Way from the tool to where it has come to along its line, shape (3,).
        lead: Way from there on, likewise.
        velocity: Velocity with which the pose moves besides, likewise.
    """

    off: Array
    lead: Array
    velocity: Array

"""Joints that do not get on, the way back of a tool that does not, and when another twist begins.

Progress itself is measured by `drake_rnn.laws.parts.progress`.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from ..inputs.fields import Array
from ..laws.parts.progress import LEAST_GAIN, NO_PROGRESS, Progress, advance, asks_for_nothing
from ..robot.limits import JointLimits

# Way of a tool between two postures that are remembered [m], and how many are; the share of the way
# back that is left where it ends, and the longest time for it [s].
_SPACING, _POSTURES, _THERE, _LONGEST = 2e-3, 10, 0.2, 1.0


class JointProgress:
    """What each joint gets on along the velocity that is asked of it.

    One that does not wants less and less, so that it no longer pushes others along what is in its
    way; one that does has all of its velocity.

    Args:
        limits: Limits of the joints.
        period: Time between two samples [s].
        patience: See `drake_rnn.laws.parts.progress.advance`.
    """

    def __init__(self, limits: JointLimits, period: float, patience: float) -> None:
        self._period, self._patience = period, patience
        self._fastest = limits.sides("velocity").largest
        self._most = None
        if limits.acceleration is not None:
            self._most = limits.sides("acceleration").largest
        self._joints = [NO_PROGRESS] * limits.size
        self._asked, self._is_noted = np.zeros(limits.size), False

    def clear(self) -> None:
        """Begin anew."""
        self._joints = [NO_PROGRESS] * len(self._joints)
        self._is_noted = False

    def shares(self, asked: Array, v: Array) -> Array:
        """Return the shares of their velocities that joints may want, after a sample, shape (n,).

        Args:
            asked: Velocities that are asked for, shape (n,) [rad/s].
            v: Those of the joints, likewise.
        """
        before, self._asked = self._asked, asked
        if not self._is_noted and (v * asked >= LEAST_GAIN * asked * asked).all():
            return np.ones(asked.size)
        turns = asked * before <= 0.0
        self._joints = [
            self._advance(k, NO_PROGRESS if turns[k] else joint, asked[k : k + 1], v[k : k + 1])
            for k, joint in enumerate(self._joints)
        ]
        self._is_noted = any(joint.blocked or joint.share < 1.0 for joint in self._joints)
        return np.array([joint.share for joint in self._joints])

    def _advance(self, k: int, joint: Progress, asked: Array, v: Array) -> Progress:
        """Return the progress of a joint a sample later, of velocities of shape (1,) [rad/s]."""
        if asks_for_nothing(asked):
            return NO_PROGRESS

        def fastest(age: float) -> float:
            most = np.inf if self._most is None else float(self._most[k]) * age
            return min(float(self._fastest[k]), most)

        return advance(joint, asked, v, self._period, self._patience, fastest)


class WayBack:
    """The posture in which a tool still got on, to which it is led where it leaves its end.

    At the end of its reach an arm is stretched. No velocity of the joints takes the tool back from
    there at once, so that a law of velocities rests there for ever.
    """

    def __init__(self) -> None:
        self._postures: deque[Array] = deque(maxlen=_POSTURES)
        self._left = self._far = self._time = 0.0

    def clear(self) -> None:
        """Forget it."""
        self._postures.clear()
        self._left = self._far = self._time = 0.0

    def note(self, q: Array, gained: float) -> None:
        """Note a posture, shape (n,) [rad], and how far the tool has got on to it [m]."""
        if self._far:
            return
        self._left -= gained
        if self._left <= 0.0:
            self._postures.append(q)
            self._left = _SPACING

    def turn(self, q: Array) -> None:
        """Lead back from now on, from a posture, shape (n,) [rad]."""
        if self._postures:
            self._far = float(np.linalg.norm(self._postures[0] - q))

    def velocity(self, q: Array, speed: float, period: float) -> Array | None:
        """Return the velocities that lead back, shape (n,) [rad/s]; None if nothing does any more.

        Args:
            q: Where the joints are, shape (n,) [rad].
            speed: How fast the tool is to be [m/s].
            period: Time until the next call [s].
        """
        if not self._far:
            return None
        way = self._postures[0] - q
        left = float(np.linalg.norm(way))
        self._time += period
        if left <= _THERE * self._far or self._time > _LONGEST:
            self.clear()
            return None
        return np.asarray(way * (self._far * speed / (left * _SPACING * _POSTURES)))


def is_another_twist(V: Array, V_before: Array) -> bool:
    """Return whether a twist asks for another direction than one before, shape (6,) each."""
    return float(V @ V_before) < 0.9 * float(np.linalg.norm(V) * np.linalg.norm(V_before))

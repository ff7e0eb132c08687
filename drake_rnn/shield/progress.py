"""Joints that do not get on, the way back of a tool that does not, and when another twist begins.

Progress itself is measured by `drake_rnn.laws.parts.progress`.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from ..inputs.fields import Array
from ..laws.parts.progress import MEAN, NO_PROGRESS, WELL, advance, asks_for_nothing
from ..robot.limits import JointLimits

# Way of a tool between two postures that are remembered [m], and how many are; the share of the way
# back that is left where it ends, and the longest time for it [s].
_SPACING, _POSTURES, _THERE, _LONGEST = 2e-3, 10, 0.2, 1.0


class JointProgress:
    """What joints get on together along the velocities that are asked of them.

    Those that hardly move as they are asked want less and less if all of them make no progress, so
    that they no longer push others along what is in their way. The others have all they ask for.

    Args:
        limits: Limits of the joints.
        period: Time between two samples [s].
        patience: See `drake_rnn.laws.parts.progress.advance`.
    """

    def __init__(self, limits: JointLimits, period: float, patience: float) -> None:
        self._period, self._patience = period, patience
        self._velocity = limits.sides("velocity")
        self._fastest = self._velocity.largest
        self._most = np.full(limits.size, np.inf)
        if limits.acceleration is not None:
            self._most = limits.sides("acceleration").largest
        self._progress = NO_PROGRESS
        self._asked, self._powers = np.zeros(limits.size), np.zeros(limits.size)
        self._held = np.zeros(limits.size, dtype=bool)

    @property
    def blocked(self) -> float:
        """Time for which those that hardly move have made no progress [s]."""
        return float(self._progress.blocked)

    def shares(self, asked: Array, v: Array) -> Array:
        """Return the shares of their velocities that joints may want, after a sample, shape (n,).

        Args:
            asked: Velocities that are asked for, shape (n,) [rad/s].
            v: Those of the joints, likewise.
        """
        progress, period = self._progress, self._period
        asked = self._velocity.clip(asked)
        if not self._asked.any() or is_another_twist(asked, self._asked):
            progress, self._asked, self._powers = NO_PROGRESS, asked, 0.0 * asked
        self._powers = self._powers + (v * asked - self._powers) * (period / (MEAN + period))
        held = self._powers < WELL * asked * asked
        self._held = held if progress.share == 1.0 else self._held | held
        held = self._held

        def fastest(age: float) -> float:
            return float(np.linalg.norm(np.minimum(self._fastest, self._most * age)[held]))

        if asks_for_nothing(held * asked):
            self._progress = NO_PROGRESS
        else:
            now = held * asked, held * v
            self._progress = advance(progress, *now, period, self._patience, fastest)
        return np.where(held, self._progress.share, 1.0)


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

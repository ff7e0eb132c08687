"""The way back of a tool that has got no further, and when progress is counted anew.

Progress itself is measured by `drake_rnn.laws.parts.progress`.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from ..inputs.fields import Array

# Way of a tool between two postures that are remembered [m], and how many are; the share of the way
# back that is left where it ends, and the longest time for it [s].
_SPACING, _POSTURES, _THERE, _LONGEST = 2e-3, 10, 0.2, 1.0


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

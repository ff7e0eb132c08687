r"""How much of its speed a tool may want, so that an arm rests where it gets no further.

The law that leads the tool does not know what stands in its way; what is safe of its velocities is
chosen behind it. Where a pose or a twist leads into a table, the nearest velocities that are safe
slide aside, the law leads back, and the arm would swing there for ever.

Progress is the work of what is wanted, :math:`\int b \cdot V \, dt`, of the task velocity b that
is wanted and that of the tool, V. To a pose at rest b is the gradient of a function of the error,
and along a constant twist it is constant: so a motion to and fro adds nothing beyond the largest
value so far. While that does not grow by a tenth of what b alone would make of it, the speed falls,
after a while in which the arm may just be starting or turning round, to a three-hundredth. With
that the arm feels its way, and is as fast as before half a second after the way is free; what
hardly counts as progress, along a wall, does not make it faster. A tool
that was on its way elsewhere has lost some of that work as it turns round: once it has gone well
along b for a while with all of its speed, progress counts from there; what one that feels its way
has slid back, it first makes good. What asks for something else has all of the speed.
Joints may be too slow for b: it counts as no more than what their limits can make of it by then.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from math import exp, sqrt

import numpy as np

from ..inputs.fields import Array
from ..robot.limits import JointLimits

# Share of the work of what is wanted that is progress, and that makes a tool faster.
_LEAST_GAIN, _FREE = 0.1, 0.25
# Time over which progress is a mean, in which the speed falls and grows by a factor of e [s].
_MEAN, _FALL, _GROWTH = 0.1, 0.15, 0.08
#: Least share of its speed that a tool wants.
LEAST = 3e-3
# Share of the work with which a tool goes well along what is wanted, and for how long it must [s].
_WELL, _LONG = 0.5, 0.3
# Way of a tool between two postures that are remembered [m], and how many are; the share of the way
# back that is left where it ends, and the longest time for it [s].
_SPACING, _POSTURES, _THERE, _LONGEST = 2e-3, 10, 0.2, 1.0
# A tool is not led by less than this [m/s].
_NOTHING = 1e-3


class Progress:
    """What a tool gets on along what is wanted of it.

    Attributes:
        share: Share of its speed that it may want.
        blocked: Time for which it has not got on [s].
        gained: How far it has got on by the last sample [m].
    """

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Begin anew, with something else that is wanted."""
        self.share, self.blocked, self.gained = 1.0, 0.0, 0.0
        self._ahead, self._rate, self._since = 0.0, 0.0, 0.0
        self._well, self._age = 0.0, 0.0

    def note(
        self,
        wanted: Array,
        V_tool: Array,
        period: float,
        patience: float,
        fastest: Callable[[float], float],
    ) -> None:
        """Take note of a sample.

        Args:
            wanted: Task velocity b that is wanted, of rows that are lengths, shape (6,) [m/s].
            V_tool: That of the tool, likewise.
            period: Time between two samples [s].
            patience: Time without progress after which the speed falls [s].
            fastest: Returns how fast the limits of the joints let a tool be at most, in any
                direction, of rows that are lengths [m/s], a time after it rested [s].
        """
        if asks_for_nothing(wanted):
            self.clear()
            return
        self._age += period
        size = sqrt(float(wanted @ wanted))
        square = size * size
        # How far it is ahead of the largest value so far; negative if it has gone back.
        power = float(wanted @ V_tool)
        if power < _WELL * self.share * square:
            square = size * min(size, fastest(self._age))
        self._well = self._well + period if power >= _WELL * self.share * square else 0.0
        is_on_its_way = self._well >= _LONG and self.share == 1.0
        self._ahead = period * power + (0.0 if is_on_its_way else self._ahead)
        gained, self._ahead = max(self._ahead, 0.0), min(self._ahead, 0.0)
        self.gained = gained / size
        self._rate += (gained - period * self._rate) / (_MEAN + period)
        self.blocked = 0.0 if self._rate >= _LEAST_GAIN * square else self.blocked + period
        if self._rate >= _LEAST_GAIN * self.share * square:
            self._since = 0.0
            if self._rate >= _FREE * self.share * square:
                self.share = min(1.0, self.share * exp(period / _GROWTH))
            return
        self._since += period
        # One that turns round goes well again before the speed falls.
        if self._since > patience and not (self._well and self.share == 1.0):
            self.share = max(LEAST, self.share * exp(-period / _FALL))


class JointProgress:
    """What joints get on together along the velocities that are asked of them.

    Those that hardly move as they are asked want less and less if all of them make no progress, so
    that they no longer push others along what is in their way. The others have all they ask for.

    Args:
        limits: Limits of the joints.
        period: Time between two samples [s].
        patience: See `Progress.note`.
    """

    def __init__(self, limits: JointLimits, period: float, patience: float) -> None:
        self._period, self._patience = period, patience
        self._velocity = limits.sides("velocity")
        self._fastest = self._velocity.largest
        self._most = np.full(limits.size, np.inf)
        if limits.acceleration is not None:
            self._most = limits.sides("acceleration").largest
        self._progress = Progress()
        self._asked, self._powers = np.zeros(limits.size), np.zeros(limits.size)
        self._held = np.zeros(limits.size, dtype=bool)

    @property
    def blocked(self) -> float:
        """Time for which those that hardly move have made no progress [s]."""
        return self._progress.blocked

    def shares(self, asked: Array, v: Array) -> Array:
        """Return the shares of their velocities that joints may want, after a sample, shape (n,).

        Args:
            asked: Velocities that are asked for, shape (n,) [rad/s].
            v: Those of the joints, likewise.
        """
        progress, period = self._progress, self._period
        asked = self._velocity.clip(asked)
        if not self._asked.any() or is_another_twist(asked, self._asked):
            progress.clear()
            self._asked, self._powers = asked, 0.0 * asked
        self._powers = self._powers + (v * asked - self._powers) * (period / (_MEAN + period))
        held = self._powers < _WELL * asked * asked
        self._held = held if progress.share == 1.0 else self._held | held
        held = self._held

        def fastest(age: float) -> float:
            return float(np.linalg.norm(np.minimum(self._fastest, self._most * age)[held]))

        progress.note(held * asked, held * v, period, self._patience, fastest)
        return np.where(held, progress.share, 1.0)


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


def asks_for_nothing(wanted: Array) -> bool:
    """Return whether a task velocity, of rows that are lengths, leads no tool, shape (6,) [m/s]."""
    return float(wanted @ wanted) < _NOTHING**2


def is_another_twist(V: Array, V_before: Array) -> bool:
    """Return whether a twist asks for another direction than one before, shape (6,) each."""
    return float(V @ V_before) < 0.9 * float(np.linalg.norm(V) * np.linalg.norm(V_before))

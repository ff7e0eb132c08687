"""What a robot is sent that goes on with its acceleration in cycles that it has lost.

A Franka robot takes a command in each of its cycles. In one without a command in time it integrates
its last acceleration: v += h a, q += h v. After some of them in a row it is off the motion that was
commanded, which a command of that motion would bring it back to at once: with J the jerk of the
motion, six lost cycles come to 4000 rad/s^3 at J = 50. So what it is off is taken over, and decays.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import InvalidInputError
from ..inputs.fields import Array, with_own_errors
from ..inputs.messages import short

# Share of what a robot is off that is left after a cycle, thrice in a row: of third order, so that
# it begins with its velocity and its acceleration.
_LEFT = 0.96


@with_own_errors
class LostCycles:
    """The motion of a robot that follows commanded positions, but for the cycles that it loses.

    It holds for motions whose acceleration and jerk are well below what the robot may: within 20
    lost cycles these bring it off by no more than what it comes back from within its limits.

    Args:
        q: Positions that the robot rests at, shape (n,) [rad].

    Attributes:
        lost: How many cycles it has lost.
    """

    def __init__(self, q: Sequence[float] | Array) -> None:
        rest = np.asarray(q, dtype=float)
        if rest.ndim != 1 or not np.isfinite(rest).all():
            raise InvalidInputError(f"q: must be finite positions, shape (n,), not {short(q)}")
        self.lost = 0
        # Positions that it holds in the last three cycles, those before its last answer, and how
        # far each is off what was commanded.
        self._held = np.tile(rest, (3, 1))
        self._before, self._off = self._held, np.zeros_like(self._held)
        self._commands = self._held

    def answer(self, commands: Sequence[Array] | Array, held: Sequence[float] | Array) -> Array:
        """Return the positions to be sent now, shape (n,) [rad].

        Args:
            commands: Positions that are commanded in the cycles since the last answer, shape
                (k, n) [rad]: k - 1 cycles that it has lost, and the one that is answered.
            held: Positions that the robot says it holds, shape (n,) [rad]. They tell whether it has
                taken the last answer, where cycles are lost.

        Raises:
            InvalidInputError: If an argument has another shape or is not finite.
        """
        rows, told = np.asarray(commands, dtype=float), np.asarray(held, dtype=float)
        n = self._held.shape[1]
        if rows.ndim != 2 or not len(rows) or rows.shape[1] != n or not np.isfinite(rows).all():
            raise InvalidInputError(f"commands: must be finite, shape (k, {n}), not {short(rows)}")
        if told.shape != (n,) or not np.isfinite(told).all():
            raise InvalidInputError(
                f"held: must be finite positions, shape ({n},), not {short(held)}"
            )
        if (count := len(rows) - 1) > 0:
            self.lost += count
            taken, dropped = _extrapolate(self._held, count), _extrapolate(self._before, count + 1)
            is_taken = np.abs(taken[-1] - told).max() <= np.abs(dropped[-1] - told).max()
            self._held = taken if is_taken else dropped
            self._commands = np.vstack((self._commands, rows[:-1]))[-3:]
            self._off = self._held - self._commands
        r, self._before = _LEFT, self._held
        off = 3.0 * r * self._off[2] - 3.0 * r**2 * self._off[1] + r**3 * self._off[0]
        q = rows[-1] + off
        self._held, self._off = np.vstack((self._held[1:], q)), np.vstack((self._off[1:], off))
        self._commands = np.vstack((self._commands[1:], rows[-1]))
        return q


def _extrapolate(held: Array, count: int) -> Array:
    """Return the last three positions after some cycles at the last acceleration, shape (3, n)."""
    for _ in range(count):
        held = np.vstack((held[1:], 3.0 * held[2] - 3.0 * held[1] + held[0]))
    return held

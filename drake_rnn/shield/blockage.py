"""For how long an arm has not got on, what is in its way, and who is told."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple
from warnings import warn

import numpy as np
from numpy.typing import NDArray

from ..inputs.fields import Array
from ..laws.guard import LastStep

# Times of a blockage at which it is looked at what has held the arm back, and how often later on at
# what would [s].
_LOOKS, _AGAIN = (0.05, 0.15, 0.25), 0.5
# A pair that has held the arm back is in its way while it is below so many of the distances at
# which arms rest, and while the arm is coming to rest.
_NEAR, _SWERVES = 1.5, 2.5


class Look(NamedTuple):
    """What is looked at to find what is in the way.

    Attributes:
        step: The last step.
        wanted: Velocities that are wanted of a joint that gets on, shape (n,) [rad/s].
    """

    step: LastStep
    wanted: Array

    def pairs(self, known: NDArray[np.intp], near: float) -> NDArray[np.intp]:
        """Return the pairs that would hold back what is wanted, with those known that are near.

        Args:
            known: Pairs that have held it back.
            near: Below how many of the distances at which arms rest they are.
        """
        distance = self.step.reading.law.avoidance.distance
        return self.step.pairs_in_the_way(self.wanted, known.tolist(), near * distance)


class Blockage:
    """For how long an arm has not got on.

    An arm that does not wants less and less, so that in the end nothing holds it back. What would
    hold back all that it wanted at first is in its way, and what has, as long as that is near.

    Args:
        after: Time after which it is told [s].
        tell: Called with the status, once a blockage; None to tell nobody. What it raises becomes a
            warning.

    Attributes:
        time: For how long it has not got on [s].
    """

    def __init__(self, after: float, tell: Callable[[Any], object] | None) -> None:
        self.time, self._after, self._tell = 0.0, after, tell
        # Looks as it came to rest, and the newest one since.
        self._early: list[Look] = []
        self._newest: Look | None = None
        self._pairs: tuple[int, ...] | None = ()

    def note(self, time: float, look: Callable[[], Look], status: Callable[[], object]) -> None:
        """Take note of how long it has not got on.

        Args:
            time: The time [s].
            look: Returns what is looked at.
            status: Returns what is told.
        """
        before, self.time = self.time, time
        is_early = any(before < each <= time for each in _LOOKS)
        if not time:
            self._early, self._newest, self._pairs = [], None, ()
        elif is_early or time // _AGAIN > before // _AGAIN:
            # What is in the way is worked out when it is asked for.
            self._pairs = None
            if is_early:
                self._early.append(look())
            else:
                self._newest = look()
        if self._tell is not None and before < self._after <= time:
            try:
                self._tell(status())
            except Exception as error:
                warn(f"on_blocked: {type(error).__name__}: {error}", stacklevel=4)

    @property
    def pairs(self) -> tuple[int, ...]:
        """Numbers of the pairs that are in the way of the arm."""
        if self._pairs is None:
            pairs = np.zeros(0, dtype=np.intp)
            for look in self._early:
                # One that is coming to rest swerves.
                pairs = np.union1d(look.pairs(pairs, _SWERVES), look.step.causes.pairs)
            if self._newest is not None:
                pairs = self._newest.pairs(pairs, _NEAR)
            self._pairs = tuple(pairs.tolist())
        return self._pairs

"""For how long an arm has not got on, what is in its way, and who is told."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any, NamedTuple
from warnings import warn

import numpy as np

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
        # Looks, and whether it is as yet coming to rest; those that are not evaluated yet.
        self._looks: deque[tuple[Look, bool]] = deque(maxlen=len(_LOOKS))
        self._pairs: tuple[int, ...] = ()

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
            self._looks.clear()
            self._pairs = ()
        elif is_early or time // _AGAIN > before // _AGAIN:
            # What is in the way is worked out when it is asked for.
            self._looks.append((look(), is_early))
        if self._tell is not None and before < self._after <= time:
            try:
                self._tell(status())
            except Exception as error:
                warn(f"on_blocked: {type(error).__name__}: {error}", stacklevel=4)

    @property
    def pairs(self) -> tuple[int, ...]:
        """Numbers of the pairs that are in the way of the arm."""
        while self._looks:
            (step, wanted), is_early = self._looks.popleft()
            avoidance = step.reading.law.avoidance
            # One that is coming to rest swerves.
            near = (_SWERVES if is_early else _NEAR) * avoidance.distance
            pairs = step.pairs_in_the_way(wanted, self._pairs, near)
            if is_early:
                pairs = np.union1d(pairs, step.causes.pairs)
            self._pairs = tuple(pairs.tolist())
        return self._pairs

"""The rate at which slices of simulated time follow each other: that of real time, or less."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

#: How far the simulation may be behind before the rest is given up [s].
_BEHIND = 0.1
# Time over which the rate is measured [s].
_WINDOW = 2.0


class Pace:
    """When the next slice is due, and how fast they have followed each other.

    A simulation that is behind by more than a tenth of a second, after a stall or because it is too
    slow, does not catch up: it goes on at the rate of real time from where it is.

    Args:
        slice_time: Simulated time of a slice [s].
        clock: Returns the time [s].
    """

    def __init__(self, slice_time: float, clock: Callable[[], float]) -> None:
        self._slice, self._clock = slice_time, clock
        self.begin()

    def begin(self) -> None:
        """Begin anew, as after a pause; nothing is behind."""
        self._due = self._clock()
        self._ends: deque[float] = deque([self._due])

    def wait(self) -> float:
        """Return the time until the next slice is due [s]; 0 if it is."""
        return max(0.0, self._due - self._clock())

    def passed(self) -> None:
        """Note that a slice has been simulated."""
        now = self._clock()
        self._due = max(self._due + self._slice, now - _BEHIND)
        self._ends.append(now)
        while now - self._ends[0] > _WINDOW and len(self._ends) > 2:
            self._ends.popleft()

    @property
    def rate(self) -> float:
        """Simulated time over real time, of the last two seconds."""
        since = self._clock() - self._ends[0]
        return (len(self._ends) - 1) * self._slice / since if since > 0.0 else 1.0

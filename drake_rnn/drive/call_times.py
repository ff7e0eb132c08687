"""Whether calls of `command` take longer than their period, or are too late: counted, told once."""

from __future__ import annotations

import time
from collections.abc import Callable
from warnings import warn

# Calls in real time that outlast their period before it is told, and their share of all calls.
_FEW, _SHARE = 10, 0.05
# Calls that count for that, at most: after a day without any, it is told as soon.
_RECENT = 1000
# Calls in simulated time before it is told that most of them take this many periods.
_MANY, _PERIODS = 200, 2.0
# Calls after which callers whose time agrees with the machine's by this share tell real time, if it
# does at each call that takes too long.
_FIRST, _AGREES = 200, 0.01


class CallTimes:
    """How long calls take against their period.

    In real time a late command is told soon. A loop that simulates has time; there it is told only
    where most calls take longer than two periods, so that no robot could be commanded so.

    Args:
        owner: What is called, for the message.
        period: Time between two calls [s].
        way: Returns how the steps of the law are made, in a line.

    Attributes:
        overruns: Number of calls that took longer than the period.
    """

    def __init__(self, owner: str, period: float, way: Callable[[], str]) -> None:
        self._owner, self._period, self._way = owner, period, way
        self.overruns = 0
        self._calls = self._slow = 0
        self._worst, self._is_told = 0.0, False
        # Commands that were too late for anybody; and of the last calls those that took too long,
        # or were too late.
        self._withdrawn, self._recent, self._recent_slow = 0, 0.0, 0.0
        # When the first call began, on the machine's clock and on the caller's.
        self._first: tuple[float, float] | None = None
        self._is_simulated = False

    def note(
        self, begin: float, t: float | None, *, is_real: bool = False, is_late: bool = False
    ) -> None:
        """Note a call that ends now.

        Args:
            begin: When it began, by `time.perf_counter` [s].
            t: The time that it was told [s]; None for none.
            is_real: Whether that is known to be real time.
            is_late: Whether its command was too late for anybody to follow.
        """
        took = time.perf_counter() - begin
        self._calls += 1
        self._recent += 1
        if self._recent > _RECENT:
            self._recent, self._recent_slow = 0.5 * self._recent, 0.5 * self._recent_slow
        if self._first is None and t is not None:
            self._first = begin, t
        is_slow = took > self._period
        if not is_slow and not is_late:
            return
        self.overruns += is_slow
        self._withdrawn += is_late
        self._slow += took > _PERIODS * self._period
        self._worst = max(self._worst, took)
        if not self._is_told and t is not None:
            self._recent_slow += is_real or self._may_be_real(begin, t)
            self._tell()

    def _may_be_real(self, begin: float, t: float) -> bool:
        """Return whether the time that callers tell has always gone as the machine's does."""
        if self._first is None or self._calls < _FIRST or self._is_simulated:
            return False
        machine, told = begin - self._first[0], t - self._first[1]
        self._is_simulated = abs(told - machine) > _AGREES * machine + self._period
        return not self._is_simulated

    def _tell(self) -> None:
        """Tell of overruns, if they matter."""
        most = max(_FEW, _SHARE * self._recent)
        is_late = not self._is_simulated and self._recent_slow >= most
        if not is_late and not (self._calls >= _MANY and 2 * self._slow > self._calls):
            return
        self._is_told = True
        way = self._way()
        advice = "fewer obstacles or a longer period would help"
        if way == "NumPy":
            advice = f"compiled=None or True would help: steps in C; else {advice}"
        elif way.startswith("NumPy until"):
            advice = "it is over once C is built"
        stops = ""
        if self._withdrawn:
            stops = (
                f", and {self._withdrawn} commands came too late, so that the arm stops on its way"
            )
        warn(
            f"{self._owner}: {self.overruns} of {self._calls} calls of command took longer than "
            f"the period of {self._period:g} s, the longest {self._worst:.2g} s{stops}; steps are "
            f"made by: {way}; {advice}",
            stacklevel=5,
        )

"""Whether calls of `command` take longer than their period, counted and told once."""

from __future__ import annotations

import time
from collections.abc import Callable
from warnings import warn

# Calls in real time that outlast their period before it is told, and their share of all calls.
_FEW, _SHARE = 3, 0.01
# Calls in simulated time before it is told that most of them take this many periods.
_MANY, _PERIODS = 200, 2.0
# By how much the time that callers tell may go otherwise than the machine's, in real time.
_DRIFT = 0.05


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
        self._calls = self._late = self._slow = 0
        self._worst, self._is_told = 0.0, False
        # When the last call began on both clocks, if it took too long.
        self._before: tuple[float, float] | None = None

    def note(self, begin: float, t: float | None, *, is_real: bool = False) -> None:
        """Note a call that ends now.

        Args:
            begin: When it began, by `time.perf_counter` [s].
            t: The time that it was told [s]; None for none.
            is_real: Whether that is known to be real time.
        """
        took = time.perf_counter() - begin
        self._calls += 1
        if self._before is not None:
            machine, told = begin - self._before[0], 0.0 if t is None else t - self._before[1]
            self._late += abs(told - machine) < _DRIFT * machine
            self._before = None
            self._tell()
        if took <= self._period:
            return
        self.overruns += 1
        self._slow += took > _PERIODS * self._period
        self._worst = max(self._worst, took)
        if is_real:
            self._late += 1
        elif t is not None:
            self._before = begin, t
        self._tell()

    def _tell(self) -> None:
        is_late = self._late >= max(_FEW, _SHARE * self._calls)
        # Of calls that are told the time: others need not have to do with any.
        is_slow = self._before is not None and self._calls >= _MANY
        is_slow = is_slow and 2 * self._slow > self._calls
        if self._is_told or not (is_late or is_slow):
            return
        self._is_told = True
        way = self._way()
        advice = "fewer obstacles or a longer period would help"
        if way == "NumPy":
            advice = f"compiled=None or True would help: steps in C; else {advice}"
        elif way.startswith("NumPy until"):
            advice = "it is over once C is built"
        warn(
            f"{self._owner}: {self.overruns} of {self._calls} calls of command took longer than "
            f"the period of {self._period:g} s, the longest {self._worst:.2g} s; steps are made "
            f"by: {way}; {advice}",
            stacklevel=5,
        )

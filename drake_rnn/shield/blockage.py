"""For how long an arm has not got on, what was in its way as it came to that, and who is told."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from warnings import warn

import numpy as np

from ..laws.guard import LastStep

# Times of a blockage at which it is looked at what is in the way [s].
_LOOKS = (0.05, 0.15, 0.25)


class Blockage:
    """For how long an arm has not got on.

    Args:
        after: Time after which it is told [s].
        tell: Called with the status, once a blockage; None to tell nobody. What it raises becomes a
            warning.

    Attributes:
        time: For how long it has not got on [s].
    """

    def __init__(self, after: float, tell: Callable[[Any], object] | None) -> None:
        self.time, self._after, self._tell = 0.0, after, tell
        self._steps: list[LastStep] = []
        self._pairs: tuple[int, ...] | None = None

    def note(
        self, time: float, last_step: Callable[[], LastStep], status: Callable[[], object]
    ) -> None:
        """Take note of how long it has not got on.

        Args:
            time: The time [s].
            last_step: Returns the last step.
            status: Returns what is told.
        """
        before, self.time = self.time, time
        if not time:
            self._steps, self._pairs = [], None
        elif any(before < look <= time for look in _LOOKS):
            # What is in the way is worked out when it is asked for.
            self._steps.append(last_step())
            self._pairs = None
        if self._tell is not None and before < self._after <= time:
            try:
                self._tell(status())
            except Exception as error:
                warn(f"on_blocked: {type(error).__name__}: {error}", stacklevel=4)

    @property
    def pairs(self) -> tuple[int, ...]:
        """Numbers of the pairs that were in the way as the arm came to be blocked."""
        if self._pairs is None:
            pairs = [step.causes.pairs for step in self._steps]
            self._pairs = tuple(np.unique(np.concatenate(pairs)).tolist()) if pairs else ()
        return self._pairs

"""A gap in the contact of a tool with a surface."""

from __future__ import annotations

import numpy as np

from ...arrays.namespace import AnyArray
from ..motion import Motion
from .group import Found

#: A gap in the contact that is longer than this counts as its loss [s].
LOST = 0.05


class GapMetrics:
    """When the contact was lost, after it had been made.

    Attributes:
        force_seen: Whether there was any force along the normal; None without a surface.
    """

    force_seen: bool | None = None

    def __init__(self) -> None:
        self._since: AnyArray = np.nan
        self._last: AnyArray = -np.inf

    def add(self, motion: Motion) -> None:
        """Add the next part of the run."""
        if (pressing := motion.pressing) is None:
            return
        touching = pressing.touching
        self.force_seen = bool(self.force_seen) or bool(pressing.force.any())
        time = motion.time.reshape(-1, *(1,) * (touching.ndim - 1))
        # Time of the last contact.
        last = np.maximum.accumulate(np.where(touching, time, -np.inf))
        last = np.maximum(last, self._last)
        lost = (time - last > LOST) & np.isfinite(last)
        if lost.any():
            first = np.take_along_axis(last, np.argmax(lost, axis=0)[None], axis=0)[0]
            new = np.isnan(self._since) & lost.any(axis=0)
            self._since = np.where(new, first, self._since)
        self._last = last[-1]

    def found(self) -> Found:
        """Return the metric, by name."""
        return {"contact_lost_time_s": self._since}

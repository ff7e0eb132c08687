"""The force with which a tool presses, and its contact."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...inputs.fields import Array
from ..motion import Motion, Pressing
from ..running import Largest, Mean
from .group import Found

#: A gap in the contact that is longer than this counts as its loss [s].
LOST = 0.05

#: Share of the desired force at which it has risen.
RISEN = 0.95


class ContactMetrics:
    """Force errors in the window, and when force and contact came and went.

    Args:
        window: Start and end of the window [s]; None for the whole run.

    Attributes:
        force_seen: Whether there was any force along the normal; None without a surface.
    """

    force_seen: bool | None = None

    def __init__(self, window: tuple[float, float] | None) -> None:
        self._window = window
        self._mean, self._square, self._largest = Mean(), Mean(), Largest()
        self._lateral, self._lost = Largest(), Mean()
        self._rise = _Rise()
        self._gap = _Gap()

    def add(self, motion: Motion) -> None:
        """Add the next part of the run."""
        if (pressing := motion.pressing) is None:
            return
        touching = pressing.force > 0.0
        self.force_seen = bool(self.force_seen) or bool(pressing.force.any())
        self._rise.add(motion.time, pressing)
        self._gap.add(motion.time, touching)
        if (within := motion.within(self._window)).any():
            error = (pressing.force - pressing.desired)[within]
            lateral = motion.aside(motion.p_WE - motion.p_WE_desired)[within]
            self._mean.add(error)
            self._square.add(error**2)
            self._largest.add(np.abs(error))
            self._lateral.add(np.linalg.norm(lateral, axis=1))
            self._lost.add(~touching[within])

    def found(self) -> Found:
        """Return the metrics, by name; none without a surface."""
        if self.force_seen is None:
            return {}
        return {
            "normal_force_peak_N": self._rise.peak,
            "force_rise_time_s": self._rise.time,
            "force_error_mean_N": self._mean.value,
            "force_error_rms_N": self._square.root,
            "force_error_max_N": self._largest.value,
            "lateral_error_max_m": self._lateral.value,
            "contact_lost_fraction": self._lost.value,
            "contact_lost_time_s": self._gap.since,
        }


class _Rise:
    """When a force first reached what is desired in the end.

    That is not known before the end: every step at which the force is larger than ever is kept.
    They are few, unless the force rises slowly all the time.
    """

    def __init__(self) -> None:
        self._peak = Largest()
        self._records: list[tuple[Array, Array]] = []
        self._enough = 0.0

    def add(self, time: Array, pressing: Pressing) -> None:
        force = pressing.force
        before = np.concatenate(([-np.inf if self.peak is None else self.peak], force))
        record = force > np.maximum.accumulate(before)[:-1]
        self._records.append((time[record], force[record]))
        self._peak.add(force)
        self._enough = RISEN * pressing.desired[-1]

    @property
    def peak(self) -> float | None:
        return self._peak.value

    @property
    def time(self) -> float | None:
        for time, force in self._records:
            if (risen := force >= self._enough).any():
                return float(time[int(np.argmax(risen))])
        return None


class _Gap:
    """When the contact was lost, after it had been made."""

    since: float | None = None

    def __init__(self) -> None:
        self._last = -np.inf

    def add(self, time: Array, touching: NDArray[np.bool_]) -> None:
        # Time of the last contact.
        last = np.maximum.accumulate(np.where(touching, time, -np.inf))
        last = np.maximum(last, self._last)
        lost = (time - last > LOST) & np.isfinite(last)
        if self.since is None and lost.any():
            self.since = float(last[int(np.argmax(lost))])
        self._last = float(last[-1])

"""The forces with which many robots press, and their contact."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..experiment import Experiment
from ..inputs.fields import Array
from ..measures.groups.contact import LOST, RISEN
from .running import Largest, Mean
from .schedule import Schedule
from .step import Found, Step, lengths


class ContactMetrics:
    """Force errors in the window, and when force and contact came and went.

    Args:
        experiments: What is run, all with a surface or none.
        schedule: Its steps.
    """

    def __init__(self, experiments: Sequence[Experiment], schedule: Schedule) -> None:
        count, end = len(experiments), float(schedule.times[-1])
        self._within = schedule.within
        contacts = [each.contact for each in experiments if each.contact is not None]
        self._none = not contacts
        self._enough = RISEN * np.array([contact.force.at(end) for contact in contacts])
        self._peak, self._largest, self._lateral = Largest(count), Largest(count), Largest(count)
        self._mean, self._square, self._lost = Mean(count), Mean(count), Mean(count)
        self._risen, self._since = np.full(count, np.nan), np.full(count, np.nan)
        self._touched = np.full(count, -np.inf)

    def add(self, step: Step) -> None:
        """Add the next step."""
        if (pressed := step.pressed) is None:
            return
        t, force = step.time, pressed.force
        touching = force > 0.0
        self._peak.add(force)
        self._risen = _first(self._risen, force >= self._enough, t)
        self._touched = np.where(touching, t, self._touched)
        lost = (t - self._touched > LOST) & np.isfinite(self._touched)
        self._since = _first(self._since, lost, self._touched)
        if self._within[step.number]:
            error = force - pressed.desired
            self._mean.add(error)
            self._square.add(error * error)
            self._largest.add(np.abs(error))
            self._lateral.add(lengths(step.aside(step.p_WE - step.p_WE_desired)))
            self._lost.add((~touching).astype(float))

    def found(self) -> Found:
        """Return the metrics, by name; none without a surface."""
        if self._none:
            return {}
        return {
            "normal_force_peak_N": self._peak.value,
            "force_rise_time_s": self._risen,
            "force_error_mean_N": self._mean.value,
            "force_error_rms_N": self._square.root,
            "force_error_max_N": self._largest.value,
            "lateral_error_max_m": self._lateral.value,
            "contact_lost_fraction": self._lost.value,
            "contact_lost_time_s": self._since,
        }


def _first(known: Array, now: NDArray[np.bool_], time: Array | float) -> Array:
    """Return times at which something first happened, shape (robots,), with those of now [s]."""
    return np.where(np.isnan(known) & now, time, known)

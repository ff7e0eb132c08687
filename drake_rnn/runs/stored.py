"""The series of a run: samples of its steps, chosen from its parts as they come."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import ceil, inf
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from ..errors import InvalidInputError
from ..experiment import Experiment
from ..inputs.complaints import short
from ..inputs.fields import Array

#: What of the series is stored: a sample for each ``log_period``; fewer, at most some 2000; or the
#: last step alone.
Series = Literal["full", "thin", "none"]

# Number of samples of thin series.
_FEW = 2000

# Largest number of samples to reserve room for at first.
_MOST_ROOM = 2**20


def stored_period(experiment: Experiment, series: Series) -> float:
    """Return the time between two stored samples [s]; infinite if the last step alone is stored.

    The period of thin samples is a multiple of the document's ``log_period``.

    Args:
        experiment: The experiment.
        series: What of the series is stored.

    Raises:
        InvalidInputError: If ``series`` is none of these.
    """
    if not isinstance(series, str) or series not in get_args(Series):
        may = ", ".join(get_args(Series))
        raise InvalidInputError(f"series: may be {may}, not {short(series)}")
    if series == "none":
        return inf
    document = experiment.document
    every = ceil(document.duration / document.log_period / _FEW * (1.0 - 1e-9))
    return document.log_period * (every if series == "thin" else 1)


def thinned(experiment: Experiment, period: float) -> Experiment:
    """Return an experiment whose ``log_period`` is the given period, if that is finite.

    Figures and the folder of the result then tell the actual period of the series.
    """
    document = experiment.document
    if period in (document.log_period, inf):
        return experiment
    return replace(experiment, document=replace(document, log_period=period))


class StoredSeries:
    """The stored samples of a run.

    Args:
        period: Time between two samples [s]; infinite to store the last step alone.
        duration: Duration of the run [s].
    """

    def __init__(self, period: float, duration: float) -> None:
        self._period = period
        # Number of the last step's period, and time of the last sample.
        self._number, self._time = 0.0 if period == inf else -1.0, -inf
        # For the first sample and for the last.
        self._room = min(ceil(duration / period) + 2, _MOST_ROOM)
        self._kept: dict[str, _Column] = {}
        self._peaks: dict[str, float] = {}

    def add(
        self,
        time: Array,
        series: Mapping[str, Array],
        changes: Mapping[str, Array],
        *,
        last: bool = False,
    ) -> None:
        """Add a part of the run, which begins with the last step of the part before.

        Args:
            time: Time of each step, shape (k,) [s].
            series: Values at every step, each with k rows, by name.
            changes: Values between consecutive steps, each with k - 1 rows. The largest magnitude
                since the last sample is stored as ``*_peak``, in addition to the value.
            last: Whether this part ends the run.
        """
        at = self._chosen(time, last=last)
        self._keep("time", time[at])
        for name, values in series.items():
            self._keep(name, values[at])
        for name, values in changes.items():
            # Value of the step that ends at each sample; no step ends at the first one.
            self._keep(name, np.concatenate((np.zeros((1, values.shape[1])), values))[at])
            self._keep(f"{name}_peak", self._peaks_at(name, np.abs(values), at))

    def taken(self) -> dict[str, Array]:
        """Return the series, ``time`` included, by name."""
        return {name: column.values for name, column in self._kept.items()}

    def _chosen(self, time: Array, *, last: bool) -> NDArray[np.intp]:
        """Return the numbers of the steps to store, each period's first and the last, (j,)."""
        number = np.floor(time / self._period + 1e-6)
        kept = np.diff(number, prepend=self._number) != 0
        if kept.any():
            self._time = time[kept][-1]
        # A last step only a rounding error after a stored one is not stored again.
        since = time[-1] - self._time if last and time.size else 0.0
        if since == inf or since > 1e-6 * self._period:
            kept[-1] = True
        if time.size:
            self._number = number[-1]
        return np.flatnonzero(kept)

    def _keep(self, name: str, values: Array) -> None:
        if name not in self._kept:
            self._kept[name] = _Column(self._room, values)
        self._kept[name].add(values)

    def _peaks_at(self, name: str, values: Array, at: NDArray[np.intp]) -> Array:
        """Return the largest entry of the rows since the sample before, shape (len(at),)."""
        peaks, begin, peak = np.zeros(at.size), 0, self._peaks.get(name, 0.0)
        for k, end in enumerate(at):
            peaks[k] = values[begin:end].max(initial=peak)
            begin, peak = end, 0.0
        self._peaks[name] = values[begin:].max(initial=peak)
        return peaks


class _Column:
    """The samples of one series in a single array, since joining parts would double the memory.

    Args:
        room: Number of samples to reserve room for; the system assigns memory when it is written.
        like: Samples of the same shape and kind.
    """

    def __init__(self, room: int, like: Array) -> None:
        self._values = np.empty((room, *like.shape[1:]), like.dtype)
        self._count = 0

    def add(self, values: Array) -> None:
        """Add samples."""
        begin, self._count = self._count, self._count + len(values)
        if self._count > len(self._values):
            kept = self._values[:begin]
            self._values = np.empty((2 * self._count, *kept.shape[1:]), kept.dtype)
            self._values[:begin] = kept
        self._values[begin : self._count] = values

    @property
    def values(self) -> Array:
        """All samples, shape (k, ...)."""
        return self._values[: self._count]

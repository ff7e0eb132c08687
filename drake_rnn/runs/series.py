"""The series of a run: samples of its steps, chosen from its parts as they come.

- The options of a run, of which one is what of its series is stored.
- The series of a run as columns: one for each number, named with its part and its unit.
- Steps of two arms that are recorded together.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import ceil, inf
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import StrictBool

from ..errors import InvalidInputError
from ..experiment import Experiment
from ..features.feature import SECOND_PREFIX
from ..features.pairs import Host
from ..inputs.fields import Array
from ..inputs.messages import nearest, short
from ..inputs.packages import import_extra
from ..laws.law import Layout
from ..measures import UNITS, Steps
from ..robot.arm import Arm

#: What of the series is stored: a sample for each ``log_period``; fewer, at most some 2000; or the
#: last step alone.
Series = Literal["full", "thin", "none"]


@dataclass(frozen=True)
class RunOptions:
    """How a run is made, beside what its document says.

    They go from the command line or a call to the diagram as one object; its checkpoint and its
    result have them too.

    Attributes:
        anyway: Whether it may take as many steps as it likes.
        series: What of the series is stored.
        compiled: Whether the steps of the law are compiled.
    """

    anyway: StrictBool = False
    series: Series = "full"
    compiled: StrictBool = False

    @property
    def host(self) -> Host:
        """Where the experiment runs, as the table of pairs names it."""
        return "compiled law" if self.compiled else "simulate"

    @property
    def words(self) -> str:
        """What a reader of the numbers should know of them; empty for the usual run."""
        return "with compiled steps" if self.compiled else ""


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


def thin(experiment: Experiment, period: float) -> Experiment:
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
        at = self._choose(time, last=last)
        self._keep("time", time[at])
        for name, values in series.items():
            self._keep(name, values[at])
        for name, values in changes.items():
            # Value of the step that ends at each sample; no step ends at the first one.
            self._keep(name, np.concatenate((np.zeros((1, values.shape[1])), values))[at])
            self._keep(f"{name}_peak", self._peaks_at(name, np.abs(values), at))

    def take(self) -> dict[str, Array]:
        """Return the series, ``time`` included, by name."""
        return {name: column.values for name, column in self._kept.items()}

    def _choose(self, time: Array, *, last: bool) -> NDArray[np.intp]:
        """Return the numbers of the steps to store, each period's first and the last, (j,)."""
        number = np.floor(time / self._period + 1e-6)
        is_new = np.diff(number, prepend=self._number) != 0
        if is_new.any():
            self._time = time[is_new][-1]
        # A last step only a rounding error after a stored one is not stored again.
        since = time[-1] - self._time if last and time.size else 0.0
        if since == inf or since > 1e-6 * self._period:
            is_new[-1] = True
        if time.size:
            self._number = number[-1]
        return np.flatnonzero(is_new)

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
            before = self._values[:begin]
            self._values = np.empty((2 * self._count, *before.shape[1:]), before.dtype)
            self._values[:begin] = before
        self._values[begin : self._count] = values

    @property
    def values(self) -> Array:
        """All samples, shape (k, ...)."""
        return self._values[: self._count]


#: Name of the column of times.
TIME = "time_s"
# Units whose series have a number for each joint.
_OF_JOINTS = ("rad", "rad/s", "rad/s^2", "N m")
_AXES = ("x", "y", "z")


def columns_of(
    time: Array, series: Mapping[str, Array], arm: Arm, names: Iterable[str] | None = None
) -> dict[str, Array]:
    """Return series as columns: their name, the joint, axis or indices from 1, and the unit.

    ``position`` of a Panda becomes ``position_panda_joint1_rad`` to ``position_panda_joint7_rad``,
    ``p_WE`` becomes ``p_WE_x_m`` and two more, and entry (1, 2) of ``J`` is ``J_1_2_m``. Units are
    written as those of metrics: ``rad_s2`` is rad/s^2.

    Args:
        time: Times, shape (k,) [s].
        series: Arrays of k rows, by name.
        arm: The arm that they are of.
        names: The series; all of them if None.

    Returns:
        Arrays of shape (k,) by name, the times first.

    Raises:
        InvalidInputError: If there is no series of that name.
    """
    series_columns = {TIME: time}
    for name in require_series(series, names):
        values, unit = series[name], UNITS.get(name, "")
        shape = values.shape[1:]
        units = [unit] * int(np.prod(shape))
        parts = _parts(shape, unit, arm.joints)
        if parts is arm.joints:
            # A joint that slides has metres for radians.
            units = [unit.replace("rad", own) for own in arm.units]
        columns = values.reshape(len(values), int(np.prod(shape))).T
        for part, own, column in zip(parts, units, columns, strict=True):
            series_columns["_".join(filter(None, (name, part, _spelt(own))))] = column
    return series_columns


def require_series(series: Mapping[str, Array], names: Iterable[str] | None) -> list[str]:
    """Return the names of series that are asked for; of all of them if that is None.

    Raises:
        InvalidInputError: If there is no series of that name.
    """
    chosen_names = list(series) if names is None else list(names)
    for name in chosen_names:
        if name not in series:
            hint = nearest(name, list(series))
            raise InvalidInputError(f"series: no {name!r} in this result; {hint}")
    return chosen_names


def frame_of(columns: Mapping[str, Array]) -> Any:
    """Return columns as a pandas frame, with the times as its index.

    Raises:
        InvalidInputError: If pandas is not installed.
    """
    (pandas,) = import_extra("frame", "pandas", "pandas")
    return pandas.DataFrame(dict(columns)).set_index(TIME)


def _parts(shape: tuple[int, ...], unit: str, joints: Sequence[str]) -> Sequence[str]:
    """Return the names of a series' parts."""
    if not shape:
        return ("",)
    if shape == (len(joints),) and unit in _OF_JOINTS:
        return joints
    if shape == (len(_AXES),) and unit:
        return _AXES
    indices = product(*(range(1, size + 1) for size in shape))
    return tuple("_".join(map(str, each)) for each in indices)


def _spelt(unit: str) -> str:
    return unit.replace("/", "_").replace("^", "").replace(" ", "")


#: What the names of a second arm's systems and recorded ports begin with.
PREFIX = SECOND_PREFIX
#: Name of the folder with a second arm's result, in that of the run.
SECOND = "second"


def of_second(steps: Steps) -> Steps:
    """Return steps as the second arm has them: its own ports first, the first arm's as second."""
    parts = steps.layout.parts
    layout = Layout(**{_swap(name): shape for name, (_, shape) in parts.items()})
    return replace(steps, layout=layout)


def _swap(name: str) -> str:
    return name.removeprefix(PREFIX) if name.startswith(PREFIX) else PREFIX + name

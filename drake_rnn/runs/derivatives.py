"""Derivatives of a run's motion up to the fifth, from its stored series."""

from __future__ import annotations

import numpy as np

from ..inputs.fields import Array
from ..measures.groups.higher import difference_time
from ..robot.limits import DERIVATIVE_UNITS
from .result import Result

#: Times, shape (k,) [s], and values of all joints, shape (k, n).
Signal = tuple[Array, Array]


def derivatives_of_motion(result: Result) -> list[Signal]:
    """Return positions, velocities, and the second to fifth derivative.

    The latter are differences of the velocity over some 10 ms, or over the distance of the samples
    if that is larger, and belong to the middle of that interval. Where the period of the law does
    not divide that of the series, samples are unevenly far apart, so each difference is taken by
    its own time.
    """
    position, velocity = result.series["position"], result.series["velocity"]
    found = [(result.time, position), (result.time, velocity)]
    document = result.experiment.document
    step = max(difference_time(document.period), document.log_period)
    wanted = np.arange(result.time[0], result.time[-1] + 1e-9, step)
    at = np.minimum(np.searchsorted(result.time, wanted - 1e-9), result.time.size - 1)
    at = np.unique(at)
    time, values = result.time[at], velocity[at]
    for _ in range(1, len(DERIVATIVE_UNITS)):
        # A run that diverged may contain infinite values.
        with np.errstate(invalid="ignore", over="ignore"):
            values = np.diff(values, axis=0) / np.diff(time)[:, None]
        time = (time[1:] + time[:-1]) / 2.0
        found.append((time, values))
    return found

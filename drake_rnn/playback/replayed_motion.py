"""What is replayed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import InvalidInputError
from ..inputs.fields import Array
from ..runs.result import Result

# A path that is shorter than this cannot be seen [m].
_STILL = 1e-6


@dataclass(frozen=True)
class ReplayedMotion:
    """What is replayed, in the world frame: k samples and one lap of the path."""

    result: Result
    time: Array
    position: Array
    traced: Array
    desired: Array
    lap: Array

    @property
    def rests(self) -> bool:
        """Whether the path is a point that stays."""
        return bool(np.ptp(self.lap, axis=0).max() < _STILL)

    def at(self, time: Array, values: Array) -> Array:
        """Linearly interpolated columns of ``values``, shape (k, m), at other times, shape (f,)."""
        return np.column_stack([np.interp(time, self.time, column) for column in values.T])


def replayed_motion(result: Result) -> ReplayedMotion:
    """A run's motion until its last finite posture.

    Raises:
        InvalidInputError: If there is none.
    """
    setup = result.experiment
    # A run that diverged is shown for as long as it had a posture.
    finite = np.isfinite(result.series["position"]).all(axis=1)
    count = finite.size if finite.all() else int(np.argmin(finite))
    if count == 0:
        raise InvalidInputError("playback: the run holds no posture")
    time = result.time[:count] - result.time[0]
    position = result.series["position"][:count]
    kinematics = setup.arm.kinematics()
    desired = np.tile(setup.path.start_point(setup.p_WE_start), (count, 1))
    desired[:, list(result.experiment.task.axes)] = result.series["p_WE_desired"][:count]
    return ReplayedMotion(
        result=result,
        time=time,
        position=position,
        traced=np.array([kinematics.p_WE(q) for q in position]),
        desired=desired,
        lap=desired[time <= (setup.path.period + setup.path_delay) * (1.0 + 1e-9)],
    )

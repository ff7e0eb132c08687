"""The joints of a motion, as a page lists them: positions, velocities and their limits."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..inputs.fields import Array
from .packing import packed
from .replay import ReplayedMotion
from .shown_curves import MOST, nearest


def joints_of(motion: ReplayedMotion, frames: Array) -> dict[str, Any]:
    """Return the joints as the page reads them.

    Args:
        motion: The motion.
        frames: Times of the frames, shape (f,) [s]; of a long run, the samples there are held.
    """
    experiment, time = motion.result.experiment, motion.time
    limits, arm = experiment.limits, experiment.arm
    at = slice(None) if time.size <= MOST else nearest(time, frames)
    speeds = limits.bounds["velocity"]
    velocity = motion.result.series.get("velocity")
    return {
        "names": list(arm.joints),
        "units": list(arm.units),
        "lower": packed(limits.position_lower),
        "upper": packed(limits.position_upper),
        "speeds": packed(np.full(arm.n, np.inf) if speeds is None else speeds),
        "time": packed(time[at]),
        "position": packed(motion.position[at]),
        "velocity": "" if velocity is None else packed(velocity[: time.size][at]),
    }

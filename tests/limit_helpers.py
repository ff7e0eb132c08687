"""Helpers of tests that look at limits."""

import numpy as np

from drake_rnn import JointLimits

#: Limits on all derivatives of five joints that differ from each other.
OF_FIVE_JOINTS = JointLimits(
    position_lower=-np.array([1.0, 0.5, 1.0, 0.2, 2.0]),
    position_upper=np.array([1.0, 0.6, 0.3, 1.0, 2.0]),
    velocity=np.array([0.5, 0.3, 1.0, 0.5, 0.7]),
    acceleration=np.array([1.0, 2.0, 1.5, 3.0, 1.0]),
    jerk=np.full(5, 10.0),
    snap=np.full(5, 100.0),
    crackle=np.full(5, 1000.0),
)


def broken(metrics, beyond=0.0):
    """Return the metrics of the limits that a run exceeds by more than ``beyond``.

    Not of the jerk between held velocities, which only a law that bounds the jerk keeps.
    """
    names = {name for name in metrics if "_violation_max_" in name and name[:5] != "held_"}
    taken = {name: metrics[name] for name in names}
    assert taken
    return {name: value for name, value in taken.items() if value > beyond}

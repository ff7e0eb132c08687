"""The fastest stop in plain numbers, against the same in arrays."""

import numpy as np
import pytest

from drake_rnn.robot.jerk_stop import course
from drake_rnn.robot.joint_stop import gaining, time_gain


def states(seed, count):
    """Velocities, accelerations and bounds; some at rest, at a bound, or in whole steps."""
    rng = np.random.default_rng(seed)
    most, jerk = rng.uniform(0.5, 5.0, count), 10.0 ** rng.uniform(0.0, 4.0, count)
    v = rng.choice([-1.0, 0.0, 1.0, *rng.uniform(-1.0, 1.0, 7)], count)
    a = most * rng.choice([-1.0, 0.0, 1.0, *rng.uniform(-1.0, 1.0, 7)], count)
    step = 1e-3 * jerk
    return v, np.where(rng.random(count) < 0.2, np.trunc(a / step) * step, a), most, jerk


@pytest.mark.parametrize("seed", range(3))
def test_it_has_the_bits_of_arrays_whatever_the_joints_do(seed):
    given = states(seed, 7 * 300)
    many = course(*given, 1e-3)
    turned, ended = many.ends
    for k in range(0, len(given[0]), 7):
        joints = slice(k, k + 7)
        few = course(*(part[joints] for part in given), 1e-3)
        for name in ("mirror", "v", "x", "steps", "longest", "last", "first", "samples"):
            assert (getattr(few, name) == getattr(many, name)[joints]).all(), name
        assert (few.ends[0] == turned[joints]).all()
        assert (few.ends[1] == ended[joints]).all()


def test_what_is_gained_is_what_gains():
    """1e-12: rounding."""
    for y in np.geomspace(1e-6, 1e6, 50):
        assert time_gain(gaining(y)) == pytest.approx(y, rel=1e-12)


def test_what_is_no_number_does_not_become_one():
    bounds = np.array([3.0]), np.array([60.0]), 1e-3
    for v, a in ((np.nan, 0.0), (0.1, np.nan), (np.inf, 0.0)):
        _, ended = course(np.array([v]), np.array([a]), *bounds).ends
        assert not np.isfinite(ended).any()

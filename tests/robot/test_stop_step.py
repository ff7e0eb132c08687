"""A step of a stop in plain numbers is that of the arrays."""

import numpy as np
import pytest

from drake_rnn.robot.jerk_stop import HeldStop, stop
from drake_rnn.robot.joint_stop import stop_step
from row_helpers import each

H, MOST, JERK = 1e-3, np.full(7, 9.999), np.full(7, 4999.9)


@each("seed", range(20))
def test_it_is_the_first_step_of_the_fastest_stop(seed):
    rng = np.random.default_rng(seed)
    v, a = rng.uniform(-2.0, 2.0, 7), rng.uniform(-MOST, MOST)
    speeds, changes = stop_step(v.tolist(), a.tolist(), MOST.tolist(), JERK.tolist(), H)
    first = stop(np.zeros(7), v, a, MOST, JERK, H).first
    np.testing.assert_array_equal(changes, first)
    np.testing.assert_array_equal(speeds, v + H * first)
    speeds, changes = stop_step(v.tolist(), a.tolist(), MOST.tolist(), None, H)
    np.testing.assert_array_equal(speeds, HeldStop(MOST, H).after(v))
    np.testing.assert_allclose(v + H * np.array(changes), speeds, atol=1e-15)


def test_it_ends_at_rest():
    v, a = [0.7, -1.3], [5.0, 0.0]
    steps = 0
    while any(v) or any(a):
        v, a = stop_step(v, a, [10.0, 10.0], [5000.0, 5000.0], H)
        steps += 1
        assert steps < 400
    # Braking takes 0.13 s, and bringing 10 rad/s^2 on and off 2 ms more.
    assert steps == pytest.approx(132, abs=2)

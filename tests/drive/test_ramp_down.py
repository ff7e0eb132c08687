"""The way to rest: within its bounds, and no longer than they ask for."""

import numpy as np
import pytest

from drake_rnn import JointLimits
from drake_rnn.drive.approach import RampDown

H, CYCLE = 1e-3, 5e-3
LIMITS = JointLimits(
    position_lower=np.full(2, -1.0),
    position_upper=np.full(2, 1.0),
    velocity=np.full(2, 1.0),
    acceleration=np.full(2, 2.0),
)


def samples(ramp, time=H):
    """Positions until the ramp rests, one for each step of the law."""
    found = []
    while not ramp.rests:
        found.append(ramp.advance(time))
        assert len(found) < 5000
    return np.array(found)


@pytest.mark.parametrize("jerk", [None, 30.0])
def test_it_stops_within_the_bounds_that_the_law_has(jerk):
    limits = LIMITS if jerk is None else LIMITS.replace(jerk=jerk)
    q, v = np.zeros(2), np.array([0.8, -0.3])
    a = np.zeros(2) if jerk is None else np.array([1.0, 0.5])
    found = samples(RampDown(q, v, a, limits, np.full(2, 8.0), H))
    speeds = np.diff(np.vstack((q - H * v, q, found)), axis=0) / H
    rates = np.diff(speeds, axis=0) / H
    assert np.abs(rates).max() <= 2.0 * (1 + 1e-9)
    if jerk is None:
        assert len(found) == 400
    else:
        assert np.abs(np.diff(np.vstack((a, rates)), axis=0)).max() / H <= 30.0 * (1 + 1e-8)


def test_cycles_of_another_length_see_the_same_motion():
    start = np.zeros(2), np.array([0.8, -0.3]), np.zeros(2)
    fine = samples(RampDown(*start, LIMITS, np.full(2, 8.0), H))
    coarse = samples(RampDown(*start, LIMITS, np.full(2, 8.0), H), CYCLE)
    np.testing.assert_allclose(coarse, fine[4::5], atol=1e-15)
    # Between two steps the velocity is held.
    half = RampDown(*start, LIMITS, np.full(2, 8.0), H)
    np.testing.assert_allclose(half.advance(0.5 * H), 0.5 * fine[0], atol=1e-15)
    np.testing.assert_allclose(half.advance(0.5 * H), fine[0], atol=1e-15)


def test_a_joint_about_to_pass_its_limit_brakes_as_hard_as_it_needs_to():
    q, v = np.array([0.9, -0.9]), np.array([0.8, 0.8])
    found = samples(RampDown(q, v, np.zeros(2), LIMITS, np.full(2, 8.0), H))
    speeds = np.diff(np.vstack((q - H * v, q, found)), axis=0) / H
    rates = np.abs(np.diff(speeds, axis=0)).max(axis=0) / H
    assert found[:, 0].max() <= 1.0
    assert 3.0 < rates[0] <= 4.0
    assert rates[1] == pytest.approx(2.0)

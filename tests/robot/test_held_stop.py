"""The fastest stop of joints whose velocities are held, against a loop over its samples."""

import numpy as np
import pytest

from drake_rnn.robot.jerk_stop import HeldStop

STOP = HeldStop(np.array([1.0, 2.0, 0.5]), 1e-2)


def looped(v, samples):
    """Positions after each sample, with v held in the first."""
    q, found = np.zeros_like(v), []
    for _ in range(samples):
        q = q + STOP.period * v
        found.append(q)
        v = np.sign(v) * np.maximum(np.abs(v) - STOP.acceleration * STOP.period, 0.0)
    return np.array(found)


@pytest.mark.parametrize("seed", range(5))
def test_it_passes_where_a_loop_does(seed):
    w = np.random.default_rng(seed).uniform(-0.6, 0.6, 3)
    count = int(STOP.samples(w))
    found = looped(w, count + 3)
    k = np.arange(1.0, count + 4.0)
    assert STOP.travel(w, k) == pytest.approx(found, abs=1e-15)
    assert STOP.travel(w, k - 0.5)[1:] == pytest.approx(0.5 * (found[1:] + found[:-1]), abs=1e-15)
    assert STOP.travel(w, np.zeros(1)) == pytest.approx(np.zeros((1, 3)), abs=0.0)
    # From the count on all joints rest.
    assert np.ptp(found[count - 1 :], axis=0).max() == 0.0
    assert STOP.way(w) == pytest.approx(np.abs(found[-1]), abs=1e-15)


@pytest.mark.parametrize("seed", range(5))
def test_what_is_left_of_it_after_a_sample_is_the_stop_from_there(seed):
    """So that one that is certified stays so."""
    w = np.random.default_rng(seed).uniform(-0.6, 0.6, 3)
    k = np.arange(1.0, STOP.samples(w) + 1.0)
    rest = STOP.travel(w, np.ones(1)) + STOP.travel(STOP.after(w), k)
    assert rest == pytest.approx(STOP.travel(w, k + 1.0), abs=1e-15)


def test_leverage_is_how_far_a_change_of_the_velocity_moves_the_joints():
    w, k = np.array([0.3331, -0.2222, 0.1111]), np.array([1.0, 3.0, 10.0, 40.0])
    change = 1e-7 * np.array([1.0, -1.0, 1.0])
    moved = np.abs(STOP.travel(w + change, k) - STOP.travel(w, k))
    assert moved / 1e-7 == pytest.approx(STOP.leverage(w, k), rel=1e-6)


def test_a_joint_without_a_bound_stops_at_once():
    stop = HeldStop(np.array([np.inf, 1.0]), 1e-2)
    w = np.array([5.0, 0.1])
    assert stop.after(w).tolist() == pytest.approx([0.0, 0.09])
    assert stop.way(w)[0] == pytest.approx(0.05)
    assert np.isfinite(stop.travel(w, np.arange(5.0))).all()

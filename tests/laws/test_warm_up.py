"""Warming up joint by joint, in place of injected noise."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drake_rnn import JointLimits, SimultaneousLearning, load_experiment, simulate
from drake_rnn.laws.simultaneous_learning import WarmUp
from limit_helpers import broken
from shared_runs import shared_run

PULSES = st.builds(WarmUp, pulse=st.floats(0.01, 2.0), acceleration=st.floats(0.01, 5.0))


@given(PULSES, st.integers(1, 7))
def test_every_joint_moves_and_returns(warm_up, n):
    """The velocity's integral over each pulse, exact for a piecewise linear one: zero."""
    grid = np.linspace(0.0, warm_up.duration(n), 8 * n + 1)
    v = np.array([warm_up.joint_velocity(t, n) for t in grid])
    moved = (v[:-1] + v[1:]).sum(axis=0) / 2
    np.testing.assert_allclose(moved, 0.0, atol=1e-6 * np.abs(v).max())
    np.testing.assert_allclose(
        np.abs(v).max(axis=0), warm_up.acceleration * warm_up.pulse / 4, rtol=1e-6
    )


@given(PULSES, st.floats(0.0, 1.0))
def test_its_acceleration_is_the_slope_of_its_velocity(warm_up, share):
    n, h = 3, 1e-4 * warm_up.pulse
    # Away from the corners, where there is no slope.
    if min(abs(share - corner) for corner in (0.0, 0.25, 0.75, 1.0)) < 1e-3:
        return
    t = (1 + share) * warm_up.pulse
    slope = (warm_up.joint_velocity(t + h, n) - warm_up.joint_velocity(t - h, n)) / (2 * h)
    np.testing.assert_allclose(slope, warm_up.joint_acceleration(t, n), rtol=1e-5, atol=1e-9)
    assert np.count_nonzero(slope) == 1


def test_only_one_joint_moves_at_a_time_and_none_afterwards():
    warm_up = WarmUp()
    for t in np.linspace(0.0, 2.0, 401):
        assert np.count_nonzero(warm_up.joint_velocity(t, 7)) <= 1
    assert not warm_up.joint_velocity(1.41, 7).any()
    assert not warm_up.joint_acceleration(1.41, 7).any()


@pytest.mark.parametrize("t", [-0.3, -1.5, 0.6, 0.75, 5.0])
def test_before_and_after_it_all_joints_stand_still(t):
    warm_up = WarmUp(pulse=0.2)
    np.testing.assert_array_equal(warm_up.joint_velocity(t, 3), np.zeros(3))
    np.testing.assert_array_equal(warm_up.joint_acceleration(t, 3), np.zeros(3))


def test_it_may_not_be_faster_than_the_law_allows():
    limits = JointLimits.unlimited(7).replace(velocity=0.5, acceleration=0.4)
    with pytest.raises(ValueError, match=r"warm_up\.acceleration: may be at most the bound, 0\.4"):
        SimultaneousLearning(limits=limits, home=np.zeros(7), warm_up=WarmUp(acceleration=0.5))


def test_the_jacobian_is_known_when_it_is_over():
    """From random to 9.3e-5, by 1.4 s of motion of at most .00125 rad."""
    result = simulate(load_experiment("slc_nephroid_warm_up", {"duration": 1.4}))
    error = np.linalg.norm(result.series["J"][-1] - result.series["J_hat"][-1])
    assert error < 1.1e-4
    moved = np.abs(result.series["position"] - result.series["position"][0])
    assert moved.max() < 1.3e-3
    assert moved[-1].max() < 1e-12


@pytest.mark.parametrize(
    "seed",
    [
        0,
        pytest.param(1, marks=pytest.mark.long),
        *(pytest.param(seed, marks=pytest.mark.nightly) for seed in range(2, 5)),
    ],
)
def test_without_noise_it_tracks_and_every_bound_holds(seed):
    """Seed 0 for the first 8 s, the others along the whole path."""
    shorter = {"duration": 8, "window": [4, 8]} if seed == 0 else {}
    metrics = shared_run("slc_nephroid_warm_up", {"seed": seed, **shorter}).metrics
    assert metrics["position_error_max_m"] <= 0.5e-3
    assert metrics["settling_time_s"] <= 3.6
    assert broken(metrics, 1e-9) == {}


@pytest.mark.nightly
def test_it_still_tracks_after_a_minute():
    """With rho = 1e-6 it would not if nothing bounded the multipliers, as printed."""
    minute = {"duration": 60, "window": [52, 60]}
    fast = {"law.rho": 1e-6}
    stays, bounded, strays = (
        simulate(load_experiment("slc_nephroid_warm_up", {**minute, **changes})).metrics
        for changes in ({}, fast, {**fast, "law.multiplier_limit": "none"})
    )
    assert stays["position_error_max_m"] <= 0.5e-3
    assert bounded["position_error_max_m"] <= 0.5e-3
    assert strays["position_error_max_m"] > 50e-3


@pytest.mark.long
def test_the_continuous_reading_agrees():
    """Over the warm-up and the first second of the task; 3e-4 rad at half a millisecond.

    Above that the multipliers meet their bound, and the error no longer grows with the period.
    """
    grid = np.linspace(0.0, 2.4, 25)

    def postures(**changes):
        changes = {"duration": 2.4, "log_period": 0.1, "law.warm_up.rho": 1e-4, **changes}
        result = simulate(load_experiment("slc_nephroid_warm_up", changes))
        return np.array([np.interp(grid, result.time, q) for q in result.series["position"].T])

    exact = postures(integrator={"scheme": "runge_kutta3", "step": 1e-4})
    errors = [np.abs(postures(period=h) - exact).max() for h in (5e-4, 1e-4)]
    assert errors[1] < 0.65 * errors[0]
    assert errors[0] < 1e-3

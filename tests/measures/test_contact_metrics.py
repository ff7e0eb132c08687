"""Metrics of a tool that presses: when force and contact come and go, and how far they are off.

Times are multiples of 1/64 s, and forces of 1/4 N: what follows from them is exact.
"""

import numpy as np
import pytest
from motions import cut, metrics, metrics_of_parts, pressed

STEP = 1 / 64
TIME = STEP * np.arange(64)


def between(begin, end, force=2.0):
    """A force at the steps from ``begin`` to before ``end``, and none at others."""
    steps = np.arange(TIME.size)
    return np.where((begin <= steps) & (steps < end), force, 0.0)


def lost(force, desired=2.0):
    """When contact was lost, which does not depend on where a run is cut into parts."""
    whole = pressed(TIME, force, desired)
    found = metrics(whole)
    for at in (1, 12, 20, 21, 22, 30, 62):
        assert metrics_of_parts(cut(whole, at)) == pytest.approx(found, rel=1e-12, abs=0)
    return found.get("contact_lost_time_s")


def test_contact_is_lost_when_the_tool_last_touched_if_it_is_away_for_50_ms():
    """It was seen away 4 steps of 15.6 ms after the last contact, or 3, which are 47 ms."""
    assert lost(between(10, 21)) == 20 * STEP
    assert lost(between(10, 21) + between(25, 64)) == 20 * STEP
    assert lost(between(10, 21) + between(24, 64)) is None


def test_it_is_lost_at_the_first_gap_that_is_long_enough():
    assert lost(between(0, 21) + between(23, 31) + between(41, 51)) == 30 * STEP


def test_before_it_is_made_contact_is_not_lost():
    assert lost(between(40, 64)) is None
    assert lost(between(0, 0)) is None


def test_a_surface_that_pulls_is_none():
    """A force into the tool's back, as from noise: it does not touch."""
    assert lost(between(10, 21) - between(21, 64, force=0.25)) == 20 * STEP


def test_the_share_of_steps_without_contact_is_that_of_the_window():
    """Of 10 steps to 0.5 s, both ends included, 3; of the whole run 13 of 64."""
    force = 2.0 - between(26, 36) - between(0, 3)
    force[26:36] = force[:3] = 0.0
    whole = pressed(TIME, force)
    assert metrics(whole)["contact_lost_fraction"] == 13 / 64
    assert metrics(whole, window=(19 * STEP, 28 * STEP))["contact_lost_fraction"] == 0.3


def test_force_errors_are_those_of_the_window_with_their_sign():
    """3 N above and 1 N below: 1 N in the mean, the root of 5 in rms, 3 N at most."""
    force = [9.0, 5.0, 1.0, 9.0]
    found = metrics(pressed([0, 1, 2, 3], force), window=(1, 2))
    assert found["force_error_mean_N"] == 1.0
    assert found["force_error_rms_N"] == np.sqrt(5.0)
    assert found["force_error_max_N"] == 3.0
    assert metrics(pressed([0, 1, 2], [2.0, 2.0, -2.0]))["force_error_max_N"] == 4.0


def test_in_contact_only_what_lies_along_the_surface_is_an_error_of_position():
    """3 m and 4 m along it, and 12 m into it."""
    p_WE = np.array([[4.0, 5.0, 13.0], [1.0, 1.0, 1.0]])
    found = metrics(pressed([0, 1], [2.0, 2.0], p_WE=p_WE, p_WE_desired=np.ones((2, 3))))
    assert found["lateral_error_max_m"] == found["position_error_max_m"] == 5.0


def test_a_force_has_risen_at_95_percent_of_what_is_desired_in_the_end():
    """However it is desired to rise, and whatever it does later."""
    time = 0.5 * np.arange(6)
    force = [0.0, 0.5, 1.8, 1.91, 1.0, 2.0]
    for desired in (2.0, [0.0, 0.4, 0.8, 1.2, 1.6, 2.0]):
        whole = pressed(time, force, desired)
        assert metrics(whole)["force_rise_time_s"] == 1.5
        for at in range(1, 5):
            assert metrics_of_parts(cut(whole, at))["force_rise_time_s"] == 1.5
    assert "force_rise_time_s" not in metrics(pressed(time, force, 2.5))
    assert metrics(pressed(time, force, -0.5))["force_rise_time_s"] == 0.0


def test_95_percent_is_enough():
    """Of 20 N, 19."""
    assert metrics(pressed([0, 1, 2], [0.0, 19.0, 20.0], 20.0))["force_rise_time_s"] == 1.0
    assert metrics(pressed([0, 1, 2], [0.0, 18.9, 20.0], 20.0))["force_rise_time_s"] == 2.0


def test_the_peak_is_the_largest_force_of_the_whole_run():
    found = metrics(pressed([0, 1, 2, 3], [0.0, 5.0, 3.0, 2.0]), window=(2, 3))
    assert found["normal_force_peak_N"] == 5.0

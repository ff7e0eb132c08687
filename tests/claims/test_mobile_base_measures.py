"""The measures of the claims of two codes for mobile manipulators: their parts, and known cases."""

import numpy as np
import pytest

from drake_rnn.claims.papers import floating_base, predefined_time


@pytest.mark.parametrize("rho", [0.3, 0.9])
def test_the_gain_of_the_first_error_makes_it_vanish_at_the_predefined_time(rho):
    """With v = |e|^rho, v' = -rho lambda (1 + v^2): at t_p but for the third term."""
    assert 0.95 < predefined_time.time_over_predefined(None, rho) <= 1.0


def test_a_bounded_gain_makes_any_entry_vanish_in_time():
    """2/pi atan(|e|^(rho/2)) of t_p."""
    for first in (0.15, 1e6):
        expected = 2.0 / np.pi * np.arctan(first**0.3)
        found = predefined_time.time_over_predefined(None, 0.6, "ptc", first)
        assert found == pytest.approx(expected, rel=1e-9)


def test_the_direction_of_the_error_stays_where_j_is_known():
    assert predefined_time.rate_aside(None) < 1e-12


def test_a_thousand_steps_of_the_gradient_are_their_sum():
    moved, went = np.array([1e-3, -2e-3, 5e-4, 0.0, 3e-3, 0.0]), np.array([1e-3, 2e-3, -1e-3])
    stepwise = np.zeros((3, 6))
    for _ in range(1000):
        stepwise += 1e4 * np.outer(went - stepwise @ moved, moved)
    at_once = np.outer(went, predefined_time._learning(moved, 1000))
    np.testing.assert_allclose(at_once, stepwise, rtol=1e-9)


@pytest.mark.parametrize("tip", [predefined_time._tip, floating_base._tip])
def test_jacobians_are_the_derivatives_of_the_tips(tip):
    q = np.array([0.2, -0.4, 0.5, 0.3, 1.2, -0.7])
    extra = () if tip is predefined_time._tip else (0.03,)
    J = tip(q, *extra)[1][:3]
    for k, step in enumerate(1e-6 * np.eye(6)):
        rate = (tip(q + step, *extra)[0] - tip(q - step, *extra)[0]) / 2e-6
        np.testing.assert_allclose(J[:, k], rate, atol=1e-9)


def test_of_a_coarse_period_the_error_is_that_of_the_authors_file():
    """Data_ts_ptc_step_1e-1.mat, and less where a command acts at once."""
    assert predefined_time.rms_error(None, step=0.1) == pytest.approx(2.0821e-4, abs=5e-9)
    assert predefined_time.rms_error(None, step=0.1, delayed=False) < 1.5e-4


def test_bounds_of_the_planner_close_towards_a_limit():
    q = np.array([0.0, 0.95, 0.0, -0.9, 0.0, 1.01]) * floating_base._LIMITS
    upper, lower = floating_base._box(q)
    assert upper[0] == -lower[0] == 0.6
    assert upper[5] == 0.0
    assert -0.6 < lower[3] < 0.0
    # Half of the way to the limit: 1 - sin(pi/2 sin(pi/4))^4.
    assert upper[1] / 0.6 == pytest.approx(1.0 - np.sin(np.pi / 2 * np.sin(np.pi / 4)) ** 4)


def test_the_adaptive_activation_forgets_what_has_vanished():
    phi = floating_base._Adaptive()
    phi(np.full(24, 0.1))
    assert (phi(np.zeros(24)) == 0.0).all()
    assert (phi(np.full(24, 0.1)) < 1e-4).all()

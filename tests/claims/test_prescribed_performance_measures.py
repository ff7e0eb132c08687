"""The measures of the prescribed-performance network's claims: its printed algorithm."""

import pytest

from drake_rnn.claims.papers import prescribed_performance as measures


def test_from_the_codes_own_start_it_stays_within_its_bounds():
    assert measures.velocity_share(None, 2.0, 0.5) < 0.7
    assert measures.funnel_share(None, 2.0, 0.5) < 0.1
    assert measures.apart_from_optimum(None, 0.5) < 1e-4


def test_with_a_gain_of_ten_it_leaves_a_bound_within_ten_samples():
    assert measures.velocity_share(None, 10.0, 0.01) > 1.0


def test_the_joints_that_hardly_move_are_those_with_narrow_bounds():
    """3.6e-4 rad/s for 0.5 s."""
    assert measures.travel(None, 1, 0.5) < 1.8e-4
    assert measures.travel(None, 3, 0.5) == pytest.approx(0.05, abs=0.05)
    assert measures.travel(None, 3, 0.5) > 1e-3

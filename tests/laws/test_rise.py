"""Rises: from 0 to 1, and how smoothly."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drake_rnn.laws.state_adjustment import (
    sine_rise,
    smooth_rise,
)

RISES = [sine_rise, smooth_rise]
times = st.floats(-10, 100)
durations = st.floats(1e-3, 50)


@given(st.sampled_from(RISES), durations)
def test_a_rise_begins_at_0_ends_at_1_and_stays_there(rise, duration):
    assert rise(0.0, duration) == rise(-3.0, duration) == 0.0
    for t in (duration, 1.5 * duration, 2 * duration, 3 * duration, 1e6):
        assert rise(t, duration) == pytest.approx(1.0, abs=1e-15)


@given(st.sampled_from(RISES), times, times, durations)
def test_a_rise_never_falls(rise, t, other, duration):
    """Rounding apart."""
    early, late = sorted((t, other))
    assert rise(early, duration) <= rise(late, duration) + 1e-15


def test_half_way():
    assert smooth_rise(1.5, 3.0) == pytest.approx(0.5)
    assert sine_rise(1.5, 3.0) == pytest.approx(np.sqrt(0.5))
    assert sine_rise(1.0, 3.0) == pytest.approx(0.5)


def test_a_sine_sets_in_at_once_and_a_smooth_rise_with_the_third_power():
    """Third order contact at both ends: neither velocity nor acceleration jumps."""
    h = 1e-4
    assert sine_rise(h, 1.0) / h == pytest.approx(np.pi / 2, rel=1e-6)
    for beyond in (smooth_rise(h, 1.0), 1.0 - smooth_rise(1.0 - h, 1.0)):
        assert beyond / h**3 == pytest.approx(10.0, rel=1e-3)


@pytest.mark.parametrize("rise", RISES)
def test_many_times_at_once_are_each_on_its_own(rise):
    t = np.linspace(-1.0, 5.0, 13).reshape(1, 13)
    shares = rise(t, 3.0)
    assert shares.shape == t.shape
    np.testing.assert_allclose(shares[0], [rise(x, 3.0) for x in t[0]], atol=1e-16)

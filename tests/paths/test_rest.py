"""The path that is none."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drake_rnn import InvalidInputError
from drake_rnn.paths import PATHS, Rest

P_WE = np.array([0.3, 0.1, 0.6])


@given(st.floats(-10, 1e6))
def test_a_point_at_rest_stays(t):
    assert not np.any(Rest().evaluate(t))


def test_it_is_where_the_arm_starts_but_for_the_offset():
    np.testing.assert_array_equal(Rest().start_point(P_WE), P_WE)
    away = Rest(offset=[0.1, 0.0, -0.02])
    np.testing.assert_allclose(P_WE - away.start_point(P_WE), [0.1, 0.0, -0.02])
    assert not np.any(away.evaluate(0.7))


def test_it_is_a_kind_of_path_that_needs_no_period():
    assert PATHS["rest"] is Rest
    assert Rest().period == 1.0
    assert not Rest().sample(5).any()


@pytest.mark.parametrize("fields", [{"period": 0}, {"size": 0.1}, {"offset": [0.1]}])
def test_what_it_cannot_have_is_refused(fields):
    with pytest.raises(InvalidInputError, match=next(iter(fields))):
        Rest(**fields)

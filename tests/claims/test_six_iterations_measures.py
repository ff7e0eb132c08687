"""The measures of the six iterations' claims, on numbers that are known."""

import numpy as np
import pytest

from drake_rnn.claims.papers import six_iterations as measures


def test_the_tables_contradict_the_text():
    """1e-5 and 1e-4 rad are said; a norm of a column is at least its largest entry."""
    assert measures.printed_drift(None, 3) == 2.5634e-5
    assert measures.printed_drift(None, 4) == pytest.approx(3.0442e-4)
    assert measures.printed_norm_misfit(None, 3) > 9.0
    assert measures.printed_norm_misfit(None, 4) < 1.05


def test_the_inequality_fails_for_m6():
    assert measures.inequality_excess(None, "E47") < 0.0
    assert measures.inequality_excess(None, "M6") > 0.01


def test_e47_needs_tens_of_iterations():
    """Bounds that act cost it some more."""
    free, bounded = (measures.iterations(None, "E47", at_bounds) for at_bounds in (False, True))
    assert 2 < free <= bounded < 100


def test_a_stiffness_of_more_than_one_over_the_period_passes_a_limit():
    assert measures.least_reach(None, 999.0, 1e-3) >= 0.0
    assert measures.least_reach(None, 1500.0, 1e-3) == pytest.approx(-5e-4, rel=0.01)


@pytest.mark.parametrize("stiffness", [0.5, 4.0, 1500.0])
def test_in_continuous_time_no_stiffness_passes_a_limit(stiffness):
    """1 rad at 1.5 rad/s down to 1.5 / stiffness, and from there by exp(-stiffness t)."""
    left = measures.least_reach(None, stiffness)
    assert 0.0 <= left < 0.01
    if stiffness == 4.0:
        sampled = measures.least_reach(None, stiffness, 1e-5)
        assert left == pytest.approx(sampled, rel=1e-2)


def test_m3_inverts_in_each_iteration_and_m5_does_not():
    """Q as Algorithm 1 makes it: of M3 it is I + M^-1, of M5 M^T; steps are the same either way."""
    program = measures._programs()[2]
    np.testing.assert_allclose(
        measures._way_of("M3", program.M) @ program.M,
        program.M + np.eye(program.p.size),
        atol=1e-12,
    )
    np.testing.assert_array_equal(measures._way_of("M5", program.M), program.M.T)
    start = measures._start(program, 0)
    for method in measures._METHODS:
        once, anew = (
            [U for _, U, _, _ in measures._steps(method, program, start, 5, each)]
            for each in (False, True)
        )
        np.testing.assert_array_equal(once, anew)

"""The measures of the six iterations' claims, on numbers that are known."""

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

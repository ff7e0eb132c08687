"""A law that is sampled too slowly for its gains, or not in a machine's time, is refused."""

import pytest

from drake_rnn import InvalidInputError, Layout, SampledLaw
from drake_rnn.laws.parts.programs import check_substeps


class Feeding(SampledLaw):
    """A law of the user's own that tells its gains, and checks nothing."""

    state = Layout(v=(3,))
    inputs = Layout(p_WE=(3,))

    def __init__(self, **gains):
        self.gains = gains

    @property
    def loop_gains(self):
        return self.gains

    def step(self, t, x, u, period):
        return x


@pytest.mark.parametrize(("period", "rate"), [(0.5, 2.0), (1e-3, 1e3), (0.25, 40.0), (4.0, 0.5)])
def test_a_feedback_that_would_overshoot_is_refused(period, rate):
    """In a sample it takes away period times rate of an error: from 1 on, all of it or more."""
    with pytest.raises(InvalidInputError, match=rf"law\.kappa at {rate:g} /s, not {period:g}; or"):
        Feeding(gamma=0.1 * rate, kappa=rate).sampled(period)


@pytest.mark.parametrize(("period", "rate"), [(0.5, 1.9), (1e-3, 999.0), (2.0, 0.25), (0.1, 9.0)])
def test_one_that_does_not_overshoot_is_not(period, rate):
    law = Feeding(kappa=rate, gamma=0.1 * rate, zero=0.0)
    assert law.sampled(period) is law


def test_what_is_refused_says_which_period_and_which_gain_would_do():
    law = Feeding(kappa=40.0)
    said = r"^period: must be below 0\.025 s with .*, not 0\.25; or give law\.kappa below 4 /s$"
    with pytest.raises(InvalidInputError, match=said):
        law.sampled(0.25)
    assert law.sampled(0.0249) is law
    assert Feeding(kappa=3.9).sampled(0.25)


def test_more_substeps_than_a_machine_makes_in_time_are_refused():
    """At 10 us each: 10 000 take a tenth of a second for each sample."""
    check_substeps(10_000, "rate: 8 /s")
    with pytest.raises(
        InvalidInputError, match=r"^law\.rate: 1e\+08 /s: .* may take at most 10000"
    ):
        check_substeps(10_001, "rate: 1e+08 /s")
    check_substeps(3, "substeps: 3", most=3)
    with pytest.raises(InvalidInputError, match=r"at most 3$"):
        check_substeps(4, "substeps: 4", most=3)

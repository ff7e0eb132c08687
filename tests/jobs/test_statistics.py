"""The formulas of the statistics, against scipy, which the package does without."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from drake_rnn.jobs.summary import (
    chance_correlation,
    quantile,
    rank_correlation,
    share,
)
from row_helpers import each

COUNTS = [(0, 1), (1, 1), (0, 40), (3, 40), (20, 40), (39, 40), (40, 40), (9_990, 10_000)]


@each(("successes", "trials"), COUNTS)
@each("confidence", [0.5, 0.95, 0.999])
def test_a_share_has_wilsons_interval(successes, trials, confidence):
    expected = stats.binomtest(successes, trials).proportion_ci(confidence, method="wilson")
    found = share(successes, trials, confidence)
    # scipy takes the same formula with the normal quantile of another library.
    assert found.value == successes / trials
    assert (found.low, found.high) == pytest.approx((expected.low, expected.high), abs=1e-12)


def test_a_share_of_nothing_says_nothing():
    found = share(0, 0)
    assert math.isnan(found.value)
    assert (found.low, found.high) == (0.0, 1.0)


@each("count", [1, 5, 6, 58, 59, 100, 1001])
@each("probability", [0.05, 0.5, 0.99])
@each("confidence", [0.5, 0.95])
def test_a_quantile_lies_between_the_closest_ranks_that_cover_it(count, probability, confidence):
    """Ranks r < s with tails P(B < r) and P(B >= s) of at most half of what is left each.

    B, the number of values below the true quantile, is binomial.
    """
    binomial, tail = stats.binom(count, probability), (1 - confidence) / 2
    lowest = max((r for r in range(1, count + 1) if binomial.cdf(r - 1) <= tail), default=0)
    highest = min((s for s in range(1, count + 1) if binomial.sf(s - 1) <= tail), default=None)
    found = quantile(np.arange(1.0, count + 1.0), probability, confidence)
    assert found.low == (lowest or -math.inf)
    assert found.high == (highest or math.inf)
    assert found.value == np.quantile(np.arange(1.0, count + 1.0), probability)


def test_six_values_are_the_fewest_that_bound_a_median():
    """0.5^5 / 2 > 0.025 > 0.5^6: the textbook's case."""
    assert quantile(np.arange(5.0), 0.5) == (2.0, -math.inf, math.inf)
    assert quantile(np.arange(6.0), 0.5) == (2.5, 0.0, 5.0)


def test_intervals_cover_the_true_quantile_as_often_as_they_say():
    """Of 2000 samples of 40 exponential values, at least 95 %, within three standard deviations."""
    rng = np.random.default_rng(0)
    truth = math.log(4.0)
    intervals = [quantile(rng.exponential(size=40), 0.75) for _ in range(2000)]
    covered = np.mean([each.low <= truth <= each.high for each in intervals])
    assert covered > 0.95 - 3 * math.sqrt(0.95 * 0.05 / 2000)


@given(
    st.lists(
        st.tuples(st.integers(-5, 5).map(float), st.floats(-1e6, 1e6)), min_size=3, max_size=30
    )
)
def test_rank_correlations_are_spearmans_with_ties(pairs):
    x, y = np.array(pairs).T
    found = rank_correlation(x, y)
    if np.ptp(x) == 0 or np.ptp(y) == 0:
        assert math.isnan(found)
        return
    assert found == pytest.approx(stats.spearmanr(x, y).statistic, abs=1e-12)


def test_rows_without_a_metric_do_not_count():
    x = np.array([1.0, 2.0, 3.0, 4.0, 5.0])
    y = np.array([1.0, np.nan, 9.0, 16.0, 25.0])
    assert rank_correlation(x, y) == pytest.approx(1.0, abs=1e-15)
    assert math.isnan(rank_correlation(x[:2], x[:2]))


def test_chance_is_exceeded_as_often_as_it_says():
    """Within three standard deviations of 4000 trials; the normal approximation costs 0.5 %."""
    rng = np.random.default_rng(1)
    bound = chance_correlation(50)
    beyond = [abs(rank_correlation(*rng.normal(size=(2, 50)))) > bound for _ in range(4000)]
    assert np.mean(beyond) == pytest.approx(0.05, abs=3 * math.sqrt(0.05 * 0.95 / 4000) + 5e-3)

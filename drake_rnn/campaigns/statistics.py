"""Formulas of the statistics, in closed form: intervals of shares and quantiles, correlations."""

from __future__ import annotations

import math
from functools import lru_cache
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from ..inputs.fields import Array


class Interval(NamedTuple):
    """An estimate with a confidence interval.

    Attributes:
        value: The estimate.
        low: Lower bound; minus infinity if there are too few values for one.
        high: Upper bound; infinity if there are too few values for one.
    """

    value: float
    low: float
    high: float


def share(successes: int, trials: int, confidence: float = 0.95) -> Interval:
    """Return the share of successes with its Wilson score interval.

    Source: E. B. Wilson, "Probable inference, the law of succession, and statistical inference",
    Journal of the American Statistical Association, 1927. Unlike the interval of the normal
    approximation, it is right for shares near 0 and 1, and for few trials.

    Args:
        successes: Number of successes.
        trials: Number of trials.
        confidence: Probability with which the interval covers the true share.
    """
    if trials == 0:
        return Interval(math.nan, 0.0, 1.0)
    z2 = NormalDist().inv_cdf(0.5 + confidence / 2) ** 2
    p = successes / trials
    middle = (p + z2 / (2 * trials)) / (1 + z2 / trials)
    spread = math.sqrt(z2 * (p * (1 - p) / trials + z2 / (4 * trials**2))) / (1 + z2 / trials)
    low = 0.0 if successes == 0 else max(middle - spread, 0.0)
    high = 1.0 if successes == trials else min(middle + spread, 1.0)
    return Interval(p, low, high)


def quantile(values: Array, probability: float, confidence: float = 0.95) -> Interval:
    """Return a quantile with an interval between two order statistics.

    The number of values below the true quantile is binomial whatever their distribution, so the
    interval covers the true quantile with at least the confidence, for any number of values. With
    too few values in a tail the interval has no bound there. Source: H. A. David and H. N.
    Nagaraja, "Order Statistics", 2003, section 7.1.

    Args:
        values: The values, shape (k,), none of them NaN.
        probability: Probability of the quantile, between 0 and 1.
        confidence: Probability with which the interval covers the true quantile.
    """
    if values.size == 0:
        return Interval(math.nan, -math.inf, math.inf)
    ordered, tail = np.sort(values), (1 - confidence) / 2
    # P(B <= j) for j = 0 .. k, where B is the number of values below the true quantile.
    below = np.cumsum(_binomial(values.size, probability))
    # Both sums carry rounding errors.
    first = int(np.searchsorted(below, tail * (1 + 1e-12), "right"))
    last = int(np.searchsorted(below, (1 - tail) * (1 - 1e-12), "left"))
    low = float(ordered[first - 1]) if first >= 1 else -math.inf
    high = float(ordered[last]) if last < values.size else math.inf
    return Interval(float(np.quantile(ordered, probability)), low, high)


@lru_cache(maxsize=64)
def _binomial(trials: int, p: float) -> Array:
    """Return the probabilities of 0 .. ``trials`` successes, shape (trials + 1,)."""
    logs = [
        math.lgamma(trials + 1)
        - math.lgamma(k + 1)
        - math.lgamma(trials - k + 1)
        + k * math.log(p)
        + (trials - k) * math.log1p(-p)
        for k in range(trials + 1)
    ]
    return np.exp(logs)


def rank_correlation(x: Array, y: Array) -> float:
    """Return Spearman's rank correlation; NaN for fewer than 3 pairs, or if x or y is constant.

    Source: C. Spearman, "The proof and measurement of association between two things", American
    Journal of Psychology, 1904: the correlation of ranks, where equal values have their mean rank.

    Args:
        x: Values, shape (k,).
        y: Values paired with ``x``, shape (k,); pairs with a NaN are left out.
    """
    both = np.isfinite(x) & np.isfinite(y)
    if both.sum() < _FEWEST:
        return math.nan
    a, b = _ranks(x[both]), _ranks(y[both])
    a, b = a - a.mean(), b - b.mean()
    size = math.sqrt(float(a @ a) * float(b @ b))
    return float(a @ b) / size if size > 0 else math.nan


#: Fewest pairs of a correlation: two pairs always correlate perfectly.
_FEWEST = 3


def _ranks(values: Array) -> Array:
    """Return ranks from 1; equal values have the mean of their ranks."""
    _, place, counts = np.unique(values, return_inverse=True, return_counts=True)
    ends = np.cumsum(counts)
    return np.asarray((ends - (counts - 1) / 2)[place], dtype=float)


def chance_correlation(count: int, confidence: float = 0.95) -> float:
    """Return the magnitude that a rank correlation of independent values hardly exceeds.

    From Student's distribution in its normal approximation, good from some 20 values.

    Args:
        count: Number of pairs.
        confidence: Probability that the correlation stays below this magnitude.
    """
    if count < _FEWEST:
        return 1.0
    return min(1.0, NormalDist().inv_cdf(0.5 + confidence / 2) / math.sqrt(count - 1))

"""Figures of numbers that come step by step, of many robots at once."""

import numpy as np
import pytest

from drake_rnn.many.joint_metrics import least_eigenvalue
from drake_rnn.many.rotation import angle_between
from drake_rnn.many.running import Largest, Mean, Median, Settling, Smallest
from drake_rnn.robot.rotation import rotation_by

RNG = np.random.default_rng(0)


@pytest.mark.parametrize("count", [501, 4])
def test_medians_are_within_six_thousandths(count):
    """Of four numbers over eight decades the middle two are far apart: it is their mean."""
    numbers = 10.0 ** RNG.uniform(-6, 2, (count, 3))
    median = Median(3)
    for row in numbers:
        median.add(row)
    assert median.value == pytest.approx(np.median(numbers, axis=0), rel=0.006)


def test_a_median_of_no_numbers_is_none():
    median = Median(2)
    assert np.isnan(median.value).all()
    median.add(np.ones(2), np.array([True, False]))
    assert median.value == pytest.approx([1.0, np.nan], rel=0.006, nan_ok=True)


def test_extremes_and_means_of_no_numbers_are_none():
    for figure in (Largest(2), Smallest(2), Mean(2)):
        assert np.isnan(figure.value).all()


def test_an_error_settles_at_its_last_crossing():
    settling = Settling(np.array([1.0, 1.0, 1.0]))
    for t, error in enumerate(([0.5, 2.0, 0.5], [0.5, 0.5, 2.0], [0.5, 2.0, 2.0], [0.5, 0.5, 1.0])):
        settling.add(float(t), np.array(error))
    assert settling.time == pytest.approx([0.0, 3.0, np.nan], nan_ok=True)


@pytest.mark.parametrize("m", [2, 3, 6])
def test_the_least_singular_value_is_that_of_numpy(m):
    J = RNG.normal(size=(50, m, 7))
    # Some nearly singular ones, where only the smallest is small.
    J[:10, 1] = J[:10, 0] + 1e-4 * RNG.normal(size=(10, 7))
    least = np.sqrt(least_eigenvalue(J.transpose(1, 2, 0)))
    known = np.linalg.svd(J, compute_uv=False)[:, -1]
    # Its square has the rounding of the largest one: 1e-15 of 10, where it is 1e-5.
    assert least == pytest.approx(known, rel=1e-7, abs=1e-9)


def test_angles_are_those_of_rotation_vectors():
    vectors = RNG.normal(size=(20, 3))
    vectors *= np.array([0.0, 1e-9, 1e-3, 1.0, 3.1])[np.arange(20) % 5, None] / np.linalg.norm(
        vectors, axis=1, keepdims=True
    )
    first, turn = rotation_by(RNG.normal(size=(20, 3))), rotation_by(vectors)
    angle = angle_between(first, turn @ first)
    assert angle == pytest.approx(np.linalg.norm(vectors, axis=1), abs=1e-14, rel=1e-12)

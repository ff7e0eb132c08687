"""Algebra of series: of one robot as NumPy has it, of many the same but for rounding."""

import numpy as np
import pytest

from drake_rnn.arrays.algebra import (
    along,
    least_singular_squares,
    lengths,
    sizes,
    transform,
)

RNG = np.random.default_rng(0)


def test_one_robot_among_others_has_its_values_alone():
    vectors, matrices = RNG.normal(size=(9, 4, 3)), RNG.normal(size=(9, 4, 3, 7))
    v, normals = RNG.normal(size=(9, 4, 7)), RNG.normal(size=(4, 3))
    for robot in range(4):
        for many, one in (
            (lengths(vectors), lengths(vectors[:, robot])),
            (sizes(matrices), sizes(matrices[:, robot])),
            (along(vectors, normals), along(vectors[:, robot], normals[robot])),
            (transform(matrices, v), transform(matrices[:, robot], v[:, robot])),
        ):
            assert many[:, robot] == pytest.approx(one, rel=1e-13, abs=1e-14)


def test_norms_of_vectors_have_the_bits_of_numpy():
    """Largest errors of recorded runs rest on this."""
    vectors = RNG.normal(size=(1000, 3))
    assert np.array_equal(lengths(vectors), np.linalg.norm(vectors, axis=1))


@pytest.mark.parametrize("m", [2, 3, 6])
def test_the_least_singular_value_is_that_of_numpy(m):
    J = RNG.normal(size=(1, 50, m, 7))
    # Some nearly singular ones, where only the smallest is small.
    J[0, :10, 1] = J[0, :10, 0] + 1e-4 * RNG.normal(size=(10, 7))
    known = np.linalg.svd(J[0], compute_uv=False)[:, -1]
    # Its square has the rounding of the largest one: 1e-15 of 10, where it is 1e-5.
    for squares in (least_singular_squares(J)[0], least_singular_squares(J[0])):
        assert np.sqrt(squares) == pytest.approx(known, rel=1e-7, abs=1e-9)

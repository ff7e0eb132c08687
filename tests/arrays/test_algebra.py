"""Sums and solutions for one robot, and for many side by side."""

import numpy as np
import pytest

from drake_rnn.arrays.algebra import require_jax, solved_regular


@pytest.mark.parametrize("m", [2, 3, 6])
def test_what_rounding_made_singular_is_solved(m):
    """Two equal rows of 1e6 and a softness of 1e-9, which rounding takes from the sum."""
    J = 1e6 * np.random.default_rng(m).uniform(0.5, 1.0, (m, 7))
    J[1] = J[0]
    found = solved_regular(J @ J.T + 1e-9 * np.eye(m), np.arange(1.0, m + 1.0))
    assert np.isfinite(found).all()


@pytest.mark.parametrize("m", [2, 3, 4, 6])
def test_so_is_it_in_jax(m):
    """Which would divide by zero: with a learned Jacobian of 1e5, velocities were no numbers."""
    pytest.importorskip("jax")
    jax, rng = require_jax(), np.random.default_rng(m)
    J = 1e6 * rng.uniform(0.5, 1.0, (2, m, 7))
    J[:, 1] = J[:, 0]
    singular, b = jax.numpy.array(J @ J.swapaxes(1, 2)), rng.normal(size=(2, m))
    assert np.isfinite(jax.jit(solved_regular)(singular, b)).all()
    regular = np.stack([J @ J.T + 1e-3 * np.eye(m) for J in rng.normal(size=(2, m, 7))])
    found = jax.jit(solved_regular)(jax.numpy.array(regular), b)
    np.testing.assert_allclose(found, solved_regular(regular, b), rtol=1e-9)
    assert solved_regular(jax.numpy.zeros((2, 0, 0)), jax.numpy.zeros((2, 0))).shape == (2, 0)


@pytest.mark.parametrize("m", [2, 3, 6])
def test_others_side_by_side_keep_their_bits(m):
    rng = np.random.default_rng(m)
    regular = np.stack([J @ J.T + 1e-6 * np.eye(m) for J in rng.normal(size=(4, m, 7))])
    b = rng.normal(size=(4, m))
    alone = solved_regular(regular, b)
    among = solved_regular(np.concatenate((regular, np.ones((1, m, m)))), np.vstack((b, b[:1])))
    np.testing.assert_array_equal(among[:4], alone)
    assert np.isfinite(among).all()
    np.testing.assert_allclose(np.einsum("kij,kj->ki", regular, alone), b, rtol=0, atol=1e-8)

"""Learning a Jacobian from measured motion, and what holds of the paper's Theorem 1."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from drake_rnn.laws.parts.jacobian import (
    gradient,
    rank_one_update,
)

matrices = arrays(float, (3, 7), elements=st.floats(-2, 2))
velocities = arrays(float, 7, elements=st.floats(-1, 1))


@given(matrices, matrices, velocities, st.floats(1e-7, 1e-1), st.floats(1e-5, 1e-1))
def test_the_error_never_grows(J, J_hat, v, rho, period):
    """Theorem 1's Lyapunov function does not increase, whatever the step."""
    updated = rank_one_update(J_hat, v, J @ v, rho, period)
    before, after = np.linalg.norm(J - J_hat), np.linalg.norm(J - updated)
    assert after <= before * (1 + 1e-12)


@pytest.mark.long
@given(matrices, matrices, velocities, st.floats(1e-3, 1e-1))
@settings(max_examples=25)
def test_the_update_solves_the_differential_equation(J, J_hat, v, rho):
    """Against many small Euler steps; first order in their number."""
    steps, period = 20_000, 0.1
    x = J_hat.copy()
    for _ in range(steps):
        x = x + period / steps * gradient(x, v, J @ v, rho)
    exact = rank_one_update(J_hat, v, J @ v, rho, period)
    stiffness = v @ v * period / rho
    error = np.linalg.norm(J - J_hat) + 1e-9
    np.testing.assert_allclose(x, exact, atol=error * (1e-9 + stiffness**2 / steps))


@given(matrices, matrices, velocities)
def test_two_half_steps_are_one_whole(J, J_hat, v):
    """It is a flow: the closed form does not depend on how time is cut."""
    half = rank_one_update(J_hat, v, J @ v, 1e-3, 5e-3)
    twice = rank_one_update(half, v, J @ v, 1e-3, 5e-3)
    np.testing.assert_allclose(twice, rank_one_update(J_hat, v, J @ v, 1e-3, 1e-2), atol=1e-12)


def test_motion_in_one_direction_teaches_nothing_of_the_others():
    """What Theorem 1 leaves out: its limit set holds every J_hat with J_hat v = J v."""
    rng = np.random.default_rng(0)
    J, J_hat = rng.normal(size=(2, 3, 7))
    v = rng.normal(size=7)
    across = np.eye(7) - np.outer(v, v) / (v @ v)
    learned = rank_one_update(J_hat, v, J @ v, 1e-6, 1.0)
    np.testing.assert_allclose(learned @ v, J @ v, atol=1e-12)
    np.testing.assert_allclose(learned @ across, J_hat @ across, atol=1e-12)


def test_motion_in_all_directions_teaches_everything():
    rng = np.random.default_rng(1)
    J, J_hat = rng.normal(size=(2, 3, 7))
    for _ in range(2000):
        v = rng.normal(scale=0.03, size=7)
        J_hat = rank_one_update(J_hat, v, J @ v, 1e-6, 1e-4)
    assert np.linalg.norm(J - J_hat) < 1e-9


def test_as_printed_the_noise_biases_what_is_learned():
    """With v_WE = J v but velocity v - n, the mean of J_hat is J S / (S + sigma^2), S = E[v v^T].

    For a mean velocity of three sigma along one direction, that is nine tenths of J along it
    and nothing of J across it: the reason why the scheme fails as it is printed.
    """
    rng = np.random.default_rng(2)
    J = rng.normal(size=(3, 7))
    v = np.zeros(7)
    v[0] = 0.09
    J_hat, mean = J.copy(), np.zeros((3, 7))
    samples = 40_000
    for k in range(2 * samples):
        shown = v - rng.normal(scale=0.03, size=7)
        # Slow enough for the noise to average out.
        J_hat = rank_one_update(J_hat, shown, J @ v, 1e-3, 1e-3)
        mean += J_hat / samples if k >= samples else 0.0
    shrinkage = 0.09**2 / (0.09**2 + 0.03**2)
    np.testing.assert_allclose(mean[:, 0], shrinkage * J[:, 0], atol=0.03)
    np.testing.assert_allclose(mean[:, 1:], 0.0, atol=0.1)


def test_at_rest_nothing_is_learned():
    J_hat = np.ones((3, 7))
    np.testing.assert_array_equal(rank_one_update(J_hat, np.zeros(7), np.ones(3), 1e-6, 1), J_hat)

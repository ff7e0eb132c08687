"""The network of motion-force control, alone: where it rests, and how it gets there."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from drake_rnn.laws.parts.programs import PrimalDual, substeps

DELTA = 1e-3


def network(seed, bound=np.inf, scale=1.0):
    rng = np.random.default_rng(seed)
    rows, aims = scale * rng.normal(size=(3, 7)), rng.normal(size=3)
    return PrimalDual(rows, rows, aims, np.full(7, -bound), np.full(7, bound), DELTA)


@pytest.mark.parametrize("seed", range(3))
def test_without_active_bounds_it_rests_at_the_least_norm(seed):
    one = network(seed)
    z = one.after(np.zeros(10), 0.2)
    np.testing.assert_allclose(z[:7], np.linalg.pinv(one.rows) @ one.aims, atol=1e-9)


@pytest.mark.long
@pytest.mark.parametrize("scale", [0.01, 1.0, 100.0])
def test_however_large_its_rows_a_period_is_stepped_without_growing(scale):
    """In one step of Runge and Kutta's method, rows of norm 100 would leave nothing finite."""
    one = network(0, scale=scale)
    rest = np.linalg.pinv(one.rows) @ one.aims
    z = np.zeros(10)
    for _ in range(50):
        z = one.after(z, 1e-2)
        assert np.linalg.norm(z[:7] - rest) < 2.0 * np.linalg.norm(rest)


def test_it_is_where_a_tight_integration_has_it():
    """With errors of about the fourth order, 3.5e-4 and 1.9e-5: halved steps, a 16th of it."""
    one = network(1, bound=0.2)
    tight = solve_ivp(lambda _, z: one.rate(z), (0.0, 2e-3), np.zeros(10), rtol=1e-10, atol=1e-12)
    ends = [np.zeros(10), np.zeros(10)]
    for _ in range(20):
        ends[0] = one.after(ends[0], 1e-4)
    for _ in range(40):
        ends[1] = one.after(ends[1], 5e-5)
    coarse, fine = (np.abs(end - tight.y[:, -1]).max() for end in ends)
    assert coarse < 4.5e-4
    assert fine < coarse / 12.0


def test_what_tends_to_its_bounds_ends_within_them():
    one = network(2, bound=0.01)
    z = one.after(np.zeros(10), 0.05)
    assert np.abs(z[:7]).max() <= 0.01
    assert np.abs(network(2).after(np.zeros(10), 0.05)[:7]).max() > 0.1


def test_substeps_grow_with_what_rings_and_are_one_at_least():
    assert substeps(1e-4, 1.0, DELTA) == 1
    assert substeps(1e-3, 2.0, DELTA) == 1
    assert substeps(1e-3, 22.0, DELTA) == 10
    assert substeps(2e-3, 22.0, DELTA) == 20

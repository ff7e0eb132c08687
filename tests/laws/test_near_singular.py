"""The softness near a singular posture."""

import numpy as np
import pytest

from drake_rnn.laws.parts.reach_edge import soften

S = 1e-6 * np.eye(3)


def with_least(value, rng):
    """Return a Jacobian of 3 rows with this smallest singular value."""
    U, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    V, _ = np.linalg.qr(rng.normal(size=(7, 7)))
    return U @ np.diag([0.8, 0.4, value]) @ V[:3]


def test_far_from_a_singular_posture_it_stays_as_it_is():
    rng = np.random.default_rng(0)
    for value in (0.0501, 0.08, 0.3):
        J = with_least(value, rng)
        np.testing.assert_array_equal(soften(J, S), S)
        np.testing.assert_array_equal(soften(J[None], S)[0], S)


@pytest.mark.parametrize(("value", "added"), [(0.0, 1e-3), (0.025, 2.5e-4), (0.04, 4e-5)])
def test_it_grows_as_the_square_of_the_way_below_the_edge(value, added):
    """1e-9 of 1e-3 per 1e-9 of the singular value: its square is known to 1e-16."""
    J = with_least(value, np.random.default_rng(1))
    np.testing.assert_allclose(soften(J, S), S + added * np.eye(3), rtol=0.0, atol=1e-9)


def test_one_and_many_agree_for_six_rows():
    rng = np.random.default_rng(2)
    J = rng.normal(size=(20, 6, 7)) * np.geomspace(0.01, 1.0, 20)[:, None, None]
    many = soften(J, 1e-6 * np.eye(6))
    for one, found in zip(J, many, strict=True):
        np.testing.assert_allclose(soften(one, 1e-6 * np.eye(6)), found, rtol=1e-12)
    assert (many[0] > many[-1]).any()

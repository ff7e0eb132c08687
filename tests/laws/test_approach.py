"""The speed at which an error is reduced: three regimes, one after the other."""

import numpy as np
import pytest

from drake_rnn.laws.parts.path_task import (
    approach,
    gain_within_jerk,
)

KAPPA, BRAKING, LIMIT = 100.0, 0.05, 0.1


@pytest.mark.parametrize(
    ("length", "speed"),
    [
        # Close, in proportion; below 2 a / kappa^2 = 10 um.
        (0.0, 0.0),
        (1e-15, 1e-13),
        (4e-6, 4e-4),
        # Further away, as it can be braked: sqrt(2 a e).
        (1e-3, 1e-2),
        (4e-2, np.sqrt(4e-3)),
        # Far away, at most the limit, from 0.1 m on.
        (0.2, 0.1),
        (50.0, 0.1),
    ],
)
def test_the_least_of_three_speeds_along_the_error(length, speed):
    for direction in (np.array([1.0, 0, 0]), np.array([2.0, -1.0, 2.0]) / 3.0):
        found = approach(length * direction, KAPPA, BRAKING, LIMIT)
        np.testing.assert_allclose(found, speed * direction, rtol=1e-12, atol=1e-30)


def test_it_is_continuous_where_the_regimes_meet():
    lengths = np.array([2 * BRAKING / KAPPA**2, LIMIT**2 / (2 * BRAKING), 1e-12])
    for length in lengths:
        below, above = (
            approach(np.array([(1 + s) * length]), KAPPA, BRAKING, LIMIT) for s in (-1e-9, 1e-9)
        )
        assert above == pytest.approx(below, rel=1e-8)


def test_followed_it_decelerates_no_more_than_it_says_and_arrives():
    """1 % for what a step of 1 ms changes of sqrt; the end takes more: kappa times the speed."""
    e, h, speeds = np.array([0.3, 0.0]), 1e-4, []
    while np.linalg.norm(e) > 2 * BRAKING / KAPPA**2:
        v = approach(e, KAPPA, BRAKING, LIMIT)
        e = e - h * v
        speeds.append(np.linalg.norm(v))
    # sqrt(2 a e) halves the speed's change near its end only where steps are long.
    assert np.diff(speeds).min() / h > -1.01 * BRAKING
    assert h * len(speeds) == pytest.approx(0.2 / LIMIT + 0.1 * 2 / LIMIT, rel=0.02)


def test_one_robot_and_many_are_the_same():
    errors = (
        np.random.default_rng(0).normal(size=(60, 3)) * 10.0 ** np.linspace(-14, 1, 60)[:, None]
    )
    errors[7] = 0.0
    many = approach(errors, KAPPA, BRAKING, LIMIT)
    for error, found in zip(errors, many, strict=True):
        np.testing.assert_allclose(found, approach(error, KAPPA, BRAKING, LIMIT), rtol=1e-14)


def test_a_bounded_jerk_bounds_the_gain():
    """Its second derivative, where the speed begins to fall in proportion to the error."""
    gain, h = gain_within_jerk(10.0, BRAKING), 1e-6
    # Just within the proportional regime: an error that falls as exp(-gain t).
    errors = [0.999 * 2.0 * BRAKING / gain**2 * np.exp(-gain * h * k) for k in range(3)]
    speeds = [approach(np.array([e, 0.0, 0.0]), gain, BRAKING, LIMIT)[0] for e in errors]
    assert np.diff(speeds, n=2)[0] / h**2 == pytest.approx(10.0, rel=0.01)

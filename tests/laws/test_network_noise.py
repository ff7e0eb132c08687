"""Noise of networks: its courses, its seed, and the generator of its random numbers."""

import numpy as np
import pytest

from drake_rnn.laws.zeroing_design import (
    MODULUS,
    MULTIPLIER,
    NetworkNoise,
)


def test_courses_of_time():
    numbers = np.array([1.0, 2.0])
    for kind, wanted in (("constant", 3.0), ("ramp", 0.75), ("sine", 3.0)):
        noise, after = NetworkNoise(kind=kind, size=3.0).step(numbers, 0.25)
        np.testing.assert_allclose(noise, [wanted, wanted])
        np.testing.assert_array_equal(after, numbers)


def test_the_generator_has_its_full_period():
    """The multiplier is a primitive root: no power by a factor of the period is 1."""
    m, a, left, factor, primes = int(MODULUS), int(MULTIPLIER), int(MODULUS) - 1, 2, set()
    assert all(m % k for k in range(2, 8193))
    while left > 1:
        while left % factor == 0:
            primes.add(factor)
            left //= factor
        factor += 1
    assert all(pow(a, (m - 1) // prime, m) != 1 for prime in primes)


def test_random_numbers_are_exact_uniform_and_of_the_seed():
    noise = NetworkNoise(kind="random", size=2.0)
    numbers = noise.init(np.random.default_rng(1), 200)
    known = [int(number) for number in numbers]
    seen = []
    for _ in range(300):
        values, numbers = noise.step(numbers, 0.0)
        known = [int(MULTIPLIER) * number % int(MODULUS) for number in known]
        seen.append(values)
    np.testing.assert_array_equal(numbers, known)
    seen = np.array(seen)
    assert np.abs(seen).max() < 2.0
    # Of 60000 uniform numbers: mean and mean square to four standard deviations, and no memory.
    assert abs(seen.mean()) < 4.0 * 2.0 / np.sqrt(3.0 * seen.size)
    assert seen.var() == pytest.approx(4.0 / 3.0, rel=0.02)
    assert abs((seen[1:] * seen[:-1]).mean()) < 4.0 * (4.0 / 3.0) / np.sqrt(seen.size)
    other = noise.init(np.random.default_rng(2), 200)
    assert (other != noise.init(np.random.default_rng(1), 200)).mean() > 0.99

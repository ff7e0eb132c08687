"""Rotations of many robots."""

import numpy as np
import pytest

from drake_rnn.robot.rotation import angle_between, rotation_by

RNG = np.random.default_rng(0)


def test_angles_are_those_of_rotation_vectors():
    vectors = RNG.normal(size=(20, 3))
    vectors *= np.array([0.0, 1e-9, 1e-3, 1.0, 3.1])[np.arange(20) % 5, None] / np.linalg.norm(
        vectors, axis=1, keepdims=True
    )
    first, turn = rotation_by(RNG.normal(size=(20, 3))), rotation_by(vectors)
    angle = angle_between(first, turn @ first)
    assert angle == pytest.approx(np.linalg.norm(vectors, axis=1), abs=1e-14, rel=1e-12)


def test_one_rotation_is_to_the_bit_that_of_many():
    sizes = np.array([0.0, 1e-300, 1e-12, 1e-6, 1e-2, 1.0, 3.1, 50.0])
    vectors = RNG.normal(size=(400, 3)) * sizes[np.arange(400) % sizes.size, None]
    vectors[::7, 1] = 0.0
    assert np.array_equal([rotation_by(each) for each in vectors], rotation_by(vectors))

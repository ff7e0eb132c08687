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

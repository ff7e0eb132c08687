"""The rotation error: an angular velocity that follows it turns E to where it should be."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drake_rnn.robot.rotation import rotation_error

components = st.lists(st.floats(-1, 1), min_size=3, max_size=3).map(np.array)
axes = components.filter(lambda axis: np.linalg.norm(axis) > 0.1).map(
    lambda axis: axis / np.linalg.norm(axis)
)


def turn(vector):
    """The rotation of a rotation vector, by Rodrigues' formula."""
    angle = np.linalg.norm(vector)
    x, y, z = vector / max(angle, 1e-300)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


@given(axes, st.floats(0, np.pi - 1e-6), components)
def test_it_is_the_rotation_vector(axis, angle, posed):
    """In the world frame, wherever E itself is turned."""
    R = turn(posed)
    error = rotation_error(R, turn(angle * axis) @ R)
    np.testing.assert_allclose(error, angle * axis, atol=1e-9)


@given(axes, components)
def test_of_half_a_turn_it_is_one_way_or_the_other(axis, posed):
    R = turn(posed)
    error = rotation_error(R, turn(np.pi * axis) @ R)
    assert np.linalg.norm(error) == pytest.approx(np.pi, abs=1e-6)
    assert abs(error @ axis) == pytest.approx(np.pi, abs=1e-6)


def test_many_errors_are_those_of_one():
    """Also at no turn, at hardly any, and at half a turn about each axis and between."""
    turns = [np.zeros(3), *(np.pi * np.eye(3)), *(1e-8 * np.eye(3)), *(-2.0 * np.eye(3))]
    turns += [np.pi * np.array([1.0, 1.0, 0.0]) / np.sqrt(2.0), np.array([1.0, -2.0, 0.5])]
    posed = turn(np.array([0.3, -0.2, 0.9]))
    for R in (np.eye(3), posed):
        desired = np.array([turn(vector) @ R for vector in turns])
        many = rotation_error(np.broadcast_to(R, desired.shape), desired)
        alone = np.array([rotation_error(R, each) for each in desired])
        # Half a turn is one way or the other.
        signs = np.sign(np.einsum("ki,ki->k", many, alone) + 1e-300)
        is_half = np.linalg.norm(alone, axis=1) > 3.14
        assert (signs[~is_half] > 0).all()
        np.testing.assert_allclose(many * signs[:, np.newaxis], alone, atol=2e-8)


@settings(max_examples=12)
@given(axes, st.sampled_from([10.0, 90.0, 170.0]), components)
def test_an_angular_velocity_along_it_brings_the_orientation_there(axis, degrees, posed):
    """The angle falls as exp(-t): from 170 degrees to 2e-5 rad in twelve time constants."""
    goal = turn(posed)
    R = turn(np.deg2rad(degrees) * axis) @ goal
    angles = []
    h = 0.1
    for _ in range(120):
        # Held for a tenth of the time constant.
        R = turn(h * rotation_error(R, goal)) @ R
        angles.append(np.linalg.norm(R - goal))
    assert (np.diff(angles) <= 1e-14).all()
    assert angles[-1] < 1e-3
    np.testing.assert_allclose(rotation_error(R, goal), 0.0, atol=1e-3)


@pytest.mark.parametrize("axis", np.eye(3))
def test_nothing_is_left_where_it_should_be(axis):
    np.testing.assert_allclose(rotation_error(turn(axis), turn(axis)), 0.0, atol=1e-16)

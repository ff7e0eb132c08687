"""Plane curves along which the end effector turns: every axis of it goes round a cone."""

import numpy as np
import pytest
from path_helpers import assert_derivatives
from pydrake.math import RollPitchYaw, RotationMatrix

from drake_rnn import PATHS
from drake_rnn.paths import Planar
from drake_rnn.robot.rotation import rotation_error

ANGLE = 0.349
CLOSED = sorted(
    kind
    for kind in ("circle", "nephroid", "four_ring", "clover", "deltoid", "cat", "square")
    if kind in PATHS
)


def path(kind="circle", **changes):
    options = {"size": 0.05, "period": 4.0, "cone": ANGLE, **changes}
    return PATHS[kind](**options)


@pytest.mark.parametrize("timing", ["uniform", "ramps"])
@pytest.mark.parametrize("kind", CLOSED)
def test_it_turns_with_the_angular_velocity_and_acceleration_that_it_says(kind, timing):
    assert issubclass(PATHS[kind], Planar)
    assert_derivatives(path(kind, timing=timing, laps=1))


@pytest.mark.parametrize("kind", CLOSED)
def test_it_begins_with_the_first_orientation_and_ends_there(kind):
    turning = path(kind, timing="ramps", laps=2)
    for t in (0.0, 4.0, 8.0, 100.0, -1.0):
        np.testing.assert_allclose(turning.evaluate_rotation(t)[0], np.eye(3), atol=1e-12)
    for t in (100.0, -1.0):
        assert not np.any(turning.evaluate_rotation(t)[1:])
    halfway = turning.evaluate_rotation(2.0)[0]
    # From one side of the cone to the other; the two tilts are about one axis.
    assert np.linalg.norm(rotation_error(np.eye(3), halfway)) == pytest.approx(2 * ANGLE)


@pytest.mark.parametrize("plane", ["xy", "xz", "yz"])
@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_the_normal_of_the_plane_is_the_axis_of_the_cone(plane, angle):
    """The tilt has the cone's angle all the time, about an axis in the plane that goes round."""
    rotation = [0.3, -0.5, 1.1]
    turning = path(plane=plane, angle=angle, rotation=rotation)
    axes = RotationMatrix(RollPitchYaw(*rotation)).matrix()
    names = "xyz"
    x, y = (axes[:, names.index(name)] for name in plane)
    normal = np.cross(x, y)
    first = np.cos(angle) * x + np.sin(angle) * y
    tilt = RotationMatrix(
        np.eye(3)
        + np.sin(ANGLE) * _cross(first)
        + (1 - np.cos(ANGLE)) * _cross(first) @ _cross(first)
    ).matrix()
    for t in np.linspace(0.0, 4.0, 17):
        C = turning.evaluate_rotation(t)[0] @ tilt
        turned = rotation_error(np.eye(3), C)
        assert np.linalg.norm(turned) == pytest.approx(ANGLE, abs=1e-12)
        assert turned @ normal == pytest.approx(0.0, abs=1e-12)
        # The axis of the tilt goes round with the phase, from x to y.
        phase = 2 * np.pi * t / 4.0
        along = np.cos(phase) * first + np.sin(phase) * np.cross(normal, first)
        np.testing.assert_allclose(turned, ANGLE * along, atol=1e-12)


def _cross(u):
    return np.array([[0, -u[2], u[1]], [u[2], 0, -u[0]], [-u[1], u[0], 0]])


def test_without_a_cone_nothing_turns():
    plain = path(cone=0.0)
    assert not plain.turns
    assert path().turns
    R, w, alpha = plain.evaluate_rotation(1.3)
    np.testing.assert_array_equal(R, np.eye(3))
    assert not np.any((w, alpha))

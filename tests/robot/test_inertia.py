"""The largest inertia of each joint exceeds the mass matrix at any posture."""

import numpy as np
import pytest

from drake_rnn import JointLimits, load_arm, shipped_arms
from drake_rnn.robot.postures import largest_inertia


@pytest.mark.parametrize("name", shipped_arms())
def test_it_exceeds_the_mass_matrix_at_postures_that_it_has_not_seen(name):
    """1.1: what 1000 postures miss of the largest row sums."""
    arm = load_arm(name)
    R, M = np.diag(largest_inertia(arm)), arm.kinematics().M
    limits = arm.limits
    postures = np.random.default_rng(1).uniform(
        limits.position_lower, limits.position_upper, (200, arm.n)
    )
    for q in postures:
        assert np.linalg.eigvalsh(1.1 * R - M(q))[0] >= 0.0


def test_it_is_that_of_the_home_posture_at_least():
    """The planar arm at home is nearly outstretched, which 1000 postures at random are not."""
    arm = load_arm("planar6")
    outstretched = np.zeros(arm.n)
    at_home = load_arm("planar6", home=outstretched.tolist())
    rows = np.abs(arm.kinematics().M(outstretched)).sum(axis=1)
    assert (largest_inertia(at_home) >= rows).all()
    assert (largest_inertia(at_home) >= largest_inertia(arm)).all()


def test_a_heavier_arm_has_more_and_the_same_arm_the_same():
    arm = load_arm("iiwa14")
    heavy = arm.replace(mass_scale=2.0)
    np.testing.assert_allclose(largest_inertia(heavy), 2.0 * largest_inertia(arm), rtol=1e-12)
    np.testing.assert_array_equal(largest_inertia(arm), largest_inertia(arm))


def test_joints_without_limits_and_arms_without_a_home_have_one_too():
    arm = load_arm("ur5")
    unlimited = load_arm("ur5").with_limits(JointLimits.unlimited(6))
    one_sided = arm.with_limits(arm.limits.replace(position_upper=np.inf))
    expected = largest_inertia(arm)
    for found in (largest_inertia(unlimited), largest_inertia(one_sided)):
        np.testing.assert_allclose(found, expected, rtol=0.1)
    arm.home = None
    assert (largest_inertia(arm) > 0).all()

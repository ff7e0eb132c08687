"""Gains of motors: those given, or those that the arm's inertia asks for."""

import numpy as np
import pytest
from scipy.linalg import eig

from drake_rnn import InvalidInputError, PlantArm, PlantSettings, load_arm, shipped_arms
from drake_rnn.robot.postures import largest_inertia
from drake_rnn.systems.plant import (
    BANDWIDTH,
    motor_gains,
)

ARM = load_arm("iiwa14", frame="tip")


@pytest.mark.parametrize("name", shipped_arms())
def test_no_motion_of_the_arm_about_its_command_oscillates_or_lasts(name):
    """Roots of M s^2 + D s + K at postures it has not seen: real, and at least half the bandwidth.

    To 10 %, what the largest inertia misses of these postures.
    """
    arm = load_arm(name)
    K, D = (np.diag(gains) for gains in motor_gains(arm, PlantSettings()))
    limits, M, n = arm.limits, arm.kinematics().M, arm.n
    postures = np.random.default_rng(1).uniform(
        limits.position_lower, limits.position_upper, (20, n)
    )
    for q in postures:
        A = np.block([[np.zeros((n, n)), np.eye(n)], [-K, -D]])
        B = np.block([[np.eye(n), np.zeros((n, n))], [np.zeros((n, n)), M(q)]])
        roots = eig(A, B, right=False)
        assert (-roots.real >= 0.45 * BANDWIDTH).all()
        assert (np.abs(roots.imag) <= 0.35 * np.abs(roots.real)).all()


def test_motors_of_equal_gains_would_be_slow_at_the_base_of_a_large_arm():
    """The planar arm's at 2000 Nm/rad: 10 rad/s, and the iiwa's 20."""
    for name, slowest in (("planar6", 10.0), ("iiwa14", 20.0)):
        arm = load_arm(name)
        gains = motor_gains(arm, PlantSettings(stiffness=2000.0, damping=60.0))
        rates = np.sqrt(gains.stiffness / largest_inertia(arm))
        assert rates.min() < slowest


def test_gains_grow_with_the_bandwidth_and_with_the_rotors():
    slow, fast, geared = (
        motor_gains(ARM, settings)
        for settings in (
            PlantSettings(bandwidth=50.0),
            PlantSettings(bandwidth=200.0),
            PlantSettings(bandwidth=50.0, reflected_inertia=1.5),
        )
    )
    np.testing.assert_allclose(fast.stiffness, 16.0 * slow.stiffness)
    np.testing.assert_allclose(fast.damping, 4.0 * slow.damping)
    np.testing.assert_allclose(geared.stiffness - slow.stiffness, 50.0**2 * 1.5)
    np.testing.assert_allclose(geared.damping - slow.damping, 2.0 * 50.0 * 1.5)


LINK = """<link name="{name}"><inertial><mass value="{mass}"/><origin xyz="{at} 0 0"/>
<inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
PENDULUM = """<robot name="pendulum"><link name="base"/>{rod}{tool}
<joint name="hinge" type="revolute"><parent link="base"/><child link="rod"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" velocity="3" effort="100"/></joint>
<joint name="weld" type="fixed"><parent link="rod"/><child link="tool"/>
<origin xyz="1 0 0"/></joint></robot>"""


def test_it_is_that_of_the_arm_and_its_tool(tmp_path):
    """A mass of 2 kg at 0.5 m and a tool of 0.3 kg at 1 m: 0.8 kg m^2."""
    file = tmp_path / "pendulum.urdf"
    rod, tool = (
        LINK.format(name=name, mass=mass, at=at)
        for name, mass, at in (("rod", 2.0, 0.5), ("tool", 0.3, 0.0))
    )
    file.write_text(PENDULUM.format(rod=rod, tool=tool))
    gains = motor_gains(load_arm(file, frame="rod"), PlantSettings(bandwidth=10.0))
    np.testing.assert_allclose(gains.stiffness, [80.0])
    np.testing.assert_allclose(gains.damping, [16.0])


def test_what_is_given_is_taken_and_the_other_gain_is_critical_for_it():
    each = np.arange(1.0, 8.0) * 100.0
    given = motor_gains(ARM, PlantSettings(stiffness=each, damping=60.0))
    np.testing.assert_array_equal(given.stiffness, each)
    np.testing.assert_array_equal(given.damping, np.full(7, 60.0))
    R = largest_inertia(ARM)
    np.testing.assert_allclose(
        motor_gains(ARM, PlantSettings(stiffness=2000.0)).damping, 2.0 * np.sqrt(2000.0 * R)
    )
    np.testing.assert_array_equal(
        motor_gains(ARM, PlantSettings(damping=60.0)).stiffness,
        motor_gains(ARM, PlantSettings()).stiffness,
    )


def test_the_plants_motors_have_them():
    """In the plant's own order of motors; to a rounding error."""
    body = PlantArm(ARM)
    gains = motor_gains(ARM, PlantSettings())
    for index in body.plant.GetJointActuatorIndices():
        motor = body.plant.get_joint_actuator(index)
        k = ARM.joints.index(motor.joint().name())
        assert motor.get_controller_gains().p == gains.stiffness[k]
        assert motor.get_controller_gains().d == gains.damping[k]


def test_gains_for_another_number_of_joints_are_refused():
    for name in ("stiffness", "damping"):
        with pytest.raises(
            InvalidInputError,
            match=rf"^plant\.{name}: must have 7 entries, one per joint of iiwa14, not 2$",
        ):
            PlantArm(ARM, settings=PlantSettings(**{name: [1.0, 2.0]}))

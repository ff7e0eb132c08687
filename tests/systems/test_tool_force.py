"""What a force-torque sensor between arm and tool says."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pydrake.common.value import Value
from pydrake.multibody.math import SpatialForce

from drake_rnn import load_arm
from drake_rnn.systems import ToolForce

ARM = load_arm("iiwa14", frame="tip")
MASS = 0.7
JOINT = 2
BODY = "tool"
R = ARM.replace(frame=BODY, joints=list(ARM.joints)).kinematics().R_WE
R_EJ = ARM.kinematics().R_WE(ARM.home).T @ R(ARM.home)
SENSOR = ToolForce(ARM, JOINT, R_EJ, MASS)


def told(held, q):
    """For what the joint exerts on the tool, in the tool's frame; others exert 99 N."""
    forces = [SpatialForce(np.zeros(3), np.full(3, 99.0)) for _ in range(4)]
    forces[JOINT] = SpatialForce(np.zeros(3), np.asarray(held))
    context = SENSOR.CreateDefaultContext()
    SENSOR.GetInputPort("reaction_forces").FixValue(context, Value[list[SpatialForce]](forces))
    SENSOR.GetInputPort("position").FixValue(context, q)
    return SENSOR.get_output_port().Eval(context)


@given(
    arrays(float, 3, elements=st.floats(-50, 50)), arrays(float, 7, elements=st.floats(-1.5, 1.5))
)
def test_a_tool_at_rest_feels_what_joint_and_weight_leave(force, q):
    """Newton: joint, weight and surroundings sum to zero; in any posture."""
    held = R(q).T @ (-force - MASS * ARM.gravity)
    np.testing.assert_allclose(told(held, q), force, atol=1e-12)


def test_a_tool_that_only_hangs_feels_nothing():
    """The joint carries its weight."""
    held = R(ARM.home).T @ (-MASS * ARM.gravity)
    np.testing.assert_allclose(told(held, ARM.home), 0.0, atol=1e-12)


def test_before_the_plants_first_step_it_says_nothing():
    """Not that the tool is held up by something, as no joint force and a weight would mean."""
    np.testing.assert_array_equal(told(np.zeros(3), ARM.home), 0.0)


def test_in_another_gravity_the_tool_weighs_otherwise():
    sideways = ARM.replace(gravity=[0.0, -9.81, 0.0], joints=list(ARM.joints))
    sensor = ToolForce(sideways, 0, R_EJ, MASS)
    context = sensor.CreateDefaultContext()
    held = R(ARM.home).T @ np.array([0.0, MASS * 9.81, 0.0])
    forces = [SpatialForce(np.zeros(3), held)]
    sensor.GetInputPort("reaction_forces").FixValue(context, Value[list[SpatialForce]](forces))
    sensor.GetInputPort("position").FixValue(context, ARM.home)
    assert sensor.get_output_port().Eval(context) == pytest.approx(np.zeros(3), abs=1e-12)

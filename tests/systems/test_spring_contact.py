"""A surface that gives way like a spring."""

from types import SimpleNamespace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from drake_rnn import ElasticSurface, load_arm
from drake_rnn.systems import SpringContact

normals = arrays(float, 3, elements=st.floats(-1, 1)).filter(lambda n: np.linalg.norm(n) > 0.1)
points = arrays(float, 3, elements=st.floats(-1, 1))
# Kinematics of an arm whose joint positions are the coordinates of its tip.
CARTESIAN = SimpleNamespace(p_WE=np.asarray)


def force_at(position, normal, p_WS=(0.0, 0.0, 0.0), stiffness=250.0, kinematics=CARTESIAN):
    surface = ElasticSurface(normal=normal, stiffness=stiffness)
    spring = SpringContact(surface, np.asarray(p_WS), len(position), kinematics)
    context = spring.CreateDefaultContext()
    spring.get_input_port().FixValue(context, position)
    return spring.get_output_port().Eval(context)


@given(points, normals, st.floats(1e-6, 0.1), points)
def test_a_depth_is_met_along_the_normal_by_its_stiffness(p_WS, normal, depth, sideways):
    """However long the normal, and wherever on the plane."""
    n = normal / np.linalg.norm(normal)
    p_WE = p_WS + (sideways - n.dot(sideways) * n) - depth * n
    np.testing.assert_allclose(force_at(p_WE, normal, p_WS), 250.0 * depth * n, atol=1e-11)


@given(points, normals, st.floats(1e-6, 0.1))
def test_above_the_surface_there_is_nothing(p_WS, normal, height):
    """It does not pull."""
    n = normal / np.linalg.norm(normal)
    np.testing.assert_array_equal(force_at(p_WS + height * n, normal, p_WS), 0.0)


def test_the_depth_is_that_of_the_arms_tip():
    """1e-11 N: rounding of what the tip's place is at the stiffness."""
    arm = load_arm("iiwa14", frame="tip")
    kinematics, q = arm.kinematics(), arm.home + 0.1
    n = np.array([0.0, 0.6, 0.8])
    p_WS = kinematics.p_WE(q) + 2e-3 * n + np.array([0.05, 0.0, 0.0])
    force = force_at(q, n, p_WS, kinematics=kinematics)
    np.testing.assert_allclose(force, 250.0 * 2e-3 * n, atol=1e-11)

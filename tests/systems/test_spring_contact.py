"""A surface that gives way like a spring."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from drake_rnn import ElasticSurface
from drake_rnn.systems import SpringContact

normals = arrays(float, 3, elements=st.floats(-1, 1)).filter(lambda n: np.linalg.norm(n) > 0.1)
points = arrays(float, 3, elements=st.floats(-1, 1))


def force_at(p_WE, normal, p_WS=(0.0, 0.0, 0.0), stiffness=250.0):
    surface = ElasticSurface(normal=normal, stiffness=stiffness)
    spring = SpringContact(surface, np.asarray(p_WS))
    context = spring.CreateDefaultContext()
    spring.get_input_port().FixValue(context, p_WE)
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

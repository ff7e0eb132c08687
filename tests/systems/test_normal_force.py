"""What of a force presses."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from drake_rnn.features.contact import NormalForce

N = np.array([0.6, 0.0, 0.8])


def pressing(force, normal=N):
    system = NormalForce()
    context = system.CreateDefaultContext()
    system.GetInputPort("force").FixValue(context, np.asarray(force))
    system.GetInputPort("normal_WE").FixValue(context, np.asarray(normal))
    (value,) = system.get_output_port().Eval(context)
    return value


@given(st.floats(-100.0, 100.0), arrays(float, 3, elements=st.floats(-100, 100)))
def test_what_lies_along_the_surface_does_not_press(along, sideways):
    """1e-12 N: rounding of 100 N."""
    sideways = sideways - N.dot(sideways) * N
    assert pressing(along * N + sideways) == pytest.approx(along, abs=1e-12)


def test_a_force_out_of_the_surface_presses_and_one_into_it_pulls():
    assert pressing(3.0 * N) == pytest.approx(3.0)
    assert pressing(-3.0 * N) == pytest.approx(-3.0)

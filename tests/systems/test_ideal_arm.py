"""The arm at the kinematic level: it is where it is told to be, and presses like a spring."""

import numpy as np
import pytest

from drake_rnn import Contact, ElasticSurface, ForceProfile, IdealArm, InvalidInputError, load_arm

IIWA = load_arm("iiwa14", frame="tip")
HOME = IIWA.home
N = np.array([0.3, 0.0, 1.0]) / np.linalg.norm([0.3, 0.0, 1.0])


def told(body, q, v):
    context = body.CreateDefaultContext()
    for name, value in (("position", q), ("velocity", v)):
        body.GetInputPort(f"{name}_commanded").FixValue(context, value)
    return lambda name: body.GetOutputPort(name).Eval(context)


@pytest.mark.parametrize("name", ["iiwa14", "planar6"])
def test_it_is_where_it_is_told_to_be(name):
    arm = load_arm(name)
    q, v = arm.home + 0.1, np.linspace(-0.3, 0.4, arm.n)
    port = told(IdealArm(arm), q, v)
    np.testing.assert_array_equal(port("position"), q)
    np.testing.assert_array_equal(port("velocity"), v)


def test_without_a_contact_there_is_no_force_to_ask_for():
    body = IdealArm(IIWA)
    assert not any(body.HasOutputPort(name) for name in ("tool_force", "contact_force"))


@pytest.mark.parametrize("gap", [-2e-3, 3e-3])
@pytest.mark.parametrize("start", [HOME, HOME + 0.1])
def test_the_surface_is_a_gap_below_the_tip_at_the_start(gap, start):
    """And pushes by its stiffness, wherever the tip is by then; 1e-9 N: rounding."""
    surface = ElasticSurface(stiffness=500.0, normal=N, gap=gap)
    body = IdealArm(IIWA, start, Contact(surface, ForceProfile(value=5.0)))
    p_WE = IIWA.kinematics().p_WE
    for q in (start, start + 0.01, start - 0.01):
        port = told(body, q, np.zeros(7))
        depth = N.dot(p_WE(start) - p_WE(q)) - gap
        expected = 500.0 * max(depth, 0.0) * N
        np.testing.assert_allclose(port("contact_force"), expected, atol=1e-9)
        np.testing.assert_array_equal(port("tool_force"), port("contact_force"))


def test_with_a_contact_all_three_axes_of_the_position_are_asked_for():
    contact = Contact(ElasticSurface(stiffness=500.0), ForceProfile(value=5.0))
    with pytest.raises(InvalidInputError, match="task: may be xyz, pose with a contact, not xy"):
        IdealArm(IIWA, contact=contact).check_task("xy")
    IdealArm(IIWA, contact=contact).check_task("xyz")
    IdealArm(IIWA).check_task("xy")

"""Joint limits and the box of velocities that they leave."""

from math import inf, nan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drake_rnn import InvalidInputError, JointLimits
from drake_rnn.documents import construct

N = 3


def numbers(low, high, **more):
    return st.lists(st.floats(low, high, **more), min_size=N, max_size=N).map(np.array)


@st.composite
def limits(draw):
    lower, width = draw(numbers(-10, 10)), draw(numbers(1e-3, 20))
    bounded = draw(numbers(0, 1)) < 0.8
    return JointLimits(
        position_lower=np.where(bounded, lower, -inf),
        position_upper=np.where(bounded, lower + width, inf),
        velocity=draw(numbers(1e-3, 1e3)),
    )


stiffnesses = st.floats(1e-2, 1e4)
postures = numbers(-100, 100)


def posture_inside(limits, shares):
    lower = np.maximum(limits.position_lower, -50)
    upper = np.minimum(limits.position_upper, 50)
    return np.clip(lower + shares * (upper - lower), lower, upper)


@given(limits(), postures, stiffnesses)
def test_there_is_always_a_velocity_that_is_allowed(limits, q, stiffness):
    lower, upper = limits.velocity_box(q, stiffness)
    assert (lower <= upper).all()


@given(limits(), postures, stiffnesses)
def test_no_velocity_beyond_the_largest_speed_is_allowed(limits, q, stiffness):
    box = np.array(limits.velocity_box(q, stiffness))
    assert (np.abs(box) <= limits.velocity).all()


@given(limits(), stiffnesses)
def test_at_its_limit_a_joint_may_not_go_on(limits, stiffness):
    at_upper = np.where(np.isfinite(limits.position_upper), limits.position_upper, 0.0)
    at_lower = np.where(np.isfinite(limits.position_lower), limits.position_lower, 0.0)
    bounded = np.isfinite(limits.position_upper)
    assert (limits.velocity_box(at_upper, stiffness)[1][bounded] == 0).all()
    assert (limits.velocity_box(at_lower, stiffness)[0][bounded] == 0).all()


@given(limits(), st.floats(1e-3, 10), stiffnesses)
def test_from_beyond_its_limit_a_joint_must_return(limits, excess, stiffness):
    bounded = np.isfinite(limits.position_upper)
    above = np.where(bounded, limits.position_upper + excess, 0.0)
    below = np.where(bounded, limits.position_lower - excess, 0.0)
    assert (limits.velocity_box(above, stiffness)[1][bounded] < 0).all()
    assert (limits.velocity_box(below, stiffness)[0][bounded] > 0).all()


@given(limits(), numbers(0, 1), numbers(0, 1), stiffnesses, st.floats(0.01, 1))
def test_a_velocity_in_the_box_held_for_a_sample_does_not_cross_a_limit(
    limits, place, choice, stiffness, product
):
    """A sample of at most 1/stiffness; 1e-12 rad: rounding of some tens of rad."""
    q = posture_inside(limits, place)
    lower, upper = limits.velocity_box(q, stiffness)
    q = q + product / stiffness * (lower + choice * (upper - lower))
    assert limits.violation(q).max() < 1e-12


@given(postures)
def test_without_limits_every_velocity_is_allowed(q):
    lower, upper = JointLimits.unlimited(N).velocity_box(q, 2.0)
    assert (lower == -inf).all()
    assert (upper == inf).all()


def simple(**more):
    return JointLimits(
        **{"position_lower": [-1, -2], "position_upper": [1, 2], "velocity": [3, 4], **more}
    )


def test_a_number_stands_for_every_joint():
    limits = simple().replace(velocity=0.5, acceleration=np.float32(2))
    np.testing.assert_array_equal(limits.velocity, [0.5, 0.5])
    np.testing.assert_array_equal(limits.acceleration, [2, 2])
    np.testing.assert_array_equal(limits.position_upper, [1, 2])


def test_some_joints_limits_can_be_taken_in_any_order():
    limits = simple(acceleration=[5, 6]).select([1])
    assert limits.size == 1
    np.testing.assert_array_equal(limits.acceleration, [6])
    assert limits.jerk is None
    np.testing.assert_array_equal(simple().select([1, 0]).velocity, [4, 3])


def test_violation_is_the_way_back_to_the_limits():
    q = np.array([[0.0, 0.0], [1.5, -2.25]])
    np.testing.assert_array_equal(simple().violation(q), [[0, 0], [0.5, 0.25]])


def test_a_missing_bound_is_said_to_be_missing_with_the_reason():
    with pytest.raises(InvalidInputError, match=r"^limits\.jerk: not known .* for braking; give"):
        simple().require("jerk", "braking")
    np.testing.assert_array_equal(simple().require("velocity", "braking"), [3, 4])


def test_limits_do_not_change():
    with pytest.raises(ValueError, match="read-only"):
        simple().velocity[0] = 1.0
    with pytest.raises(AttributeError):
        simple().velocity = np.ones(2)


@pytest.mark.parametrize(
    ("bounds", "message"),
    [
        (
            {"position_lower": [-1, 3]},
            "limits.position_lower: must be below position_upper, not 3 and 2 as for joint 2",
        ),
        (
            {"position_lower": [1, -2]},
            "limits.position_lower: must be below position_upper, not 1 and 1 as for joint 1",
        ),
        ({"velocity": [0, 1]}, "limits.velocity: must be positive, not [0.0, 1.0]"),
        ({"acceleration": [-1, 1]}, "limits.acceleration: must be positive, not [-1.0, 1.0]"),
        (
            {"velocity": [1, 2, 3]},
            "limits.velocity: must have 2 entries like position_lower, not 3",
        ),
        (
            {"velocity": [nan, 1]},
            "limits.velocity: must be one list of numbers, none of them NaN, not [nan, 1]",
        ),
        ({"jerk": "fast"}, "limits.jerk: must be a list of numbers, not 'fast'"),
        ({"velocty": [1, 1]}, "limits.velocty: no such key; nearest: velocity"),
    ],
)
def test_limits_that_cannot_be_are_refused_by_name(bounds, message):
    with pytest.raises(InvalidInputError) as caught:
        construct(JointLimits, simple().merged(bounds), "limits")
    assert str(caught.value) == message
    with pytest.raises(InvalidInputError):
        simple(**bounds)


@pytest.mark.parametrize("bounds", [{}, {"position_lower": [-1]}])
def test_limits_need_position_and_velocity(bounds):
    with pytest.raises(InvalidInputError, match=r"limits\.position_(lower|upper): must be given"):
        construct(JointLimits, bounds, "limits")

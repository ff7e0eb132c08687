"""Joint limits and the box of velocities that they leave."""

from math import inf, nan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drake_rnn import InvalidInputError, JointLimits
from drake_rnn.inputs.documents import construct

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
            "limits.position_lower: must be below position_upper, but they are 3 and 2 for joint 2",
        ),
        (
            {"position_lower": [1, -2]},
            "limits.position_lower: must be below position_upper, but they are 1 and 1 for joint 1",
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
        ({"velocty": [1, 1]}, "limits.velocty: no such key; nearest: velocity, velocity_lower"),
    ],
)
def test_limits_that_cannot_be_are_refused_by_name(bounds, message):
    with pytest.raises(InvalidInputError) as caught:
        construct(JointLimits, simple().merge(bounds), "limits")
    assert str(caught.value) == message
    with pytest.raises(InvalidInputError):
        simple(**bounds)


@pytest.mark.parametrize("bounds", [{}, {"position_lower": [-1]}])
def test_limits_need_position_and_velocity(bounds):
    with pytest.raises(InvalidInputError, match=r"limits\.position_(lower|upper): must be given"):
        construct(JointLimits, bounds, "limits")


# Accelerations that keep every bound.


@st.composite
def braking(draw):
    """Limits, a period, and a safe state: slow enough, and with the way that braking takes."""
    lower, width = draw(numbers(-5, 5)), draw(numbers(1e-3, 10))
    bounded = draw(numbers(0, 1)) < 0.8
    limits = JointLimits(
        position_lower=np.where(bounded, lower, -inf),
        position_upper=np.where(bounded, lower + width, inf),
        velocity=np.where(draw(numbers(0, 1)) < 0.9, draw(numbers(0.01, 10)), inf),
        acceleration=np.where(draw(numbers(0, 1)) < 0.9, draw(numbers(0.01, 100)), inf),
    )
    period = draw(st.sampled_from([1e-4, 1e-3, 1e-2, 0.1]))
    q = np.where(bounded, lower + draw(numbers(0, 1)) * width, draw(numbers(-5, 5)))
    toward = np.where(draw(numbers(0, 1)) < 0.5, -1.0, 1.0)
    room = np.where(toward > 0, limits.position_upper - q, q - limits.position_lower)
    # From w a joint needs w^2 / 2a and, in samples, w h; of half the room.
    h = period
    fastest = np.where(
        np.isfinite(room),
        np.minimum(room, 1e9) / (h + np.sqrt(h * h + np.minimum(room, 1e9) / limits.acceleration)),
        np.minimum(limits.velocity, 10),
    )
    v = toward * draw(numbers(0, 1)) * np.minimum(fastest, limits.velocity)
    return limits, period, q, v


def adversary(kind, limits, rng, size):
    """What is asked for, far beyond what is allowed: k samples by n joints."""
    most = 3 * np.minimum(limits.acceleration, 1e3)
    if kind == "random":
        return most * rng.uniform(-1, 1, (size, N))
    if kind == "bang-bang":
        switches = np.cumsum(rng.random((size, N)) < 0.02, axis=0)
        return most * np.where(switches % 2 == 0, 1.0, -1.0)
    return np.broadcast_to(most * rng.choice([-1, 1], N), (size, N))


def driven(limits, period, q, v, demands, box=True):
    """Positions, velocities and accelerations of joints that do what is asked within the box."""
    positions, velocities, slopes = [q], [v], []
    for demand in demands:
        if box:
            lower, upper = limits.acceleration_box(q, v, period)
            assert (lower <= upper).all()
        else:
            lower, upper = -limits.acceleration, limits.acceleration
        slope = np.clip(demand, lower, upper)
        q, v = q + period * (v + period / 2 * slope), v + period * slope
        positions.append(q)
        velocities.append(v)
        slopes.append(slope)
    return np.array(positions), np.array(velocities), np.array(slopes)


def highest(positions, velocities, slopes):
    """Of each joint, the lowest and highest position at a sample or between two."""
    with np.errstate(divide="ignore", invalid="ignore"):
        turning = -(np.asarray(velocities[:-1]) ** 2) / (2 * slopes) + positions[:-1]
    turns = np.asarray(velocities[:-1]) * velocities[1:] < 0
    between = np.where(turns, turning, positions[:-1])
    everything = np.concatenate((positions, between))
    return everything.min(axis=0), everything.max(axis=0)


@settings(max_examples=40)
@given(
    braking(),
    st.sampled_from(["random", "bang-bang", "outward"]),
    st.integers(0, 2**32 - 1),
)
def test_whatever_is_asked_no_bound_is_ever_broken(start, kind, seed):
    """Between samples neither; 1e-9 rad, rad/s and rad/s^2: rounding."""
    limits, period, q, v = start
    demands = adversary(kind, limits, np.random.default_rng(seed), 500)
    positions, velocities, slopes = driven(limits, period, q, v, demands)
    lowest, most = highest(positions, velocities, slopes)
    assert (lowest >= limits.position_lower - 1e-9).all()
    assert (most <= limits.position_upper + 1e-9).all()
    assert (np.abs(velocities) <= limits.velocity + 1e-9).all()
    assert (np.abs(slopes) <= limits.acceleration).all()


BRAKING = JointLimits(
    position_lower=[-1.0], position_upper=[1.0], velocity=[0.8], acceleration=[2.0]
)


@pytest.mark.parametrize("period", [1e-3, 1e-2, 0.1])
def test_a_joint_driven_outward_comes_to_rest_at_its_limit_and_not_before(period):
    """On the way it is as fast as it may be; 1e-3 rad: it nears the limit like w, then w^2."""
    demands = np.full((round(6 / period), 1), 100.0)
    positions, velocities, _ = driven(BRAKING, period, np.zeros(1), np.zeros(1), demands)
    assert velocities.max() == pytest.approx(0.8, abs=1e-9)
    assert 0 <= 1.0 - positions[-1, 0] < 1e-3
    # Without the box it is 30 rad off.
    free, _, _ = driven(BRAKING, period, np.zeros(1), np.zeros(1), demands, box=False)
    assert free[-1, 0] > 30


@given(
    q=st.floats(1e-6, 2.0).map(lambda excess: 1.0 + excess),
    v=st.floats(-0.8, 0.0),
    period=st.sampled_from([4e-3, 2e-2, 0.1]),
    above=st.booleans(),
)
@settings(max_examples=30)
def test_a_joint_outside_is_brought_back_and_never_goes_on(q, v, period, above):
    """However hard it is pushed outward: to the limit itself, within 1e-9 rad."""
    way = 1.0 if above else -1.0
    demands = np.full((round(6 / period), 1), way * 100.0)
    positions, velocities, slopes = driven(
        BRAKING, period, np.array([way * q]), np.array([way * v]), demands
    )
    assert (np.abs(slopes) <= 2.0).all()
    assert (np.abs(velocities) <= 0.8 + 1e-9).all()
    assert (np.diff(BRAKING.violation(positions), axis=0) <= 1e-12).all()
    assert BRAKING.violation(positions[-1]) < 1e-9


@given(q=st.floats(-0.5, 0.5), v=st.floats(0.9, 5.0), period=st.sampled_from([4e-3, 2e-2, 0.1]))
@settings(max_examples=30)
def test_a_joint_that_is_too_fast_is_slowed_down_as_hard_as_it_may(q, v, period):
    demands = np.full((round(12 / period), 1), 100.0)
    positions, velocities, slopes = driven(BRAKING, period, np.array([q]), np.array([v]), demands)
    fast = velocities[:-1, 0] > 0.8 + 2.0 * period
    np.testing.assert_array_equal(slopes[fast], -2.0)
    # It may leave the limits, and then returns to them.
    assert BRAKING.violation(positions[-1]) < 1e-9
    assert np.abs(velocities[-1]) < 1e-6 + 2.0 * period


def test_without_bounds_every_acceleration_is_allowed():
    limits = JointLimits.unlimited(N).replace(acceleration=inf)
    lower, upper = limits.acceleration_box(np.array([0.0, 1e3, -1e3]), np.ones(N), 1e-3)
    assert (lower == -inf).all()
    assert (upper == inf).all()


def test_without_an_acceleration_bound_a_joint_may_stop_at_once():
    """So it may go as far in a sample as the limit is away."""
    limits = JointLimits(
        position_lower=[-1.0], position_upper=[1.0], velocity=[inf], acceleration=[inf]
    )
    _, upper = limits.acceleration_box(np.array([0.9]), np.zeros(1), 0.01)
    # The ramp up takes half of the way, the ramp down the other.
    np.testing.assert_allclose(upper, (0.1 / 0.01) / 0.01)
    stuck = limits.acceleration_box(np.array([1.0]), np.zeros(1), 0.01)
    assert stuck[1] == 0.0


def test_to_brake_in_time_an_acceleration_must_be_known():
    with pytest.raises(InvalidInputError, match=r"^limits\.acceleration: not known .* braking"):
        simple().acceleration_box(np.zeros(2), np.zeros(2), 1e-3)


def held(limits, period, q, v, wishes):
    """Positions and velocities of joints that hold what is wished for, cut to the box."""
    positions, velocities = [q], [v]
    for wish in wishes:
        lower, upper = limits.held_velocity_box(q, v, period)
        assert (lower <= upper).all()
        v = np.clip(wish, lower, upper)
        q = q + period * v
        positions.append(q)
        velocities.append(v)
    return np.array(positions), np.array(velocities)


@settings(max_examples=40, deadline=None)
@given(
    braking(),
    st.sampled_from(["random", "bang-bang", "outward"]),
    st.integers(0, 2**32 - 1),
)
def test_whatever_velocity_is_asked_for_no_bound_is_ever_broken(start, kind, seed):
    """From rest; 1e-9 rad, rad/s and, as a share, of the acceleration: rounding."""
    limits, period, q, _ = start
    wishes = adversary(kind, limits, np.random.default_rng(seed), 600)
    positions, velocities = held(limits, period, q, np.zeros(q.size), wishes)
    slopes = np.abs(np.diff(velocities, axis=0)) / period
    assert limits.violation(positions).max() <= 1e-9
    assert (np.abs(velocities) <= limits.velocity + 1e-9).all()
    assert (slopes <= limits.acceleration * (1 + 1e-9) + 1e-9).all()


@pytest.mark.parametrize("period", [1e-3, 1e-2, 0.1])
def test_a_held_velocity_stops_at_the_limit_itself_and_could_not_be_larger(period):
    """Braked from it in whole samples: at the limit to 1e-12 rad, and beyond it if faster."""
    # Also what takes one sample, two and three: to a h^2, to 3 a h^2 and to 6 a h^2.
    for room in (1e-6, 0.0123, 0.5, 1.9, *(2.0 * period**2 * np.array([0.5, 2.0, 5.0]))):
        _, upper = BRAKING.stopping_box(np.array([1.0 - room]), period)
        assert stopped(1.0 - room, upper[0], period) == pytest.approx(1.0, abs=1e-12)
        assert stopped(1.0 - room, upper[0] + 1e-6, period) > 1.0 + 0.9e-6 * period


def stopped(q, v, period):
    """The position of a joint that brakes at 2 rad/s^2 in whole samples."""
    while v > 0.0:
        q, v = q + period * v, v - 2.0 * period
    return q


def test_a_joint_that_is_asked_to_pass_its_limit_stops_there():
    positions, velocities = held(BRAKING, 1e-2, np.zeros(1), np.zeros(1), np.full((1000, 1), 5.0))
    assert velocities.max() == pytest.approx(0.8)
    assert abs(1.0 - positions[-1, 0]) < 1e-12


@given(st.floats(1e-9, 2.0), st.sampled_from([4e-3, 2e-2, 0.1]), st.booleans())
@settings(max_examples=20)
def test_a_joint_outside_is_led_back_by_held_velocities(excess, period, above):
    way = 1.0 if above else -1.0
    wishes = np.full((round(16 / period), 1), way * 5.0)
    positions, velocities = held(
        BRAKING, period, np.array([way * (1.0 + excess)]), np.zeros(1), wishes
    )
    assert (np.abs(np.diff(velocities, axis=0)) <= 2.0 * period * (1 + 1e-9)).all()
    assert (np.diff(BRAKING.violation(positions), axis=0) <= 1e-12).all()
    assert BRAKING.violation(positions[-1]) < 1e-6


def test_without_limits_every_velocity_may_be_held():
    limits = JointLimits.unlimited(N).replace(acceleration=inf)
    lower, upper = limits.held_velocity_box(np.array([0.0, 1e3, -1e3]), np.ones(N), 1e-3)
    assert (lower == -inf).all()
    assert (upper == inf).all()


def test_a_joint_that_may_stop_at_once_may_use_all_its_room_in_a_sample():
    limits = JointLimits(position_lower=[-1.0], position_upper=[1.0], velocity=[inf])
    _, upper = limits.stopping_box(np.array([0.9]), 0.01, np.array([inf]))
    np.testing.assert_allclose(upper, 0.1 / 0.01)
    with pytest.raises(InvalidInputError, match=r"^limits\.acceleration: not known .* braking"):
        limits.held_velocity_box(np.zeros(1), np.zeros(1), 0.01)

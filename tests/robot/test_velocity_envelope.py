"""Velocity limits by the way left to a position limit, with wishes that do all they can."""

import numpy as np
import pytest
from jerk_helpers import assert_one_joint_has_the_box_of_many, joints, spread
from test_jerk_box import Wishes

from drake_rnn import JointLimits, require_jax
from drake_rnn.laws.parts.bounded_velocity import reached_limits
from drake_rnn.robot.jerk_stop import course, stop
from drake_rnn.robot.velocity_envelope import (
    JerkLimits,
    VelocityEnvelope,
    farthest,
    jerk_box,
)

#: Limits of the FR3's joints 2 and 5, whose D is below and above the largest acceleration.
FR3 = JerkLimits(
    np.array([[-1.7918, -2.8101], [1.7918, 2.8101]]),
    *(np.array(bound) for bound in ([2.619, 5.259], [9.999, 9.999], [4999.9, 4999.9])),
    VelocityEnvelope(np.array([0.201, 0.351]), np.array([2.585, 17.0])),
)


def with_envelopes(rng, count):
    """Joints of all kinds; at rest up to four tenths of their range is out of their reach."""
    limits = joints(rng, count)
    width = np.ptp(limits.position, axis=0)
    D = np.where(rng.random(count) < 0.1, np.inf, spread(rng, 0.3, 30.0, count))
    finite = np.where(np.isfinite(D), D, 1.0)
    offset = np.sqrt(2.0 * finite * width * rng.uniform(0.0, 0.4, count))
    return limits._replace(envelope=VelocityEnvelope(offset, D))


def starts(rng, limits):
    """Positions in which joints may rest."""
    envelope, (lower, upper) = limits.envelope, limits.position
    room = envelope.room(0.0 * envelope.offset)
    return rng.uniform(lower + room, upper - room)


def excess(q, v, limits):
    """How far velocities are beyond the envelope of ``limits`` [rad/s]."""
    lowest, highest = limits.envelope.velocities(q, tuple(limits.position))
    return np.maximum(v - highest, lowest - v)


def driven(limits, period, steps, envelope):
    """Largest excess over the envelope of ``limits``, in a box that knows the one given."""
    rng = np.random.default_rng(5)
    q = starts(rng, limits)
    v = a = np.zeros(q.size)
    wish, worst = Wishes(rng, limits, period), -np.inf
    for k in range(steps):
        slowest, fastest = jerk_box(q, v, a, limits._replace(envelope=envelope), period)
        assert (slowest <= fastest).all()
        assert (np.maximum(fastest - a, a - slowest) <= limits.jerk * period * (1 + 1e-9)).all()
        a = np.clip(wish(k), slowest, fastest)
        v = v + period * a
        # Within the envelope at both ends of the sample.
        worst = max(worst, excess(q, v, limits).max(), excess(q + period * v, v, limits).max())
        q = q + period * v
    return worst


@pytest.mark.parametrize("period", [1e-3, 1e-2])
def test_the_envelope_is_kept_whatever_is_wished_for(period):
    limits = with_envelopes(np.random.default_rng(4), 700)
    assert driven(limits, period, 300, limits.envelope) < 1e-9


@pytest.mark.parametrize("period", [1e-3, 1e-2])
def test_few_joints_are_worked_out_in_plain_numbers_with_the_same_bits(period):
    rng = np.random.default_rng(6)
    limits = with_envelopes(rng, 960)
    v = limits.velocity * rng.uniform(-1.1, 1.1, 960)
    b = limits.acceleration * rng.uniform(-1.0, 1.0, 960)
    b[::7] = 0.0
    many = farthest(v, b, limits.envelope, limits.acceleration, limits.jerk, period)
    assert np.isfinite(many).all()
    for few in np.split(np.arange(960), 48):
        envelope = VelocityEnvelope(*(part[few] for part in limits.envelope))
        bounds = limits.acceleration[few], limits.jerk[few]
        found = farthest(v[few], b[few], envelope, *bounds, period)
        np.testing.assert_array_equal(found, many[few])


def test_a_box_that_knows_no_envelope_breaks_it():
    limits = with_envelopes(np.random.default_rng(4), 350)
    assert driven(limits, 4e-3, 300, envelope=None) > 0.5


@pytest.mark.parametrize(
    ("period", "count", "steps"),
    [
        pytest.param(1e-3, 1400, 1500, marks=pytest.mark.long),
        *(pytest.param(h, 2800, 3000, marks=pytest.mark.nightly) for h in (1e-3, 4e-3, 1e-2)),
    ],
)
def test_the_envelope_is_kept_in_long_runs_of_many_joints(period, count, steps):
    limits = with_envelopes(np.random.default_rng(6), count)
    assert driven(limits, period, steps, limits.envelope) < 1e-9


def stopped(w, b, limits, period):
    """The largest H of a stop, sample by sample."""
    bounds = limits.acceleration, limits.jerk, period
    q, v, a = period * w, w, b
    largest = q + limits.envelope.room(v)
    while (np.abs(v) > 1e-12).any() or (np.abs(a) > 1e-9).any():
        a = stop(q, v, a, *bounds).first
        v = v + period * a
        q = q + period * v
        largest = np.maximum(largest, q + limits.envelope.room(v))
    return largest


def moving(rng, limits):
    """Velocities and accelerations of joints that are to stop."""
    return limits.velocity * rng.uniform(-1, 1, limits.jerk.size), limits.acceleration * (
        rng.uniform(-1, 1, limits.jerk.size)
    )


@pytest.mark.parametrize(
    "jerk", [(100.0, 3000.0), pytest.param((5.0, 50.0), marks=pytest.mark.long)]
)
def test_where_h_is_largest_is_found_and_never_underestimated(jerk):
    """2e-5 rad: where the acceleration rises, a bound is taken of steps in between."""
    rng, h = np.random.default_rng(3), 1e-3
    limits = with_envelopes(rng, 500)
    fast = spread(rng, 0.5, 10.0, 500)
    limits = limits._replace(acceleration=fast, jerk=spread(rng, *jerk, 500))
    w, b = moving(rng, limits)
    upwards = course(w, b, limits.acceleration, limits.jerk, h).mirror > 0.0
    most = farthest(w, b, limits.envelope, limits.acceleration, limits.jerk, h)
    largest = stopped(w, b, limits, h)
    over = (most - largest)[upwards]
    assert (over > -1e-11 * (1.0 + np.abs(largest[upwards]))).all()
    # Beyond 2^8 steps it is a bound, too.
    few = (limits.acceleration / limits.jerk < 0.1)[upwards]
    assert over[few].max(initial=0.0) < 2e-5


def test_the_largest_h_is_convex_in_the_next_acceleration():
    """So the chord is never too low a bound: second differences, to rounding."""
    rng, h = np.random.default_rng(7), 1e-3
    limits = with_envelopes(rng, 5000)
    limits = limits._replace(jerk=spread(rng, 300.0, 3000.0, 5000))
    v, a = moving(rng, limits)
    bounds = limits.acceleration, limits.jerk, h
    c = stop(0.0 * v, v, a, *bounds).first
    upper = np.maximum(np.minimum(limits.acceleration, a + limits.jerk * h), c)
    # At c itself, rounding may show a stop from above as one from below.
    shares = np.linspace(1e-6, 1.0, 9)
    ways = [
        farthest(v + h * b, b, limits.envelope, *bounds)
        for b in (c + share * (upper - c) for share in shares)
    ]
    # 2e-5: what is bounded, not found; see above.
    assert np.diff(ways, n=2, axis=0).min() > -2e-5
    assert np.median(np.diff(ways, n=2, axis=0).min(axis=0)) > -1e-13


def test_a_joint_rests_where_the_envelope_ends_and_no_nearer_to_its_limit():
    """0.0078 and 0.0036 rad before it; pushed, it neither moves on nor is pushed back."""
    room = FR3.envelope.room(np.zeros(2))
    np.testing.assert_allclose(room, [0.201**2 / 5.17, 0.351**2 / 34.0])
    q, v, a = FR3.position[1] - room - 0.02, np.zeros(2), np.zeros(2)
    fastest = np.zeros(2)
    for _ in range(800):
        _, a = jerk_box(q, v, a, FR3, 1e-3)
        v = v + 1e-3 * a
        q = q + 1e-3 * v
        fastest = np.maximum(fastest, v)
    np.testing.assert_allclose(v, 0.0, atol=1e-4)
    assert (FR3.position[1] - room - q >= -1e-12).all()
    np.testing.assert_allclose(q, FR3.position[1] - room, atol=1e-3)
    # It gets as fast as 0.02 rad allow, in which it must speed up and stop again.
    assert (fastest > 0.15).all()


def test_one_joint_and_many_have_the_same_box():
    rng = np.random.default_rng(8)
    limits = with_envelopes(rng, 60)
    q = starts(rng, limits)
    assert_one_joint_has_the_box_of_many(limits, 4e-3, q, *moving(rng, limits))


@pytest.mark.long
def test_jax_has_the_same_box():
    pytest.importorskip("jax")
    jax = require_jax()
    rng = np.random.default_rng(8)
    limits = with_envelopes(rng, 60)
    q, (v, a) = starts(rng, limits), moving(rng, limits)
    compiled = jax.jit(lambda *state: jerk_box(*state, limits, 4e-3))(q, v, a)
    box = np.array(jerk_box(q, v, a, limits, 4e-3))
    np.testing.assert_allclose(np.array(compiled), box, rtol=1e-9, atol=1e-9)


def test_far_from_its_limits_an_envelope_changes_no_bit():
    rng = np.random.default_rng(9)
    limits = with_envelopes(rng, 500)
    limits = limits._replace(position=limits.position * 1e4 + [[-1e6], [1e6]])
    (v, a), q = moving(rng, limits), rng.uniform(-1, 1, 500)
    np.testing.assert_array_equal(
        jerk_box(q, v, a, limits, 1e-3), jerk_box(q, v, a, limits._replace(envelope=None), 1e-3)
    )


def test_an_envelope_without_a_bound_of_the_jerk_has_one_that_bounds_nothing():
    limits = JointLimits.unlimited(2).replace(
        position_lower=-1.0, position_upper=1.0, velocity=2.0, acceleration=5.0
    )
    assert reached_limits(limits.replace(jerk=1e9), 1e-3).jerk is None
    envelope = {"envelope_offset": 0.2, "envelope_deceleration": 3.0}
    for jerk in (None, 1e9):
        reached = reached_limits(limits.replace(jerk=jerk, **envelope), 1e-3)
        np.testing.assert_allclose(reached.jerk, 2 * 5.0 / 1e-3)
        np.testing.assert_array_equal(reached.envelope_offset, [0.2, 0.2])

"""Bounds of velocity and acceleration that differ for the two directions."""

from __future__ import annotations

import numpy as np
import pytest

from drake_rnn.arrays.algebra import require_jax
from drake_rnn.errors import InvalidInputError
from drake_rnn.robot.limits import JointLimits

N, PERIOD = 12, 4e-3


def directed(rng, jerk):
    """Return limits of which those of the two directions differ by up to ten times."""
    down, up = np.exp(rng.uniform(np.log(0.2), np.log(2.0), (2, N)))
    slow, fast = np.exp(rng.uniform(np.log(1.0), np.log(10.0), (2, N)))
    return JointLimits(
        position_lower=np.full(N, -0.3),
        position_upper=np.full(N, 0.3),
        velocity=up,
        velocity_lower=-down,
        acceleration=fast,
        acceleration_lower=-slow,
        jerk=rng.uniform(30.0, 3000.0, N) if jerk else None,
    )


def boxes(limits, motion):
    """Return the bounds of the next acceleration, whatever is bounded."""
    q, v, a = motion
    if limits.jerk is not None:
        return limits.held_acceleration_box(q, v, a, PERIOD)
    lower, upper = limits.held_velocity_box(q, v, PERIOD)
    return (lower - v) / PERIOD, (upper - v) / PERIOD


def advance(motion, a):
    q, v, _ = motion
    v = v + PERIOD * a
    return q + PERIOD * v, v, a


@pytest.mark.parametrize("jerk", [True, False])
def test_motions_within_the_boxes_keep_the_bounds_of_their_direction(jerk):
    rng = np.random.default_rng(5)
    limits = directed(rng, jerk)
    motion, used = (np.zeros(N),) * 3, np.zeros(4)
    share = rng.integers(0, 2, N)
    for _ in range(1500):
        lower, upper = boxes(limits, motion)
        assert (lower <= upper).all()
        share = np.where(rng.random(N) < 0.01, rng.choice([0.0, 0.5, 1.0], N), share)
        before, motion = motion, advance(motion, lower + share * (upper - lower))
        q, v, a = motion
        ends = limits.position_lower - q, q - limits.position_upper
        assert np.max(ends) <= 1e-9
        of_v, of_a = (
            np.array((x / -limits.sides(name).down, x / limits.sides(name).up))
            for name, x in (("velocity", v), ("acceleration", a))
        )
        assert of_v.max() <= 1.0 + 1e-9
        assert of_a.max() <= 1.0 + 1e-9
        if jerk:
            assert (np.abs(a - before[2]) <= PERIOD * limits.jerk * (1.0 + 1e-9)).all()
        used = np.maximum(used, [*of_v.max(axis=1), *of_a.max(axis=1)])
    np.testing.assert_allclose(used, 1.0, rtol=1e-6)


@pytest.mark.parametrize("jerk", [True, False])
def test_joints_that_count_the_other_way_have_the_mirrored_box(jerk):
    rng = np.random.default_rng(6)
    limits = directed(rng, jerk)
    back = rng.random(N) < 0.5
    mirrored = limits.replace(
        **limits.mirrored(back),
        position_lower=np.where(back, -limits.position_upper, limits.position_lower),
        position_upper=np.where(back, -limits.position_lower, limits.position_upper),
    )
    sign, motion = np.where(back, -1.0, 1.0), (np.zeros(N),) * 3
    for k in range(300):
        lower, upper = boxes(limits, motion)
        other = boxes(mirrored, tuple(sign * x for x in motion))
        np.testing.assert_array_equal(lower, np.where(back, -other[1], other[0]))
        np.testing.assert_array_equal(upper, np.where(back, -other[0], other[1]))
        motion = advance(motion, upper if k // 60 % 2 else lower)


def test_bounds_downwards_that_mirror_those_upwards_change_no_bit():
    rng = np.random.default_rng(7)
    limits = directed(rng, True).replace(velocity_lower=None, acceleration_lower=None)
    same = limits.replace(velocity_lower=-limits.velocity, acceleration_lower=-limits.acceleration)
    motion = (np.zeros(N),) * 3
    for k in range(300):
        lower, upper = boxes(limits, motion)
        np.testing.assert_array_equal((lower, upper), boxes(same, motion))
        motion = advance(motion, upper if k // 70 % 2 else lower)


@pytest.mark.parametrize("jerk", [True, False])
def test_many_robots_and_jax_have_the_boxes_of_one(jerk):
    rng = np.random.default_rng(8)
    limits = directed(rng, jerk)
    motions = [(np.zeros(N),) * 3]
    for k in range(120):
        lower, upper = boxes(limits, motions[-1])
        motions.append(advance(motions[-1], upper if k // 30 % 2 else lower))
    every = [np.array(part) for part in zip(*motions, strict=True)]
    each = np.array([boxes(limits, motion) for motion in motions]).swapaxes(0, 1)
    np.testing.assert_allclose(boxes(limits, every), each, rtol=0, atol=1e-9)
    pytest.importorskip("jax", reason="needs the extra jax")
    jnp = require_jax().numpy
    np.testing.assert_allclose(boxes(limits, map(jnp.asarray, every)), each, rtol=0, atol=1e-9)


def test_two_arms_beside_each_other_keep_what_is_theirs():
    rng = np.random.default_rng(9)
    one = directed(rng, True)
    other = one.replace(velocity_lower=None, acceleration_lower=None)
    both = JointLimits.beside(one, other)
    for name in ("velocity", "acceleration"):
        down = np.concatenate((one.sides(name).down, other.sides(name).down))
        np.testing.assert_array_equal(both.sides(name).down, down)
    np.testing.assert_array_equal(both.select(range(N)).velocity_lower, one.velocity_lower)


@pytest.mark.parametrize(
    ("bounds", "message"),
    [
        ({"velocity_lower": 0.5}, "velocity_lower: must be negative, at most -1e-06, not"),
        ({"acceleration_lower": -1.0}, "acceleration: must be given where acceleration_lower is"),
        ({"velocity_lower": np.zeros(2)}, "velocity_lower: must have 3 entries"),
    ],
)
def test_bounds_downwards_that_cannot_be_are_refused(bounds, message):
    limits = JointLimits.unlimited(3)
    with pytest.raises((InvalidInputError, ValueError), match=message):
        limits.replace(**bounds)

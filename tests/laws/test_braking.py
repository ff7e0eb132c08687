"""Position limits that hold whatever a network does, on arms that are asked for anything."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drake_rnn import JointLimits, SimultaneousLearning, load_arm
from drake_rnn.laws.parts.path_task import Braking

ARMS = {name: load_arm(name) for name in ("panda", "iiwa14", "ur5", "planar6")}
KINEMATICS = {name: arm.kinematics() for name, arm in ARMS.items()}
STEPS = 120


def narrowed(limits, q, rng):
    """The limits that a case has: of position around ``q``, near enough to be reached."""
    n = q.size
    lower, upper = limits.position_lower, limits.position_upper
    below, above = rng.uniform(1e-3, 0.3, (2, n)) * rng.choice([0.1, 1.0], (2, n))
    return limits.replace(
        position_lower=np.maximum(lower, q - below),
        position_upper=np.minimum(upper, q + above),
        velocity=10.0 ** rng.uniform(-1, 0.5, n),
        acceleration=10.0 ** rng.uniform(-0.5, 1.5, n),
    )


def drawn(rng, **fixed):
    """An arm, a start posture, a period and a law with gains from tame to absurd."""
    name = rng.choice(list(ARMS))
    arm = ARMS[name]
    reached = np.minimum(np.abs([arm.limits.position_lower, arm.limits.position_upper]), 3.0)
    q = rng.uniform(-0.95, 0.95, arm.limits.size) * reached.min(axis=0)
    q = np.clip(q, arm.limits.position_lower + 1e-2, arm.limits.position_upper - 1e-2)
    period = float(rng.choice([1e-3, 2e-3, 5e-3, 2e-2]))
    choices = {
        "acceleration_bound": str(rng.choice(["scalar", "per_joint"])),
        "kappa": float(10.0 ** rng.uniform(0, 2)),
        # Slow, or one substep of Euler's to a sample and more where J is large.
        "rate": float(rng.choice([0.1, 1.0])) / period,
        "return_gain": float(rng.choice([0.0, 1.0])),
        "limit_stiffness": float(10.0 ** rng.uniform(0, 2)),
        "feedback_limit": (None, 0.1)[rng.integers(2)],
        "multiplier_limit": ("none", 10.0)[rng.integers(2)],
    }
    law = SimultaneousLearning(
        limits=narrowed(arm.limits, q, rng),
        home=q,
        jacobian="known",
        task_size=2 if name == "planar6" else 3,
        **{**choices, **fixed},
    )
    return name, q, law, period


def excesses(seed, **fixed):
    """By how much a case breaks its limits: rad, rad/s and, as a share, acceleration."""
    rng = np.random.default_rng(seed)
    name, q, law, period = drawn(rng, **fixed)
    kinematics, m = KINEMATICS[name], law.task_size
    start = kinematics.p_WE(q)[:m]
    u = {"v_WE_desired": np.zeros(m)}
    x = law.initial_state(rng, u)
    positions, velocities = [q], [x[: q.size]]
    for k in range(STEPS):
        if k % 30 == 0:
            # Targets jump, and are out of reach as often as not.
            u["p_WE_desired"] = start + rng.choice([0.1, 2.0]) * rng.normal(size=m)
            u["v_WE_desired"] = rng.choice([0.0, 1.0]) * rng.normal(size=m)
        u |= {"position": q, "p_WE": kinematics.p_WE(q)[:m], "J": kinematics.J(q)[:m]}
        x = law.step(k * period, x, u, period)
        v = x[: q.size]
        q = q + period * v
        positions.append(q)
        velocities.append(v)
    limits = law.limits
    slope = np.abs(np.diff(velocities, axis=0)) / period
    most = limits.acceleration
    if law.acceleration_bound == "scalar":
        most = most.min()
    return np.array(
        [
            limits.violation(np.array(positions)).max(),
            (np.abs(velocities) - limits.velocity).max(),
            (slope / most).max() - 1.0,
        ]
    )


def worst(seeds, **fixed):
    return np.max([excesses(seed, **fixed) for seed in seeds], axis=0)


@pytest.mark.parametrize(
    ("first", "last"),
    [
        (0, 80),
        pytest.param(80, 600, marks=pytest.mark.long),
        pytest.param(600, 10_000, marks=pytest.mark.nightly),
    ],
)
def test_no_bound_is_ever_broken(first, last):
    assert (worst(range(first, last)) <= 1e-9).all()


def test_without_braking_position_limits_are_broken_by_far():
    """What the paper's box alone does: the other two bounds hold."""
    beyond = worst(range(40), position_bound="printed")
    assert beyond[0] > 0.1
    assert (beyond[1:] <= 1e-9).all()


LIMITS = JointLimits(
    position_lower=[-1.0, -np.inf, -1.0, -2.0],
    position_upper=[1.0, 1.0, np.inf, 2.0],
    velocity=[0.5, 1.0, 2.0, 0.3],
    acceleration=[1.0, 2.0, np.inf, 0.5],
)
MOST = LIMITS.acceleration
shares = st.lists(st.floats(0, 1), min_size=4, max_size=4).map(np.array)


def inside(share):
    lower = np.maximum(LIMITS.position_lower, -3.0)
    return lower + share * (np.minimum(LIMITS.position_upper, 3.0) - lower)


@given(shares, shares, st.floats(0.1, 20.0), st.sampled_from([1e-3, 1e-2, 0.1]))
def test_where_it_says_that_it_does_nothing_it_does_nothing(at, speed, stiffness, period):
    braking = Braking(LIMITS, MOST, stiffness)
    q, v = inside(at), (2.0 * speed - 1.0) * LIMITS.velocity
    if braking.is_idle(*LIMITS.velocity_box(q, stiffness), period):
        assert braking.hold(v, v, q, period) is v


@given(shares, shares, st.sampled_from([1e-3, 1e-2, 0.1]))
def test_it_touches_only_joints_that_could_not_stop(at, speed, period):
    braking = Braking(LIMITS, MOST, 2.0)
    q, v = inside(at), (2.0 * speed - 1.0) * LIMITS.velocity
    lower, upper = LIMITS.stopping_box(q, period)
    held = braking.hold(v, v, q, period)
    # It stops 1e-12 rad early: at 1 ms, for want of a sample, 1e-9 rad/s.
    could = (v > lower + 2e-9) & (v < upper - 2e-9)
    np.testing.assert_array_equal(held[could], v[could])


@given(st.integers(0, 3), st.floats(0, 1), st.floats(-1, 1), st.sampled_from([1e-3, 1e-2, 0.1]))
def test_whatever_is_wanted_a_joint_that_can_stop_can_stop_after_it(joint, at, speed, period):
    """Each joint alone: beside one that is too fast, no other joint is looked at in haste."""
    limits = LIMITS.select([joint])
    q = inside(np.full(4, at))[[joint]]
    wanted = speed * limits.velocity
    lower, upper = limits.stopping_box(q, period)
    held = Braking(limits, limits.acceleration, 2.0).hold(
        wanted, np.clip(wanted, lower, upper), q, period
    )
    assert (lower - 1e-12 <= held).all()
    assert (held <= upper + 1e-12).all()


@settings(max_examples=4, deadline=None)
@given(shares, st.integers(0, 2**32 - 1), st.floats(1.0, 20.0))
def test_the_differential_equation_too_keeps_the_limits(at, seed, stiffness):
    """Joints that are accelerated at random; 1e-9 rad, by Heun's method in steps of 0.5 ms."""
    limits = LIMITS.replace(acceleration=[1.0, 2.0, 5.0, 0.5])
    most, h = limits.acceleration, 5e-4
    braking, rng = Braking(limits, most, stiffness), np.random.default_rng(seed)
    q, v = inside(0.1 + 0.8 * at), np.zeros(4)
    for k in range(3000):
        if k % 500 == 0:
            asked = most * rng.choice([-1.0, 1.0], 4)
        first = braking.rate(asked, v, q)
        assert (np.abs(first) <= most).all()
        second = braking.rate(asked, v + h * first, q + h * v)
        q, v = q + h * v + h * h / 2 * first, v + h / 2 * (first + second)
        assert limits.violation(q).max() <= 1e-9

"""Bounds on the next acceleration, and on the next velocity, with wishes that do all they can."""

import numpy as np
import pytest
from jerk_helpers import assert_one_joint_has_the_box_of_many, joints

from drake_rnn import InvalidInputError, JointLimits
from drake_rnn.robot.jerk_stop import stop
from drake_rnn.robot.velocity_envelope import (
    JerkLimits,
    jerk_box,
)

PERIODS = (1e-3, 4e-3, 1e-2)
#: Ways to wish for accelerations, of joints side by side.
WISHES = ("up", "down", "to and fro", "random", "whole", "held", "rests")


class Wishes:
    """Accelerations that joints wish for; each joint has a way of its own."""

    def __init__(self, rng, limits, period):
        self._rng, self._most = rng, limits.acceleration
        count = self._most.size
        self._way = np.arange(count) % len(WISHES)
        # As long as a joint takes to speed up, and a good deal shorter or longer.
        typical = limits.velocity / limits.acceleration + limits.acceleration / limits.jerk
        self._turns = np.maximum(typical * rng.uniform(0.1, 2.0, count) / period, 1.0)
        self._held = np.zeros(count)

    def __call__(self, k):
        rng, most = self._rng, self._most
        anew = rng.random(most.size) < 1.0 / self._turns
        self._held = np.where(anew, most * rng.uniform(-1.5, 1.5, most.size), self._held)
        turn = np.where((k // self._turns) % 2 < 1, np.inf, -np.inf)
        whole = np.where(rng.random(most.size) < 0.5, -np.inf, np.inf)
        choices = (
            *(np.inf + 0.0 * most, -np.inf + 0.0 * most, turn),
            *(most * rng.uniform(-1.5, 1.5, most.size), whole, self._held, 0.0 * most),
        )
        return np.choose(self._way, choices)


def driven(limits, period, steps, seed, box=jerk_box):
    """Largest excess over each bound, as a share of it: of positions, of the way between limits."""
    rng = np.random.default_rng(seed)
    lower, upper = limits.position
    q = rng.uniform(lower, upper)
    v = a = np.zeros(q.size)
    wish = Wishes(rng, limits, period)
    excess = {name: np.zeros(q.size) for name in ("position", "velocity", "acceleration", "jerk")}
    for k in range(steps):
        slowest, fastest = box(q, v, a, limits, period)
        assert (slowest <= fastest).all()
        b = np.clip(wish(k), slowest, fastest)
        change, a = (b - a) / period, b
        v = v + period * a
        q = q + period * v
        now = {
            "position": np.maximum(lower - q, q - upper) / (upper - lower),
            "velocity": np.abs(v) / limits.velocity - 1.0,
            "acceleration": np.abs(a) / limits.acceleration - 1.0,
            "jerk": np.abs(change) / limits.jerk - 1.0,
        }
        excess = {name: np.maximum(value, now[name]) for name, value in excess.items()}
    return {name: value.max() for name, value in excess.items()}


@pytest.mark.parametrize("period", PERIODS)
def test_no_bound_is_broken_whatever_is_wished_for(period):
    """1e-11: a way of 5 mm near 5 rad has 2e-13 of rounding for each of many steps."""
    limits = joints(np.random.default_rng(4), 1400)
    excess = driven(limits, period, 250, seed=5)
    assert max(excess.values()) < 1e-11, excess


@pytest.mark.parametrize(
    ("period", "count", "steps"),
    [
        pytest.param(1e-3, 1400, 1500, marks=pytest.mark.long),
        *(pytest.param(period, 2800, 3000, marks=pytest.mark.nightly) for period in PERIODS),
    ],
)
def test_no_bound_is_broken_in_long_runs_of_many_joints(period, count, steps):
    limits = joints(np.random.default_rng(6), count)
    excess = driven(limits, period, steps, seed=7)
    assert max(excess.values()) < 1e-11, excess


def short_sighted(q, v, a, limits, period):
    """The bounds of this period alone."""
    d = limits.jerk * period
    most = np.minimum(limits.acceleration, np.maximum((limits.velocity - v) / period, -np.inf))
    least = np.maximum(-limits.acceleration, (-limits.velocity - v) / period)
    lower, upper = np.clip((least, most), a - d, a + d)
    return np.minimum(lower, upper), upper


def test_bounds_that_do_not_look_ahead_are_broken():
    """By far, in position and in velocity: a joint that must turn round has no time left."""
    limits = joints(np.random.default_rng(4), 700)
    excess = driven(limits, 4e-3, 500, seed=5, box=short_sighted)
    assert excess["position"] > 1.0
    assert excess["velocity"] > 0.5


def as_joint_limits(limits):
    lower, upper = limits.position
    _, velocity, acceleration, jerk, _ = limits
    return JointLimits(
        position_lower=lower,
        position_upper=upper,
        velocity=velocity,
        acceleration=acceleration,
        jerk=jerk,
    )


def test_the_box_of_velocities_alone_breaks_the_jerk_and_nothing_else():
    """1e-9 of the bounds: differences of velocities, divided by the period."""
    limits = joints(np.random.default_rng(4), 700)
    known = as_joint_limits(limits)

    def of_velocities(q, v, a, limits, period):
        lower, upper = (np.stack(known.held_velocity_box(q, v, period)) - v) / period
        return lower, upper

    excess = driven(limits, 4e-3, 500, seed=5, box=of_velocities)
    assert excess.pop("jerk") > 10.0
    assert max(excess.values()) < 1e-9, excess


def on_the_way(period, count=300, steps=(0, 3, 20, 120, 121)):
    """Limits, and states of joints under way, some of them close to a limit."""
    rng = np.random.default_rng(8)
    limits = joints(rng, count)
    q, v, a = rng.uniform(*limits.position), np.zeros(count), np.zeros(count)
    wish, states = Wishes(rng, limits, period), []
    for k in range(max(steps) + 1):
        if k in steps:
            states.append((q, v, a))
        a = np.clip(wish(k), *jerk_box(q, v, a, limits, period))
        v = v + period * a
        q = q + period * v
    return limits, states


def test_one_joint_and_many_have_the_same_box():
    limits, states = on_the_way(4e-3)
    for q, v, a in states:
        assert_one_joint_has_the_box_of_many(limits, 4e-3, q, v, a)


def test_the_first_step_of_the_stop_and_zero_at_rest_are_in_the_box():
    limits, states = on_the_way(1e-3)
    q = states[0][0]
    still = np.zeros(q.size)
    lower, upper = jerk_box(q, still, still, limits, 1e-3)
    assert (lower <= 0.0).all()
    assert (upper >= 0.0).all()


def test_far_from_limits_it_is_what_acceleration_and_jerk_allow():
    rng = np.random.default_rng(9)
    limits = joints(rng, 500)
    far = limits._replace(
        position=limits.position * 1e4 + [[-1e6], [1e6]], velocity=np.full(500, 1e4)
    )
    a = limits.acceleration * rng.uniform(-1, 1, 500)
    lower, upper = jerk_box(rng.uniform(-1, 1, 500), rng.uniform(-1, 1, 500), a, far, 1e-3)
    d = 1e-3 * limits.jerk
    np.testing.assert_array_equal(lower, np.maximum(-limits.acceleration, a - d))
    np.testing.assert_array_equal(upper, np.minimum(limits.acceleration, a + d))


def test_what_is_infinite_bounds_nothing():
    """Joints without limits of position, of velocity, of both; the others keep theirs."""
    limits = joints(np.random.default_rng(10), 700)
    free = np.arange(700) % 3
    position = np.where(free != 1, limits.position, [[-np.inf], [np.inf]])
    velocity = np.where(free == 0, limits.velocity, np.inf)
    mixed = limits._replace(position=position, velocity=velocity)
    rng = np.random.default_rng(11)
    q, v, a = rng.uniform(*limits.position), np.zeros(700), np.zeros(700)
    wish, farthest, fastest = Wishes(rng, limits, 4e-3), 0.0, 0.0
    for k in range(500):
        lower, upper = jerk_box(q, v, a, mixed, 4e-3)
        assert np.isfinite(lower).all()
        assert np.isfinite(upper).all()
        a = np.clip(wish(k), lower, upper)
        v = v + 4e-3 * a
        q = q + 4e-3 * v
        beyond = np.maximum(position[0] - q, q - position[1]) / np.ptp(limits.position, axis=0)
        assert beyond.max() < 1e-11
        assert (np.abs(v) <= velocity * (1 + 1e-11)).all()
        farthest = max(farthest, np.abs(q[free == 1]).max())
        fastest = max(fastest, (np.abs(v) / limits.velocity)[free == 1].max())
    assert farthest > 10.0
    assert fastest > 2.0


def test_from_beyond_a_limit_a_joint_stops_as_fast_as_it_may():
    """The box is a point, the first step of the stop; 1e-12 of the acceleration: rounding."""
    limits = JerkLimits(np.array([[-1.0], [1.0]]), *(np.array([x]) for x in (2.0, 5.0, 40.0)))
    lower, upper = jerk_box(np.array([1.1]), np.array([0.5]), np.array([1.0]), limits, 1e-2)
    assert upper == pytest.approx(1.0 - 0.4, abs=1e-12)
    assert lower == pytest.approx(1.0 - 0.4, abs=1e-12)


def test_limits_of_joints_name_what_is_missing():
    known = JointLimits.unlimited(2)
    some = np.zeros(2)
    with pytest.raises(InvalidInputError, match=r"^limits\.acceleration: not known"):
        known.held_velocity_box(some, some, 1e-3)
    with pytest.raises(InvalidInputError, match=r"^limits\.jerk: not known"):
        known.replace(acceleration=1.0).held_acceleration_box(some, some, some, 1e-3)


def test_the_shortcut_far_from_limits_changes_no_bit_of_the_box_of_velocities():
    """Of one robot, whose joints are far or close, at rest, fast or faster than they may be."""
    rng = np.random.default_rng(12)
    known = as_joint_limits(joints(rng, 5))
    ways = []
    for case in range(2000):
        period = rng.choice(PERIODS)
        place = rng.uniform(0, 1, 5) if case % 2 else 0.5 + rng.uniform(-0.05, 0.05, 5)
        q = known.position_lower + place * (known.position_upper - known.position_lower)
        v = known.velocity * rng.uniform(-1, 1, 5) * 10.0 ** rng.uniform(-3, 0.3)
        ways.append(known._is_far(q, v, period))
        full = np.array(known.held_velocity_box(q[None], v[None], period))[:, 0]
        np.testing.assert_array_equal(known.held_velocity_box(q, v, period), full)
    assert 0.02 < np.mean(ways) < 0.9


def test_the_box_of_velocities_of_joints_without_limits():
    known = JointLimits.unlimited(2).replace(acceleration=[2.0, np.inf])
    lower, upper = known.held_velocity_box(np.zeros(2), np.ones(2), 0.1)
    np.testing.assert_allclose(lower, [0.8, -np.inf])
    np.testing.assert_allclose(upper, [1.2, np.inf])


def test_between_the_stop_and_the_largest_acceleration_the_way_is_convex():
    """So the chord between them is never too low a bound: second differences, to rounding."""
    rng, h, count = np.random.default_rng(7), 1e-3, 20_000
    most, jerk = 10.0 ** rng.uniform(-0.3, 1.0, count), 10.0 ** rng.uniform(0.5, 3.0, count)
    v, a = rng.uniform(-2.0, 2.0, count), most * rng.uniform(-1.0, 1.0, count)
    least = stop(np.zeros(count), v, a, most, jerk, h).first
    upper = np.maximum(np.minimum(most, a + jerk * h), least)
    ways = []
    for share in np.linspace(0.0, 1.0, 9):
        b = least + share * (upper - least)
        w = v + h * b
        ways.append(stop(h * w, w, b, most, jerk, h).highest)
    # Rounding: of ways of up to 10 m, eight digits beyond what a position shows.
    assert np.diff(ways, n=2, axis=0).min() > -1e-13 * np.max(ways)

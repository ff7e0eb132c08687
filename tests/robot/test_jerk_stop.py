"""The fastest stop of a joint whose jerk is bounded, followed period by period."""

import numpy as np
import pytest
from jerk_helpers import joints

from drake_rnn.robot.jerk_stop import gaining, stop, time_gain

COUNT = 2000
PERIODS = (1e-3, 4e-3, 2e-2)


def test_what_an_acceleration_gains_on_its_way_to_zero_is_the_sum_of_its_steps():
    """1e-12 of the sum: rounding of some hundred terms."""
    x = np.concatenate((np.linspace(-2.0, 3.0, 51), np.linspace(3.0, 300.0, 99)))
    steps = np.maximum(x - np.arange(400.0)[:, np.newaxis], 0.0).sum(axis=0)
    np.testing.assert_allclose(time_gain(x), steps, rtol=1e-12, atol=0)


def test_the_acceleration_that_gains_a_velocity_is_the_inverse():
    """1e-12: a root of 8 y, and its whole part, which rounding may take to either side."""
    y = np.concatenate(([0.0, 1.0, 3.0, 6.0, 10.0], np.geomspace(1e-6, 1e6, 200)))
    np.testing.assert_allclose(time_gain(gaining(y)), y, rtol=1e-12, atol=0)
    assert gaining(np.zeros(1)) == 0.0


def moving(rng, period):
    """Joints that move and accelerate somehow; some at rest, some at a bound."""
    limits = joints(rng, COUNT)
    # None takes more than some hundred periods to stop.
    slow = np.minimum(limits.velocity, 300 * period * limits.acceleration)
    jerk = np.maximum(limits.jerk, limits.acceleration / (100 * period))
    limits = limits._replace(velocity=slow, jerk=jerk)
    v = limits.velocity * rng.choice([-1, 0, 1, *rng.uniform(-1, 1, 7)], COUNT)
    a = limits.acceleration * rng.choice([-1, 0, 1, *rng.uniform(-1, 1, 7)], COUNT)
    # Whole numbers of steps of the acceleration, where the count of them may go either way.
    whole = rng.random(COUNT) < 0.2
    d = limits.jerk * period
    a = np.where(whole, np.trunc(a / d) * d, a)
    return limits, rng.uniform(-1, 1, COUNT), v, a


def followed(q, v, a, limits, period, least):
    """Positions and accelerations of joints that stop, until all are at rest."""
    positions, accelerations = [q], [a]
    for _ in range(2000):
        if (np.abs(v) <= least * limits.velocity).all() and (
            np.abs(a) <= least * limits.acceleration
        ).all():
            break
        a = stop(q, v, a, limits.acceleration, limits.jerk, period).first
        v = v + period * a
        q = q + period * v
        positions.append(q)
        accelerations.append(a)
    else:
        pytest.fail("some joint never came to rest")
    return np.array(positions), np.array(accelerations)


@pytest.mark.parametrize("period", PERIODS)
def test_followed_step_by_step_it_ends_at_rest_within_the_bounds_where_it_says(period):
    """1e-9 of the bounds, and of the way: rounding of some thousand steps."""
    rng = np.random.default_rng(1)
    limits, q, v, a = moving(rng, period)
    said = stop(q, v, a, limits.acceleration, limits.jerk, period)
    positions, accelerations = followed(q, v, a, limits, period, 1e-10)
    assert (np.abs(accelerations) <= limits.acceleration * (1 + 1e-12)).all()
    jerks = np.abs(np.diff(accelerations, axis=0)) / period
    assert (jerks <= limits.jerk * (1 + 1e-9)).all()
    way = 1e-9 * (1.0 + np.ptp(positions, axis=0))
    np.testing.assert_array_less(np.abs(positions.max(axis=0) - said.highest), way)
    mirrored = stop(-q, -v, -a, limits.acceleration, limits.jerk, period)
    np.testing.assert_array_less(np.abs(positions.min(axis=0) + mirrored.highest), way)


def test_it_takes_as_long_as_the_fastest_stop_in_continuous_time():
    """From a velocity, without acceleration: v / A + A / J, or 2 sqrt(v / J) if A is not reached.

    Steps of the acceleration lose less than three periods to this.
    """
    rng, period = np.random.default_rng(2), 4e-3
    limits, q, v, _ = moving(rng, period)
    _, accelerations = followed(q, v, np.zeros(COUNT), limits, period, 1e-10)
    braking = np.abs(accelerations) > 1e-9 * limits.acceleration
    last = np.where(braking.any(axis=0), len(braking) - 1 - braking[::-1].argmax(axis=0), 0)
    most, jerk, speed = limits.acceleration, limits.jerk, np.abs(v)
    reached = speed > most**2 / jerk
    fastest = np.where(reached, speed / most + most / jerk, 2.0 * np.sqrt(speed / jerk))
    assert (period * last < fastest + 3.0 * period).all()
    assert reached.mean() > 0.2
    assert (~reached & (speed > 0)).mean() > 0.2


def test_at_rest_it_is_there_already():
    still = stop(np.ones(2), np.zeros(2), np.zeros(2), np.ones(2), np.full(2, 10.0), 1e-3)
    assert (still.first == 0.0).all()
    assert (still.highest == 1.0).all()


def test_one_robot_and_many_stop_alike():
    rng = np.random.default_rng(3)
    limits, q, v, a = moving(rng, 1e-3)
    many = stop(q, v, a, limits.acceleration, limits.jerk, 1e-3)
    for k in range(0, COUNT, 97):
        joint = slice(k, k + 1)
        alone = stop(q[joint], v[joint], a[joint], limits[2][joint], limits[3][joint], 1e-3)
        for name in ("first", "highest"):
            assert getattr(alone, name)[0] == getattr(many, name)[k]

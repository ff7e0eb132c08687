"""An arm that rests as near to something as it may come leaves it at the next sample.

The certificate must find room for a motion where there is none but what the motion itself gains:
what is off a straight line is of second order in the motion, and what leads away is of first.
"""

from functools import cache

import numpy as np
import pytest

from drake_rnn import Guard, JointStream, load_arm, make_obstacles
from drake_rnn.robot.clearance.arm_clearance import arm_clearance
from drake_rnn.robot.clearance.clearance import least_on_bow

FLOOR = 0.005
OBSTACLES = [
    {"kind": "box", "center": [0.55, 0.45, 0.3], "size": [0.3, 0.2, 0.5], "rpy": [0.1, 0.2, 0.5]},
    {"kind": "ball", "center": [0.3, -0.6, 0.6], "radius": 0.15},
    {"kind": "half_space", "point": [0.0, 0.0, 0.1], "normal": [0.0, 0.05, 1.0]},
]


@cache
def clearance_of(name):
    arm = load_arm(name)
    clearance, _ = arm_clearance(arm, make_obstacles(OBSTACLES[:2]), arm.home)
    return arm, clearance


def posture_at(rng, name, room):
    """A posture in which the nearest pair is apart by the floor and a room, or None."""
    arm, clearance = clearance_of(name)
    end = arm.home + rng.uniform(-1.5, 1.5, arm.n)
    way = np.linspace(arm.home, end, 200)
    near = np.flatnonzero(clearance.gaps(way).min(axis=1) < FLOOR + room)
    if not near.size or not near[0] or arm.limits.violation(way[near[0]]).any():
        return None
    free, blocked = way[near[0] - 1], way[near[0]]
    for _ in range(60):
        middle = 0.5 * (free + blocked)
        if clearance.gaps(middle).min() >= FLOOR + room:
            free = middle
        else:
            blocked = middle
    return free


def slopes_at(clearance, q):
    """How much farther apart near pairs are by each joint, of length 1, shape (r, n)."""
    pairs = np.flatnonzero(clearance.gaps(q) < 0.02)
    slopes = clearance.near(q[None], None, pairs).slopes[0]
    return slopes / np.maximum(np.linalg.norm(slopes, axis=1), 1e-9)[:, None]


def direction(rng, slopes, kind):
    """A direction in which no near pair comes nearer, or None."""
    if kind == "straight away":
        way = slopes.sum(axis=0)
        return way if (slopes @ way > 0.0).all() else None
    for _ in range(200):
        way = rng.normal(size=slopes.shape[1])
        if (slopes @ way >= 0.02 * np.linalg.norm(way)).all():
            return way
    return None


def first_steps(kind, seed, count):
    """The arm's motion from rest: at the first sample [rad/s], after 0.5 s [rad], least gap [m]."""
    rng, results = np.random.default_rng(seed), []
    while len(results) < count:
        name = rng.choice(["panda", "ur5", "iiwa14"])
        arm, clearance = clearance_of(name)
        q = posture_at(rng, name, rng.choice([0.0, 1e-9, 1e-7, 1e-6, 1e-5]))
        way = None if q is None else direction(rng, slopes_at(clearance, q), kind)
        if way is None:
            continue
        period = float(rng.choice([1e-3, 5e-3, 0.01, 0.02]))
        limits = arm.limits.replace(
            velocity=1.0,
            acceleration=rng.choice([2.0, 5.0, 20.0]),
            jerk=rng.choice([None, 50.0, 500.0, 5000.0]),
        )
        target = q + 0.1 * way / np.linalg.norm(way)
        guard = Guard(JointStream(limits=limits, home=q, clearance=clearance), period)
        postures = [q]
        for k in range(round(0.5 / period)):
            postures.append(guard.command(target))
            if not k:
                begins = np.abs(guard.velocity).max()
            if np.abs(postures[-1] - q).max() > 2e-3:
                break
        gaps = clearance.gaps(np.array(postures)).min()
        results.append((begins, np.abs(postures[-1] - q).max(), gaps))
    return np.array(results).T


@pytest.mark.parametrize(
    ("kind", "seed", "count"),
    [
        ("straight away", 0, 8),
        ("anywhere", 1, 8),
        pytest.param("straight away", 2, 150, marks=pytest.mark.long),
        pytest.param("anywhere", 3, 150, marks=pytest.mark.long),
    ],
)
def test_an_arm_at_the_floor_leaves_in_any_direction_in_which_nothing_comes_nearer(
    kind, seed, count
):
    begins, moved, gaps = first_steps(kind, seed, count)
    assert (begins > 0.0).all()
    assert (moved > 1e-3).all()
    # Bisection leaves some at the floor itself, to a bit.
    assert (gaps >= FLOOR - 1e-15).all()


def test_the_least_on_a_bow_is_that_of_the_lowest_parabola():
    rng, share = np.random.default_rng(0), np.linspace(0.0, 1.0, 20001)
    begin, end, bend = rng.uniform(0, 1, (3, 50))
    bow = begin[:, None] + share * (end - begin)[:, None]
    bow -= 0.5 * bend[:, None] * share * (1.0 - share)
    np.testing.assert_allclose(least_on_bow(begin, end, bend), bow.min(axis=1), atol=1e-9)
    np.testing.assert_array_equal(least_on_bow(begin, end, 0.0), np.minimum(begin, end))

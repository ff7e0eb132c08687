"""Two arms in one world: capsules, distances and how fast they can come nearer."""

import numpy as np
import pytest

from drake_rnn import load_arm, make_obstacles
from drake_rnn.robot.clearance.arm_clearance import arm_clearance
from drake_rnn.robot.clearance.clearance import (
    beside,
    stood,
)
from drake_rnn.robot.rotation import rotation_of

R, P = rotation_of(np.array([0.1, -0.2, 2.5])), np.array([0.9, 0.2, 0.1])
BALL = {"kind": "ball", "center": [0.5, 0.4, 0.4], "radius": 0.05}


@pytest.fixture(scope="module")
def arms():
    panda, ur5 = load_arm("panda"), load_arm("ur5")
    one, _ = arm_clearance(panda, make_obstacles([BALL]), panda.home)
    other, _ = arm_clearance(ur5, [], ur5.home)
    return one, other, beside(one, other.arm.move(R, P))


def postures(one, other, count=20):
    rng = np.random.default_rng(0)
    return rng.uniform(-1.5, 1.5, (count, one.size)), rng.uniform(-1.5, 1.5, (count, other.size))


def test_capsules_of_both_are_where_each_has_them_alone(arms):
    one, other, both = arms
    q, r = postures(one, other)
    ends = both.arm.segments_in_world(both.arm.poses.at(np.concatenate((q, r), axis=1)))
    own = one.arm.segments_in_world(one.arm.poses.at(q))
    there = other.arm.segments_in_world(other.arm.poses.at(r)) @ R.T + P
    np.testing.assert_allclose(ends, np.concatenate((own, there), axis=1), atol=1e-12)


def test_pairs_are_those_of_one_arm_with_itself_with_obstacles_and_with_the_other(arms):
    one, other, both = arms
    moved = int((one.arm.links > 0).sum())
    assert both.count == one.count + moved * len(other.arm.links)
    own = len(one.own)
    q, r = postures(one, other)
    gaps = both.gaps(np.concatenate((q, r), axis=1))
    np.testing.assert_allclose(gaps[:, :own], one.gaps(q)[:, :own], atol=1e-12)
    np.testing.assert_allclose(gaps[:, -moved:], one.gaps(q)[:, -moved:], atol=1e-12)


def test_no_pair_comes_nearer_than_the_ways_of_all_joints_allow(arms):
    one, other, both = arms
    q = np.concatenate(postures(one, other, 200), axis=1)
    step = np.random.default_rng(1).uniform(-0.1, 0.1, q.shape)
    nearer = both.gaps(q) - both.gaps(q + step)
    assert (nearer <= np.abs(step) @ both.reaches.T + 1e-12).all()


def test_slopes_are_those_of_the_distances(arms):
    one, other, both = arms
    q = np.concatenate(postures(one, other, 5), axis=1)
    near = both.near(q)
    e = 1e-6
    for posture, pair in np.argwhere(near.gaps < 0.5)[::7]:
        slope = near.slopes[posture, pair]
        moved = q[posture] + e * np.eye(both.size)
        back = q[posture] - e * np.eye(both.size)
        found = (both.gaps(moved)[:, pair] - both.gaps(back)[:, pair]) / (2.0 * e)
        np.testing.assert_allclose(slope, found, atol=1e-5)


def test_an_arm_that_stands_elsewhere_has_the_same_distances_from_itself(arms):
    _, other, _ = arms
    _, r = postures(*arms[:2])
    np.testing.assert_allclose(stood(other, R, P).gaps(r), other.gaps(r), atol=1e-12)

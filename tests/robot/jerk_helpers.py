"""Joints of all kinds side by side, for the tests of stops and boxes up to the jerk."""

import numpy as np

from drake_rnn.robot.velocity_envelope import (
    JerkLimits,
    VelocityEnvelope,
    jerk_box,
)


def spread(rng, low, high, count):
    """Numbers spread evenly over the orders of magnitude between two."""
    return np.exp(rng.uniform(np.log(low), np.log(high), count))


def joints(rng, count):
    """Limits of joints slow and fast, with short and long ways, shape (count,) each."""
    middle, width = rng.uniform(-3, 3, count), spread(rng, 0.005, 6.0, count)
    return JerkLimits(
        np.array([middle - width / 2, middle + width / 2]),
        spread(rng, 0.05, 4.0, count),
        spread(rng, 0.1, 30.0, count),
        spread(rng, 3.0, 3000.0, count),
    )


def one(limits, k):
    """The limits of one joint of many, as an arm of one joint."""
    envelope = limits.envelope and VelocityEnvelope(*(x[k : k + 1] for x in limits.envelope))
    bounds = (bound[k : k + 1] for bound in limits[1:4])
    return JerkLimits(limits.position[:, k : k + 1], *bounds, envelope)


def assert_one_joint_has_the_box_of_many(limits, period, q, v, a):
    """The box of joints side by side is that of each alone, to the bit, and so with two axes."""
    many = np.array(jerk_box(q, v, a, limits, period))
    stacked = jerk_box(q[None], v[None], a[None], limits, period)
    np.testing.assert_array_equal(np.array(stacked)[:, 0], many)
    for k in range(q.size):
        alone = jerk_box(q[k : k + 1], v[k : k + 1], a[k : k + 1], one(limits, k), period)
        np.testing.assert_array_equal(np.ravel(alone), many[:, k])

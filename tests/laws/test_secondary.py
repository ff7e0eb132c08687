"""What joints do besides their task."""

import numpy as np
import pytest

from drake_rnn import JointLimits, load_arm
from drake_rnn.laws.parts.secondary import (
    Moment,
    Posture,
    manipulability_gradient,
    pushed_back,
)
from screw_helpers import askew

POSTURES = {
    "panda": [0.0, 0.3, 0.1, -1.8, 0.2, 2.0, 0.5],
    "iiwa14": [0.1, 0.6, -0.2, -1.7, 0.3, 0.9, 0.2],
    "ur5": [0.3, -1.2, 1.8, -2.2, -1.57, 0.4],
}


@pytest.fixture(scope="module")
def arms(tmp_path_factory):
    known = {name: (load_arm(name), np.array(q)) for name, q in POSTURES.items()}
    # Slides and turns in turn.
    known["askew"] = askew(tmp_path_factory.mktemp("arm") / "askew.urdf"), np.linspace(-0.6, 0.8, 5)
    return {name: (arm.kinematics(), q) for name, (arm, q) in known.items()}


def jacobians(kinematics, q, m):
    J_omega = kinematics.J_omega(q)
    J = kinematics.J(q)
    return (J if m == 3 else np.vstack((J_omega, J))), J_omega


def log_manipulability(kinematics, q, m):
    J, _ = jacobians(kinematics, q, m)
    return 0.5 * np.linalg.slogdet(J @ J.T + 1e-6 * np.eye(m))[1]


@pytest.mark.parametrize(
    ("name", "m"), [*((name, m) for name in POSTURES for m in (3, 6)), ("askew", 3)]
)
def test_the_gradient_of_the_manipulability_is_that_of_differences(arms, name, m):
    """Central differences of 1e-6 rad; 1e-5 of the largest: their rounding."""
    kinematics, home = arms[name]
    rng = np.random.default_rng(0)
    for _ in range(5):
        q = home + rng.uniform(-0.3, 0.3, home.size)
        found = manipulability_gradient(*jacobians(kinematics, q, m))
        steps = 1e-6 * np.eye(q.size)
        differences = [
            (log_manipulability(kinematics, q + s, m) - log_manipulability(kinematics, q - s, m))
            / 2e-6
            for s in steps
        ]
        largest = np.abs(differences).max()
        np.testing.assert_allclose(found, differences, rtol=0, atol=1e-5 * largest)


@pytest.mark.parametrize("m", [3, 6])
def test_followed_the_gradient_leads_away_from_a_singular_posture(arms, m):
    kinematics, _ = arms["iiwa14"]
    # All but stretched out.
    q = np.array([0.1, 0.2, -0.2, -0.1, 0.3, 0.1, 0.2])
    first = log_manipulability(kinematics, q, m)
    for _ in range(100):
        gradient = manipulability_gradient(*jacobians(kinematics, q, m))
        q = q + 1e-2 * gradient / max(1.0, np.abs(gradient).max())
    assert log_manipulability(kinematics, q, m) > first + 1.0


def test_it_is_finite_in_a_singular_posture_and_one_robot_has_that_of_many(arms):
    kinematics, home = arms["iiwa14"]
    each = [jacobians(kinematics, q, 6) for q in (np.zeros(7), home)]
    many = manipulability_gradient(*(np.array(part) for part in zip(*each, strict=True)))
    assert np.isfinite(many).all()
    for k, own in enumerate(each):
        # The zero posture has 1e-6 for its least eigenvalue.
        np.testing.assert_allclose(many[k], manipulability_gradient(*own), rtol=1e-8, atol=1e-8)


LIMITS = JointLimits(
    position_lower=np.array([-1.0, -np.inf, -0.2]),
    position_upper=np.array([2.0, np.inf, 0.2]),
    velocity=np.ones(3),
)


@pytest.mark.parametrize(
    ("q", "wished"),
    [
        ([0.0, 9.0, 0.0], 0.0),
        # As far from the limit as the zone reaches; within it, at the limit, beyond.
        ([-0.7, 0.0, 0.0], 0.0),
        ([-0.85, 0.0, 0.0], 0.75),
        ([-1.0, 0.0, 0.0], 3.0),
        ([-1.3, 0.0, 0.0], 12.0),
        ([1.85, 0.0, 0.0], -0.75),
    ],
)
def test_joints_are_pushed_back_only_near_a_limit_and_with_the_weight_at_it(q, wished):
    for found in (
        pushed_back(np.array(q), LIMITS, 3.0, 0.3),
        pushed_back(np.array([q]), LIMITS, 3.0, 0.3)[0],
    ):
        # The third joint, amid limits that are closer than the zone, is pushed from both sides.
        np.testing.assert_allclose(found, [wished, 0.0, 0.0], atol=1e-12)


def test_the_push_is_continuous_with_a_slope_that_is():
    q = np.zeros((4001, 3))
    q[:, 0] = np.linspace(-1.0, 2.0, 4001)
    push = pushed_back(q, LIMITS, 3.0, 0.3)[:, 0]
    slope = np.diff(push) / np.diff(q[:, 0])
    # Its second derivative is 2 * 3 / 0.3^2 at most.
    assert np.abs(np.diff(slope)).max() < 1.01 * 66.7 * np.diff(q[:2, 0])[0]
    assert (np.diff(push) <= 1e-12).all()


def pulled(q, most, pull):
    """Return the velocities that joints at some positions prefer, pulled to zero."""
    limits = JointLimits(
        position_lower=np.full(2, -9.0),
        position_upper=np.full(2, 9.0),
        velocity=np.full(2, 9.0),
        acceleration=None if most is None else np.full(2, most),
    )
    moment = Moment(0.0, np.asarray(q), np.zeros(2), np.zeros((3, 2)), {}, 4e-3)
    return Posture(pull, np.zeros(2), limits, "start").velocity(moment)


@pytest.mark.parametrize(("most", "pull"), [(0.3, 1.0), (0.1, 1.0), (1.0, 2.0)])
def test_a_joint_that_is_pulled_to_its_posture_can_stop_there(most, pull):
    """In proportion to a way of 2 rad it would come too fast for its acceleration."""
    farthest = []
    for bound in (most, None):
        q, v, passed = 2.0, 0.0, 0.0
        for _ in range(4000):
            wanted = pulled([q, q], bound, pull)[0]
            v += min(max(wanted - v, -4e-3 * most), 4e-3 * most)
            q += 4e-3 * v
            passed = max(passed, -q)
        farthest.append(passed)
    assert farthest[0] < 0.01
    assert farthest[1] > 0.1


def test_a_pull_that_can_be_braked_is_in_proportion_to_the_way():
    """At 1 rad/s^2 and a pull of 1 /s on ways of up to 1 rad; beyond, half of it brakes."""
    np.testing.assert_array_equal(pulled([-1.0, 0.7], 1.0, 1.0), [1.0, -0.7])
    np.testing.assert_allclose(pulled([-4.0, 2.0], 1.0, 1.0), [2.0, -(2.0**0.5)])
    np.testing.assert_array_equal(pulled([-4.0, 2.0], np.inf, 1.0), [4.0, -2.0])
    many = pulled([[-4.0, 0.5], [0.2, 0.3]], 1.0, 1.0)
    np.testing.assert_allclose(many, [[2.0, -0.5], [-0.2, -0.3]])

"""An arm that was asked for what it cannot do comes back, if the multipliers are bounded."""

import numpy as np
import pytest

from drake_rnn import MotionForce, SimultaneousLearning, load_arm, load_experiment
from drake_rnn.laws.parts.programs import not_outward, within

ARM = load_arm("panda")
KINEMATICS = ARM.kinematics()
START = load_experiment("slc_nephroid_known").start
FORCE_START = load_experiment("motion_force_tricuspid").start
DOWN = KINEMATICS.R_WE(FORCE_START)
HOME = KINEMATICS.p_WE(START)
SURFACE = KINEMATICS.p_WE(FORCE_START)


def signals(q, v, target):
    J = KINEMATICS.J(q)
    return {
        "position": q,
        "velocity": v,
        "p_WE": KINEMATICS.p_WE(q),
        "p_WE_desired": target,
        "v_WE_desired": np.zeros(3),
        "J": J,
        "v_WE": J @ v,
    }


def pressed(q, v, target):
    """The same of a tool that presses with 5 N on a surface of 10 N/mm."""
    u = signals(q, v, target)
    return u | {
        "R_WE": KINEMATICS.R_WE(q),
        "J_omega": KINEMATICS.J_omega(q),
        "R_WE_desired": DOWN,
        "w_WE_desired": np.zeros(3),
        "normal_WE": np.array([0.0, 0.0, 1.0]),
        "normal_force_desired": np.array([5.0]),
        "normal_force": np.array([1e4 * max(0.0, SURFACE[2] - u["p_WE"][2])]),
    }


def errors(law, seen, q, targets, period):
    """The distance from each target, and the largest excess of a position limit [rad]."""
    x = law.initial_state(np.random.default_rng(0), seen(q, np.zeros(7), targets[0]))
    away, passed = [], 0.0
    for k, target in enumerate(targets):
        u = seen(q, x[:7], target)
        x = law.step(k * period, x, u, period)
        q = q + period * x[:7]
        away.append(np.linalg.norm(u["p_WE"] - target))
        passed = max(passed, float(ARM.limits.violation(q).max()))
    return np.array(away), passed


def there_and_back(home, way, gone, back, period):
    n, m = round(gone / period), round(back / period)
    return np.concatenate((np.tile(home + way, (n, 1)), np.tile(home, (m, 1))))


WAYS = {
    "ahead": np.array([1.5, 0.0, 0.0]),
    "up": np.array([0.0, 0.0, 1.5]),
    "behind": np.array([-1.5, 0.0, 0.0]),
}


def learning(way, **changes):
    limits = ARM.limits.replace(velocity=0.5, acceleration=1.0)
    law = SimultaneousLearning(limits=limits, home=START, jacobian="known", **changes)
    targets = there_and_back(HOME, WAYS[way], gone=8.0, back=8.0, period=2e-3)
    return errors(law, signals, START, targets, 2e-3)


@pytest.mark.parametrize(
    "way", ["ahead", *(pytest.param(way, marks=pytest.mark.long) for way in ("up", "behind"))]
)
def test_the_arm_is_back_soon_after_a_target_that_was_out_of_reach(way):
    """Within 7.5 s; from its limits half a turn of a joint alone takes 6 s at 0.5 rad/s."""
    away, passed = learning(way)
    assert away[8 * 500 - 1] > 0.3, "the target is meant to be out of reach"
    assert away[-250:].max() < 1e-2
    assert passed <= 1e-9


def test_as_printed_it_does_not_come_back_and_passes_its_limits():
    away, passed = learning("behind", multiplier_limit="none", position_bound="printed")
    assert away[-250:].min() > 0.1
    assert passed > 0.05


def test_braking_alone_keeps_the_limits_of_an_arm_that_winds_up():
    away, passed = learning("behind", multiplier_limit="none")
    assert away[-250:].min() > 0.1
    assert passed <= 1e-9


def pressing(**changes):
    limits = ARM.limits.replace(velocity=0.1)
    law = MotionForce(limits=limits, stiffness=8000.0, approach_speed=0.05, **changes)
    way = np.array([0.0, 0.2, 0.0])
    targets = there_and_back(SURFACE, way, gone=3.0, back=7.0, period=1e-3)
    return errors(law, pressed, FORCE_START, targets, 1e-3)


def test_an_arm_that_presses_is_back_after_it_was_too_slow():
    """0.2 m to the side at 0.1 rad/s, which 3 s do not suffice for; 0.5 mm deep at 5 N."""
    away, passed = pressing()
    assert away[-1000:].max() < 1e-3
    assert passed <= 1e-9


def test_as_printed_an_arm_that_presses_goes_on_to_leave():
    away, _ = pressing(multiplier_limit="none")
    assert away[-1000:].min() > 0.05


def test_below_their_limit_multipliers_are_what_they_were():
    y, rate = np.array([3.0, 4.0]), np.array([1.0, 1.0])
    assert within(y, 5.0) is y
    assert not_outward(rate, y, 5.1) is rate
    np.testing.assert_array_equal(not_outward(-rate, y, 5.0), -rate)


@pytest.mark.parametrize("rows", [None, np.array([[2.0, 0.0], [0.0, 1.0]])])
def test_at_their_limit_they_turn_but_do_not_grow(rows):
    y, rate = np.array([3.0, 4.0]), np.array([1.0, -0.2])
    scale = np.eye(2) if rows is None else rows
    limit = float(np.linalg.norm(y @ scale))
    turned = not_outward(rate, y, limit, rows)
    assert (turned @ scale) @ (y @ scale) == pytest.approx(0.0, abs=1e-12)
    assert np.abs(turned).max() > 0.1
    assert np.linalg.norm(within(2.0 * y, limit, rows) @ scale) == pytest.approx(limit)


LIMITS = ARM.limits.replace(velocity=0.5, acceleration=1.0)


@pytest.mark.parametrize(
    ("law", "part"),
    [
        (SimultaneousLearning(limits=LIMITS, home=START, jacobian="known"), "multipliers"),
        # What turns the tool has a norm of its own.
        (MotionForce(limits=LIMITS, stiffness=1e4), "orientation_multipliers"),
    ],
)
def test_unless_told_otherwise_multipliers_grow_to_10(law, part):
    """Of a task that is out of reach, at a posture that stands still; 1.25 on a usual path."""
    u = pressed(START, np.zeros(7), HOME + 1.5)
    u["R_WE_desired"] = np.diag([-1.0, -1.0, 1.0]) @ DOWN
    x = law.initial_state(np.random.default_rng(0), u)
    for k in range(2000):
        x = law.step(2e-3 * k, x, u, 2e-3)
    assert np.linalg.norm(law.state.part(x, part)) == pytest.approx(10.0, rel=1e-9)

"""Objectives of a task: coordinates that follow from the posture, with the right derivatives."""

from types import SimpleNamespace

import numpy as np
import pytest

from drake_rnn import InvalidInputError, load_arm, load_experiment
from drake_rnn.inputs.fields import validated
from drake_rnn.robot.rotation import rotation_by, rotation_error
from drake_rnn.robot.task import Task
from drake_rnn.robot.task_objectives import PositionObjective

PANDA = load_arm("panda")
KINEMATICS = PANDA.kinematics()
R_START = KINEMATICS.R_WE(PANDA.home)
SECTION = [
    {"kind": "position", "axes": "xz"},
    {"kind": "orientation"},
    {"kind": "axis", "axis": [0.0, 0.0, 1.0]},
    {"kind": "axis", "axis": [1.0, 0.0, 0.5], "toward": [0.3, 0.2, 1.0], "within": 0.3},
    {"kind": "look", "point": [1.0, 0.2, 0.3]},
    {"kind": "look", "point": [1.0, 0.2, 0.3], "within": 0.2},
    {"kind": "position", "axes": "y", "at_least": 0.1},
    {"kind": "remote_centre", "depth": 0.2, "axis": [0.2, 0.1, 1.0], "through": [0.01, 0.02, 0]},
    {"kind": "remote_centre", "point": [0.5, 0.1, 0.7], "within": 0.05, "normal": [0.1, 0.3, 1.0]},
    {"kind": "remote_centre", "depth": 0.2, "moves": [0.01, 0.02, 0.005], "period": 3.0},
]
TASK = Task.of(SECTION).at(R_START, KINEMATICS, PANDA.home)


def postures(count=5, far=0.4):
    rng = np.random.default_rng(3)
    return PANDA.home + rng.uniform(-far, far, (count, PANDA.n)), rng.uniform(-1, 1, (count, 7))


def test_their_rows_and_accelerations_are_those_of_difference_quotients():
    """Central ones; 1e-6 and 1e-5 rad leave some 1e-9 of rounding and truncation."""
    for q, v in zip(*postures(), strict=True):
        J = TASK.J(KINEMATICS, q).copy()
        quotients = [
            (TASK.coordinates(KINEMATICS, q + e) - TASK.coordinates(KINEMATICS, q - e)) / 2e-6
            for e in 1e-6 * np.eye(7)
        ]
        np.testing.assert_allclose(J, np.transpose(quotients), atol=1e-7)
        after, before = (TASK.J(KINEMATICS, q + h * v).copy() for h in (1e-5, -1e-5))
        bias = TASK.bias(KINEMATICS, q, v)
        np.testing.assert_allclose(bias, (after - before) @ v / 2e-5, atol=1e-6)
        np.testing.assert_allclose(TASK.velocity(KINEMATICS, q, v), J @ v)


def turning_path(R=R_START):
    """A path that turns by two rotations at once, exactly differentiated."""
    a, b = np.array([0.3, 0.2, 0.5]), np.array([0.1, -0.4, 0.2])

    def orientation(t):
        first, second = rotation_by(a * t), rotation_by(b * t * t)
        w = a + first @ (2 * t * b)
        return first @ second @ R, w, np.cross(a, w - a) + first @ (2 * b)

    def position(t):
        return np.array([t, t * t, 0.0]), np.array([1.0, 2 * t, 0.0]), np.array([0.0, 2.0, 0.0])

    return SimpleNamespace(position=position, orientation=orientation, time=lambda t: t)


def test_what_they_should_be_along_a_path_that_turns_has_the_derivatives_it_says():
    path, t, h = turning_path(), 0.7, 1e-4
    x, x_dot, x_ddot = TASK.desired(path, t)
    after, before = (TASK.desired(path, t + step)[0] for step in (h, -h))
    np.testing.assert_allclose(x_dot, (after - before) / (2 * h), atol=1e-7)
    np.testing.assert_allclose(x_ddot, (after - 2 * x + before) / h**2, atol=1e-6)


@pytest.mark.parametrize("kind", ["orientation", "axis"])
def test_an_arm_that_turns_as_its_path_has_the_coordinates_that_it_should_have(kind):
    path = turning_path()
    task = Task.of([{"kind": kind}]).at(R_START)
    R = path.orientation(0.7)[0]
    there = SimpleNamespace(tools=None, R_WE=lambda q: R)
    np.testing.assert_allclose(
        task.coordinates(there, None), task.desired(path, 0.7)[0], atol=1e-14
    )


def test_small_errors_of_charts_are_angles():
    """2 tan(theta / 2) and 4 tan(theta / 4) differ from theta by its third power over 12 and 48."""
    turned = rotation_by(np.array([0.01, -0.02, 0.005])) @ R_START
    there = SimpleNamespace(tools=None, R_WE=lambda q: turned)
    orientation = Task.of([{"kind": "orientation"}]).at(R_START)
    vector = rotation_error(R_START, turned)
    np.testing.assert_allclose(orientation.coordinates(there, None), vector, rtol=1e-4)
    axis = Task.of([{"kind": "axis"}]).at(R_START)
    angle = axis.errors(np.zeros((1, 3)), turned[None], R_START[None])["axis_error"][0]
    length = np.linalg.norm(axis.coordinates(there, None))
    assert length == pytest.approx(angle, rel=1e-4)


def test_many_robots_have_the_coordinates_of_each():
    q, v = postures()
    stack = {
        name: np.array([getattr(KINEMATICS, name)(each) for each in q])
        for name in ("p_WE", "R_WE", "J", "J_omega")
    }
    stack["Jdot_v"] = np.array([KINEMATICS.Jdot_v(*each) for each in zip(q, v, strict=True)])
    many = SimpleNamespace(tools=None, **{n: (lambda *a, x=x: x) for n, x in stack.items()})
    for function in (
        lambda k, q, v: TASK.coordinates(k, q),
        lambda k, q, v: TASK.J(k, q),
        TASK.bias,
    ):
        alone = [function(KINEMATICS, *each) for each in zip(q, v, strict=True)]
        np.testing.assert_allclose(function(many, q, v), alone, rtol=1e-12, atol=1e-12)


def test_margins_are_negative_outside_of_a_range_and_errors_do_not_count_there():
    p, R = np.array([[0.4, 0.05, 0.3]]), R_START[None]
    errors = Task.of(SECTION[:7]).at(R_START).errors(p, R, R)
    assert errors["position_margin"][0] == pytest.approx(-0.05)
    assert errors["angle_margin"][0] < 0.0 < errors["axis_error"][0]


def test_a_law_is_told_what_is_a_range_and_what_has_a_price():
    assert [block.is_range for block in TASK.blocks] == [
        False,
        False,
        False,
        True,
        False,
        True,
        True,
        False,
        True,
        False,
    ]
    assert TASK.size == 17 == sum(block.size for block in TASK.blocks)
    assert TASK.valued.size == 13
    assert (TASK.has_ranges, TASK.has_weights) == (True, False)
    heavy = Task.of([{"kind": "axis", "weight": 2.0}])
    assert (heavy.has_ranges, heavy.has_weights) == (False, True)


@validated
class Low(PositionObjective):
    """A range of a user's own, of which no key of the shipped ones tells."""

    @property
    def bounds(self):
        return None, 0.7


def test_a_range_of_ones_own_is_refused_by_a_law_of_equations():
    """It would be solved as an equation; the adaptive law keeps it."""
    task = [{"kind": "position", "axes": "xy"}, {"kind": f"{__name__}:Low", "axes": "z"}]
    changes = {"task": task, "accept": None}
    assert load_experiment("adaptive_upright", changes).law_task.has_ranges
    with pytest.raises(InvalidInputError, match=r"^task: must have no at_least, at_most or within"):
        load_experiment("zeroing_upright", changes)


def test_objectives_need_the_start_to_which_they_refer():
    with pytest.raises(InvalidInputError, match=r"^task: objectives need the start"):
        Task.of(SECTION).J(KINEMATICS, PANDA.home)

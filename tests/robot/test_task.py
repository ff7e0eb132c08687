"""Tasks: which rows of the end effector's motion they take."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drake_rnn import InvalidInputError, load_arm
from drake_rnn.robot.task import (
    TASKS,
    named_task,
    tasks_suiting,
)

PANDA = load_arm("panda")
KINEMATICS = PANDA.kinematics()
shares = st.lists(st.floats(0.05, 0.95), min_size=7, max_size=7).map(np.array)


@given(shares)
def test_rows_of_a_pose_are_rotation_then_position(share):
    limits = PANDA.limits
    q = limits.position_lower + share * (limits.position_upper - limits.position_lower)
    J = TASKS["pose"].J(KINEMATICS, q)
    np.testing.assert_array_equal(J[:3], KINEMATICS.J_omega(q))
    np.testing.assert_array_equal(J[3:], TASKS["xyz"].J(KINEMATICS, q))
    np.testing.assert_array_equal(J[3:5], TASKS["xy"].J(KINEMATICS, q))


@pytest.mark.parametrize(("name", "size", "axes"), [("xyz", 3, 3), ("xy", 2, 2), ("pose", 6, 3)])
def test_a_task_has_as_many_rows_as_its_size(name, size, axes):
    task = named_task(name)
    assert task.size == size
    assert task.J(KINEMATICS, PANDA.home).shape == (size, 7)
    np.testing.assert_array_equal(task.position(np.arange(3.0)), np.arange(float(axes)))


def test_a_task_that_is_none_is_refused_with_those_that_are():
    with pytest.raises(
        InvalidInputError, match=r"^task: may be xyz, xy, pose, or a list of obj.*, not 'yz'"
    ):
        named_task("yz")


@pytest.mark.parametrize(
    ("shapes", "able"),
    [
        ({"J": (3, 7)}, ["xyz"]),
        ({"J": (6, 7), "p_WE": (3,)}, ["pose"]),
        ({"p_WE": (3,), "v_WE": (3,)}, ["xyz", "pose"]),
        ({"J_hat": (2, 7), "velocity": (7,)}, ["xy"]),
        ({"velocity": (7,)}, ["xyz", "xy", "pose"]),
        ({"J": (4, 7)}, []),
    ],
)
def test_a_signal_suits_the_tasks_with_as_many_rows(shapes, able):
    assert tasks_suiting(shapes) == able

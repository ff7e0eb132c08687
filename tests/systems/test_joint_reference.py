"""The reference of the joints: the right times ahead, and joints that are on the path."""

import numpy as np
import pytest

from drake_rnn import InvalidInputError, load_arm
from drake_rnn.paths import Circle
from drake_rnn.systems.sources import (
    JointReference,
    followed_path,
    held_posture,
)

START = np.array([0.4, 0.8, -0.3, -1.2, 0.5, 0.9, 0.2])


def preview(reference, t):
    context = reference.CreateDefaultContext()
    context.SetTime(t)
    return reference.GetOutputPort("position_preview").Eval(context)


def test_shows_the_times_ahead_row_by_row():
    reference = JointReference(lambda t: np.column_stack((t, -2.0 * t)), 2, 0.1, 3)
    np.testing.assert_allclose(preview(reference, 5.0), [5.1, -10.2, 5.2, -10.4, 5.3, -10.6])


def test_holds_a_posture():
    given = START.copy()
    reference = JointReference(held_posture(given), 7, 0.1, 2)
    given[:] = 0.0
    np.testing.assert_array_equal(preview(reference, 3.0), np.tile(START, 2))


@pytest.mark.parametrize("task", ["xyz", "xy"])
def test_the_joints_are_on_the_path(task):
    arm = load_arm("iiwa14")
    path = Circle(size=0.1, period=4.0, plane="xy", timing="quintic")
    positions_at = followed_path(path, arm, START, 2.0, task)
    kinematics = arm.kinematics()
    origin = kinematics.p_WE(START)
    axes = [0, 1, 2][: len(task)]
    times = np.array([0.0, 0.3, 0.7005, 1.1, 2.0])
    for t, q in zip(times, positions_at(times), strict=True):
        miss = (kinematics.p_WE(q) - origin - path.evaluate(t)[0])[axes]
        # The pseudoinverse's own error at 0.3 m/s and 1 ms.
        assert np.abs(miss).max() < 2e-5
    np.testing.assert_array_equal(positions_at(times[:1])[0], START)
    # Beyond its end it stays.
    np.testing.assert_array_equal(positions_at(np.array([9.0])), positions_at(np.array([2.0])))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((held_posture(START), 7, 0.0, 3), "interval: must be positive, not 0.0"),
        ((held_posture(START), 7, 0.1, 0), "count: must be a whole number of at least 1, not 0"),
        ((held_posture(START), 6, 0.1, 3), r"positions_at: must give shape \(3, 6\)"),
    ],
)
def test_refuses(arguments, message):
    with pytest.raises(InvalidInputError, match=message):
        JointReference(*arguments)


def test_knows_no_orientation():
    with pytest.raises(
        InvalidInputError, match="task: may be xyz, xy for a joint reference, not 'pose'"
    ):
        followed_path(Circle(size=0.1, period=4.0), load_arm("iiwa14"), START, 1.0, "pose")


def test_a_step_at_which_the_feedback_would_overshoot_is_refused():
    circle = Circle(size=0.1, period=4.0)
    with pytest.raises(InvalidInputError, match=r"step: must be below 0\.1 s, not 0\.1"):
        followed_path(circle, load_arm("iiwa14"), START, 1.0, step=0.1)

"""Targets of two arms in one file: each column names its arm, or the file is refused."""

import numpy as np
import pytest

from drake_rnn import InvalidInputError
from drake_rnn.paths.joint_targets import RecordedTargets

JOINTS = {name: tuple(f"joint{k}" for k in range(1, 4)) for name in ("left", "right")}
POSE = ["x", "y", "z", "qw", "qx", "qy", "qz"]


def numbered(prefix, count=3):
    return [f"{prefix}{k}" for k in range(1, count + 1)]


def of(names, prefix):
    return [f"{prefix}{name}" for name in names]


def calls_of(place, columns):
    """What each arm is given by a file of two rows, whose numbers are those of the columns."""
    file = place / "two.csv"
    rows = [[0.1 * k, *columns.values()] for k in range(2)]
    file.write_text("\n".join(",".join(map(str, row)) for row in (["t", *columns], *rows)) + "\n")
    arms = RecordedTargets(file=str(file)).by_arm(JOINTS)
    return {arm: own.calls(JOINTS[arm], ["rad"] * 3, np.zeros(3))[0] for arm, own in arms.items()}


@pytest.mark.parametrize(
    ("left", "right", "kinds"),
    [
        (numbered("left/q"), numbered("right/q"), ["positions", "positions"]),
        (numbered("left_joint"), numbered("right_joint"), ["positions", "positions"]),
        (numbered("action.left_joint"), numbered("action.right_joint"), ["positions"] * 2),
        (of(POSE, "left/"), numbered("right.v", 3), ["poses", "velocities"]),
        (numbered("left/q"), [], ["positions"]),
    ],
)
def test_an_arm_gets_what_names_it_whatever_the_order_of_columns(tmp_path, left, right, kinds):
    names = [*left, *right, "reward"]
    columns = dict(zip(names, np.linspace(0.1, 1.0, len(names)).tolist(), strict=True))
    there = calls_of(tmp_path, columns)
    assert [calls[0].kind for calls in there.values()] == kinds
    for own, calls in zip((left, right), there.values(), strict=False):
        np.testing.assert_array_equal(calls[1].values[0], [columns[name] for name in own])
    order = np.random.default_rng(1).permutation(len(names))
    again = calls_of(tmp_path, {names[k]: columns[names[k]] for k in order})
    for arm, calls in there.items():
        np.testing.assert_array_equal(again[arm][1].values, calls[1].values)


def test_a_longer_name_is_not_that_of_the_arm_that_it_begins_with(tmp_path):
    file = tmp_path / "two.csv"
    names = [*numbered("arm_q"), *numbered("arm_2_q")]
    file.write_text(",".join(["t", *names]) + "\n" + ",".join(map(str, range(7))) + "\n")
    joints = {"arm": JOINTS["left"], "arm_2": JOINTS["right"]}
    arms = RecordedTargets(file=str(file)).by_arm(joints)
    first = {arm: own.calls(joints[arm], ["rad"] * 3, np.zeros(3))[0] for arm, own in arms.items()}
    assert {arm: calls[0].values.tolist() for arm, calls in first.items()} == {
        "arm": [[1.0, 2.0, 3.0]],
        "arm_2": [[4.0, 5.0, 6.0]],
    }


@pytest.mark.parametrize(
    ("names", "message"),
    [
        ([*numbered("left/q"), *numbered("rihgt/q")], "rihgt/q1: no arm 'rihgt'; nearest: right"),
        ([*numbered("Left_q"), *numbered("right_q")], "Left_q1: no arm 'Left'"),
        ([*numbered("left/q"), *numbered("q")], "q1, q2, q3: are of no arm; must begin with left/"),
        ([*of(POSE, ""), *numbered("right/q")], "x, y, z, .*: are of no arm"),
        ([*numbered("left/q"), *numbered("left.q")], "left/q1 and left.q1 are both q1 of left"),
        ([*numbered("left/q", 2), *numbered("right/q")], "must have the columns t, q1, q2, q3"),
    ],
)
def test_columns_that_may_be_of_an_arm_and_name_none_are_refused(tmp_path, names, message):
    with pytest.raises(InvalidInputError, match=message):
        calls_of(tmp_path, dict.fromkeys(names, 0.1))

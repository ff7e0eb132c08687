"""Kinematics for many robots: they are Drake's, whatever the arm, and each robot's are its own.

Lengths are of 1 m and speeds of 2 rad/s; 1e-12 is some thousand roundings, of which a few are
seen.
"""

from dataclasses import replace

import numpy as np
import pytest

from drake_rnn import InvalidInputError, load_arm, screws_of, shipped_arms, side_by_side
from screw_helpers import all_of, all_of_drake, askew, assert_close, assert_same, motions

TOOL = {"length": 0.1, "offset": [0.02, -0.03, 0.01], "rpy": [0.3, 0.2, -0.5]}


@pytest.fixture(scope="module")
def panda():
    return load_arm("panda")


@pytest.fixture
def sliding(tmp_path):
    return askew(tmp_path / "askew.urdf")


# They are Drake's.


@pytest.mark.parametrize("name", shipped_arms())
def test_shipped_arms_move_as_in_drake(name):
    arm = load_arm(name)
    q, v = motions(arm.n)
    assert_close(all_of(screws_of(arm), q, v), all_of_drake(arm, q, v), 1e-12)


def test_joints_that_slide_and_axes_askew_move_as_in_drake(sliding):
    q, v = motions(sliding.n)
    screws = screws_of(sliding)
    assert screws.slides == (True, False, False, True, False)
    assert_close(all_of(screws, q, v), all_of_drake(sliding, q, v), 1e-12)


@pytest.mark.parametrize("changes", [{"tool": TOOL}, {"lock": {"panda_joint3": 0.4}}])
def test_a_tool_and_a_joint_that_is_held_are_part_of_the_arm(panda, changes):
    arm = panda.replace(**changes)
    q, v = motions(arm.n)
    assert_close(all_of(screws_of(arm), q, v), all_of_drake(arm, q, v), 1e-12)


def test_joints_in_any_order_and_beyond_the_frame_move_as_in_drake(sliding):
    """The last two joints do not move E, which is a link before them."""
    names = ["joint3", "joint5", "joint1", "joint2", "joint4"]
    arm = load_arm(sliding.model, frame="link3", joints=names)
    q, v = motions(arm.n)
    found = all_of(screws_of(arm), q, v)
    assert_close(found, all_of_drake(arm, q, v), 1e-12)
    assert not found["J"][..., [1, 4]].any()
    assert not found["J_omega"][..., [1, 4]].any()


# They agree with each other.


def test_jacobians_and_bias_are_derivatives(sliding):
    """Central differences over 1e-5 s are wrong by some 1e-10, and by roundings of 1e-11."""
    screws, h = screws_of(sliding), 1e-5
    q, v = motions(sliding.n)
    moved, before, after = screws.at(q), screws.at(q - h * v), screws.at(q + h * v)

    def rate(then, now):
        return (now - then) / (2 * h)

    def times(J):
        return (J * v[:, None]).sum(axis=-1)

    np.testing.assert_allclose(rate(before.p_WE, after.p_WE), times(moved.J), atol=1e-8)
    J_rate = rate(before.J, after.J)
    np.testing.assert_allclose(times(J_rate), moved.Jdot_v(v), atol=1e-8)
    omega = rate(before.R_WE, after.R_WE) @ moved.R_WE.swapaxes(-1, -2)
    spin = np.stack((omega[:, 2, 1], omega[:, 0, 2], omega[:, 1, 0]), axis=-1)
    np.testing.assert_allclose(spin, times(moved.J_omega), atol=1e-8)


def test_orientations_stay_rotations(sliding):
    """Ten roundings."""
    R = screws_of(sliding).at(motions(sliding.n, (1000,))[0]).R_WE
    np.testing.assert_allclose(
        R @ R.swapaxes(-1, -2), np.broadcast_to(np.eye(3), R.shape), atol=2e-15
    )


# One robot and many.


@pytest.mark.parametrize("robots", [1, 8, 37, 1000])
@pytest.mark.parametrize("make", [lambda: load_arm("panda"), None], ids=["panda", "askew"])
def test_a_robot_has_the_same_bits_alone_as_in_any_batch(make, robots, sliding):
    arm = sliding if make is None else make()
    q, v = motions(arm.n, (1000,))
    screws = screws_of(arm)
    every = all_of(screws, q, v)
    batch = all_of(screws, q[:robots], v[:robots])
    assert_same(batch, {name: value[:robots] for name, value in every.items()})
    last = all_of(screws, q[robots - 1], v[robots - 1])
    assert_same(last, {name: value[robots - 1] for name, value in every.items()})


def test_how_robots_lie_in_memory_changes_no_bit(panda):
    q, v = motions(7, (37,))
    screws = screws_of(panda)
    beside = [np.ascontiguousarray(values.T).T for values in (q, v)]
    assert_same(all_of(screws, *beside), all_of(screws, q, v))


def test_robots_lie_side_by_side_in_what_comes_out(panda):
    moved = screws_of(panda).at(motions(7, (37,))[0])
    assert moved.J.shape == (37, 3, 7)
    assert moved.J.strides[0] == moved.p_WE.strides[0] == moved.R_WE.strides[0] == 8


def test_there_may_be_several_leading_axes_or_none_and_no_robots_at_all(panda):
    screws = screws_of(panda)
    q, v = motions(7, (4, 5))
    flat = all_of(screws, q.reshape(20, 7), v.reshape(20, 7))
    assert_same(all_of(screws, q, v), {k: a.reshape(4, 5, *a.shape[1:]) for k, a in flat.items()})
    assert screws.at(q[0, 0]).J.shape == (3, 7)
    assert screws.at(np.zeros((0, 7))).J.shape == (0, 3, 7)


# Each its own arm.


def own_arms(panda):
    """Three Pandas: as it is, with a tool, and with another one, turned."""
    tools = (None, {"length": 0.2}, TOOL)
    return [panda.replace(tool=tool) for tool in tools]


def test_each_robot_may_have_its_own_arm(panda):
    arms = own_arms(panda)
    screws = side_by_side([screws_of(arm) for arm in arms])
    assert screws.robots == (3,)
    q, v = motions(7, (3,))
    found = all_of(screws, q, v)
    for robot, arm in enumerate(arms):
        rows = slice(robot, robot + 1)
        of_drake = all_of_drake(arm, q[rows], v[rows])
        assert_close({name: value[rows] for name, value in found.items()}, of_drake, 1e-12)
        alone = all_of(screws_of(arm), q[robot], v[robot])
        assert_same({name: value[robot] for name, value in found.items()}, alone)
        assert_same(all_of(screws.of(robot), q[robot], v[robot]), alone)


def test_own_arms_take_one_posture_or_several_for_each(panda):
    """Three arms: were a vector taken for three robots, nothing would say so."""
    screws = side_by_side([screws_of(arm) for arm in own_arms(panda)])
    q, v = motions(7, (5, 1))
    found = all_of(screws, q, np.broadcast_to(v, (5, 3, 7)))
    assert found["J"].shape == (5, 3, 3, 7)
    one = all_of(screws, q[2, 0], v[2, 0])
    assert_same({name: value[2] for name, value in found.items()}, one)
    for robot in range(3):
        alone = all_of(screws.of(robot), q[2, 0], v[2, 0])
        assert_same({name: value[robot] for name, value in one.items()}, alone)


# Refusals.


def test_joints_that_neither_turn_nor_slide_are_refused(tmp_path, sliding):
    text = sliding.model.read_text().replace("<robot", '<robot xmlns:drake="http://drake.mit.edu"')
    first = text.replace(
        '<joint name="joint3" type="continuous">', '<drake:joint name="joint3" type="screw">'
    )
    start, end = first.split('type="screw"')
    end = end.replace("</joint>", '<drake:screw_thread_pitch value="0.1"/></drake:joint>', 1)
    file = tmp_path / "screw.urdf"
    file.write_text(f'{start}type="screw"{end}')
    with pytest.raises(InvalidInputError, match=r"'joint3' is a screw joint; .* only revolute"):
        screws_of(load_arm(file, frame="tip"))


def test_a_joint_that_follows_another_is_refused_with_the_arm(tmp_path, sliding):
    follows = '<mimic joint="joint2"/></joint>'
    start, end = sliding.model.read_text().split('name="joint5"')
    file = tmp_path / "mimic.urdf"
    file.write_text(f'{start}name="joint5"{end.replace("</joint>", follows, 1)}')
    with pytest.raises(InvalidInputError, match=r"'joint5' follows 'joint2' \(mimic\)"):
        screws_of(load_arm(file, frame="tip"))


def test_a_frame_that_nothing_moves_is_refused(sliding):
    arm = load_arm(sliding.model, frame="link0", joints=["joint1"])
    with pytest.raises(InvalidInputError, match=r"arm\.frame: no joint moves 'link0'"):
        screws_of(arm)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda s: s.at(np.zeros(6)), r"position: must have shape \(\.\.\., 7\), not \(6,\)"),
        (lambda s: s.at(np.array(0.0)), r"position: must have shape"),
        (lambda s: s.at([0.0] * 7), r"position: must be an array of NumPy or JAX, not \["),
        (lambda s: s.at(np.zeros(7, int)), r"position: must be of float64, not int64"),
        (lambda s: s.at(np.zeros(7, np.float32)), r"position: must be of float64, not float32"),
        (lambda s: s.at(np.zeros(7)).Jdot_v(np.zeros(6)), r"velocity: must have shape"),
        (lambda s: s.at(np.zeros((4, 7))).Jdot_v(np.zeros(7)), r"velocity: must be given for each"),
        (lambda s: side_by_side([]), r"arms: must be given"),
        (lambda s: side_by_side([s, None]), r"arms\[1\]: must be of class Screws, not None"),
        (lambda s: side_by_side([s, side_by_side([s])]), r"arms\[1\]: must be of one robot"),
        (
            lambda s: side_by_side([s, screws_of(load_arm("ur5"))]),
            r"arms\[1\]: must have the joints",
        ),
        (lambda s: side_by_side([s, s]).at(np.zeros((3, 7))), r"position: is for robots of shape"),
        (lambda s: side_by_side([s, s]).of(2), r"robot: may be 0 to 1, not 2"),
        (lambda s: replace(s, axes=s.axes[1:]), r"screws\.axes: must have shape \(\.\.\., 7, 3\)"),
        (lambda s: screws_of("panda"), r"arm: must be of class Arm"),
    ],
)
def test_what_does_not_fit_is_refused_by_name(panda, call, message):
    with pytest.raises(InvalidInputError, match=f"^{message}"):
        call(screws_of(panda))

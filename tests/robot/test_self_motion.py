"""Self-motion: the arm moves, the end effector does not."""

from functools import cache
from math import inf, nan, pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drake_rnn import InvalidInputError, JointLimits, SelfMotion, load_arm, load_experiment

# Each with a self-motion, whole or in part of what the end effector does.
CASES = [("panda", "xyz"), ("panda", "pose"), ("iiwa14", "xyz"), ("ur5", "xyz"), ("planar6", "xy")]


@cache
def arm(name):
    return load_arm(name)


@cache
def home(name, task="xyz"):
    return SelfMotion(arm(name), arm(name).home, task)


def bounded(name, **bounds):
    return arm(name).with_limits(arm(name).limits.replace(**bounds))


def numbers(low, high):
    return st.lists(st.floats(low, high), min_size=7, max_size=7).map(np.array)


def assert_at_its_place(motion, q, orientation=False):
    """Measured anew, not by what `SelfMotion` says of itself."""
    kinematics = motion.arm.kinematics()
    assert abs(kinematics.p_WE(q) - kinematics.p_WE(motion.start)).max() < 1e-10
    if orientation:
        turn = kinematics.R_WE(q) - kinematics.R_WE(motion.start)
        assert abs(turn).max() < 1e-9


def null_space(motion, q):
    """Orthonormal joint velocities that leave the end effector's position, in rows."""
    _, s, V = np.linalg.svd(motion.arm.kinematics().J(q))
    return V[int((s > 1e-6).sum()) :]


# How much there is of it.


@pytest.mark.parametrize(
    ("name", "task", "dimensions"),
    [
        ("panda", "xyz", 4),
        ("panda", "pose", 1),
        ("iiwa14", "xyz", 4),
        ("iiwa14", "pose", 1),
        ("ur5", "xyz", 3),
        ("ur5", "pose", 0),
        ("planar6", "xy", 4),
        ("planar6", "xyz", 4),
        ("planar6", "pose", 3),
    ],
)
def test_joints_beyond_what_the_task_takes_are_free(name, task, dimensions):
    assert home(name, task).free_dimensions == dimensions


def test_a_locked_joint_is_one_free_dimension_less():
    part = arm("panda").replace(lock={"panda_joint3": 0.0})
    motion = SelfMotion(part, part.home)
    assert motion.free_dimensions == 3
    assert_at_its_place(motion, motion.somewhere(0.3))
    few = arm("panda").replace(joints=["panda_joint2", "panda_joint4"])
    motion = SelfMotion(few, few.home)
    assert motion.free_dimensions == 0
    np.testing.assert_array_equal(motion.towards(few.home + 0.3), few.home)


# Walks.


@settings(max_examples=40)
@given(st.sampled_from(CASES), numbers(-1, 1), st.floats(1e-4, 1.0))
def test_a_walk_is_as_long_as_asked_and_leaves_the_end_effector_in_its_place(
    case, direction, length
):
    """1e-8 rad; or the self-motion ends before, and that is said."""
    motion = home(*case)
    try:
        q = motion.walk(direction[: motion.arm.n], length)
    except InvalidInputError as error:
        assert "ends" in str(error)  # noqa: PT017
        return
    assert abs(abs(q - motion.start).max() - length) < 1e-8
    assert not motion.arm.limits.violation(q).any()
    assert_at_its_place(motion, q, orientation=case[1] == "pose")


@pytest.mark.parametrize("case", CASES)
def test_towards_a_posture_of_the_self_motion_leads_there(case):
    motion = home(*case)
    for seed, length in enumerate((0.01, 0.3, 0.8)):
        target = motion.somewhere(length, seed)
        assert_at_its_place(motion, target, orientation=case[1] == "pose")
        np.testing.assert_allclose(motion.towards(target), target, atol=1e-6)


def test_somewhere_is_the_same_for_a_seed_and_another_for_another():
    motion = home("panda")
    np.testing.assert_array_equal(motion.somewhere(0.5, 3), motion.somewhere(0.5, 3))
    assert abs(motion.somewhere(0.5, 3) - motion.somewhere(0.5, 4)).max() > 0.05


def test_a_walk_ends_where_the_self_motion_does():
    """With the hand held, joint 7 of the Panda gets nowhere near a turn."""
    with pytest.raises(InvalidInputError, match=r"^length: the self-motion of panda ends .* 6 rad"):
        home("panda", "pose").walk(np.eye(7)[6], 6.0)
    with pytest.raises(
        InvalidInputError, match=r"no posture found in 20 directions; .* panda ends"
    ):
        home("panda", "pose").somewhere(6.0)
    with pytest.raises(InvalidInputError, match="ends 0 rad from the start"):
        home("ur5", "pose").walk(np.ones(6), 0.1)


# Towards a target.


def paper():
    """The postures of Jin et al., their limits, and the self-motion from the start."""
    experiment = load_experiment("state_adjustment")
    iiwa = arm("iiwa14").with_limits(experiment.limits)
    return SelfMotion(iiwa, experiment.start), np.array(experiment.document.law["target"])


def test_the_papers_target_is_off_the_self_motion_of_its_start():
    motion, target = paper()
    assert motion.distance(target) == pytest.approx(0.02232, abs=1e-5)
    q = motion.towards(target)
    off = abs(q - target)
    assert off.argmax() == 3
    assert off.max() == pytest.approx(0.0662, abs=1e-4)
    assert_at_its_place(motion, q)


def test_where_it_ends_no_self_motion_brings_the_joints_nearer():
    """What is left of the way to the target stands at right angles to the self-motion."""
    motion, target = paper()
    q = motion.towards(target)
    assert np.linalg.norm(target - q) > 0.07
    assert abs(null_space(motion, q) @ (target - q)).max() < 1e-6


@settings(max_examples=40)
@given(st.sampled_from(CASES), numbers(-3, 3))
def test_any_target_is_approached_within_the_limits(case, target):
    motion = home(*case)
    target = target[: motion.arm.n]
    q = motion.towards(target)
    assert_at_its_place(motion, q, orientation=case[1] == "pose")
    assert not motion.arm.limits.violation(q).any()
    assert np.linalg.norm(q - target) <= np.linalg.norm(motion.start - target)


def straightened(seed):
    """The iiwa 14 with its elbow 0.02 rad from straight, and a target anywhere."""
    rng, limits = np.random.default_rng(seed), arm("iiwa14").limits
    start = rng.uniform(-1, 1, 7)
    start[3] = 0.02
    motion = SelfMotion(arm("iiwa14"), start)
    return motion, rng.uniform(limits.position_lower, limits.position_upper)


@pytest.mark.parametrize("seed", [6, 24, 53])
def test_a_nearly_straight_arm_does_not_run_away_as_a_plain_gauss_newton_projection_does(seed):
    """Whose steps are of any length near a singularity; here they only ever lead nearer."""
    motion, target = straightened(seed)
    way = np.linalg.norm(motion.start - target)
    q = motion.towards(target)
    assert np.linalg.norm(q - target) < way
    assert not motion.arm.limits.violation(q).any()
    assert_at_its_place(motion, q)

    kinematics, q, farthest = motion.arm.kinematics(), motion.start, 0.0
    for _ in range(100):
        J = kinematics.J(q)
        J_inverse = np.linalg.pinv(J)
        q = q + (np.eye(7) - J_inverse @ J) @ (target - q)
        miss = kinematics.p_WE(q) - kinematics.p_WE(motion.start)
        q = q - np.linalg.pinv(kinematics.J(q)) @ miss
        farthest = max(farthest, np.linalg.norm(q - target))
    assert farthest > 2 * way


@settings(max_examples=20)
@given(st.integers(0, 2**31))
def test_from_nearly_straight_any_target_is_approached(seed):
    motion, target = straightened(seed)
    q = motion.towards(target)
    assert np.linalg.norm(q - target) <= np.linalg.norm(motion.start - target)
    assert not motion.arm.limits.violation(q).any()
    assert_at_its_place(motion, q)


def test_an_outstretched_arm_cannot_move():
    """Though to first order all joints but one can."""
    motion = SelfMotion(arm("planar6"), np.zeros(6), "xy")
    assert abs(motion.towards(np.array([0.5, -0.3, 0.2, -0.4, 0.1, 0.3]))).max() < 1e-4
    with pytest.raises(InvalidInputError, match="ends"):
        motion.walk(np.array([1.0, -1.0, 0.5, 0.2, 0.1, 0.0]), 0.1)
    with pytest.raises(InvalidInputError, match="no posture found"):
        motion.somewhere(0.1)


def test_a_straight_arm_turns_about_its_axis():
    """The iiwa upright: joints 1, 3, 5 and 7 turn as they like, and the others stay."""
    motion = SelfMotion(arm("iiwa14"), np.zeros(7))
    target = np.array([0.5, 0.0, -0.4, 0.0, 0.3, 0.0, 1.0])
    np.testing.assert_allclose(motion.towards(target), target, atol=1e-6)


def test_the_start_is_where_it_ends_if_it_is_the_target():
    motion = home("iiwa14")
    np.testing.assert_array_equal(motion.towards(motion.start), motion.start)


# Limits.


@settings(max_examples=200)
@given(st.sampled_from(["panda", "iiwa14", "planar6"]), st.integers(0, 2**31), st.booleans())
@pytest.mark.long
def test_a_joint_that_is_pressed_against_its_limit_stops_there_and_the_others_go_on(
    name, seed, begins_there
):
    """No step within the limits leads nearer, as the cone of such steps has it."""
    rng = np.random.default_rng(seed)
    start, n = arm(name).home, arm(name).n
    lower, upper = start - rng.uniform(0.02, 0.3, n), start + rng.uniform(0.02, 0.3, n)
    if begins_there:
        joints = rng.integers(n, size=3)
        upper[joints] = start[joints]
    motion = SelfMotion(bounded(name, position_lower=lower, position_upper=upper), start)
    target = rng.uniform(lower, upper)
    q = motion.towards(target)
    assert not motion.arm.limits.violation(q).any()
    assert_at_its_place(motion, q)
    # Steps of the self-motion, at random; those that leave the limits turn round or are none.
    N = null_space(motion, q)
    steps = rng.standard_normal((300, len(N))) @ N
    allowed = ~((steps > 0) & (q > upper - 2e-6) | (steps < 0) & (q < lower + 2e-6)).any(axis=1)
    assert (steps[allowed] @ (target - q) < 1e-4).all()


@settings(max_examples=40)
@given(st.sampled_from(["panda", "planar6"]), st.integers(0, 2**31))
@pytest.mark.long
def test_a_start_outside_the_limits_comes_inside(name, seed):
    """By up to 0.1 rad in one joint, whether or not the target can be reached."""
    rng = np.random.default_rng(seed)
    start, joint = arm(name).home, rng.integers(arm(name).n)
    upper = arm(name).limits.position_upper.copy()
    upper[joint] = start[joint] - rng.uniform(0.0, 0.1)
    motion = SelfMotion(bounded(name, position_upper=upper), start)
    limits = motion.arm.limits
    q = motion.towards(rng.uniform(limits.position_lower, upper))
    assert limits.violation(q).max() == 0.0
    assert_at_its_place(motion, q)
    target = motion.somewhere(0.4, seed)
    assert limits.violation(target).max() == 0.0
    np.testing.assert_allclose(motion.towards(target), target, atol=1e-6)


def test_joints_without_limits_go_as_far_as_they_are_asked_to():
    """The last joint of the UR5 turns the flange about its own axis: three turns and more."""
    free = arm("ur5").with_limits(JointLimits.unlimited(6))
    motion = SelfMotion(free, free.home)
    target = free.home + 20.0 * np.eye(6)[5]
    np.testing.assert_allclose(motion.towards(target), target, atol=1e-9)
    q = motion.walk(np.eye(6)[5], 2 * pi)
    assert q[5] - free.home[5] == pytest.approx(2 * pi, abs=1e-8)


# The orientation.


def test_a_turn_about_the_end_effectors_own_axis_is_one_of_the_pose_alone():
    q = arm("panda").home + 0.3 * np.eye(7)[6]
    assert home("panda", "xyz").distance(q) < 1e-12
    assert home("panda", "xyz").angle(q) == 0.0
    assert home("panda", "pose").angle(q) == pytest.approx(0.3, abs=1e-12)


# Refusals.


@pytest.mark.parametrize(
    ("refused", "message"),
    [
        (lambda: SelfMotion(arm("panda"), np.zeros(6)), "start: must be 7 finite numbers"),
        (lambda: SelfMotion(arm("panda"), np.full(7, nan)), "start: must be 7 finite numbers"),
        (lambda: SelfMotion(arm("panda"), None), "start: must be 7 finite numbers"),
        (
            lambda: home("panda", "yaw"),
            "task: may be xyz, xy, pose, or a list of objectives, not 'yaw'",
        ),
        (lambda: home("panda").walk(np.ones(6), 0.1), "direction: must be 7 finite numbers"),
        (lambda: home("panda").walk(np.full(7, inf), 0.1), "direction: must be 7 finite numbers"),
        (lambda: home("panda").walk(np.zeros(7), 0.1), "length: the self-motion of panda ends 0"),
        (lambda: home("panda").walk(np.ones(7), 0.0), "length: must be positive and at most 2 pi"),
        (lambda: home("panda").walk(np.ones(7), nan), "length: must be positive and at most 2 pi"),
        (lambda: home("panda").somewhere(-1.0), "length: must be positive and at most 2 pi"),
        (lambda: home("panda").somewhere(inf), "length: must be positive and at most 2 pi"),
        (lambda: home("panda").somewhere(0.1, seed=-1), "seed: must be 0 or more, not -1"),
        (lambda: home("panda").towards(np.zeros(6)), "target: must be 7 finite numbers"),
        (lambda: home("panda").towards(np.full(7, nan)), "target: must be 7 finite numbers"),
    ],
)
def test_what_cannot_be_is_refused_by_name(refused, message):
    with pytest.raises(InvalidInputError, match=f"^{message}"):
        refused()

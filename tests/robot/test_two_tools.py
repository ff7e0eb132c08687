"""An arm with two tools: its model, its frames, its objectives, and what it is refused."""

from pathlib import Path

import numpy as np
import pytest

from drake_rnn import InvalidInputError, load_arm, make_experiment
from drake_rnn.robot.clearance.arm_clearance import arm_clearance
from drake_rnn.robot.load_arm import screws_of
from drake_rnn.robot.rotation import rotation_by, rotation_error
from drake_rnn.robot.task import Task
from drake_rnn.robot.task_frame import pose_of

BASE = {"translation": [0.9, 0.1, 0.05], "rpy": [0.1, -0.2, 3.0]}
PAIR = {"arm": "panda", "base": BASE}
ARM = load_arm("panda", pair=PAIR)
ONE = load_arm("panda")
FRAMES = ["first", "second", "relative", "centre"]
SECTION = [
    {"kind": "position"},
    {"kind": "orientation"},
    {"kind": "position", "of": "relative", "axes": "xz"},
    {"kind": "orientation", "of": "relative"},
    {"kind": "axis", "of": "second"},
    {"kind": "look", "of": "first", "point": [1.0, 0.2, 0.3]},
]


def postures(count=3, far=0.4):
    rng = np.random.default_rng(7)
    return ARM.home + rng.uniform(-far, far, (count, ARM.n)), rng.uniform(-1, 1, (count, ARM.n))


def test_two_arms_are_one_of_fourteen_joints_where_their_bases_stand():
    """Each tool is where its own arm has it, the second one from its own base."""
    assert ARM.n == 14
    assert ARM.joints[7:] == tuple(f"second_{name}" for name in ONE.joints)
    np.testing.assert_array_equal(ARM.home, np.tile(ONE.home, 2))
    np.testing.assert_array_equal(ARM.limits.velocity, np.tile(ONE.limits.velocity, 2))
    np.testing.assert_array_equal(ARM.effort, np.tile(ONE.effort, 2))
    kinematics, alone = ARM.kinematics(), ONE.kinematics()
    R = load_arm("panda").kinematics()
    R_AB = rotation_matrix(BASE["rpy"])
    for q in postures()[0]:
        first, second = (pose_of(kinematics, q, name) for name in ("first", "second"))
        np.testing.assert_allclose(first.p_WE, alone.p_WE(q[:7]), atol=1e-14)
        there = BASE["translation"] + R_AB @ R.p_WE(q[7:])
        np.testing.assert_allclose(second.p_WE, there, atol=1e-14)
        np.testing.assert_allclose(second.R, R_AB @ R.R_WE(q[7:]), atol=1e-14)


def rotation_matrix(rpy):
    x, y, z = (rotation_by(angle * axis) for angle, axis in zip(rpy, np.eye(3), strict=True))
    return z @ y @ x


def test_the_centre_is_half_way_between_both_tools_in_place_and_turn():
    """It has the first one's orientation at home, and turns by half of what one tool turns."""
    kinematics = ARM.kinematics()
    home = [pose_of(kinematics, ARM.home, name) for name in FRAMES]
    np.testing.assert_allclose(home[3].R, home[0].R, atol=1e-14)
    for q in postures()[0]:
        first, second, relative, centre = (pose_of(kinematics, q, name) for name in FRAMES)
        np.testing.assert_allclose(centre.p_WE, 0.5 * (first.p_WE + second.p_WE), atol=1e-15)
        turned = second.R @ kinematics.tools.R_21
        whole, half = rotation_error(first.R, turned), rotation_error(first.R, centre.R)
        np.testing.assert_allclose(half, 0.5 * whole, atol=1e-13)
        np.testing.assert_allclose(relative.R, first.R.T @ second.R, atol=1e-15)
        way = first.R.T @ (second.p_WE - first.p_WE)
        np.testing.assert_allclose(relative.p_WE, way, atol=1e-15)


@pytest.mark.parametrize("frame", FRAMES)
def test_rows_and_accelerations_of_each_frame_are_those_of_difference_quotients(frame):
    """Central ones; 1e-6 and 1e-5 rad leave some 1e-9 of rounding and truncation."""
    kinematics = load_arm("panda", pair={**PAIR, "task_frame": frame}).kinematics()
    for q, v in zip(*postures(), strict=True):
        steps = 1e-6 * np.eye(14)
        J = [(kinematics.p_WE(q + e) - kinematics.p_WE(q - e)) / 2e-6 for e in steps]
        np.testing.assert_allclose(kinematics.J(q), np.transpose(J), atol=1e-8)
        ends = [[kinematics.R_WE(q + sign * e) for sign in (-1, 1)] for e in steps]
        J_omega = [rotation_error(*each) / 2e-6 for each in ends]
        np.testing.assert_allclose(kinematics.J_omega(q), np.transpose(J_omega), atol=1e-8)
        after, before = (kinematics.J(q + h * v) for h in (1e-5, -1e-5))
        bias = (after - before) @ v / 2e-5
        np.testing.assert_allclose(kinematics.Jdot_v(q, v), bias, atol=1e-7)
        after, before = (kinematics.J_omega(q + h * v) for h in (1e-5, -1e-5))
        alpha = pose_of(kinematics, q).rates(v).alpha
        np.testing.assert_allclose(alpha, (after - before) @ v / 2e-5, atol=1e-7)


@pytest.mark.parametrize("frame", FRAMES)
def test_kinematics_of_many_are_those_of_one(frame):
    arm = load_arm("panda", pair={**PAIR, "task_frame": frame})
    kinematics, (q, v) = arm.kinematics(), postures()
    moved = screws_of(arm).at(q)
    for k in range(len(q)):
        for name in ("p_WE", "R_WE", "J", "J_omega"):
            value = getattr(kinematics, name)(q[k])
            np.testing.assert_allclose(getattr(moved, name)[k], value, atol=1e-13)
        bias = kinematics.Jdot_v(q[k], v[k])
        np.testing.assert_allclose(moved.Jdot_v(v)[k], bias, atol=1e-12)


def test_objectives_of_frames_have_rows_and_accelerations_of_difference_quotients():
    kinematics = ARM.kinematics()
    task = Task.of(SECTION).at(kinematics.R_WE(ARM.home), kinematics, ARM.home)
    for q, v in zip(*postures(), strict=True):
        steps = 1e-6 * np.eye(14)
        quotients = [
            (task.coordinates(kinematics, q + e) - task.coordinates(kinematics, q - e)) / 2e-6
            for e in steps
        ]
        np.testing.assert_allclose(task.J(kinematics, q), np.transpose(quotients), atol=1e-7)
        after, before = (task.J(kinematics, q + h * v) for h in (1e-5, -1e-5))
        bias = task.bias(kinematics, q, v)
        np.testing.assert_allclose(bias, (after - before) @ v / 2e-5, atol=1e-6)


def test_frames_other_than_E_are_held_where_they_start():
    """At the start all coordinates are what they should be, and what is held stays so."""
    arm = {"model": "panda", "pair": PAIR}
    experiment = make_experiment(
        {"arm": arm, "task": SECTION[:4], "path": {"kind": "circle", "size": 0.05, "period": 4}}
        | {"law": {"kind": "adaptive"}, "period": 1e-3, "duration": 1.0}
    )
    task, kinematics = experiment.law_task, experiment.arm.kinematics()
    start = task.coordinates(kinematics, experiment.start)
    np.testing.assert_allclose(task.desired(experiment.desired, 0.0)[0], start, atol=1e-13)
    p, v, a = task.desired(experiment.desired, 0.7)
    np.testing.assert_allclose(p[6:], start[6:], atol=1e-13)
    assert not v[6:].any()
    assert not a[6:].any()


TWO_ARMS = Path(__file__).parents[1] / "data" / "two_arms.urdf"


def test_a_model_of_a_users_own_may_have_both_tools():
    arm = load_arm(
        TWO_ARMS, frame="left_tool", pair={"frame": "right_tool", "tool": {"length": 0.1}}
    )
    assert arm.joints == ("left_a", "left_b", "right_a", "right_b")
    assert arm.begins == (0, 2)
    first, second = (pose_of(arm.kinematics(), np.zeros(4), name) for name in FRAMES[:2])
    np.testing.assert_allclose(first.p_WE, [0.5, 0.2, 0.0], atol=1e-15)
    np.testing.assert_allclose(second.p_WE, [0.5, -0.2, 0.1], atol=1e-15)


def test_links_of_both_arms_are_kept_apart():
    """Bases 0.9 m apart, facing each other: bodies of one and of the other are pairs."""
    clearance, _ = arm_clearance(ARM, (), ARM.home)
    across = [pair for pair in clearance.names if len({n.startswith("second_") for n in pair}) == 2]
    assert ("panda_link7", "second_panda_link7") in across
    alone, _ = arm_clearance(ONE, (), ONE.home)
    own = [pair for pair in clearance.names if not any(n.startswith("second_") for n in pair)]
    assert own == list(alone.names)
    reach = ARM.home.copy()
    reach[[1, 3, 8, 10]] = 0.9, -1.2, 0.9, -1.2  # both lean towards each other
    gaps = dict(zip(clearance.names, clearance.gaps(reach), strict=True))
    assert min(gaps[pair] for pair in across) < 0.0 < clearance.gaps(ARM.home).min()


DOCUMENT = {"arm": {"model": "panda", "pair": PAIR}, "law": {"kind": "adaptive"}}
DOCUMENT |= {"path": {"kind": "circle", "size": 0.02, "period": 4}, "period": 1e-3, "duration": 1}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"arm": "panda", "task": SECTION[:4]}, "task: of: is of an arm with two tools"),
        ({"arm": {"model": "panda", "pair": {}}}, "arm.pair.arm: must be given"),
        (
            {"arm": {"model": "panda", "pair": {**PAIR, "arm": "pand"}}},
            "arm.pair.arm: no arm 'pand'",
        ),
        ({"arm": {"model": "panda", "pair": {"frame": "tipp"}}}, "arm.pair.frame: no frame 'tipp'"),
        (
            {"arm": {"model": "panda", "pair": {**PAIR, "task_frame": "third"}}},
            "arm.pair.task_frame: must be 'first'",
        ),
        (
            {"arm": {"model": "panda", "pair": {**PAIR, "tool": {"length": 0.2}}}},
            "arm.pair.tool: is one of the same model",
        ),
        (
            {"arm": {"model": "panda", "pair": {**PAIR, "arm": {"model": "panda", "pair": PAIR}}}},
            "arm.pair.arm.pair: must be left out",
        ),
        (
            {"arm": {"model": "panda", "pair": {**PAIR, "arm": {"model": "panda", "base": {}}}}},
            "arm.pair.arm.base: must be left out; arms of a pair stand still",
        ),
        (
            {"arm": {"model": "panda", "base": {"model": "cart"}, "pair": PAIR}},
            "arm.pair: must be left out with a mobile base, which carries one arm",
        ),
        ({"arm": {"model": "panda", "pair": {"arm": "panda"}}}, "arm.pair.base: must be given"),
        ({"obstacles": [], "second": {}}, "second: must be left out with arm.pair"),
        ({"task": [{"kind": "position", "of": "third"}]}, "task[0].of: must be 'first'"),
        (
            {"environment": {"kind": "elastic_surface", "stiffness": 1e3}, "force": {"value": 5}},
            "environment: must be left out with arm.pair",
        ),
    ],
)
def test_what_does_not_go_is_refused(changes, message):
    with pytest.raises(InvalidInputError, match="^" + message.replace("[", r"\[")):
        make_experiment({**DOCUMENT, **changes})


def test_a_replaced_pair_keeps_the_arm():
    other = ARM.replace(pair={**PAIR, "task_frame": "relative"})
    np.testing.assert_array_equal(other.home, ARM.home)
    np.testing.assert_array_equal(other.limits.velocity, ARM.limits.velocity)
    assert ARM.replace(pair=None).n == 7

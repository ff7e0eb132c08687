"""Grippers with a model of their own, which are added to an arm's model."""

from pathlib import Path

import numpy as np
import pytest

from drake_rnn import (
    Goal,
    Guard,
    InvalidInputError,
    JointStream,
    arm_clearance,
    load_arm,
    load_experiment,
    make_experiment,
    make_obstacles,
    plan_motion,
    simulate,
)
from drake_rnn.models import MODELS
from drake_rnn.robot.clearance.arm_capsules import capsules_of, outside_of, union_volume
from drake_rnn.robot.clearance.arm_clearance import fit_arm
from drake_rnn.robot.clearance.arm_shapes import Enclosing, arm_surfaces

HAND = {"model": "franka_hand", "frame": "hand_tcp", "lock": {"finger_joint1": 0.04}}
UR5 = MODELS / "ur5" / "ur5.urdf"
# A hand of 0.7 kg with two fingers that slide, one after the other, and a point between them.
PARTS = """
<link name="hand">
  <inertial><origin xyz="0 0.01 0.03"/><mass value="0.6"/>
    <inertia ixx="1e-3" iyy="2e-3" izz="1.5e-3" ixy="0" ixz="0" iyz="0"/></inertial>
  <visual><origin xyz="0 0 0.03"/><geometry><box size="0.2 0.05 0.06"/></geometry></visual>
</link>
<link name="left"><inertial><origin xyz="0 0 0.02"/><mass value="0.05"/>
    <inertia ixx="1e-5" iyy="1e-5" izz="1e-5" ixy="0" ixz="0" iyz="0"/></inertial>
  <visual><origin xyz="0 0 0.03"/><geometry><box size="0.01 0.02 0.06"/></geometry></visual>
</link>
<link name="right"><inertial><origin xyz="0 0 0.02"/><mass value="0.05"/>
    <inertia ixx="1e-5" iyy="1e-5" izz="1e-5" ixy="0" ixz="0" iyz="0"/></inertial>
  <visual><origin xyz="0 0 0.03"/><geometry><box size="0.01 0.02 0.06"/></geometry></visual>
</link>
<link name="between"/>
<joint name="opens" type="prismatic"><parent link="hand"/><child link="left"/>
  <origin xyz="0 0 0.06"/><axis xyz="1 0 0"/>
  <limit lower="0" upper="0.05" velocity="0.1" effort="20"/></joint>
<joint name="follows" type="prismatic"><parent link="hand"/><child link="right"/>
  <origin xyz="0 0 0.06" rpy="0 0 3.14"/><axis xyz="1 0 0"/>
  <limit lower="0" upper="0.05" velocity="0.1" effort="20"/><mimic joint="opens"/></joint>
<joint name="at_between" type="fixed"><parent link="hand"/><child link="between"/>
  <origin xyz="0 0 0.1"/></joint>
"""
NAMES = ("hand", "left", "right", "between", "opens", "follows", "at_between")
DOCUMENT = {
    "path": {"kind": "circle", "size": 0.03, "period": 4},
    "law": {"kind": "adaptive"},
    "limits": {"velocity": 0.5, "acceleration": 1.0},
    "obstacles": [{"kind": "ball", "center": [2, 0, 0], "radius": 0.1}],
    "period": 2e-3,
    "duration": 0.1,
}
POSTURES = np.random.default_rng(0).uniform(-2.0, 2.0, (5, 6))


@pytest.fixture(scope="module")
def hand(tmp_path_factory):
    """The file of a gripper."""
    file = tmp_path_factory.mktemp("gripper") / "hand.urdf"
    file.write_text(f'<robot name="hand">{PARTS}</robot>')
    return str(file)


def written(folder: Path) -> str:
    """A UR5 with the same gripper as a modeller would write it, 2 cm beyond the flange."""
    parts = PARTS
    for name in NAMES:
        parts = parts.replace(f'"{name}"', f'"gripper_{name}"')
    weld = (
        '<joint name="gripper_base" type="fixed"><parent link="tool0"/>'
        '<child link="gripper_hand"/><origin xyz="0 0 0.02" rpy="0 0 0.5"/></joint>'
    )
    file = folder / "written.urdf"
    file.write_text(UR5.read_text().replace("</robot>", f"{weld}{parts}</robot>"))
    return str(file)


def added(hand, **changes):
    """The settings of the gripper of `written`."""
    return {"model": hand, "translation": [0, 0, 0.02], "rpy": [0, 0, 0.5], **changes}


def test_a_gripper_moves_and_weighs_as_if_it_were_written_into_the_model(hand, tmp_path):
    lock = {"opens": 0.03}
    arm = load_arm(UR5, frame="tool0", gripper=added(hand, frame="between", lock=lock))
    joints = list(load_arm("ur5").joints)
    same = load_arm(
        written(tmp_path), frame="gripper_between", joints=joints, lock={"gripper_opens": 0.03}
    )
    assert arm.joints == same.joints
    assert arm.frame == "gripper_between"
    one, other = arm.kinematics(), same.kinematics()
    for q in POSTURES:
        np.testing.assert_array_equal(one.p_WE(q), other.p_WE(q))
        np.testing.assert_array_equal(one.R_WE(q), other.R_WE(q))
        np.testing.assert_array_equal(one.M(q), other.M(q))
        np.testing.assert_array_equal(one.gravity(q), other.gravity(q))
    plants = (arm.plant(), load_arm(UR5, frame="tool0").plant())
    masses = [plant.CalcTotalMass(plant.CreateDefaultContext()) for plant in plants]
    assert masses[0] == pytest.approx(0.7 + masses[1], abs=1e-12)


def test_fingers_stand_where_they_are_locked_and_those_that_mimic_follow(hand):
    arm = load_arm("ur5", gripper=added(hand, lock={"opens": 0.03}))
    plant = arm.plant()
    context = plant.CreateDefaultContext()
    base = plant.GetFrameByName("gripper_hand")
    for name, x in (("left", 0.03), ("right", -0.03)):
        X = plant.GetFrameByName(f"gripper_{name}").CalcPose(context, base)
        assert X.translation()[0] == pytest.approx(x, abs=1e-6)


def test_a_gripper_takes_the_place_of_a_tool_and_leaves_its_place_to_another(hand):
    arm = load_arm("panda")
    held = arm.replace(gripper={"model": hand, "frame": "between"})
    assert held.tool is None
    assert held.frame == "gripper_between"
    assert held.description.gripper.mount == "panda_link8"
    again = held.replace(gripper=None)
    assert again.frame == "panda_link8"
    for q in np.zeros(7), arm.home:
        np.testing.assert_array_equal(
            again.kinematics().p_WE(q), load_arm("panda", tool=None).kinematics().p_WE(q)
        )
    with_pen = load_arm("panda", gripper={"model": hand, "frame": "between"}, tool={"length": 0.2})
    assert repr(with_pen).endswith("task frame tip, with hand.urdf, with a ball of 12 mm>")
    assert with_pen.tool.mount == "gripper_between"


def test_a_guard_keeps_a_gripper_clear_of_what_the_bare_arm_leads_it_into(hand):
    """A ball at the goal is 2 cm clear of the bare arm, and 6 cm within the hand's capsule."""
    arm = load_arm("ur5", gripper={"model": hand})
    bare = load_arm("ur5", tool=None)
    goal = arm.home + np.array([0.4, 0, 0, 0, 0, 0])
    kinematics = bare.kinematics()
    center = kinematics.p_WE(goal) + kinematics.R_WE(goal) @ [0.09, 0, 0.03]
    ball = make_obstacles([{"kind": "ball", "center": center.tolist(), "radius": 0.02}])
    whole, _ = arm_clearance(arm, ball, arm.home)
    least, error = {}, {}
    for name, each in (("with", arm), ("without", bare)):
        clearance, _ = arm_clearance(each, ball, each.home)
        limits = each.limits.replace(velocity=1.0, acceleration=4.0)
        guard = Guard(JointStream(limits=limits, home=arm.home, clearance=clearance), 0.01)
        motion = np.array([guard.command(goal) for _ in range(150)])
        least[name] = float(whole.gaps(motion).min())
        error[name] = float(np.abs(motion[-1] - goal).max())
    assert least["with"] >= 0.005
    assert error["without"] < 1e-3
    assert least["without"] < -0.05


@pytest.mark.long
def test_a_goal_that_coarse_capsules_of_a_hand_call_blocked_is_free_with_fine_ones():
    """A rod before the palm is 12 mm clear of the fine capsules, 6 mm within the coarse one."""
    least = {}
    for shapes in ("coarse", "fine"):
        arm = load_arm("panda", gripper=HAND, shapes=shapes)
        arm = arm.with_limits(arm.limits.replace(velocity=1.0, acceleration=4.0))
        goal = arm.home + np.array([0.9, 0, 0, 0, 0, 0, 0])
        kinematics = arm.kinematics()
        p, R = kinematics.p_WE(goal), kinematics.R_WE(goal)
        ends = [(p + R @ [x, 0.0, -0.057]).tolist() for x in (0.04, 0.06)]
        rod = make_obstacles([{"kind": "capsule", "ends": ends, "radius": 0.003}])
        clearance, _ = arm_clearance(arm, rod, arm.home)
        least[shapes] = clearance.gaps(goal).min()
        aim = (arm, Goal(q=goal), arm.home, 0.01, clearance)
        if shapes == "fine":
            np.testing.assert_allclose(plan_motion(*aim).position[-1], goal, atol=1e-9)
        else:
            with pytest.raises(InvalidInputError, match=r"goal: gripper_hand and .* overlap"):
                plan_motion(*aim)
    assert least["coarse"] < -0.006
    assert least["fine"] > 0.012


@pytest.mark.long
def test_capsules_that_are_fitted_to_a_gripper_contain_it(hand, tmp_path):
    """Every vertex and face; they are used with ``shapes: fine``, and take less space."""
    own = added(hand, lock={"opens": 0.03})
    text, fits = fit_arm(load_arm("panda", gripper=own), np.zeros(7), 3, "by a test")
    assert max(fit.outside for fit in fits) == 0.0
    assert {fit.body for fit in fits} == {"hand", "left", "right"}
    file = tmp_path / "hand.capsules.yaml"
    file.write_text(text)
    arm = load_arm("panda", gripper={**own, "capsules": str(file)}, shapes="fine")
    capsules, _ = capsules_of(arm)
    volume = {}
    for body, triangles in arm_surfaces(arm).items():
        every = [c for c in capsules if c.body == body]
        if body.startswith("gripper_"):
            enclosing = [Enclosing(np.array(c.ends), c.radius) for c in every]
            assert np.min([c.outside(triangles.reshape(-1, 3)) for c in every], axis=0).max() <= 0.0
            assert outside_of(triangles, enclosing) == 0.0
            volume[body] = union_volume(every)
    assert len(volume) == 3
    coarse, _ = capsules_of(arm.replace(shapes="coarse"))
    single = {c.body: c for c in coarse if c.body in volume}
    assert sum(volume.values()) < sum(union_volume([c]) for c in single.values())
    clearance, _ = arm_clearance(arm, [], arm.home)
    assert clearance.gaps(arm.home).min() > 0.0


def test_capsules_of_a_gripper_must_be_of_its_bodies(hand, tmp_path):
    file = tmp_path / "hand.capsules.yaml"
    file.write_text("capsules:\n- {body: rigth, ends: [[0, 0, 0], [0, 0, 0.1]], radius: 0.1}\n")
    arm = load_arm("panda", gripper={"model": hand, "capsules": str(file)})
    with pytest.raises(InvalidInputError, match=r"no body 'rigth' in hand.urdf; nearest: right"):
        arm_clearance(arm, [], arm.home)


def test_the_result_of_a_document_encloses_the_gripper(hand, tmp_path):
    result = simulate(make_experiment(DOCUMENT | {"arm": {"model": "ur5", "gripper": added(hand)}}))
    result.save(tmp_path)
    document = (tmp_path / "experiment.yaml").read_text()
    assert "inputs/arm.gripper.model/hand.urdf" in document
    again = simulate(load_experiment(tmp_path / "experiment.yaml"))
    for name in ("position", "velocity"):
        np.testing.assert_array_equal(again.series[name], result.series[name])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"model": "none.urdf"}, "arm.gripper.model: no file 'none.urdf'"),
        ({"mount": "flange"}, "arm.gripper.mount: no link 'flange' in ur5.urdf"),
        ({"frame": "tcp"}, "^arm.gripper.frame: no frame 'tcp' in hand.urdf; "),
        ({"lock": {"opened": 0.01}}, "arm.gripper.lock: no movable joint 'opened' in hand.urdf"),
        ({"lock": {"opens": 0.06}}, "^arm.gripper.lock.opens: may be 0 to 0.05, not 0.06"),
        # The other finger would stay where it is.
        (
            {"lock": {"follows": 0.01}},
            "^arm.gripper.lock.follows: 'follows' follows 'opens' .*is at 0 then, not 0.01; lock",
        ),
        ({"translation": [0, 0, np.nan]}, "arm.gripper.translation"),
        ({"translation": [0, 0, 100]}, "arm.gripper.translation: .*are these millimetres?"),
        ({"capsules": "none.yaml"}, "arm.gripper.capsules: no file 'none.yaml'"),
        ({"packages": {"robot": "nowhere"}}, "arm.gripper.packages.robot: no folder 'nowhere'"),
    ],
)
def test_a_gripper_that_cannot_be_added_is_refused_by_name(hand, changes, message):
    with pytest.raises(InvalidInputError, match="(?s)" + message):
        load_arm("ur5", gripper={"model": hand, **changes})


def test_a_gripper_must_be_one_urdf_with_one_base(tmp_path):
    two = tmp_path / "two.urdf"
    two.write_text('<robot name="two"><link name="a"/><link name="b"/></robot>')
    with pytest.raises(
        InvalidInputError, match=r"arm\.gripper: two.urdf must have one base, not 2"
    ):
        load_arm("ur5", gripper={"model": str(two)})

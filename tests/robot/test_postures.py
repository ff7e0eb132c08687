"""Random postures, and a posture to start from."""

import numpy as np
import pytest
from pydrake.multibody.tree import BodyIndex

from drake_rnn import load_arm, proposed_home, shipped_arms
from drake_rnn.models import MODELS
from drake_rnn.robot.postures import conditioning, random_postures

TURNTABLE = """<robot name="t"><link name="base"/><link name="a"/><link name="b"/>
  <joint name="spin" type="continuous"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/>
    <limit velocity="1" effort="9"/></joint>
  <joint name="tilt" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/>
    <origin xyz="0.4 0 0.3"/><limit lower="-9" upper="1" velocity="1" effort="9"/></joint>
</robot>"""


@pytest.mark.parametrize("name", shipped_arms())
def test_random_postures_lie_within_the_limits_and_repeat(name):
    arm = load_arm(name)
    drawn = random_postures(arm, 200)
    assert not arm.limits.violation(drawn).any()
    assert np.ptp(drawn, axis=0).max() <= 2 * np.pi
    np.testing.assert_array_equal(drawn, random_postures(arm, 200))
    assert (drawn != random_postures(arm, 200, seed=1)).all()


def test_a_joint_of_more_than_a_turn_is_drawn_from_the_middle_one(tmp_path):
    file = tmp_path / "t.urdf"
    file.write_text(TURNTABLE)
    drawn = random_postures(load_arm(file, frame="b"), 2000)
    np.testing.assert_allclose(drawn.min(axis=0), [-np.pi, -4 - np.pi], atol=0.02)
    np.testing.assert_allclose(drawn.max(axis=0), [np.pi, -4 + np.pi], atol=0.02)


@pytest.mark.parametrize("name", shipped_arms())
@pytest.mark.long
def test_the_proposed_home_is_away_from_limits_and_singularities(name):
    """Against a thousand random postures: better conditioned than three of four."""
    arm = load_arm(name)
    q, kinematics = proposed_home(arm), arm.kinematics()
    room = np.minimum(q - arm.limits.position_lower, arm.limits.position_upper - q)
    assert room.min() > 0.4
    rank = 3 if name == "planar6" else 6

    def condition(posture):
        return conditioning(kinematics, posture, 1.0)[rank - 1]

    others = [condition(other) for other in random_postures(arm, 1000)]
    assert condition(q) > np.quantile(others, 0.75)
    np.testing.assert_array_equal(q, proposed_home(arm))
    np.testing.assert_array_equal(q, np.round(q, 2))


@pytest.mark.parametrize(
    "name", ["panda", *(pytest.param(name, marks=pytest.mark.long) for name in ("iiwa14", "ur5"))]
)
def test_there_the_tool_points_down_ahead_of_the_base_and_nothing_is_below_it(name):
    arm = load_arm(name, frame="tip")
    q, kinematics = proposed_home(arm), arm.kinematics()
    p_WE = kinematics.p_WE(q)
    assert kinematics.R_WE(q)[2, 2] < -0.95
    assert p_WE[0] > 0.3
    assert abs(p_WE[1]) < 0.3 * p_WE[0]
    assert p_WE[2] > 0.1
    bodies = kinematics.skeleton(q)
    out = np.linalg.norm(bodies[:, :2], axis=1) > 0.4
    assert bodies[out, 2].min() > p_WE[2] - 0.1


def test_a_mounting_upside_down_turns_the_tool_up():
    arm = load_arm(str(MODELS / "ur5" / "ur5.urdf"), frame="tool0", gravity=[0, 0, 9.81])
    kinematics = arm.kinematics()
    assert kinematics.R_WE(proposed_home(arm))[2, 2] > 0.95


def test_an_arm_that_hangs_below_its_base_gets_a_posture_of_some_merit(tmp_path):
    """No posture is ahead of the base's plane; what is left is to be far from singular."""
    hung = (MODELS / "ur5" / "ur5.urdf").read_text()
    mount = '<link name="rack"/><joint name="hang" type="fixed"><parent link="rack"/>'
    root = load_arm("ur5").plant().get_body(BodyIndex(1)).name()
    mount += f'<child link="{root}"/><origin xyz="0 0 -1.6"/></joint></robot>'
    file = tmp_path / "hung.urdf"
    file.write_text(hung.replace("</robot>", mount))
    arm = load_arm(str(file), frame="tool0")
    found = proposed_home(arm)
    first = random_postures(arm, 2000)[0]

    def worst(q):
        return conditioning(arm.kinematics(), q, 2.4)[-1]

    assert worst(found) > 2.0 * worst(first)

"""The tool of an arm, found in its model."""

import numpy as np
import pytest

from drake_rnn import InvalidInputError, load_arm, shipped_arms
from drake_rnn.robot.tool import beyond_tool, bodies_at_tip, find_tool, standoff
from row_helpers import each
from scene_helpers import in_scene

RADIUS = 0.012
UP = np.array([0.0, 0.0, 1.0])
NORMALS = [UP, -UP, np.array([0.6, 0.0, 0.8]), np.array([-0.48, 0.6, 0.64])]
# A ball at the end of a rod; what ``shape`` is.
MODEL = """<robot name="one"><link name="base"/>
  <link name="rod"><inertial><mass value="2"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>{collision}</link>
  <link name="end"><inertial><mass value="0.5"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="turn" type="revolute"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" velocity="1" effort="100"/></joint>
  <joint name="last" type="{last}"><parent link="rod"/><child link="end"/>
    <origin xyz="0 0 0.3"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" velocity="1" effort="100"/></joint></robot>"""
BALL = """<collision><origin xyz="0 0 0.2"/><geometry><sphere radius="0.05"/></geometry>
  </collision>"""
BOX = """<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>"""


def found(arm, check):
    def look(plant, _):
        return check(find_tool(plant, plant.GetFrameByName(arm.frame)))

    return in_scene(arm, look)


def with_tip(name):
    arm = load_arm(name)
    return arm.replace(frame=arm.tip)


def made(tmp_path, frame="end", collision=BALL, last="fixed"):
    file = tmp_path / "one.urdf"
    file.write_text(MODEL.format(collision=collision, last=last))
    return load_arm(file, frame=frame)


@pytest.mark.parametrize("name", shipped_arms())
def test_every_shipped_arm_holds_its_tool_by_a_weld(name):
    def check(tool):
        assert len(tool.geometries) == 1
        assert tool.joint.child_body() == tool.body
        assert tool.joint.num_positions() == 0
        return tool.mass

    # Of the planar arm it is a point.
    mass = found(with_tip(name), check)
    assert mass > 0.0 or name == "planar6"


@pytest.mark.long
@each("name", shipped_arms())
@each("normal", NORMALS)
def test_from_the_middle_of_the_ball_a_surface_is_its_radius_away(name, normal):
    """Whichever way it faces, in whatever posture."""
    arm = with_tip(name)
    for q in (arm.home, arm.home + 0.1):
        assert standoff(arm, q, normal) == pytest.approx(RADIUS, abs=1e-12)


@pytest.mark.parametrize("normal", NORMALS)
def test_from_elsewhere_on_the_tool_it_is_farther_by_the_way_to_the_ball(tmp_path, normal):
    """The arm is turned by 0.7 rad about y; E is 0.1 m past the ball's middle."""
    way = 0.1 * np.array([np.sin(0.7), 0.0, np.cos(0.7)])
    reach = standoff(made(tmp_path), np.array([0.7]), normal)
    assert reach == pytest.approx(0.05 + normal.dot(way), abs=1e-12)


def test_what_a_joint_holds_is_all_that_hangs_on_it(tmp_path):
    assert found(made(tmp_path), lambda tool: (tool.body.name(), tool.mass)) == ("rod", 2.5)
    assert found(made(tmp_path), lambda tool: tool.joint.name()) == "turn"


@pytest.mark.parametrize("name", ["iiwa14", "panda", "ur5"])
def test_a_flange_without_the_tool_is_refused(name):
    """The ball is farther out: E would not be on it."""
    arm = load_arm(name)
    message = rf"arm\.frame: nothing that moves with '{arm.frame}' has collision geometry"
    with pytest.raises(InvalidInputError, match=message):
        standoff(arm, arm.home, UP)


def test_collision_geometry_beyond_another_joint_is_no_tool(tmp_path):
    with pytest.raises(InvalidInputError, match=r"arm\.frame: nothing that moves with 'end'"):
        standoff(made(tmp_path, last="revolute"), np.zeros(2), UP)


def test_a_tool_that_is_no_ball_needs_a_standoff(tmp_path):
    with pytest.raises(InvalidInputError, match=r"environment\.standoff: must be given .*'rod'"):
        standoff(made(tmp_path, collision=BOX), np.zeros(1), UP)


PAD = """<visual><origin xyz="0.05 0 {z}"/><geometry><box size="0.02 0.02 0.1"/></geometry>
  </visual>"""


@pytest.mark.parametrize("z", [0.19, 0.21])
def test_what_is_drawn_beyond_the_ball_is_found(tmp_path, z):
    """The ball ends 0.25 m from the joint, the box at z + 0.05 m; both hang down."""
    file = tmp_path / "two.urdf"
    text = MODEL.format(collision=BALL, last="fixed")
    file.write_text(text.replace('<link name="end">', '<link name="end">' + PAD.format(z=z - 0.3)))
    found = beyond_tool(load_arm(file, frame="end"), np.array([np.pi]), UP)
    expected = {"end": pytest.approx(z + 0.05 - 0.25, abs=1e-9)} if z > 0.2 else {}
    assert found == expected


@pytest.mark.parametrize("name", ["iiwa14", "panda", "ur5"])
def test_of_a_shipped_arm_nothing_is_beyond_the_tool(name):
    arm = with_tip(name)
    assert beyond_tool(arm, arm.home, arm.kinematics().R_WE(arm.home)[:, 2] * -1.0) == {}


@pytest.mark.parametrize("name", shipped_arms())
def test_what_touches_is_the_tool_whatever_frame_of_it_is_named(name):
    arm = with_tip(name)
    assert bodies_at_tip(arm) == {found(arm, lambda tool: tool.body.name())}


def test_of_an_arm_without_a_tool_all_from_its_frame_to_the_last_joint_may_touch():
    assert bodies_at_tip(load_arm("iiwa14", tool=None)) == {"iiwa_link_7", "iiwa_link_ee"}

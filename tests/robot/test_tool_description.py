"""Tools that are added to an arm's model."""

import numpy as np
import pytest
from pydrake.geometry import Role

from drake_rnn import InvalidInputError, load_arm, make_experiment, simulate
from drake_rnn.models import MODELS
from drake_rnn.robot.arm_description import ToolDescription
from drake_rnn.robot.tool import find_tool, standoff
from scene_helpers import in_scene

UR5 = str(MODELS / "ur5" / "ur5.urdf")
IIWA = load_arm("iiwa14", frame="tip")
UP = np.array([0.0, 0.0, 1.0])
POSTURES = np.random.default_rng(0).uniform(-2.0, 2.0, (5, 6))
# The tool of the shipped arms as a modeller would write it.
WRITTEN = """
<joint name="tool_joint" type="fixed"><parent link="iiwa_link_ee"/><child link="tool"/></joint>
<link name="tool">
  <inertial>
    <origin xyz="0 0 0.05"/><mass value="0.1"/>
    <inertia ixx="8.333333333333333e-05" iyy="8.333333333333333e-05" izz="1.44e-05"
             ixy="0" ixz="0" iyz="0"/>
  </inertial>
  <collision name="ball">
    <origin xyz="0 0 0.1"/><geometry><sphere radius="0.012"/></geometry>
    <drake:proximity_properties>
      <drake:compliant_hydroelastic/>
      <drake:hydroelastic_modulus value="1e6"/>
      <drake:mesh_resolution_hint value="0.005"/>
      <drake:hunt_crossley_dissipation value="1.5"/>
      <drake:mu_static value="0.3"/><drake:mu_dynamic value="0.3"/>
    </drake:proximity_properties>
  </collision>
</link>
<joint name="tip_joint" type="fixed"><parent link="tool"/><child link="tip"/>
  <origin xyz="0 0 0.1"/></joint>
<link name="tip"/>
</robot>"""


def ur5(**changes):
    return load_arm(UR5, frame="tool0", **changes)


def pressing(arm, **changes):
    """The experiment contact_circle on another arm, a fiftieth as long."""
    document = {
        "arm": arm,
        "path": {"kind": "circle", "size": 0.03, "period": 20, "timing": "sin2", "laps": 1},
        "law": {"kind": "motion_force", "stiffness": 8000},
        "level": "dynamic",
        "environment": {"kind": "plate"},
        "force": {"value": 5},
        "limits": {"velocity": 0.5, "acceleration": None},
        "period": 1e-3,
        "duration": 0.4,
    }
    return simulate(make_experiment({**document, **changes}))


# Where it is.


def test_the_task_frame_is_the_middle_of_the_ball():
    """Rounding alone."""
    flange, tip = ur5().kinematics(), ur5(tool={"length": 0.17}).kinematics()
    for q in POSTURES:
        expected = flange.p_WE(q) + 0.17 * flange.R_WE(q)[:, 2]
        np.testing.assert_allclose(tip.p_WE(q), expected, rtol=0, atol=1e-14)
        np.testing.assert_allclose(tip.R_WE(q), flange.R_WE(q), rtol=0, atol=1e-14)


@pytest.mark.parametrize("axis", [[1, 0, 0], [0, -3, 0], [0, 0, 2], [0, 0, -1], [1, 2, -3]])
def test_the_shaft_points_along_its_axis_from_its_offset(axis):
    """Whatever the length of the vector; 1e-14: rounding."""
    offset, along = np.array([0.01, 0.02, 0.03]), np.array(axis) / np.linalg.norm(axis)
    flange = ur5().kinematics()
    tip = ur5(tool={"axis": axis, "offset": offset.tolist()}).kinematics()
    for q in POSTURES:
        R = flange.R_WE(q)
        expected = flange.p_WE(q) + R @ (offset + 0.1 * along)
        np.testing.assert_allclose(tip.p_WE(q), expected, rtol=0, atol=1e-14)
        np.testing.assert_allclose(tip.R_WE(q)[:, 2], R @ along, rtol=0, atol=1e-14)


def test_roll_pitch_and_yaw_say_the_same_as_an_axis_and_more():
    by_axis, by_angles = ur5(tool={"axis": [1, 0, 0]}), ur5(tool={"rpy": [0.0, np.pi / 2, 0.0]})
    rolled = ur5(tool={"rpy": [np.pi, np.pi / 2, 0.0]})
    for q in POSTURES:
        R = by_axis.kinematics().R_WE(q)
        np.testing.assert_allclose(by_angles.kinematics().R_WE(q), R, rtol=0, atol=1e-14)
        turned = R.T @ rolled.kinematics().R_WE(q)
        np.testing.assert_allclose(np.trace(turned), -1.0, atol=1e-14)


@pytest.mark.parametrize("ball", [0.005, 0.03])
def test_a_surface_is_the_balls_radius_from_the_task_frame(ball):
    assert standoff(ur5(tool={"ball": ball}), POSTURES[0], UP) == pytest.approx(ball, abs=1e-12)


# What it weighs.


def test_the_wrist_carries_the_tools_weight():
    """Against the principle of virtual work; 1e-12 Nm: rounding."""
    bare, tool = ur5(), {"mass": 0.7, "centre_of_mass": [0.01, 0.0, 0.06]}
    loaded = ur5(tool=tool)
    flange, weight = bare.kinematics(), np.array([0.0, 0.0, -0.7 * 9.81])
    for q in POSTURES:
        R = flange.R_WE(q)
        arm_to_mass = R @ np.array([0.01, 0.0, 0.06])
        J = flange.J(q) - np.cross(arm_to_mass, flange.J_omega(q), axisb=0, axisc=0)
        more = loaded.kinematics().gravity(q) - flange.gravity(q)
        np.testing.assert_allclose(more, J.T @ weight, rtol=0, atol=1e-12)


def test_without_numbers_the_tool_has_the_inertia_of_a_solid_cylinder():
    tool = ToolDescription(ball=0.02, length=0.3, mass=0.6)
    central = tool.spatial_inertia.Shift([0.0, 0.0, 0.15]).CalcRotationalInertia()
    across = 0.6 * (3 * 0.02**2 + 0.3**2) / 12
    along = 0.6 * 0.02**2 / 2
    np.testing.assert_allclose(central.get_moments(), [across, across, along], rtol=1e-12)


def test_a_scale_of_the_masses_is_one_of_the_tools():
    light, heavy = ur5(tool={"mass": 0.5}), ur5(tool={"mass": 0.5}, mass_scale=2.0)
    q = POSTURES[0]
    np.testing.assert_allclose(
        heavy.kinematics().gravity(q), 2 * light.kinematics().gravity(q), rtol=1e-12
    )


# What it touches and how it looks.


def test_the_ball_alone_collides_and_is_held_by_a_weld():
    def look(plant, inspector):
        tool = find_tool(plant, plant.GetFrameByName("tip"))
        (ball,) = inspector.GetAllGeometryIds(Role.kProximity)
        assert tool.geometries == (ball,)
        assert tool.joint.num_positions() == 0
        properties = inspector.GetProximityProperties(ball)
        shape = inspector.GetShape(ball)
        return shape.radius(), tool.mass, properties.GetProperty("hydroelastic", "resolution_hint")

    seen = in_scene(ur5(tool={"ball": 0.024, "mass": 0.3}), look)
    assert seen == pytest.approx((0.024, 0.3, 0.01), rel=1e-12)


@pytest.mark.parametrize(
    ("tool", "drawn"),
    [
        ({}, {"plate", "stem", "ball"}),
        ({"shaft": 0.0}, {"ball"}),
        # There is no room for a stem.
        ({"length": 0.02, "ball": 0.018}, {"plate", "ball"}),
    ],
)
def test_shaft_and_ball_are_drawn(tool, drawn):
    def look(plant, inspector):
        frame = plant.GetBodyFrameIdOrThrow(plant.GetBodyByName("tool").index())
        shapes = inspector.GetGeometries(frame, Role.kIllustration)
        return {inspector.GetName(shape).split("::")[-1] for shape in shapes}

    assert in_scene(ur5(tool=tool), look) == drawn


@pytest.mark.long
def test_a_tool_touches_as_one_that_is_written_into_the_model(tmp_path):
    """To the last bit: it is the same body at the same place in Drake's order."""
    text, home = (MODELS / "iiwa14" / "iiwa14.urdf").read_text(), IIWA.home.tolist()
    written, bare = tmp_path / "written.urdf", tmp_path / "bare.urdf"
    written.write_text(text.replace("</robot>", WRITTEN))
    bare.write_text(text)
    tool = {"ball": 0.012, "length": 0.1, "mass": 0.1, "inertia": IIWA.tool.inertia.tolist()}
    one = pressing({"model": str(written), "frame": "tip", "home": home})
    other = pressing({"model": str(bare), "frame": "iiwa_link_ee", "home": home, "tool": tool})
    assert one.metrics["normal_force_peak_N"] > 3.0
    for name in ("normal_force", "normal_force_measured", "position"):
        np.testing.assert_array_equal(other.series[name], one.series[name], err_msg=name)


@pytest.mark.long
def test_a_gripper_beside_the_tool_passes_through_the_surface_and_is_told(tmp_path):
    """Only the tool makes contact, whatever collision geometry a model has; 1e-9 N: rounding."""
    text, home = (MODELS / "iiwa14" / "iiwa14.urdf").read_text(), IIWA.home.tolist()
    box = '<origin xyz="0.05 0 0.1"/><geometry><box size="0.02 0.02 0.2"/></geometry>'
    finger = (
        '<joint name="hold" type="fixed"><parent link="iiwa_link_ee"/>'
        '<child link="finger"/></joint>'
        f'<link name="finger"><visual>{box}</visual><collision>{box}</collision></link></robot>'
    )
    bare, gripper = tmp_path / "bare.urdf", tmp_path / "gripper.urdf"
    bare.write_text(text)
    gripper.write_text(text.replace("</robot>", finger))
    arm = {"frame": "iiwa_link_ee", "home": home, "tool": {}}
    one, other = pressing({"model": str(bare), **arm}), pressing({"model": str(gripper), **arm})
    np.testing.assert_allclose(
        other.series["normal_force"], one.series["normal_force"], rtol=0, atol=1e-9
    )
    told = "arm.tool: finger reaches up to 0.088 m farther towards the surface than the tool; "
    assert any(text.startswith(told) for text in other.warnings)
    assert not any(text.startswith("arm.tool: ") for text in one.warnings)


@pytest.mark.long
def test_another_tool_presses_as_hard():
    """5 N within 0.1 N, with a ball of more than twice the size, mounted aside."""
    tool = {"ball": 0.03, "length": 0.06, "mass": 0.4, "offset": [0.02, 0.0, 0.01], "friction": 0.1}
    result = pressing({"model": "iiwa14", "tool": tool}, duration=2.0, window=[1.5, 2.0])
    assert result.metrics["force_error_max_N"] < 0.1
    assert result.metrics["contact_lost_fraction"] == 0.0


def test_at_the_kinematic_level_the_tool_presses_on_a_spring():
    """A foreign model; 5 N within 0.01 N."""
    arm = {"model": UR5, "frame": "tool0", "tool": {}, "home": [0.0, -1.2, 1.6, -2.0, -1.57, 0.0]}
    spring = {"kind": "elastic_surface", "stiffness": 8000}
    result = pressing(arm, level="kinematic", environment=spring, duration=2.0, window=[1.5, 2.0])
    assert result.metrics["force_error_max_N"] < 0.01


# Changes of an arm with a tool.


@pytest.mark.parametrize(
    ("changes", "frame", "mount"),
    [
        ({}, "panda_link8", "panda_link8"),
        ({"frame": "tip"}, "tip", "panda_link8"),
        ({"tool": {"ball": 0.02}}, "tip", "panda_link8"),
        ({"frame": "tip", "tool": {"ball": 0.02}}, "tip", "panda_link8"),
        ({"frame": "panda_link7", "tool": {}}, "tip", "panda_link7"),
        ({"tool": {"mount": "panda_link7"}}, "panda_link8", "panda_link7"),
        ({"frame": "tip", "tool": {"mount": "panda_link7"}}, "tip", "panda_link7"),
        ({"tool": None}, "panda_link8", None),
    ],
)
def test_a_tool_replaces_that_of_a_shipped_arm(changes, frame, mount):
    arm = load_arm("panda", **changes)
    assert arm.frame == frame
    assert (None if arm.tool is None else arm.tool.mount) == mount
    assert arm.tip == (None if arm.tool is None else "tip")
    assert arm.limits.jerk is not None
    np.testing.assert_array_equal(arm.home, load_arm("panda").home)


def test_the_task_frame_goes_with_the_tool_and_back_with_it():
    arm = ur5(tool={"ball": 0.02}, home=[0.0] * 6)
    assert (arm.frame, arm.tip) == ("tip", "tip")
    assert arm.replace(tool=None).frame == "tool0"
    assert arm.replace(tool={"ball": 0.01}).tool.ball == 0.01
    at_flange = arm.replace(frame="tool0")
    assert (at_flange.frame, at_flange.tool.ball) == ("tool0", 0.02)
    locked = arm.replace(lock={"elbow_joint": 1.0})
    assert (locked.n, locked.frame, locked.tool.ball) == (5, "tip", 0.02)
    q = np.delete(POSTURES[0], 2)
    np.testing.assert_allclose(
        locked.kinematics().p_WE(q), arm.kinematics().p_WE(np.insert(q, 2, 1.0)), atol=1e-15
    )


def test_a_tool_can_be_an_object_and_names_of_its_own():
    tool = ToolDescription(mass=0.2, name="pencil", tip="lead")
    arm = load_arm("planar6", tool=tool)
    assert (arm.frame, arm.tip, arm.tool.mount) == ("lead", "lead", "tip")
    assert arm.plant().GetBodyByName("pencil").default_mass() == 0.2


# Refusals.


@pytest.mark.parametrize(
    ("tool", "message"),
    [
        ({"bal": 1}, r"arm\.tool\.bal: no such key; nearest: ball"),
        ({"ball": 0}, r"arm\.tool\.ball: must be greater than 0, not 0"),
        ({"length": -1}, r"arm\.tool\.length: must be greater than 0, not -1"),
        ({"axis": [0, 0, 0]}, r"arm\.tool\.axis: must be a direction, not zero"),
        ({"axis": [1, 0, 0], "rpy": [0, 0, 0]}, r"arm\.tool\.rpy: cannot be combined with axis"),
        ({"inertia": [1, 1, 3]}, r"arm\.tool\.inertia: must be three positive numbers, none above"),
        ({"inertia": [1, 1, 0]}, r"arm\.tool\.inertia: must be three positive numbers"),
        ({"name": ""}, r"arm\.tool\.name: must be a name, not ''"),
        ({"name": "tip"}, r"arm\.tool\.tip: must differ from name, which is 'tip' as well"),
        (
            {"name": "tool0"},
            r"arm\.tool\.name: ur5\.urdf has a frame 'tool0' already; give another",
        ),
        ({"tip": "base_link"}, r"arm\.tool\.tip: ur5\.urdf has a frame 'base_link' already"),
        ({"mount": "tol0"}, r"arm\.tool: no frame 'tol0' in ur5\.urdf .*; nearest: tool0"),
        ("pen", r"arm\.tool: must be a mapping of keys to values, not 'pen'"),
    ],
)
def test_a_tool_that_cannot_be_is_refused_by_name(tool, message):
    with pytest.raises(InvalidInputError, match=message):
        ur5(tool=tool)


def test_a_flange_that_does_not_exist_is_refused_with_those_of_like_name():
    with pytest.raises(InvalidInputError, match=r"arm\.tool: no frame 'tool9' .*nearest: tool0"):
        load_arm(UR5, frame="tool9", tool={})


def test_a_mesh_that_would_take_minutes_is_refused():
    with pytest.raises(InvalidInputError, match=r"mesh_resolution: must be at least 0\.04 of"):
        ToolDescription(ball=0.012, mesh_resolution=1e-5)

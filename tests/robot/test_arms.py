"""Arms from model files: which joints move, which stand still, and what is refused."""

import logging
import pickle
from math import inf, pi

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant

from drake_rnn import InvalidInputError, load_arm, make_experiment, shipped_arms, simulate
from drake_rnn.robot.arm_description import LinkErrorSettings
from drake_rnn.robot.clearance.arm_clearance import arm_clearance

INERTIA = (
    '<inertial><mass value="2"/>'
    '<inertia ixx="0.02" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial>'
)

# Three joints, the first continuous, and a gripper of two fingers.
GRIPPER = f"""<robot name="grasper">
  <link name="base"/>
  <link name="upper">{INERTIA}</link>
  <link name="lower">{INERTIA}</link>
  <link name="hand">{INERTIA}</link>
  <link name="left">{INERTIA}</link>
  <link name="right">{INERTIA}</link>
  <joint name="turn" type="continuous">
    <parent link="base"/><child link="upper"/><origin xyz="0 0 0.2"/><axis xyz="0 0 1"/>
    <limit effort="10" velocity="2" drake:acceleration="6"/>
  </joint>
  <joint name="shoulder" type="revolute">
    <parent link="upper"/><child link="lower"/><origin xyz="0.1 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="10" velocity="1.5" drake:acceleration="5"/>
  </joint>
  <joint name="elbow" type="revolute">
    <parent link="lower"/><child link="hand"/><origin xyz="0.4 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-2.5" upper="2.5" effort="10" velocity="1.5" drake:acceleration="4"/>
  </joint>
  <joint name="left_finger" type="prismatic">
    <parent link="hand"/><child link="left"/><origin xyz="0.3 0 0"/><axis xyz="0 1 0"/>
    <limit lower="0" upper="0.04" effort="10" velocity="0.1"/>
  </joint>
  <joint name="right_finger" type="prismatic">
    <parent link="hand"/><child link="right"/><origin xyz="0.3 0 0"/><axis xyz="0 -1 0"/>
    <limit lower="0" upper="0.04" effort="10" velocity="0.1"/>
  </joint>
</robot>
"""

ROD = (
    "<inertial><mass>1</mass><inertia><ixx>0.01</ixx><iyy>0.01</iyy><izz>0.01</izz>"
    "<ixy>0</ixy><ixz>0</ixz><iyz>0</iyz></inertia></inertial>"
)

# One arm in three formats: two joints, about z and then about x, neither rod straight.
TWO_JOINTS = {
    "urdf": f"""<robot name="two">
      <link name="base">{INERTIA}</link><link name="upper">{INERTIA}</link>
      <link name="lower">{INERTIA}</link><link name="tip"/>
      <joint name="first" type="revolute"><parent link="base"/><child link="upper"/>
        <origin xyz="0 0 0.3" rpy="0 0 0.25"/><axis xyz="0 0 1"/>
        <limit lower="-1" upper="2" velocity="3" effort="1"/></joint>
      <joint name="second" type="revolute"><parent link="upper"/><child link="lower"/>
        <origin xyz="0.4 0 0.1"/><axis xyz="1 0 0"/>
        <limit lower="-2" upper="1" velocity="3" effort="1"/></joint>
      <joint name="end" type="fixed"><parent link="lower"/><child link="tip"/>
        <origin xyz="0 0.2 0.05"/></joint></robot>""",
    "sdf": f"""<sdf version="1.9"><model name="two">
      <link name="base">{ROD}</link>
      <link name="upper"><pose relative_to="first"/>{ROD}</link>
      <link name="lower"><pose relative_to="second"/>{ROD}</link>
      <frame name="tip" attached_to="lower"><pose>0 0.2 0.05 0 0 0</pose></frame>
      <joint name="first" type="revolute"><pose relative_to="base">0 0 0.3 0 0 0.25</pose>
        <parent>base</parent><child>upper</child>
        <axis><xyz>0 0 1</xyz><limit><lower>-1</lower><upper>2</upper><velocity>3</velocity>
        </limit></axis></joint>
      <joint name="second" type="revolute"><pose relative_to="upper">0.4 0 0.1 0 0 0</pose>
        <parent>upper</parent><child>lower</child>
        <axis><xyz>1 0 0</xyz><limit><lower>-2</lower><upper>1</upper><velocity>3</velocity>
        </limit></axis></joint></model></sdf>""",
    "xml": """<mujoco model="two"><compiler angle="radian"/><worldbody>
      <body name="upper" pos="0 0 0.3" euler="0 0 0.25">
        <inertial pos="0 0 0" mass="2" diaginertia="0.02 0.02 0.02"/>
        <joint name="first" type="hinge" axis="0 0 1" limited="true" range="-1 2"/>
        <body name="lower" pos="0.4 0 0.1">
          <inertial pos="0 0 0" mass="2" diaginertia="0.02 0.02 0.02"/>
          <joint name="second" type="hinge" axis="1 0 0" limited="true" range="-2 1"/>
          <body name="tip" pos="0 0.2 0.05">
            <inertial pos="0 0 0" mass="1e-3" diaginertia="1e-5 1e-5 1e-5"/>
          </body></body></body></worldbody></mujoco>""",
}


def chain(axes, length=0.2):
    """A URDF of as many links as axes, each ``length`` long along x."""
    links = '<link name="link0"/>'
    joints = ""
    for number, axis in enumerate(axes, start=1):
        links += f'<link name="link{number}">{INERTIA}</link>'
        joints += (
            f'<joint name="joint{number}" type="revolute"><parent link="link{number - 1}"/>'
            f'<child link="link{number}"/><origin xyz="{length if number > 1 else 0} 0 0"/>'
            f'<axis xyz="{axis}"/><limit lower="-3" upper="3" velocity="2" effort="1"/></joint>'
        )
    return (
        f'<robot name="chain">{links}<link name="tip"/>{joints}<joint name="end" type="fixed">'
        f'<parent link="link{len(axes)}"/><child link="tip"/><origin xyz="{length} 0 0"/></joint>'
        "</robot>"
    )


@pytest.fixture
def gripper(tmp_path):
    file = tmp_path / "grasper.urdf"
    file.write_text(GRIPPER)
    return file


def write(folder, name, text):
    file = folder / name
    file.write_text(text)
    return file


def refusal(*arguments, **fields):
    """What the refusal says: always one line."""
    with pytest.raises(InvalidInputError) as caught:
        load_arm(*arguments, **fields)
    message = str(caught.value)
    assert "\n" not in message
    return message


# What moves and what does not.


@pytest.mark.parametrize("name", shipped_arms())
def test_shipped_arms_load_by_name(name):
    arm = load_arm(name)
    assert arm.name == name
    assert arm.n == arm.limits.size == arm.home.size
    assert np.isfinite(arm.kinematics().p_WE(arm.home)).all()


def test_joints_between_base_and_frame_are_controlled_and_the_fingers_are_not(gripper):
    arm = load_arm(gripper, frame="hand")
    assert arm.joints == ("turn", "shoulder", "elbow")
    assert arm.name == "grasper"
    assert arm.home is None


def test_jacobian_of_the_controlled_joints_is_part_of_the_whole_arms(gripper):
    """Exact: the same computation, of which columns are taken."""
    q, finger = np.array([0.3, -0.4, 0.9]), 0.02
    whole = load_arm(
        gripper,
        frame="left",
        joints=["turn", "shoulder", "elbow", "left_finger", "right_finger"],
    ).kinematics()
    part = load_arm(gripper, frame="left", lock={"left_finger": finger}).kinematics()
    everything = np.array([*q, finger, 0.0])
    np.testing.assert_array_equal(part.p_WE(q), whole.p_WE(everything))
    np.testing.assert_array_equal(part.J(q), whole.J(everything)[:, :3])
    np.testing.assert_array_equal(part.J_omega(q), whole.J_omega(everything)[:, :3])
    np.testing.assert_array_equal(part.M(q), whole.M(everything)[:3, :3])
    np.testing.assert_array_equal(part.gravity(q), whole.gravity(everything)[:3])
    v = np.array([0.5, -0.2, 0.1])
    moving = np.array([*v, 0.0, 0.0])
    np.testing.assert_array_equal(part.Jdot_v(q, v), whole.Jdot_v(everything, moving))
    np.testing.assert_array_equal(part.bias(q, v), whole.bias(everything, moving)[:3])


def test_controlled_joints_may_be_named_in_any_order(gripper):
    forward = load_arm(gripper, frame="hand", joints=["shoulder", "elbow"]).kinematics()
    backward = load_arm(gripper, frame="hand", joints=["elbow", "shoulder"]).kinematics()
    q = np.array([0.3, -0.7])
    np.testing.assert_array_equal(forward.p_WE(q), backward.p_WE(q[::-1]))
    np.testing.assert_array_equal(forward.J(q), backward.J(q[::-1])[:, ::-1])


def test_a_finger_stands_where_it_is_locked_else_at_the_models_default(gripper):
    """Two roundings of a position of 1 m."""
    q = np.array([0.0, 0.0, 0.0])
    default = load_arm(gripper, frame="left", lock={"left_finger": 0.0}).kinematics()
    opened = load_arm(gripper, frame="left", lock={"left_finger": 0.03}).kinematics()
    np.testing.assert_allclose(opened.p_WE(q) - default.p_WE(q), [0, 0.03, 0], atol=1e-15)
    unnamed = load_arm(gripper, frame="left", joints=["turn", "shoulder", "elbow"]).kinematics()
    np.testing.assert_array_equal(unnamed.p_WE(q), default.p_WE(q))


def test_locking_the_elbow_bends_the_arm_there_for_good(gripper):
    """From shoulder 0.1 m off the axis: 0.4 m along x, then 0.3 m down past a right angle."""
    arm = load_arm(gripper, frame="left", lock={"elbow": pi / 2, "left_finger": 0.0})
    assert arm.joints == ("turn", "shoulder")
    p_WE = arm.kinematics().p_WE(np.zeros(2))
    np.testing.assert_allclose(p_WE, [0.5, 0, 0.2 - 0.3], atol=1e-15)


def test_part_of_a_shipped_arm_keeps_its_limits_and_stands_at_home_elsewhere():
    whole = load_arm("panda")
    part = load_arm("panda", joints=["panda_joint2", "panda_joint4", "panda_joint6"])
    np.testing.assert_array_equal(part.home, whole.home[[1, 3, 5]])
    np.testing.assert_array_equal(part.limits.jerk, whole.limits.jerk[[1, 3, 5]])
    here, there = part.kinematics(), whole.kinematics()
    np.testing.assert_array_equal(here.p_WE(part.home), there.p_WE(whole.home))
    np.testing.assert_array_equal(here.J(part.home), there.J(whole.home)[:, [1, 3, 5]])


def test_a_locked_joint_of_a_shipped_arm_is_no_longer_controlled():
    part, whole = load_arm("panda", lock={"panda_joint1": 0.5}), load_arm("panda")
    assert part.joints == whole.joints[1:]
    turned = np.array([0.5, *whole.home[1:]])
    np.testing.assert_array_equal(
        part.kinematics().p_WE(part.home), whole.kinematics().p_WE(turned)
    )


def test_another_frame_of_a_shipped_arm_keeps_joints_home_and_limits():
    arm = load_arm("panda", frame="tip")
    assert arm.frame == "tip"
    assert arm.joints == load_arm("panda").joints
    np.testing.assert_array_equal(arm.home, load_arm("panda").home)
    assert arm.limits.jerk is not None


def test_the_skeleton_runs_from_the_base_to_the_task_frame(gripper):
    """Folded by a right angle at the elbow: base, upper arm, lower arm, hand; 1e-15 m: rounding."""
    arm = load_arm(gripper, frame="left", joints=["turn", "shoulder", "elbow", "left_finger"])
    skeleton = arm.kinematics().skeleton(np.array([0.0, 0.0, pi / 2, 0.03]))
    shoulder, elbow, finger = [0.1, 0, 0.2], [0.5, 0, 0.2], [0.5, 0.03, -0.1]
    expected = [[0, 0, 0], [0, 0, 0.2], shoulder, elbow, finger, finger]
    np.testing.assert_allclose(skeleton, expected, atol=1e-15)


@pytest.mark.parametrize("name", shipped_arms())
def test_bones_keep_their_lengths(name):
    """However the arm stands; and the last point is the end effector."""
    arm = load_arm(name)
    kinematics = arm.kinematics()
    bones = []
    for q in (arm.home, arm.home + 0.3):
        skeleton = kinematics.skeleton(q)
        np.testing.assert_array_equal(skeleton[-1], kinematics.p_WE(q))
        np.testing.assert_allclose(skeleton[0], 0.0, atol=1e-15)
        bones.append(np.linalg.norm(np.diff(skeleton, axis=0), axis=1))
    np.testing.assert_allclose(*bones, atol=1e-14)
    assert len(bones[0]) >= arm.n


def test_a_free_base_is_welded_to_the_world(gripper):
    """URDF says nothing of a base; unwelded it would fall."""
    plant = load_arm(gripper, frame="hand").plant()
    assert plant.num_positions() == plant.num_velocities() == 3
    assert not plant.GetFloatingBaseBodies()


def test_a_free_base_is_welded_where_the_model_puts_it(tmp_path):
    """1e-15 m: rounding."""
    text = TWO_JOINTS["sdf"]
    here = load_arm(write(tmp_path, "here.sdf", text), frame="tip")
    raised = text.replace('<model name="two">', '<model name="two"><pose>0 0 1 0 0 0</pose>')
    there = load_arm(write(tmp_path, "there.sdf", raised), frame="tip")
    q = np.array([0.2, -0.3])
    rise = there.kinematics().p_WE(q) - here.kinematics().p_WE(q)
    np.testing.assert_allclose(rise, [0, 0, 1], atol=1e-15)


def test_an_arm_can_be_added_to_a_plant_that_holds_another(gripper):
    plant = MultibodyPlant(0.0)
    load_arm("panda").add_to(plant)
    load_arm(gripper, frame="hand").add_to(plant)
    plant.Finalize()
    assert plant.num_positions() == 7 + 3
    assert not plant.GetFloatingBaseBodies()


@pytest.mark.parametrize("suffix", ["sdf", "xml"])
def test_sdf_and_mjcf_of_an_arm_move_as_its_urdf(tmp_path, suffix):
    """1e-15: rounding of lengths and cosines below 1."""
    urdf = load_arm(write(tmp_path, "two.urdf", TWO_JOINTS["urdf"]), frame="tip")
    other = load_arm(write(tmp_path, f"two.{suffix}", TWO_JOINTS[suffix]), frame="tip")
    assert other.joints == urdf.joints == ("first", "second")
    for q in np.random.default_rng(0).uniform(-2, 2, (5, 2)):
        for name in ("p_WE", "R_WE", "J", "J_omega"):
            np.testing.assert_allclose(
                getattr(other.kinematics(), name)(q),
                getattr(urdf.kinematics(), name)(q),
                rtol=0,
                atol=1e-15,
                err_msg=name,
            )
    np.testing.assert_array_equal(other.limits.position_lower, [-1, -2])
    np.testing.assert_array_equal(other.limits.position_upper, [2, 1])


# Masses.


@pytest.mark.parametrize("name", shipped_arms())
def test_a_scale_of_the_masses_is_one_of_all_forces_and_of_nothing_else(name):
    """1e-13 of the largest: rounding."""
    arm, light = load_arm(name), load_arm(name, mass_scale=0.4)
    heavy, scaled = arm.kinematics(), light.kinematics()
    rng = np.random.default_rng(0)
    for _ in range(3):
        q, v = rng.uniform(-1, 1, arm.n), rng.uniform(-1, 1, arm.n)
        for what in ("p_WE", "J"):
            np.testing.assert_array_equal(getattr(scaled, what)(q), getattr(heavy, what)(q))
        for force, expected in (
            (scaled.M(q), heavy.M(q)),
            (scaled.bias(q, v), heavy.bias(q, v)),
            (scaled.gravity(q), heavy.gravity(q)),
        ):
            scale = np.abs(expected).max()
            np.testing.assert_allclose(force, 0.4 * expected, rtol=0, atol=1e-13 * scale)


def test_a_scale_of_the_masses_goes_with_the_arm(gripper):
    """Through other limits, another frame, locked joints; fingers and massless bodies too."""
    arm = load_arm(gripper, frame="hand", mass_scale=2.0)
    q, weight = np.array([0.3, -0.7, 0.4]), load_arm(gripper, frame="hand").kinematics()
    for same in (arm, arm.with_limits(arm.limits), arm.replace(frame="lower", joints=arm.joints)):
        np.testing.assert_allclose(same.kinematics().gravity(q), 2 * weight.gravity(q), rtol=1e-13)
    locked = arm.replace(lock={"elbow": 0.4}).kinematics()
    np.testing.assert_allclose(locked.M(q[:2]), 2 * weight.M(q)[:2, :2], rtol=1e-13)


@pytest.mark.parametrize("scale", [0.0, -1.0, inf, "heavy"])
def test_a_scale_of_the_masses_that_cannot_be_is_refused(scale):
    assert "mass_scale: must be" in refusal("planar6", mass_scale=scale)


# Files that a model needs.


@pytest.fixture
def meshed(tmp_path):
    """A model whose hand is drawn from a package's mesh, and the folder for that package."""
    visual = '<visual><geometry><mesh filename="package://parts/hand.obj"/></geometry></visual>'
    text = GRIPPER.replace('<link name="hand">', f'<link name="hand">{visual}')
    return write(tmp_path, "meshed.urdf", text), tmp_path / "parts_lie_here"


def test_package_names_are_looked_up_in_the_packages_given(meshed):
    file, folder = meshed
    folder.mkdir()
    (folder / "hand.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert load_arm(file, frame="hand", packages={"parts": str(folder)}).n == 3


def test_a_package_that_is_not_there_is_refused(meshed):
    file, folder = meshed
    message = refusal(file, frame="hand", packages={"parts": str(folder)})
    assert message == f"arm.packages.parts: no folder '{folder}'"
    folder.mkdir()
    assert refusal(file, frame="hand", packages={"drake": str(folder)}).startswith(
        "arm.packages.drake: "
    )


def test_what_the_parser_warns_of_is_said_once_and_reaches_the_experiment(tmp_path, caplog):
    odd = GRIPPER.replace('velocity="2"', 'velocity="2"/><dynamics friction="0.1"')
    file = write(tmp_path, "odd.urdf", odd)
    with caplog.at_level(logging.WARNING, logger="drake"):
        arm = load_arm(file, frame="hand")
        arm.kinematics()
        arm.with_limits(arm.limits).plant()
    assert not caplog.records
    (warning,) = arm.warnings
    assert warning.startswith("arm.model: odd.urdf: Drake warns once, first: A joint has specified")
    document = experiment(file, start=[0.1, 0.5, 0.5], limits={"acceleration": 3})
    made = make_experiment({**document, "arm": {"model": str(file), "frame": "hand"}})
    assert made.warnings[0] == warning


def test_what_the_parser_warns_of_is_said_although_drakes_log_is_silent(tmp_path):
    odd = GRIPPER.replace('velocity="2"', 'velocity="2"/><dynamics friction="0.1"')
    file = write(tmp_path, "odd.urdf", odd)
    log = logging.getLogger("drake")
    level, disabled = log.level, log.disabled
    try:
        for log.disabled in (False, True):
            log.setLevel(logging.CRITICAL)
            assert len(load_arm(file, frame="hand").warnings) == 1
            assert log.level == logging.CRITICAL
    finally:
        log.disabled = disabled
        log.setLevel(level)


# Limits that a model states.


def test_limits_are_read_from_the_model_acceleration_too(gripper):
    limits = load_arm(gripper, frame="hand").limits
    np.testing.assert_array_equal(limits.position_lower, [-inf, -2, -2.5])
    np.testing.assert_array_equal(limits.position_upper, [inf, 2, 2.5])
    np.testing.assert_array_equal(limits.velocity, [2, 1.5, 1.5])
    np.testing.assert_array_equal(limits.acceleration, [6, 5, 4])
    assert limits.jerk is None


def test_a_continuous_joint_has_its_full_speed_at_any_angle(gripper):
    limits = load_arm(gripper, frame="hand").limits
    lower, upper = limits.velocity_box(np.array([1e3, 2.0, 0.0]), 2.0)
    np.testing.assert_array_equal(lower, [-2, -1.5, -1.5])
    np.testing.assert_array_equal(upper, [2, 0, 1.5])


def test_a_law_that_needs_an_acceleration_that_no_one_states_says_so(tmp_path):
    file = write(tmp_path, "chain.urdf", chain(["0 0 1", "0 1 0", "0 1 0"]))
    assert load_arm(file, frame="tip").limits.acceleration is None
    document = experiment(file, start=[0.1, 0.5, 0.5])
    del document["law"]["acceleration_bound"]
    with pytest.raises(InvalidInputError, match=r"^limits\.acceleration: not known for this arm"):
        make_experiment(document)
    make_experiment({**document, "limits": {"acceleration": 3}})


def experiment(file, start, **more):
    return {
        "arm": {"model": str(file), "frame": "tip"},
        "start": start,
        "path": {"kind": "circle", "size": 0.02, "period": 1, "timing": "quintic"},
        "law": {
            "kind": "simultaneous_learning",
            "jacobian": "known",
            "acceleration_bound": "none",
            "return_gain": 0,
            "kappa": 20,
            "rate": 2e4,
        },
        "period": 1e-3,
        "duration": 0.2,
        **more,
    }


def test_an_arm_of_five_joints_follows_a_path_in_space(tmp_path):
    """0.2 mm of 4 mm: the multipliers lag by 1 / (rate s^2), some ms, s a singular value of J."""
    file = write(tmp_path, "five.urdf", chain(["0 0 1", "0 1 0", "0 1 0", "0 1 0", "1 0 0"]))
    result = simulate(make_experiment(experiment(file, start=[0.1, -0.5, 0.8, 0.4, 0.0])))
    assert result.metrics["end_effector_drift_max_m"] > 2e-3
    assert result.metrics["position_error_max_m"] < 2e-4
    assert result.series["J"].shape[1:] == (3, 5)


def test_an_arm_of_two_joints_follows_a_path_in_its_plane(tmp_path):
    """0.2 mm, as above."""
    file = write(tmp_path, "two.urdf", chain(["0 0 1", "0 0 1"]))
    result = simulate(make_experiment(experiment(file, start=[0.2, 1.2], task="xy")))
    assert result.metrics["end_effector_drift_max_m"] > 2e-3
    assert result.metrics["position_error_max_m"] < 2e-4
    assert result.series["J"].shape[1:] == (2, 2)


# Refusals.


def test_an_unknown_arm_is_refused_with_those_of_like_name():
    assert refusal("pandas").startswith("arm: no arm 'pandas'; nearest: panda")
    assert "it may be fr3, gen3, iiwa14, panda, planar6, puma560, ur5" in refusal("xyzzy")


def test_a_file_that_is_no_model_is_refused(tmp_path):
    assert refusal("nowhere.urdf", frame="tip") == "arm.model: no file 'nowhere.urdf'"
    assert ".urdf, .sdf, .xml or .xacro file" in refusal("arm.stl", frame="tip")
    for name, text in {
        "a.urdf": "<robot><link",
        "b.urdf": "",
        "c.xml": "<urdf/>",
        "d.sdf": '<sdf version="1.9"/>',
        "e.urdf": '<robot name="e"><link name="a"/><link name="a"/></robot>',
    }.items():
        message = refusal(write(tmp_path, name, text), frame="tip")
        assert message.startswith("arm.model: "), message
        assert name in message


def test_a_file_of_several_models_is_refused(tmp_path):
    model = '<model name="{}"><link name="l"/></model>'
    world = (
        f'<sdf version="1.9"><world name="w">{model.format("a")}{model.format("b")}</world></sdf>'
    )
    assert "holds 2 models; it must hold one" in refusal(write(tmp_path, "w.sdf", world), frame="l")


def test_frames_and_joints_that_do_not_exist_are_refused_with_those_of_like_name(gripper):
    assert refusal(gripper, frame="hnd") == (
        "arm.frame: no frame 'hnd' in grasper.urdf; nearest: hand"
    )
    assert refusal(gripper, frame="hand", tip="lft").startswith("arm.tip: no frame 'lft'")
    assert refusal(gripper, frame="hand", joints=["elbows"]) == (
        "arm.joints: no movable joint 'elbows' in grasper.urdf; nearest: elbow"
    )
    assert refusal(gripper, frame="hand", lock={"lef_finger": 0}).startswith(
        "arm.lock: no movable joint 'lef_finger' in grasper.urdf; nearest: left_finger"
    )
    assert refusal(gripper, frame="base") == (
        "arm.frame: no movable joint between the base and 'base'"
    )


def test_a_joint_is_either_controlled_or_locked_and_only_once(gripper):
    assert "arm.lock: 'elbow' is also a controlled joint" in refusal(
        gripper, frame="hand", joints=["elbow"], lock={"elbow": 0}
    )
    assert refusal(gripper, frame="hand", joints=["elbow", "elbow"]) == (
        "arm.joints: 'elbow' is given twice"
    )


def test_a_joint_of_several_degrees_of_freedom_is_refused(tmp_path):
    text = GRIPPER.replace('name="elbow" type="revolute"', 'name="elbow" type="planar"')
    file = write(tmp_path, "loose.urdf", text)
    what = "'elbow' is a planar joint and must have one degree of freedom; "
    assert refusal(file, frame="hand").startswith(f"arm.joints: {what}name the other joints in")
    message = refusal(file, frame="hand", lock={"elbow": 1.0})
    assert message == f"arm.lock: {what}it is held where the model has it: leave it out"


def test_fields_that_do_not_fit_are_refused_by_name(gripper):
    assert refusal(gripper, frame="hand", home=[0, 0]) == "arm.home: has 2 entries for 3 joints"
    assert refusal(gripper) == (
        "arm.frame: must be given; the chains of grasper.urdf end in left, right"
    )
    assert refusal(gripper, frame="hand", fram="x") == "arm.fram: no such key; nearest: frame"
    assert refusal(gripper, frame="hand", lock={"elbow": float("nan")}).startswith(
        "arm.lock.elbow: must be a finite number, not nan"
    )
    assert refusal("panda", home=[0.0] * 6) == "arm.home: has 6 entries for 7 joints"
    with pytest.raises(InvalidInputError, match=r"arm\.limits: has 7 entries for 3 joints"):
        load_arm(gripper, frame="hand").with_limits(load_arm("panda").limits)


def test_limits_that_cannot_be_are_refused(tmp_path):
    text = GRIPPER.replace('velocity="1.5"', 'velocity="-1.5"')
    assert "velocity must not be negative, as -1.5 is" in refusal(
        write(tmp_path, "backwards.urdf", text), frame="hand"
    )
    text = GRIPPER.replace('lower="-2" upper="2"', 'lower="2" upper="2"')
    assert "arm.model.position_lower: must be below position_upper" in refusal(
        write(tmp_path, "stuck.urdf", text), frame="hand"
    )


def test_a_joint_cannot_be_locked_where_it_cannot_be():
    with pytest.raises(InvalidInputError, match=r"arm\.lock\.panda_joint7: may be -2\.8973 to"):
        load_arm("panda", lock={"panda_joint7": 9})


def test_copies_with_other_limits_share_the_plant_and_those_with_other_links_do_not():
    arm = load_arm("panda")
    kinematics, q = arm.kinematics(), arm.home
    slower = arm.with_limits(arm.limits.replace(velocity=0.1))
    assert slower.kinematics()._plant is kinematics._plant
    assert slower.memo is arm.memo
    wrong = slower.with_link_errors(LinkErrorSettings(translation=0.01, seed=1))
    assert np.abs(wrong.kinematics().p_WE(q) - kinematics.p_WE(q)).max() > 1e-3
    again = pickle.loads(pickle.dumps(slower))
    np.testing.assert_array_equal(again.kinematics().p_WE(q), kinematics.p_WE(q))
    assert again.memo == {}


def test_pairs_are_those_of_the_posture_and_the_position_limits_and_capsules_of_the_arm():
    arm = load_arm("iiwa14")
    once, _ = arm_clearance(arm, [], arm.home)
    again, _ = arm_clearance(arm.with_limits(arm.limits.replace(velocity=0.1)), [], arm.home)
    assert again.own is once.own
    bent = arm.home + 0.01
    other, _ = arm_clearance(arm, [], bent)
    assert other.own is not once.own
    assert other.arm is once.arm
    narrow = arm.limits.replace(position_lower=arm.home - 0.1, position_upper=arm.home + 0.1)
    fewer, _ = arm_clearance(arm.with_limits(narrow), [], arm.home)
    assert fewer.own is not once.own

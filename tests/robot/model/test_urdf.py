"""URDF as makers publish it: what of it is changed, and what that means for the motion."""

import numpy as np
import pytest
from model_files import (
    INERTIA,
    LIMIT,
    START,
    experiment,
    five,
    refusal,
    same_kinematics,
    urdf,
    write,
)

from drake_rnn import InvalidInputError, load_arm, make_experiment, shipped_arms, simulate
from drake_rnn.robot.model import read_model

TRANSMISSION = (
    '<transmission name="{0}"><type>transmission_interface/{1}</type>'
    '<joint name="{2}"/><actuator name="{3}"/></transmission>'
)
# A gripper on the last link: the second finger follows the first.
FINGERS = "".join(
    f'<link name="{side}">{INERTIA}</link><joint name="{side}_joint" type="prismatic">'
    f'<parent link="link5"/><child link="{side}"/><origin xyz="0.25 0 0"/><axis xyz="0 {way} 0"/>'
    f'<limit lower="0" upper="0.04" effort="10" velocity="0.1"/>{follows}</joint>'
    for side, way, follows in (
        ("left", 1, ""),
        ("right", 1, '<mimic joint="left_joint" multiplier="-1" offset="-0.01"/>'),
    )
)


def two_arms():
    """Two arms of five joints on one base, the second 1 m aside."""
    one = urdf().removeprefix('<robot name="five">').removesuffix("</robot>")
    other = one.replace('<link name="base"/>', "")
    for name in ("link", "joint", "tip", "end"):
        other = other.replace(f'"{name}', f'"other_{name}')
    other = other.replace('xyz="0 0 0"', 'xyz="0 1 0"', 1)
    return f'<robot name="two">{one}{other}</robot>'


# Files that need no change.


@pytest.mark.parametrize("name", shipped_arms())
def test_shipped_models_are_parsed_as_they_are(name):
    arm = load_arm(name)
    assert read_model(arm.model, {}).text is None
    assert arm.warnings == ()
    assert arm.units == ("rad",) * arm.n


# Limits.


def test_limits_of_zero_are_taken_for_unknown(tmp_path):
    """Before, refused: velocity must be positive."""
    arm = five(tmp_path, limit='lower="-2" upper="2" effort="0" velocity="0"')
    np.testing.assert_array_equal(arm.limits.velocity, np.inf)
    np.testing.assert_array_equal(arm.effort, np.inf)
    assert arm.warnings == tuple(
        f"arm.model: five.urdf: a limit of 0 is taken for an unknown {name} limit: joint1, joint2, "
        "joint3, joint4 and 1 more"
        for name in ("velocity", "effort")
    )


def test_efforts_are_known_without_transmissions(tmp_path):
    """Before, infinite: Drake takes them from transmissions."""
    arm = five(tmp_path)
    np.testing.assert_array_equal(arm.effort, 200.0)
    assert arm.warnings == ()


@pytest.mark.parametrize(
    "lost",
    [
        TRANSMISSION.format("a", "SimpleTransmission", "joint1", "motor") * 2,
        TRANSMISSION.format("a", "SimpleTransmission", "joint1", "motor")
        + TRANSMISSION.format("b", "SimpleTransmission", "joint2", "motor"),
        TRANSMISSION.format("a", "SimpleTransmission", "nowhere", "motor"),
        TRANSMISSION.format("a", "SimpleTransmission", "end", "motor"),
        TRANSMISSION.format("a", "DifferentialTransmission", "joint1", "motor"),
        '<gazebo reference="link1"><plugin:odd/></gazebo>',
    ],
)
def test_lost_and_repeated_transmissions_are_no_obstacle(tmp_path, lost):
    """Before, refused: actuator names must be unique, the joint does not exist."""
    arm = five(tmp_path, links=lost)
    np.testing.assert_array_equal(arm.effort, 200.0)
    assert arm.warnings == ()


def test_one_motor_drives_each_joint_at_the_dynamic_level(tmp_path):
    """15 mm of 40 mm: the motors' lag; a finger that nobody held would fall."""
    file = write(tmp_path, "five.urdf", urdf(links=FINGERS))
    arm = {"model": str(file), "frame": "tip"}
    limits = {"acceleration": 100.0}
    result = simulate(
        make_experiment(experiment(arm, duration=1.0, level="dynamic", limits=limits))
    )
    assert result.metrics["position_error_max_m"] < 15e-3


# Inertia.


def test_an_inertia_that_no_body_has_becomes_the_nearest_possible(tmp_path):
    """Drake takes a ball of water in its place; 1e-8: what is kept from the bound."""
    impossible = INERTIA.replace('izz="0.02"', 'izz="0.05"')
    arm = five(tmp_path, inertia=impossible)
    (warning,) = arm.warnings
    assert "the nearest possible one is taken: link1, link2, link3, link4 and 1 more" in warning
    body = arm.plant().GetBodyByName("link3")
    moments = body.default_spatial_inertia().CalcRotationalInertia().get_moments()
    np.testing.assert_allclose(moments, [0.02, 0.02, 0.04], rtol=1e-8)
    possible = five(tmp_path, inertia=INERTIA.replace('izz="0.02"', 'izz="0.04"'))
    assert possible.warnings == ()


def test_an_arm_without_masses_moves_at_the_kinematic_level_only(tmp_path):
    file = write(tmp_path, "five.urdf", urdf(inertia=""))
    arm = {"model": str(file), "frame": "tip"}
    assert simulate(make_experiment(experiment(arm))).metrics["position_error_max_m"] < 1e-4
    with pytest.raises(InvalidInputError, match="no link that 'joint1' of five moves has any ine"):
        simulate(make_experiment(experiment(arm, level="dynamic")))


# Joints.


def test_a_sliding_joint_is_controlled_and_named_in_metres(tmp_path):
    kinds = ("prismatic", "revolute", "revolute", "revolute", "continuous")
    arm = five(tmp_path, kinds=kinds)
    assert arm.units == ("m", "rad", "rad", "rad", "rad")
    q = np.array(START)
    slid = np.array([START[0] + 0.3, *START[1:]])
    rise = arm.kinematics().p_WE(slid) - arm.kinematics().p_WE(q)
    np.testing.assert_allclose(rise, [0, 0, 0.3], atol=1e-15)
    document = {"model": str(arm.model), "frame": "tip"}
    result = simulate(make_experiment(experiment(document)))
    assert result.metrics["position_error_max_m"] < 1e-4
    with pytest.raises(InvalidInputError, match=r"start: joint1 is at 2\.5 m; it may be -2 to 2"):
        make_experiment(experiment(document, start=[2.5, *START[1:]]))


def test_a_finger_that_follows_a_locked_one_stands_where_it_follows_it_to(tmp_path):
    """1e-15 m: rounding."""
    file = write(tmp_path, "five.urdf", urdf(links=FINGERS))
    arm = load_arm(file, frame="tip", lock={"left_joint": 0.03})
    assert arm.joints == tuple(f"joint{number}" for number in range(1, 6))
    assert arm.plant().num_positions() == 5
    context = (plant := arm.plant()).CreateDefaultContext()
    hand = plant.GetFrameByName("link5")
    for side, where in (("left", 0.03), ("right", -0.03 - 0.01)):
        X = plant.GetFrameByName(side).CalcPose(context, hand)
        np.testing.assert_allclose(X.translation(), [0.25, where, 0], atol=1e-15)


def test_a_controlled_joint_that_follows_another_is_refused(tmp_path):
    file = write(tmp_path, "five.urdf", urdf(links=FINGERS))
    assert refusal(file, frame="right") == (
        "arm.joints: 'right_joint' follows 'left_joint' (mimic), so it cannot be controlled; hold "
        "it in arm.lock, or take a frame before it"
    )
    assert load_arm(file, frame="right", lock={"right_joint": 0.0}).n == 5


def test_a_fixed_joint_may_follow_and_be_followed(tmp_path):
    """Before, refused: a joint of 0 degrees of freedom cannot mimic."""
    for side in ("left", "right"):
        joint = f'name="{side}_joint" type='
        still = FINGERS.replace(f'{joint}"prismatic"', f'{joint}"fixed"')
        assert load_arm(write(tmp_path, f"{side}.urdf", urdf(links=still)), frame="tip").n == 5


def test_of_two_arms_in_one_model_the_frame_chooses(tmp_path):
    """1e-15 m: rounding."""
    file = write(tmp_path, "two.urdf", two_arms())
    one, other = load_arm(file, frame="tip"), load_arm(file, frame="other_tip")
    assert one.joints == tuple(f"joint{number}" for number in range(1, 6))
    assert other.joints == tuple(f"other_joint{number}" for number in range(1, 6))
    alone = five(tmp_path)
    same_kinematics(one, alone)
    q = np.array(START)
    shift = other.kinematics().p_WE(q) - alone.kinematics().p_WE(q)
    np.testing.assert_allclose(shift, [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(other.kinematics().M(q), alone.kinematics().M(q), atol=1e-15)
    joints = [f"other_joint{number}" for number in range(2, 6)]
    assert load_arm(file, frame="other_tip", joints=joints).joints == tuple(joints)


def test_a_floating_joint_is_fixed_where_the_model_puts_it(tmp_path):
    """Before, the arm was welded to the origin: Drake takes such a base for a free body."""
    free = (
        '<link name="world_link"/><joint name="free" type="floating"><parent link="world_link"/>'
        '<child link="base"/><origin xyz="0 0 1"/></joint>'
    )
    file = write(tmp_path, "free.urdf", urdf(links=free))
    arm = load_arm(file, frame="tip")
    assert arm.warnings == ("arm.model: free.urdf: floating joints are fixed: free",)
    rise = arm.kinematics().p_WE(START) - five(tmp_path).kinematics().p_WE(START)
    np.testing.assert_allclose(rise, [0, 0, 1], atol=1e-15)


def test_a_planar_joint_is_refused_by_name(tmp_path):
    file = write(tmp_path, "five.urdf", urdf(kinds=("planar", *["revolute"] * 4)))
    assert refusal(file, frame="tip") == (
        "arm.joints: 'joint1' is a planar joint and must have one degree of freedom; name the "
        "other joints in arm.joints, and it is held where the model has it"
    )
    names = [f"joint{number}" for number in range(2, 6)]
    assert load_arm(file, frame="tip", joints=names).joints == tuple(names)


def test_numbers_that_are_none_are_refused(tmp_path):
    file = write(tmp_path, "odd.urdf", urdf(limit=LIMIT.replace("1.5", "fast")))
    said = "arm.model: the limits of 'joint1': velocity must be a finite decimal number, not 'fast'"
    assert refusal(file, frame="tip") == said


def test_a_negative_mass_is_refused_with_its_link(tmp_path):
    text = urdf().replace('<mass value="', '<mass value="-', 1)
    assert "the mass of '" in refusal(write(tmp_path, "five.urdf", text), frame="tip")

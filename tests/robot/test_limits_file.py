"""Files of joint limits beside a model or named in an arm's description."""

import numpy as np
import pytest
from numpy import inf

from drake_rnn import (
    InvalidInputError,
    PlantArm,
    load_arm,
    load_experiment,
    make_experiment,
    simulate,
)
from drake_rnn.models import MODELS
from row_helpers import each

JOINTS = load_arm("ur5").joints
STATED = load_arm("ur5").limits


@pytest.fixture
def model(tmp_path):
    """The UR5's model alone in a folder."""
    file = tmp_path / "my.urdf"
    file.write_text((MODELS / "ur5" / "ur5.urdf").read_text())
    return file


def loaded(model, text, name="my.limits.yaml", **changes):
    (model.parent / name).write_text(text)
    return load_arm(model, frame="tool0", **changes)


def refusal(model, text):
    with pytest.raises(InvalidInputError) as caught:
        loaded(model, text)
    return str(caught.value).removeprefix(f"{model.parent / 'my.limits.yaml'}: ")


# What is read.


@pytest.mark.parametrize(
    "value",
    [
        "[1, 2, 3, 4, 5, 6]",
        "{wrist_3_joint: 6, wrist_2_joint: 5, wrist_1_joint: 4, elbow_joint: 3, "
        "shoulder_lift_joint: 2, shoulder_pan_joint: 1}",
    ],
)
def test_limits_are_given_in_the_order_of_the_joints_or_by_name(model, value):
    arm = loaded(model, f"acceleration: {{value: {value}, unit: rad/s^2, source: tried}}")
    np.testing.assert_array_equal(arm.limits.acceleration, [1, 2, 3, 4, 5, 6])
    np.testing.assert_array_equal(arm.limits.velocity, STATED.velocity)
    np.testing.assert_array_equal(arm.limits.position_lower, STATED.position_lower)


def test_a_list_may_say_whose_order_it_has(model):
    names = ", ".join(reversed(JOINTS))
    arm = loaded(model, f"joints: [{names}]\nvelocity: {{value: [1, 1, 1, 0.5, 2, 2]}}")
    np.testing.assert_array_equal(arm.limits.velocity, [2, 2, 0.5, 1, 1, 1])


def test_a_number_is_for_all_joints(model):
    arm = loaded(model, "jerk: {value: 40}\nvelocity: {value: 2}")
    np.testing.assert_array_equal(arm.limits.jerk, np.full(6, 40.0))
    np.testing.assert_array_equal(arm.limits.velocity, np.full(6, 2.0))


def test_bounds_downwards_are_those_upwards_mirrored_where_none_is_stated(model):
    arm = loaded(model, "velocity_lower: {value: {elbow_joint: -0.5}}\nvelocity: {value: 2}")
    np.testing.assert_array_equal(arm.limits.velocity_lower, [-2, -2, -0.5, -2, -2, -2])
    text = "velocity_lower: {value: 0.5}"
    assert refusal(model, text) == "velocity_lower.value: must be negative, not 0.5"


def test_what_is_unpublished_is_what_the_model_says_or_not_known(model):
    arm = loaded(
        model,
        "velocity: {value: unpublished}\nacceleration: {value: {elbow_joint: 3}}\n"
        "jerk: {value: unpublished, source: asked}",
    )
    np.testing.assert_array_equal(arm.limits.velocity, STATED.velocity)
    np.testing.assert_array_equal(arm.limits.acceleration, [inf, inf, 3, inf, inf, inf])
    assert arm.limits.jerk is None


def test_efforts_of_the_file_bound_the_motors(model):
    arm = loaded(model, "effort: {value: {wrist_3_joint: 5}, unit: N m}")
    np.testing.assert_array_equal(arm.effort, [150, 150, 150, 28, 28, 5])
    body = PlantArm(arm, start=np.array([0.0, -1.2, 1.6, -2.0, -1.57, 0.0]))
    motors = map(body.plant.get_joint_actuator, body.plant.GetJointActuatorIndices())
    limits = {motor.joint().name(): motor.effort_limit() for motor in motors}
    np.testing.assert_array_equal([limits[name] for name in arm.joints], arm.effort)


def test_limits_go_with_the_joints(model):
    """Also where a joint is locked, and where other limits were set before."""
    names = ", ".join(JOINTS)
    text = f"joints: [{names}]\nacceleration: {{value: [1, 2, 3, 4, 5, 6]}}\neffort: {{value: 9}}"
    arm = loaded(model, text).replace(lock={"elbow_joint": 0.5})
    np.testing.assert_array_equal(arm.limits.acceleration, [1, 2, 4, 5, 6])
    np.testing.assert_array_equal(arm.effort, np.full(5, 9.0))
    slow = loaded(model, text).with_limits(STATED.replace(velocity=0.1))
    np.testing.assert_array_equal(slow.replace(frame="wrist_3_link").limits.velocity, 0.1)


# Which file is read.


def test_a_file_named_after_the_model_is_found_beside_it(model):
    assert loaded(model, "jerk: {value: 40}").description.limits == str(
        model.parent / "my.limits.yaml"
    )
    assert load_arm(model, frame="tool0", limits=None).limits.jerk is None


def test_a_file_of_another_name_has_to_be_named(model):
    """In the same folder there may be other models."""
    assert loaded(model, "jerk: {value: 40}", name="limits.yaml").limits.jerk is None
    other = str(model.parent / "limits.yaml")
    np.testing.assert_array_equal(load_arm(model, frame="tool0", limits=other).limits.jerk, 40)


def test_a_file_may_replace_that_of_a_shipped_arm(model):
    (model.parent / "mine.yaml").write_text("acceleration: {value: 3}")
    arm = load_arm("panda", limits=str(model.parent / "mine.yaml"))
    np.testing.assert_array_equal(arm.limits.acceleration, 3.0)
    np.testing.assert_array_equal(arm.limits.velocity, load_arm("panda").limits.velocity)
    assert arm.limits.jerk is None


@pytest.mark.parametrize(
    ("name", "key"), [("my.limits.yaml", ""), ("else.yaml", ", limits: else.yaml")]
)
def test_a_document_says_which_limits_were_used(model, name, key):
    """Files are relative to the document; one that is found is named in what is saved."""
    (model.parent / name).write_text("velocity: {value: 0.25}")
    document = model.parent / "reach.yaml"
    document.write_text(
        f"arm: {{model: my.urdf, frame: tool0{key}}}\nlaw: {{kind: pseudoinverse}}\n"
        "start: [0, -1.2, 1.6, -2, -1.57, 0]\npath: {kind: circle, size: 0.01, period: 4}\n"
        "period: 1e-3\nduration: 1\n"
    )
    experiment = load_experiment(document)
    np.testing.assert_array_equal(experiment.limits.velocity, 0.25)
    assert experiment.document.arm["limits"] == str(model.parent / name)
    unnamed = load_experiment(document, {"arm.model": "ur5", "arm.limits": None})
    np.testing.assert_array_equal(unnamed.limits.velocity, STATED.velocity)


# Refusals.


def test_units_of_a_joint_that_slides_are_those_of_lengths(tmp_path):
    """Of a file for both kinds of joints, the unit may be that of either."""
    model = tmp_path / "my.urdf"
    body = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    links = "".join(f'<link name="{name}">{body}</inertial></link>' for name in "abt")
    joint = '<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/>'
    joint += '<limit lower="-1" upper="1" velocity="5" effort="9"/></joint>'
    joints = joint.format("rail", "prismatic", "a", "b") + joint.format("j", "revolute", "b", "t")
    model.write_text(f'<robot name="r">{links}{joints}</robot>')

    def velocity(text):
        (tmp_path / "my.limits.yaml").write_text(f"velocity: {text}")
        return load_arm(model, frame="t").limits.velocity.tolist()

    assert velocity("{value: {rail: 0.5}, unit: m/s}") == [0.5, 5.0]
    assert velocity("{value: [0.5, 2], unit: rad/s}") == [0.5, 2.0]
    with pytest.raises(InvalidInputError, match="unit: must be m/s, as rail slides, not 'rad/s'"):
        velocity("{value: {rail: 0.5}, unit: rad/s}")


@each(
    ("text", "message"),
    [
        ("velocty: {value: 2}", "velocty: no such key; nearest: velocity"),
        (
            "joints: [elbow_joint, elbow_joint]\nvelocity: {value: [1, 2]}",
            "joints: names elbow_joint twice",
        ),
        (
            "velocity: {value: {elbow_joint: 1, elbow_joint: 2}}",
            "the key 'elbow_joint' is given twice",
        ),
        ("velocity: 2", "velocity: must be a mapping of keys to values, not 2"),
        ("velocity: {}", "velocity.value: must be given"),
        ("velocity: {valu: 2}", "velocity.valu: no such key; nearest: value"),
        (
            "velocity: {value: 2, unit: deg/s}",
            "velocity.unit: must be rad/s or m/s, not 'deg/s'",
        ),
        (
            "velocity: {value: 2, unit: m/s}",
            "velocity.unit: must be rad/s, as shoulder_pan_joint turns, not 'm/s'",
        ),
        (
            "jerk: {value: {elbow_joint: 9}, unit: m/s^3}",
            "jerk.unit: must be rad/s^3, as elbow_joint turns, not 'm/s^3'",
        ),
        ("effort: {value: 60, unit: N}", "effort.unit: must be N m, as shoulder_pan_joint turns"),
        (
            "velocity: {value: [1, 2]}",
            "velocity.value: has 2 entries for 6 joints; name their joints with the key joints",
        ),
        (
            "joints: [elbow_joint]\nvelocity: {value: [1, 2]}",
            "velocity.value: has 2 entries for 1 joint",
        ),
        ("joints: [elbw]", "joints: no movable joint 'elbw' in the model; nearest: elbow_joint"),
        ("velocity: {value: {elbw: 1}}", "velocity: no movable joint 'elbw' in the model; nearest"),
        ("velocity: {value: none}", "velocity.value: must be numbers or unpublished, not 'none'"),
        ("velocity: {value: .nan}", "velocity.value: must be numbers, not nan"),
        ("effort: {value: -1}", "effort.value: must be positive, not -1"),
        (
            "velocity: {value: [1, 2, 3, 4, -2.5, 6]}",
            "velocity.value: must be positive, not -2.5, entry 5",
        ),
        (
            "velocity: {value: {elbow_joint: 0}}",
            "velocity.value: must be positive, not 0 for elbow_joint",
        ),
        (
            "joints: [elbow_joint, wrist_1_joint]\nvelocity: {value: [1, -2]}",
            "velocity.value: must be positive, not -2 for wrist_1_joint",
        ),
        (
            "position_lower: {value: {elbow_joint: 9}}",
            "position_lower: must be below position_upper, but they are 9 and 3.14159 for "
            "elbow_joint",
        ),
        ("- velocity", "must be a mapping of limits to their value and source"),
    ],
)
def test_a_file_that_cannot_be_is_refused_by_name(model, text, message):
    assert refusal(model, text).startswith(message)


def test_a_file_that_is_missing_is_refused(model):
    with pytest.raises(InvalidInputError, match=r"^arm\.limits: no file 'no\.yaml'$"):
        load_arm(model, frame="tool0", limits="no.yaml")


# Files of others.

MOVEIT = """
default_velocity_scaling_factor: 0.1
joint_limits:
  panda_joint1: {has_velocity_limits: true, max_velocity: 2, has_acceleration_limits: true,
                 max_acceleration: 3.75, has_jerk_limits: false, max_jerk: 0}
  panda_joint2: {max_velocity: 1, has_position_limits: true, min_position: -1, max_position: 1.5,
                 has_acceleration_limits: true, max_acceleration: 3, max_deceleration: -2}
  panda_joint3: {has_velocity_limits: false, max_velocity: 0, has_effort_limits: true,
                 max_effort: 40}
  panda_finger_joint1: {has_velocity_limits: true, max_velocity: 0.1}
"""
UR = """
joint_limits:
  shoulder_pan: {has_acceleration_limits: false, has_effort_limits: true, has_position_limits: true,
                 has_velocity_limits: true, max_effort: 100.0, max_position: !degrees  180.0,
                 max_velocity: !degrees 90.0, min_position: !degrees -180.0}
  elbow_joint: {has_position_limits: true, min_position: !radians -3, max_position: !radians 3}
"""
FRANKA = """
joint1: {limit: {lower: -2.5, upper: 2.5, velocity: 2.0, effort: 80},
         position_based_velocity_limits: {velocity_offset: 0.3, deceleration_limit: 6.0}}
joint2: {limit: {lower: -1.5, upper: 1.5, velocity: 1.0, effort: 80}}
"""
KORTEX = """
default_velocity_scaling_factor: 1
default_acceleration_scaling_factor: 1
joint_limits:
  $(arg prefix)joint_1: {has_velocity_limits: true, max_velocity: 1.33,
                         has_acceleration_limits: true, max_acceleration: 4.94}
  $(arg prefix)joint_7: {has_velocity_limits: true, max_velocity: 1.16}
  $(arg prefix)finger_joint: {has_velocity_limits: true, max_velocity: 2}
"""
LISTS = """
joint_names: [joint_1, joint_2]
joint_limits_min: [-1.0, -2.0]
joint_limits_max: [1.0, 2.0]
"""
TWO_TURNS = (
    "joint_limits: {panda_joint1: {has_position_limits: true, min_position: -170, "
    "max_position: 170}}"
)


def of_others(tmp_path, name, text):
    """An arm with another's file, and the experiment that runs with it."""
    file = tmp_path / "joint_limits.yaml"
    file.write_text(text)
    document = {
        "arm": {"model": name, "limits": str(file)},
        "path": {"kind": "circle", "size": 0.01, "period": 1},
        "law": {"kind": "pseudoinverse"},
        "period": 1e-3,
        "duration": 0.02,
        "on_unreachable": "follow",
    }
    experiment = make_experiment(document)
    assert simulate(experiment).metrics["position_error_max_m"] < 1e-3
    return experiment.arm, [w for w in experiment.warnings if w.startswith("arm.limits: ")]


def test_limits_of_moveit(tmp_path):
    """What is turned off is the model's; of two accelerations the smaller one counts."""
    model = load_arm("panda", limits=None)
    arm, told = of_others(tmp_path, "panda", MOVEIT)
    own = model.limits.velocity
    np.testing.assert_array_equal(arm.limits.velocity, [2, 1, *own[2:]])
    np.testing.assert_array_equal(
        arm.limits.acceleration, [3.75, 2, *model.limits.acceleration[2:]]
    )
    np.testing.assert_array_equal(
        arm.limits.position_upper[:2], [model.limits.position_upper[0], 1.5]
    )
    np.testing.assert_array_equal(arm.effort[:3], [87, 87, 40])
    assert arm.limits.jerk is None
    assert told == [
        "arm.limits: joint_limits.yaml: not used: default_velocity_scaling_factor; joints that "
        "the model has not: panda_finger_joint1; max_deceleration of panda_joint2 counts without "
        "has_deceleration_limits; max_velocity of panda_joint2 counts without has_velocity_limits"
    ]


@pytest.mark.parametrize(
    ("joints", "told"),
    [
        (
            "panda_joint1: {has_velocity_limits: true, max_velocty: 2}",
            "not used: max_velocty of panda_joint1 (nearest: max_velocity); has_velocity_limits of "
            "panda_joint1 is true without a value: the model's counts",
        ),
        (
            "panda_joint1: {has_jerk_limits: true}\n  panda_joint2: {has_jerk_limits: true, a: 1}",
            "not used: a of panda_joint2; has_jerk_limits of panda_joint1, panda_joint2 is true "
            "without a value: the model's counts",
        ),
        (
            "panda_joint1: {damping: 1}\n  panda_joint2: {damping: 1}",
            "not used: damping of panda_joint1, panda_joint2",
        ),
        (
            "panda_joint1: {has_position_limits: true, min_position: -1}",
            "has_position_limits of panda_joint1 is true with min_position alone",
        ),
        (
            "panda_joint1: {max_velocity: 1, has_velocty_limits: false}",
            "not used: has_velocty_limits of panda_joint1 (nearest: has_velocity_limits); "
            "max_velocity of panda_joint1 counts without has_velocity_limits",
        ),
        ("panda_joint1: {max_velocity: 1, has_velocity_limits: 'Yes'}", None),
    ],
)
def test_what_is_in_doubt_of_ros_limits_is_told_with_its_joints(tmp_path, joints, told):
    file = tmp_path / "joint_limits.yaml"
    file.write_text(f"joint_limits:\n  panda_joint4: {{lower: -3}}\n  {joints}\n")
    warnings = load_arm("panda", limits=str(file)).warnings
    assert warnings == (() if told is None else (f"arm.limits: joint_limits.yaml: {told}",))


@pytest.mark.parametrize("no", ["false", "no", "No", "OFF", "n", "'false'"])
def test_limits_are_turned_off_by_all_words_of_ros(tmp_path, no):
    """YAML 1.2 reads some of them as text, by which a limit was taken that was not meant."""
    file = tmp_path / "joint_limits.yaml"
    file.write_text(
        f"joint_limits: {{panda_joint1: {{has_velocity_limits: {no}, max_velocity: 0}}}}"
    )
    arm = load_arm("panda", limits=str(file))
    np.testing.assert_array_equal(arm.limits.velocity, load_arm("panda").limits.velocity)
    assert arm.warnings == ()


def test_limits_of_universal_robots(tmp_path):
    """Degrees are declared by a tag, and names lack an ending."""
    arm, told = of_others(tmp_path, "ur5", UR)
    np.testing.assert_allclose(arm.limits.position_upper[[0, 2]], [np.pi, 3], rtol=1e-15)
    np.testing.assert_allclose(arm.limits.velocity[0], np.pi / 2, rtol=1e-15)
    assert arm.effort[0] == 100.0
    assert not told


def test_limits_of_franka(tmp_path):
    """Names lack a prefix; the velocity falls towards the position limits."""
    arm, told = of_others(tmp_path, "fr3", FRANKA)
    np.testing.assert_array_equal(arm.limits.position_lower[:2], [-2.5, -1.5])
    np.testing.assert_array_equal(arm.limits.velocity[:2], [2.0, 1.0])
    np.testing.assert_array_equal(arm.effort[:2], [80, 80])
    assert (arm.limits.envelope_offset[0], arm.limits.envelope_deceleration[0]) == (0.3, 6.0)
    assert (arm.limits.envelope_offset[1], arm.limits.envelope_deceleration[1]) == (0.0, inf)
    assert not told


def test_limits_of_kinova(tmp_path):
    arm, told = of_others(tmp_path, "gen3", KORTEX)
    np.testing.assert_array_equal(arm.limits.velocity[[0, 6]], [1.33, 1.16])
    assert arm.limits.acceleration[0] == 4.94
    assert told == [
        "arm.limits: joint_limits.yaml: not used: default_velocity_scaling_factor, "
        "default_acceleration_scaling_factor; joints that the model has not: "
        "$(arg prefix)finger_joint"
    ]
    arm, told = of_others(tmp_path, "gen3", LISTS)
    np.testing.assert_array_equal(arm.limits.position_upper[:2], [1, 2])
    assert not told


def test_position_limits_in_degrees_are_suspected(tmp_path):
    file = tmp_path / "joint_limits.yaml"
    file.write_text(TWO_TURNS)
    assert load_arm("panda", limits=str(file)).warnings == (
        "arm.limits: joint_limits.yaml: position_lower: more than two turns; are they in degrees?",
    )


@each(
    ("text", "message"),
    [
        ("joint_names: [joint_1, joint_2]", "names 2 joints and states no limit; give the file of"),
        ("joint_limits: {a: {max_velocity: 1}}", "none of its joints is in the model: a; the mod"),
        (
            "joint_limits: {elbow_joint: {max_velocity: fast}}",
            "elbow_joint.max_velocity: must be a number, not 'fast'",
        ),
        (
            "joint_limits: {elbow_joint: {max_velocity: 0}}",
            "elbow_joint.max_velocity: must be positive, not 0",
        ),
        (
            "joint_limits: {shoulder_pan: {limit: {velocity: -2.5}}}",
            "shoulder_pan.velocity: must be positive, not -2.5",
        ),
        (
            "joint_limits: {elbow_joint: {max_deceleration: 0}}",
            "elbow_joint.max_deceleration: must be positive, not 0",
        ),
        (
            "joint_limits: {elbow_joint: {min_position: 2, max_position: 1}}",
            "elbow_joint.min_position: must be below max_position, 1, not 2",
        ),
        (
            "joint_limits: {elbow_joint: {limit: {lower: 2, upper: 1}}}",
            "elbow_joint.lower: must be below upper, 1, not 2",
        ),
        (
            "joint_limits: {elbow_joint: {min_position: 4}}",
            "position_lower: must be below position_upper, but they are 4 and 3.14159 for elbow_j",
        ),
        (
            "joint_names: [elbow_joint]\njoint_limits_min: [2]\njoint_limits_max: [1]",
            "elbow_joint.joint_limits_min: must be below joint_limits_max, 1, not 2",
        ),
        (
            "joint_names: [elbow_joint]\nmax_velocity: [-1]",
            "elbow_joint.max_velocity: must be positive, not -1",
        ),
        (
            "joint_names: [elbow_joint]\njoint_limits_min: [low]",
            "elbow_joint.joint_limits_min: must be a number, not 'low'",
        ),
        (
            "joint_names: [elbow_joint, elbow_joint]\njoint_limits_min: [1, 2]",
            "joint_names: names elbow_joint twice",
        ),
        (
            "joint_limits: {elbow_joint: {max_velocity: 1, has_velocity_limits: maybe}}",
            "elbow_joint.has_velocity_limits: must be true or false, not 'maybe'",
        ),
        (
            "joint_limits: {elbow_joint: {max_velocity: 1, has_velocity_limits: 1}}",
            "elbow_joint.has_velocity_limits: must be true or false, not 1",
        ),
        (
            "joint_limits: {elbow: {max_velocity: 1}, elbow_joint: {max_velocity: 2}}",
            "elbow_joint: is elbow_joint of the model, as elbow",
        ),
        (
            "joint_names: [elbow_joint]\njoint_limits_max: [1, 2]",
            "joint_limits_max: must have 1 entry, one for each joint",
        ),
        ("joint_limits: {elbow_joint: {max_velocity: !degrees x}}", "a value is not as its tag"),
        ("joint_limits: {elbow_joint: {max_velocity: !turns 1}}", "not a YAML document: line 1"),
    ],
)
def test_what_cannot_be_of_others_files_is_refused_by_name(model, text, message):
    assert refusal(model, text).startswith(message)

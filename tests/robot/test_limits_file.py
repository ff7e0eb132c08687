"""Files of joint limits beside a model or named in an arm's description."""

import numpy as np
import pytest
from numpy import inf

from drake_rnn import InvalidInputError, PlantArm, load_arm, load_experiment
from drake_rnn.models import MODELS

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


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("velocty: {value: 2}", "velocty: no such key; nearest: velocity"),
        ("velocity: 2", "velocity: must be a mapping of keys to values, not 2"),
        ("velocity: {}", "velocity.value: must be given"),
        ("velocity: {valu: 2}", "velocity.valu: no such key; nearest: value"),
        (
            "velocity: {value: 2, unit: deg/s}",
            "velocity.unit: must be rad/s or m/s, not 'deg/s'",
        ),
        (
            "velocity: {value: [1, 2]}",
            "velocity.value: has 2 entries for 6 joints; name their joints with the key joints",
        ),
        (
            "joints: [elbow_joint]\nvelocity: {value: [1, 2]}",
            "velocity.value: has 2 entries for 1 joints",
        ),
        ("joints: [elbw]", "joints: no movable joint 'elbw' in the model; nearest: elbow_joint"),
        ("velocity: {value: {elbw: 1}}", "velocity: no movable joint 'elbw' in the model; nearest"),
        ("velocity: {value: none}", "velocity.value: must be numbers or unpublished, not 'none'"),
        ("velocity: {value: .nan}", "velocity.value: must be numbers, not [nan]"),
        ("effort: {value: -1}", "effort.value: must be positive, not [-1.0]"),
        ("position_lower: {value: 9}", "position_lower: must be below position_upper"),
        ("- velocity", "must be a mapping of limits to their value and source"),
    ],
)
def test_a_file_that_cannot_be_is_refused_by_name(model, text, message):
    assert refusal(model, text).startswith(message)


def test_a_file_that_is_missing_is_refused(model):
    with pytest.raises(InvalidInputError, match=r"^arm\.limits: no file 'no\.yaml'$"):
        load_arm(model, frame="tool0", limits="no.yaml")

"""Experiments that seek a target posture: what is checked before they run."""

import re
from math import pi

import numpy as np
import pytest

from drake_rnn import InvalidInputError, load_arm, load_experiment, make_experiment
from drake_rnn.inputs.documents import parse_yaml
from drake_rnn.paths import Rest

MSA, NSA, SLC = "modified_state_adjustment", "null_space_adjustment", "slc_nephroid_known"
UR5 = load_arm("ur5").home
ON_UR5 = {"arm": "ur5", "start": None, "limits": {}, "law.target": UR5.tolist()}


def refusal(changes, name=MSA):
    """What the refusal says: always one line."""
    with pytest.raises(InvalidInputError) as caught:
        load_experiment(name, changes)
    message = str(caught.value)
    assert "\n" not in message
    return message


def moved(q, joint, by):
    return (np.asarray(q) + by * np.eye(len(q))[joint]).tolist()


# A target that cannot be reached.


@pytest.mark.parametrize("name", [MSA, NSA])
def test_the_papers_target_is_refused_with_the_way_off_it_and_the_nearest_posture(name):
    message = refusal({"on_unreachable": "refuse"}, name)
    assert message.startswith("law.target: moves the end effector 0.0223 m from where it starts")
    assert "0.0662 rad off in iiwa_joint_4" in message
    assert message.endswith("on_unreachable: project")


def test_the_posture_that_a_refusal_offers_is_accepted():
    """As printed, to 6 digits; and it is what would have been taken in the target's place."""
    message = refusal({"on_unreachable": "refuse"})
    offered = [float(q) for q in re.search(r"\[(.*)\]", message)[1].split(",")]
    experiment = load_experiment(MSA, {"on_unreachable": "refuse", "law.target": offered})
    assert experiment.warnings == ()
    np.testing.assert_array_equal(experiment.target, offered)
    np.testing.assert_allclose(load_experiment(MSA).target, offered, atol=5e-7)


def test_a_projected_target_is_said_to_be_one():
    experiment = load_experiment(MSA)
    (warning,) = experiment.warnings
    assert warning.startswith("law.target: moves the end effector 0.0223 m")
    assert warning.endswith("; that one is used instead")
    np.testing.assert_array_equal(experiment.law.target, experiment.target)
    kinematics = experiment.arm.kinematics()
    np.testing.assert_allclose(
        kinematics.p_WE(experiment.target), experiment.p_WE_start, atol=1e-10
    )


def test_a_pose_is_left_by_more_than_its_position():
    message = refusal({"on_unreachable": "refuse", "task": "pose"})
    assert "0.0223 m from where it starts and turns it by 0.861 rad" in message
    experiment = load_experiment(MSA, {"task": "pose"})
    np.testing.assert_allclose(
        experiment.arm.kinematics().R_WE(experiment.target), experiment.R_WE_start, atol=1e-9
    )


def test_a_target_to_which_no_way_leads_is_refused_though_the_end_effector_is_in_its_place():
    """The shoulder of the iiwa turned over: joint 2 comes from the other side."""
    start = np.array([0.3, 0.6, 0.2, -1.2, 0.4, 0.7, 0.0])
    over = start * [1, -1, 1, 1, 1, 1, 1] - np.array([pi, 0, pi, 0, 0, 0, 0])
    changes = {"start": start.tolist(), "law.target": over.tolist()}
    message = refusal({**changes, "on_unreachable": "refuse"})
    assert message.startswith("law.target: is not reached by the self-motion from the start")
    load_experiment(MSA, changes)


def test_an_arm_without_self_motion_is_refused():
    message = refusal({**ON_UR5, "task": "pose"})
    assert message.startswith("task: pose leaves ur5 no self-motion at its start")
    assert "0 free dimensions" in message
    assert load_experiment(MSA, ON_UR5).warnings == ()


# What a law asks of the period.


def test_without_feedback_longer_periods_will_do():
    load_experiment(NSA, {"period": 0.019})
    load_experiment(NSA, {"period": 0.04, "law.feedback": 0})


# A start outside the limits.


def outside(excess):
    """The paper's start, that far beyond the limit of joint 1, towards which it goes."""
    experiment = load_experiment(MSA)
    upper = [experiment.start[0] - excess, *experiment.limits.position_upper[1:]]
    return {"limits.position_upper": upper}


def test_a_start_a_little_outside_its_limits_is_brought_back_by_a_law_that_can():
    experiment = load_experiment(MSA, outside(0.05))
    assert (
        "start: iiwa_joint_1 is at 0.981028 rad, 0.05 rad outside its limits"
        in experiment.warnings[0]
    )
    assert not experiment.limits.violation(experiment.target).any()


def test_a_start_far_outside_its_limits_is_refused():
    message = refusal(outside(0.25))
    assert message == "start: iiwa_joint_1 is at 0.981028 rad; it may be -2.96706 to 0.731028"


def test_a_law_that_follows_a_path_must_not_start_far_outside_the_limits():
    upper = load_arm("panda").limits.position_upper.tolist()
    message = refusal({"limits.position_upper": [-0.25, *upper[1:]]}, SLC)
    assert message == "start: panda_joint1 is at 0 rad; it may be -2.8973 to -0.25"


@pytest.mark.parametrize("joint", range(7))
def test_a_target_in_place_of_another_lies_within_the_limits_though_the_start_does_not(joint):
    """Else the law would refuse what is offered to it."""
    experiment = load_experiment(MSA)
    lower, upper = experiment.limits.position_lower.copy(), experiment.limits.position_upper.copy()
    # Joint 6 is near its lower limit.
    way = 1.0 if joint == 5 else -1.0
    (lower if way > 0 else upper)[joint] = experiment.start[joint] + way * 0.05
    target = experiment.start + 0.3 * np.linspace(-1, 1, 7) * (np.arange(7) != 5)
    target[joint] = experiment.start[joint] + way * 0.051
    changes = {"position_lower": lower.tolist(), "position_upper": upper.tolist(), "velocity": 1.5}
    made = load_experiment(MSA, {"limits": changes, "law.target": target.tolist()})
    assert not made.limits.violation(made.target).any()
    assert "that one is used instead" in made.warnings[1]


# Detours.


@pytest.mark.parametrize("way", [1, -1])
def test_a_joint_that_goes_more_than_half_a_turn_is_warned_of(way):
    """The last joint of the UR5 turns the flange about its own axis."""
    experiment = load_experiment(MSA, {**ON_UR5, "law.target": moved(UR5, 5, way * 3.3)})
    (warning,) = experiment.warnings
    assert "wrist_3_joint has to turn by 3.3 rad" in warning
    nearer = way * (3.3 - 2 * pi)
    assert f"at {nearer:.6g} rad the posture is the same, and nearer" in warning


def test_half_a_turn_or_one_that_has_no_other_way_is_not():
    half = load_experiment(MSA, {**ON_UR5, "law.target": moved(UR5, 5, 3.1)})
    assert half.warnings == ()
    limits = {"position_lower": [*[-2 * pi] * 5, -1]}
    only = load_experiment(MSA, {**ON_UR5, "limits": limits, "law.target": moved(UR5, 5, 3.3)})
    assert not any("has to turn" in warning for warning in only.warnings)


# Documents.


@pytest.mark.parametrize("name", [MSA, NSA, SLC])
def test_a_document_is_read_back_as_it_was_with_and_without_a_path(name):
    experiment = load_experiment(name)
    document = parse_yaml(experiment.document.to_yaml(), name)
    assert ("path" in document) == (name == SLC)
    again = make_experiment(document)
    assert again.document.contents() == experiment.document.contents()
    assert again.warnings == experiment.warnings
    assert type(again.path) is type(experiment.path)
    if name != SLC:
        assert isinstance(again.path, Rest)
        np.testing.assert_array_equal(again.target, experiment.target)


def test_an_offered_posture_at_a_limit_can_be_given_back():
    """Six decimals of 17/18 pi lie outside it."""
    document = load_experiment("modified_state_adjustment").document.contents()
    upper = document["limits"]["position_upper"]
    target = [*document["law"]["target"][:6], upper[6]]
    changes = {"law.target": target, "on_unreachable": "refuse"}
    with pytest.raises(InvalidInputError) as caught:
        load_experiment("modified_state_adjustment", changes)
    offered = re.search(r"is \[(.*?)\]", str(caught.value)).group(1)
    assert float(offered.split(", ")[6]) <= upper[6]
    changes["law.target"] = [float(number) for number in offered.split(", ")]
    load_experiment("modified_state_adjustment", changes)


@pytest.mark.parametrize("name", ["position_lower", "position_upper", "velocity"])
def test_limits_of_another_arm_are_refused_by_their_own_name(name):
    message = f"limits.{name}: must have 7 entries, one per joint of iiwa14, not 6"
    with pytest.raises(InvalidInputError, match=message):
        load_experiment(MSA, {f"limits.{name}": [1.0] * 6})


def test_limits_beyond_what_the_arm_can_are_warned_of():
    upper = [*load_experiment(MSA).document.contents()["limits"]["position_upper"][:6], 4.0]
    warnings = load_experiment(MSA, {"limits.position_upper": upper}).warnings
    assert any("iiwa_joint_7 may go 0.946 rad beyond the limits of iiwa14" in w for w in warnings)


def test_a_planar_task_that_lets_the_end_effector_leave_its_plane_is_refused():
    with pytest.raises(InvalidInputError, match="task: xy leaves the end effector free along z"):
        load_experiment(MSA, {"task": "xy"})


def test_bounds_that_open_must_be_there():
    message = "law.rise_time: needs a velocity limit for every joint, but joint 1 has none"
    with pytest.raises(InvalidInputError, match=message):
        load_experiment(MSA, {"limits": "none"})

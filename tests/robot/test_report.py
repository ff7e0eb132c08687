"""Figures of an arm, and what is missing."""

import re
from pathlib import Path

import numpy as np
import pytest

from drake_rnn import arm_report, load_arm, shipped_arms
from drake_rnn.models import MODELS

UR5 = str(MODELS / "ur5" / "ur5.urdf")


def ur5(**changes):
    return load_arm(UR5, frame="tool0", **changes)


def warning(report, key):
    found = [text for text in report.warnings if text.startswith(f"{key}: ")]
    assert len(found) <= 1
    return found[0] if found else None


@pytest.mark.parametrize("name", ["panda", "iiwa14"])
def test_of_an_arm_that_is_known_in_full_nothing_is_missing(name):
    report = arm_report(load_arm(name))
    assert report.warnings == ()
    assert report.carries_itself
    assert not report.home_is_proposed


@pytest.mark.parametrize(
    ("name", "length"), [("planar6", 1.2), ("iiwa14", 0.36 + 0.42 + 0.4 + 0.126)]
)
def test_the_reach_is_within_the_length_of_the_arm_and_near_it(name, length):
    smallest, largest = arm_report(load_arm(name)).reach
    assert 0.0 <= smallest < 0.2 * length
    assert 0.9 * length < largest <= length


def test_a_model_in_millimetres_is_told_and_not_called_massless(tmp_path):
    """Its mass matrix has lengths squared beside what is about the last axis."""
    text = Path(UR5).read_text()
    lengths = re.compile(r'(<origin [^>]*xyz=")([^"]*)"')

    def in_millimetres(match):
        return match[1] + " ".join(str(1e3 * float(x)) for x in match[2].split()) + '"'

    file = tmp_path / "mm.urdf"
    file.write_text(lengths.sub(in_millimetres, text))
    report = arm_report(load_arm(str(file), frame="tool0"))
    assert " m; lengths are in metres: are these millimetres?" in warning(report, "model")
    assert warning(report, "mass") is None


def test_inertia_bounds_the_kinetic_energy():
    """At postures of its own: within the extremes of others, with some room."""
    arm = load_arm("panda")
    smallest, largest = arm_report(arm).inertia
    rng = np.random.default_rng(7)
    for q in rng.uniform(arm.limits.position_lower, arm.limits.position_upper, (20, 7)):
        v = rng.standard_normal(7)
        ratio = v @ arm.kinematics().M(q) @ v / (v @ v)
        assert 0.9 * smallest < ratio < 1.1 * largest


def test_the_planar_arm_stretched_out_is_its_heaviest_posture():
    """30 kg at 0.6 m; random postures come within 20 %."""
    report = arm_report(load_arm("planar6"))
    assert 0.8 < report.weight_torque[0] / (30 * 9.81 * 0.6) <= 1.0
    assert report.mass == pytest.approx(35.0)
    np.testing.assert_allclose(report.weight_share, report.weight_torque / 200, rtol=1e-14)


@pytest.mark.long
def test_a_load_that_a_motor_cannot_hold_is_told():
    home = load_arm("ur5").home
    report = arm_report(ur5(tool={"mass": 20.0, "length": 0.3}, home=home))
    assert not report.carries_itself
    told = [text for text in report.warnings if "cannot hold the weight" in text]
    assert any("shoulder_lift_joint" in text and "150 Nm" in text for text in told)
    assert arm_report(ur5(tool={"mass": 0.2}, home=home)).carries_itself


def test_what_a_model_does_not_say_is_told_by_name(tmp_path):
    text = (MODELS / "ur5" / "ur5.urdf").read_text()
    file = tmp_path / "bare.urdf"
    head, last = text[: text.rindex('effort="28"')], text[text.rindex('effort="28"') :]
    file.write_text(head + last.replace('effort="28"', 'effort="0"', 1))
    report = arm_report(load_arm(file, frame="tool0"), postures=20)
    assert "wrist_3_joint" in warning(report, "effort")
    assert "all joints" in warning(report, "acceleration")
    assert "not given" in warning(report, "home")
    assert warning(report, "tool").startswith("tool: none")
    assert report.home_is_proposed
    tooled = ur5(tool={}, home=load_arm("ur5").home)
    assert warning(arm_report(tooled, postures=20), "tool") is None


def test_a_home_near_a_limit_or_a_singularity_is_told():
    home = load_arm("panda").home.copy()
    home[3] = -0.0698 - 0.01
    near = arm_report(load_arm("panda", home=home), postures=20)
    assert "panda_joint4" in warning(near, "home")
    stretched = load_arm("iiwa14", home=[0.0, 0.3, 0.0, 0.0, 0.0, 0.3, 0.0])
    assert "near-singular" in warning(arm_report(stretched, postures=20), "home")


@pytest.mark.parametrize("name", shipped_arms())
def test_figures_repeat(name):
    arm = load_arm(name)
    one, other = arm_report(arm, 50), arm_report(arm, 50)
    assert (one.reach, one.inertia) == (other.reach, other.inertia)
    np.testing.assert_array_equal(one.weight_torque, other.weight_torque)


def test_a_model_without_inertia_is_told_of(tmp_path):
    links = "".join(f'<link name="l{k}"/>' for k in range(3))
    joints = "".join(
        f'<joint name="j{k}" type="revolute"><parent link="l{k}"/><child link="l{k + 1}"/>'
        '<origin xyz="0 0 0.3"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="1" '
        'effort="9"/></joint>'
        for k in range(2)
    )
    file = tmp_path / "bare.urdf"
    file.write_text(f'<robot name="bare">{links}{joints}</robot>')
    warnings = arm_report(load_arm(file, frame="l2"), postures=5).warnings
    assert (
        "inertia: none; the model states no mass, so the weights above say nothing, and level: "
        "dynamic is refused"
    ) in warnings

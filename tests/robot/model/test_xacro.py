"""xacro: expanded where it is installed, else refused with what to do."""

import pytest
from model_files import LIMIT, five, refusal, same_kinematics, urdf, write

from drake_rnn import load_arm
from drake_rnn.robot.model import ros_packages as expansion

pytest.importorskip("xacro")


def macros(text):
    """The same arm, with its limits and its hand in macros."""
    opening = (
        '<robot name="five" xmlns:xacro="http://ros.org/wiki/xacro">'
        '<xacro:arg name="speed" default="1.5"/><xacro:property name="reach" value="${4 / 2}"/>'
    )
    limit = 'lower="-${reach}" upper="${reach}" effort="200" velocity="$(arg speed)"'
    return text.replace(LIMIT, limit).replace('<robot name="five">', opening)


def test_macros_are_expanded_with_their_defaults(tmp_path):
    arm = load_arm(write(tmp_path, "arm.urdf.xacro", macros(urdf())), frame="tip")
    same_kinematics(arm, five(tmp_path))
    assert arm.limits.velocity.tolist() == [1.5] * 5
    assert arm.limits.position_upper.tolist() == [2.0] * 5
    assert load_arm(write(tmp_path, "unexpanded.urdf", macros(urdf())), frame="tip").n == 5


def test_files_of_packages_are_included(tmp_path):
    part = urdf().replace('<robot name="five">', "<robot>")
    write(tmp_path, "five_support/macros/five.xacro", part)
    include = '<xacro:include filename="$(find five_support)/macros/five.xacro"/>'
    text = f'<robot name="five" xmlns:xacro="http://ros.org/wiki/xacro">{include}</robot>'
    same_kinematics(
        load_arm(write(tmp_path, "five_moveit/five.xacro", text), frame="tip"), five(tmp_path)
    )
    lost = write(tmp_path, "five.xacro", text.replace("five_support", "nowhere"))
    assert refusal(lost, frame="tip") == (
        f"arm.model: {lost} names the unknown package 'nowhere'; give its folder in arm.packages"
    )


def test_what_cannot_be_expanded_is_refused_with_what_to_do(tmp_path, monkeypatch):
    needy = macros(urdf()).replace('<xacro:arg name="speed" default="1.5"/>', "")
    file = write(tmp_path, "needy.urdf.xacro", needy)
    assert refusal(file, frame="tip") == (
        f"arm.model: {file} needs the argument 'speed'; give it in arm.xacro_arguments: "
        "{speed: ...}"
    )
    given = load_arm(file, frame="tip", xacro_arguments={"speed": 0.5})
    assert given.limits.velocity.tolist() == [0.5] * 5
    whole = write(tmp_path, "whole.urdf.xacro", macros(urdf()))
    assert refusal(whole, frame="tip", xacro_arguments={"sped": 1}) == (
        "arm.xacro_arguments.sped: whole.urdf.xacro has no such argument; nearest: speed"
    )
    bare = write(tmp_path, "bare.urdf", urdf())
    assert refusal(bare, frame="tip", xacro_arguments={"speed": 1}) == (
        "arm.xacro_arguments: bare.urdf has no macros"
    )
    monkeypatch.setattr(expansion, "xacro", None)
    assert refusal(file, frame="tip") == (
        f"arm.model: {file} is a xacro file; expand it with `xacro needy.urdf.xacro > needy.urdf`, "
        "or pip install 'xacro>=2.0'"
    )


def test_a_file_of_macros_alone_is_refused(tmp_path):
    inside = urdf().removeprefix('<robot name="five">').removesuffix("</robot>")
    only = f'<xacro:macro name="five" params="">{inside}</xacro:macro>'
    text = f'<robot xmlns:xacro="http://ros.org/wiki/xacro">{only}</robot>'
    file = write(tmp_path, "five_macro.xacro", text)
    assert refusal(file, frame="tip") == (
        f"arm.model: {file} defines macros and uses none, so it has no links; give the file that "
        "uses them"
    )

"""xacro: expanded where it is installed, else refused with what to do."""

import pytest
from model_files import LIMIT, five, refusal, same_kinematics, urdf, write

from drake_rnn import load_arm
from drake_rnn.robot.model import packages as expansion

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
    needy = macros(urdf()).replace(' default="1.5"', "")
    file = write(tmp_path, "needy.urdf.xacro", needy)
    message = refusal(file, frame="tip")
    assert message.startswith(f"arm.model: {file} cannot be expanded: ")
    assert message.endswith(
        "; expand it with `xacro needy.urdf.xacro > needy.urdf`, with the arguments that it needs"
    )
    monkeypatch.setattr(expansion, "xacro", None)
    assert refusal(file, frame="tip") == (
        f"arm.model: {file} is a xacro file; expand it with `xacro needy.urdf.xacro > needy.urdf`, "
        "or pip install 'xacro>=2.0'"
    )

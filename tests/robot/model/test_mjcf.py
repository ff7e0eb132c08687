"""MJCF as MuJoCo reads it: frames, limits, efforts and order of joints have MuJoCo's values.

Numbers are those of MuJoCo 4.0 (`mj_kinematics`, `qfrc_actuator` at the ends of the controls).
"""

import numpy as np
import pytest
from model_files import refusal, write

from drake_rnn import load_arm

# Classes, frames, orientations of every kind, two joints of one body, `ref`, gears.
WHOLE = """
<mujoco>
  <compiler eulerseq="zyx"/>
  <default>
    <site quat="0 1 0 0"/>
    <general gear="2"/>
    <default class="tool">
      <site pos="0 0 0.1" euler="90 0 0"/><joint axis="0 1 0" range="-100 80"/>
    </default>
  </default>
  <worldbody>
    <body name="base" pos="0.1 0 0">
      <joint name="a" axis="0 0 1" range="-170 170" actuatorfrcrange="-9 9"/>
      <geom size="0.05"/>
      <frame pos="0 0 0.3" euler="30 0 0" childclass="tool">
        <body name="link" pos="0.2 0 0">
          <joint name="b" ref="20"/>
          <joint name="c" type="slide" axis="1 0 0" range="-1 1" ref="0.05"/>
          <geom size="0.05"/>
          <site name="one"/>
          <body name="last" zaxis="1 1 0">
            <joint name="e" pos="0 0 0.1"/>
            <geom size="0.05"/>
            <site name="two" pos="0.1 0 0" axisangle="0 0 1 45"/>
            <site name="three" class="main" type="capsule" size="0.01" fromto="0 0 0 0.3 0 0.4"/>
            <frame pos="0 0.1 0"><frame euler="0 90 0">
              <site name="four" class="main" pos="0.2 0 0"/>
            </frame></frame>
          </body>
        </body>
      </frame>
    </body>
  </worldbody>
  <actuator>
    <motor joint="a" ctrlrange="-6 6"/>
    <motor joint="b" ctrlrange="-3 3" gear="-20"/>
    <position joint="c" kp="100" forcerange="-4 7"/>
    <motor joint="e" ctrlrange="-1 1"/><velocity joint="e" kv="5" forcerange="-3 3" gear="1"/>
  </actuator>
  <keyframe><key name="home" qpos="0.3 -0.5 0.1 0.7"/></keyframe>
</mujoco>
"""
POSTURE = {"a": 0.3, "b": -0.5, "c": 0.1, "e": 0.7}
PLACES = {
    "one": (
        [0.20735268959382186, 0.11588464295601603, 0.4036016443331646],
        [-0.7335962508631503, -0.44899176237988797, -0.510140116080408],
    ),
    "two": (
        [0.2780825218937933, 0.1407983764726787, 0.3147124590863551],
        [0.44351065864449296, -0.7695865460781638, 0.4593852890158864],
    ),
    "three": (
        [0.4128490426818624, 0.2889914529364098, 0.36346486377467463],
        [-0.4106002343487371, -0.23057047118577, -0.8821817870314108],
    ),
    "four": (
        [0.07736949100225538, 0.05664355963041148, 0.20231919401866083],
        [-0.45938528901588654, 0.23057047118577007, -0.8577892596978363],
    ),
}


@pytest.mark.parametrize("site", PLACES)
def test_sites_are_where_mujoco_has_them(tmp_path, site):
    arm = load_arm(write(tmp_path, "whole.xml", WHOLE), frame=site)
    q = np.array([POSTURE[name] for name in arm.joints])
    p_WE, first_row = PLACES[site]
    np.testing.assert_allclose(arm.kinematics().p_WE(q), p_WE, atol=1e-15)
    np.testing.assert_allclose(arm.kinematics().R_WE(q)[0], first_row, atol=1e-15)


def test_joints_limits_and_efforts_are_those_of_mujoco(tmp_path):
    """The effort of c is -8 to 14 N, of which the smaller one counts, with a warning."""
    arm = load_arm(write(tmp_path, "whole.xml", WHOLE), frame="two", home="home")
    assert arm.joints == ("a", "b", "c", "e")
    degrees = np.pi / 180.0
    lower = [-170 * degrees, -100 * degrees, -1, -100 * degrees]
    upper = [170 * degrees, 80 * degrees, 1, 80 * degrees]
    np.testing.assert_allclose(arm.limits.position_lower, lower, rtol=1e-15)
    np.testing.assert_allclose(arm.limits.position_upper, upper, rtol=1e-15)
    np.testing.assert_allclose(arm.effort, [9, 60, 8, 5], rtol=1e-15)
    np.testing.assert_array_equal(arm.home, [0.3, -0.5, 0.1, 0.7])
    assert arm.warnings == (
        "arm.model: whole.xml: efforts that differ by direction count as the smaller one: c (-8 to "
        "14)",
    )


HAND = """<mujoco model="hand"><compiler angle="radian"/>
  <default><default class="k"><joint range="-1 1" axis="0 1 0"/>
    <motor ctrlrange="-3 3" gear="2"/></default></default>
  <worldbody><body name="palm" pos="1 0 0" childclass="k"><joint name="j"/><geom size=".1"/>
    <body name="tip" pos="0 0 .5" euler="0 0 1.5"><joint name="j2" actuatorfrcrange="-4 4"/>
      <geom size=".1"/><site name="s" pos=".1 0 0"/></body></body></worldbody>
  <actuator><motor joint="j" name="m1" class="k"/></actuator>
  <keyframe><key name="home" qpos="0.1 0.2"/></keyframe></mujoco>"""
HOST = """<mujoco><asset><model name="hand" file="hand.xml"/></asset><worldbody>
  <body name="A" pos="0 0 1"><joint name="a"/><geom size=".1"/>
    <frame pos="0 0 .2" euler="0 0 90"><attach model="hand" body="palm" prefix="left-"/></frame>
  </body></worldbody></mujoco>"""


def test_a_model_is_attached_with_its_own_units_and_classes(tmp_path):
    write(tmp_path, "hand.xml", HAND)
    arm = load_arm(write(tmp_path, "host.xml", HOST), frame="left-s")
    assert arm.joints == ("a", "left-j", "left-j2")
    place = arm.kinematics().p_WE(np.array([0.3, 0.2, -0.4]))
    np.testing.assert_allclose(
        place, [-0.4168208404755514, 1.036574755437628, 1.7269044833304728], atol=1e-15
    )
    np.testing.assert_array_equal(arm.limits.position_upper, [np.inf, 1, 1])
    np.testing.assert_array_equal(arm.effort, [np.inf, 6, 4])
    lost = write(tmp_path, "lost.xml", HOST.replace("hand.xml", "no.xml"))
    assert refusal(lost, frame="s") == (
        "arm.model: the file 'no.xml' that it attaches cannot be read"
    )
    itself = write(tmp_path, "itself.xml", HOST.replace("hand.xml", "itself.xml"))
    assert refusal(itself, frame="s") == (
        "arm.model: its files include or attach each other without end"
    )


def arm_of(tmp_path, joint="", body="", more="", head=""):
    """A joint about z with a site 0.2 m along x."""
    text = (
        f'<mujoco>{head}<worldbody><body name="l"><joint name="j" axis="0 0 1" {joint}/>'
        f'<geom size="0.05"/><site name="s" pos="0.2 0 0"/>{body}</body></worldbody>{more}</mujoco>'
    )
    return write(tmp_path, "arm.xml", text)


def test_a_site_with_the_name_of_a_body_is_a_frame_of_another_name(tmp_path):
    file = arm_of(tmp_path, body='<site name="l" pos="0 0 0.3"/>')
    arm = load_arm(file, frame="l_site")
    np.testing.assert_allclose(arm.kinematics().p_WE(np.zeros(1)), [0, 0, 0.3], atol=1e-15)
    assert arm.warnings == (
        "arm.model: arm.xml: sites with the name of a body are frames called NAME_site: l",
    )


def test_replicas_are_placed_from_each_other(tmp_path):
    body = (
        '<replicate count="3" offset="1 0 0" euler="0 0 90" sep="-">'
        '<site name="r" pos="0 0 0.5"/></replicate>'
    )
    file = arm_of(tmp_path, body=body)
    for name, place in (("r-0", [0, 0, 0.5]), ("r-1", [1, 0, 0.5]), ("r-2", [1, 1, 0.5])):
        arm = load_arm(file, frame=name)
        np.testing.assert_allclose(arm.kinematics().p_WE(np.zeros(1)), place, atol=1e-15)


@pytest.mark.parametrize(
    ("joint", "head", "upper"),
    [
        ('range="-90 90"', "", np.pi / 2),
        ('range="-90 90" limited="false"', "", np.inf),
        ('range="-90 90"', '<compiler autolimits="false"/>', np.inf),
        ('range="-90 90" limited="true"', '<compiler autolimits="false"/>', np.pi / 2),
        ('range="-1 1"', '<compiler angle="degree"/><compiler angle="radian"/>', 1.0),
    ],
)
def test_limits_count_as_flags_and_settings_say(tmp_path, joint, head, upper):
    arm = load_arm(arm_of(tmp_path, joint=joint, head=head), frame="s")
    np.testing.assert_allclose(arm.limits.position_upper, [upper], rtol=1e-15)


@pytest.mark.parametrize(
    ("drives", "effort"),
    [
        ('<motor joint="j" ctrlrange="-1 1" gear="60"/>', 60),
        ('<motor joint="j" ctrlrange="-1 1" ctrllimited="false" gear="60"/>', np.inf),
        ('<motor joint="j" forcerange="-5 5" gear="3"/>', 15),
        ('<position joint="j" kp="9" ctrlrange="-1 1"/>', np.inf),
        ('<general joint="j" gainprm="7" ctrlrange="-2 2"/>', 14),
        ('<general joint="j" gainprm="7" biastype="affine" ctrlrange="-2 2"/>', np.inf),
        ('<position joint="j" forcerange="-5 5"/><velocity joint="j" forcerange="-2 2"/>', 7),
        ('<motor jointinparent="j" ctrlrange="-3 3"/>', 3),
        ('<motor site="s" ctrlrange="-3 3"/>', np.inf),
    ],
)
def test_efforts_are_what_actuators_exert_together(tmp_path, drives, effort):
    arm = load_arm(arm_of(tmp_path, more=f"<actuator>{drives}</actuator>"), frame="s")
    np.testing.assert_array_equal(arm.effort, [effort])
    bounded = load_arm(
        arm_of(tmp_path, 'actuatorfrcrange="-4 4"', more=f"<actuator>{drives}</actuator>"),
        frame="s",
    )
    np.testing.assert_array_equal(bounded.effort, [min(effort, 4)])


def test_efforts_of_classes_are_shared_by_all_kinds_of_actuators(tmp_path):
    head = '<default><position forcerange="-7 7"/><general gear="2"/></default>'
    more = '<actuator><motor joint="j"/></actuator>'
    np.testing.assert_array_equal(
        load_arm(arm_of(tmp_path, head=head, more=more), frame="s").effort, 14
    )


FINGER = (
    '<body name="f"><joint name="k" axis="0 1 0"/><geom size="0.05"/>'
    '<site name="t" pos="0 0 0.1"/></body>'
)


def test_joints_that_follow_others_are_held_where_they_follow(tmp_path):
    """k = 0.1 + 2 j; alone it is held at 0.1."""
    rule = '<equality><joint joint1="k" joint2="j" polycoef="0.1 2 0 0 0"/></equality>'
    file = arm_of(tmp_path, body=FINGER, more=rule)
    assert refusal(file, frame="t").startswith("arm.joints: 'k' follows 'j' (mimic)")
    arm = load_arm(file, frame="t", joints=["j"], lock={})
    assert "k should follow a controlled joint (mimic), and is held still" in arm.warnings[-1]
    moved = FINGER.replace('"f">', '"f"><joint name="i"/>')
    longer = write(tmp_path, "longer.xml", arm_of(tmp_path, body=moved, more=rule).read_text())
    assert refusal(longer, frame="t", lock={"j": 0.2, "k": 0.3}) == (
        "arm.lock.k: 'k' follows 'j' (mimic), which is locked and is at 0.5 then, not 0.3; leave "
        "it out"
    )
    alone = '<equality><joint joint1="k" polycoef="0.4"/></equality>'
    fixed = arm_of(tmp_path, body=FINGER, more=alone)
    assert refusal(fixed, frame="t").startswith("arm.joints: 'k' is held at 0.4 by the model")
    arm = load_arm(fixed, frame="t", joints=["j"])
    place = [0.1 * np.sin(0.4), 0, 0.1 * np.cos(0.4)]
    np.testing.assert_allclose(arm.kinematics().p_WE(np.zeros(1)), place, atol=1e-15)
    curve = rule.replace("2 0 0 0", "2 1 0 0")
    (told,) = load_arm(arm_of(tmp_path, body=FINGER, more=curve), frame="t").warnings
    assert told.endswith("joints that follow another by a curve move on their own: k")
    strange = '<equality><joint joint1="k" joint2="J"/></equality>'
    told = load_arm(arm_of(tmp_path, body=FINGER, more=strange), frame="t", joints=["j"]).warnings
    assert any(
        each.endswith("left out are equalities of joints that are not in the model: J")
        for each in told
    )


def test_keyframes_are_postures_of_the_joints_that_they_name(tmp_path):
    """Of seven positions of a free base, then the joint."""
    keys = (
        '<keyframe><key name="up" qpos="0 0 0 1 0 0 0 0.7"/><key qpos="0 0 0 1 0 0 0 0.2"/>'
        '<key name="short" qpos="1"/></keyframe>'
    )
    text = (
        '<mujoco><worldbody><body name="b"><freejoint/><geom size="0.1"/><body name="l">'
        '<joint name="j"/><geom size="0.1"/></body></body></worldbody>' + keys + "</mujoco>"
    )
    arm = load_arm(write(tmp_path, "free.xml", text), frame="l")
    assert {name: q.tolist() for name, q in arm.postures.items()} == {"up": [0.7], "key1": [0.2]}
    assert arm.warnings[0].endswith("of other sizes are left out: short (1 positions of 8)")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<mujocoinclude/>", "part.xml is a part that models include (mujocoinclude); give the mo"),
        ("<scene/>", "part.xml is no URDF, SDF or MJCF: its outermost element is <scene>"),
        (
            '<mujoco><compiler coordinate="global"/></mujoco>',
            "coordinate: global is read by Mu",
        ),
        (
            '<mujoco><worldbody><body><joint name="j" range="2 1"/></body></worldbody></mujoco>',
            "the limits of 'j': lower is 0.0349066, and must be below upper, 0.0174533",
        ),
        (
            '<mujoco><worldbody><body><joint name="j" type="fixed"/></body></worldbody></mujoco>',
            "part.xml cannot be read: the joint 'j' may be hinge, slide, ball, free, not 'fixed'",
        ),
        (
            '<mujoco><worldbody><body><joint class="no"/></body></worldbody></mujoco>',
            "part.xml cannot be read: no class 'no' of defaults",
        ),
        (
            '<mujoco><worldbody><body name="a" quat="1 0"/></worldbody></mujoco>',
            "part.xml cannot be read: quat of 'a' must be 4 numbers, not '1 0'",
        ),
        (
            '<mujoco><worldbody><replicate count="1e9"/></worldbody></mujoco>',
            "part.xml cannot be read: count of a replica must be 1 to 1000, not '1e9'",
        ),
        (
            '<mujoco><worldbody><attach model="m"/></worldbody></mujoco>',
            "it attaches the model 'm', which it has not",
        ),
    ],
)
def test_what_is_not_read_is_refused_in_our_words(tmp_path, text, message):
    told = refusal(write(tmp_path, "part.xml", text), frame="s").replace(f"{tmp_path}/", "")
    assert told.startswith(f"arm.model: {message}")

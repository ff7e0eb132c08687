"""MJCF as in MuJoCo Menagerie, and SDF, with meshes."""

import numpy as np
import pytest
from model_files import START, experiment, refusal, write, write_box
from pydrake.geometry import Role
from pydrake.multibody.plant import MultibodyPlant

from drake_rnn import InvalidInputError, load_arm, make_experiment, simulate, write_playback
from scene_helpers import extents

AXES = ("0 0 1", "0 1 0", "0 1 0", "0 0 1", "0 1 0")


def mjcf(ending="stl", missing=""):
    """An arm of five joints in the manner of MuJoCo Menagerie."""
    bodies, end = "", ""
    for number, axis in enumerate(AXES, start=1):
        place = "0.2 0 0" if number > 1 else "0 0 0"
        bodies += (
            f'<body name="link{number}" pos="{place}"><inertial pos="0 0 0" mass="2" '
            'diaginertia="0.02 0.02 0.02"/>'
            f'<joint name="joint{number}" axis="{axis}"/>'
            '<geom class="visual" mesh="hand"/><geom class="collision" mesh="hand"/>'
        )
        end += "</body>"
    extra = '<mesh file="nowhere.stl"/>' if missing else ""
    lost = '<geom class="visual" mesh="nowhere"/>' if missing else ""
    drives = "".join(
        f'<general class="five" name="drive{number}" joint="joint{number}"/>'
        for number in range(1, 6)
    )
    return f"""<mujoco model="five">
      <compiler angle="radian" meshdir="assets" autolimits="true"/>
      <option integrator="implicitfast"/>
      <default><default class="five">
        <joint range="-2 2" armature="0.1"/>
        <general gainprm="450" biasprm="0 -450 -45" forcerange="-200 200"/>
        <default class="visual"><geom type="mesh" contype="0" conaffinity="0" group="2"/></default>
        <default class="collision"><geom type="mesh" group="3"/></default>
      </default></default>
      <asset><mesh name="hand" file="hand.{ending}" scale="0.001 0.001 0.001"/>{extra}</asset>
      <worldbody><light pos="0 0 2"/><body name="base" childclass="five">{bodies}{lost}
        <site name="tip" pos="0.2 0 0"/>{end}</body></worldbody>
      <actuator>{drives}</actuator>
      <keyframe><key name="home" qpos="0 0 0 0 0"/></keyframe>
    </mujoco>"""


@pytest.fixture
def menagerie(tmp_path):
    write_box(tmp_path / "assets/hand.stl", (100.0, 40.0, 20.0))
    write_box(tmp_path / "assets/hand.obj", (100.0, 40.0, 20.0))
    return tmp_path


@pytest.mark.parametrize("ending", ["stl", "obj"])
def test_mjcf_of_menagerie_runs_and_plays_back(menagerie, ending):
    """Before, refused: only meshes in .obj format."""
    file = write(menagerie, "five.xml", mjcf(ending))
    arm = load_arm(file, frame="tip")
    np.testing.assert_array_equal(arm.limits.position_upper, 2.0)
    np.testing.assert_array_equal(arm.effort, 200.0)
    seen = extents(arm, Role.kIllustration)
    assert len(seen) == 5
    np.testing.assert_allclose(seen[0], [0.05, 0.02, 0.01], atol=1e-6)
    described = {"model": str(file), "frame": "tip"}
    result = simulate(make_experiment(experiment(described)))
    assert result.metrics["position_error_max_m"] < 1e-4
    assert write_playback(result, menagerie / "playback.html", 8).stat().st_size > 2e6


@pytest.mark.long
def test_mjcf_of_menagerie_runs_at_the_dynamic_level(menagerie):
    """15 mm of 40 mm: the motors' lag."""
    file = write(menagerie, "five.xml", mjcf())
    arm = {"model": str(file), "frame": "tip"}
    result = simulate(make_experiment(experiment(arm, duration=1.0, level="dynamic")))
    assert result.metrics["position_error_max_m"] < 15e-3


def test_a_site_is_a_frame(menagerie):
    """1e-15 m: rounding."""
    file = write(menagerie, "five.xml", mjcf())
    tip, link = load_arm(file, frame="tip").kinematics(), load_arm(file, frame="link5").kinematics()
    expected = link.p_WE(START) + 0.2 * link.R_WE(START)[:, 0]
    np.testing.assert_allclose(tip.p_WE(START), expected, atol=1e-15)


def test_what_drake_leaves_out_of_mjcf_is_said_in_one_line(menagerie):
    (warning,) = load_arm(write(menagerie, "five.xml", mjcf()), frame="tip").warnings
    assert warning.startswith("arm.model: five.xml: Drake warns 2 times, first: ")


def test_closed_loops_are_left_out_with_a_warning(menagerie):
    loop = '<equality><connect body1="link2" body2="link5" anchor="0 0 0"/></equality></mujoco>'
    text = mjcf().replace("</mujoco>", loop)
    arm = load_arm(write(menagerie, "five.xml", text), frame="tip")
    assert arm.warnings[0] == (
        "arm.model: five.xml: constraints such as closed loops are left out (1)"
    )
    assert arm.plant().num_constraints() == 0
    other = MultibodyPlant(1e-3)
    load_arm("panda").add_to(other)
    link = other.GetBodyByName("panda_link7")
    other.AddDistanceConstraint(link, [0, 0, 0], other.world_body(), [0, 0, 0], 1.0)
    arm.add_to(other)
    assert other.num_constraints() == 1
    part = load_arm("panda", lock={"panda_joint1": 0.0})
    with pytest.raises(InvalidInputError, match="add panda, whose joint 'panda_joint1' is held, b"):
        part.add_to(other)


def test_a_missing_mesh_of_mjcf_is_left_out(menagerie):
    arm = load_arm(write(menagerie, "five.xml", mjcf(missing="yes")), frame="tip")
    assert arm.warnings[0] == (
        "arm.model: five.xml: assets/nowhere.stl is missing; the arm is drawn without it"
    )
    assert len(extents(arm, Role.kIllustration)) == 5


def test_a_scene_includes_its_robot(menagerie):
    write(menagerie, "five.xml", mjcf())
    floor = '<worldbody><geom name="floor" type="plane" size="1 1 1"/></worldbody>'
    scene = f'<mujoco><include file="five.xml"/>{floor}</mujoco>'
    assert load_arm(write(menagerie, "scene.xml", scene), frame="tip").n == 5
    lost = write(menagerie, "lost.xml", scene.replace("five.xml", "nowhere.xml"))
    assert "the file 'nowhere.xml' that it includes cannot be read" in refusal(lost, frame="tip")


# SDF.


def sdf(uri, more=""):
    link = (
        '<link name="arm"><pose>0 0 0.5 0 0 0</pose><inertial><mass>2</mass></inertial>'
        f'<visual name="v"><geometry><mesh><uri>{uri}</uri></mesh></geometry>'
        "<material><diffuse>1 0 0 1</diffuse></material></visual>"
        f'<collision name="c"><geometry><mesh><uri>{uri}</uri></mesh></geometry></collision></link>'
    )
    return (
        f'<sdf version="1.9"><model name="one"><link name="base"/>{link}'
        '<joint name="turn" type="revolute"><parent>base</parent><child>arm</child><axis>'
        "<xyz>0 0 1</xyz><limit><lower>-1</lower><upper>1</upper></limit></axis></joint>"
        f"{more}</model></sdf>"
    )


@pytest.mark.parametrize("uri", ["hand.stl", "model://one/hand.stl", "package://one/hand.stl"])
def test_sdf_may_have_meshes_of_any_format(tmp_path, uri):
    """Before, STL was refused."""
    write_box(tmp_path / "one/hand.stl")
    arm = load_arm(write(tmp_path, "one/one.sdf", sdf(uri)), frame="arm")
    assert arm.warnings == (
        "arm.model: one.sdf: collision meshes count for distances, but make no contact: those of "
        "arm",
    )
    (seen,) = extents(arm, Role.kIllustration)
    np.testing.assert_allclose(seen, [0.05, 0.02, 0.01], atol=1e-6)


def test_a_missing_mesh_of_sdf_is_left_out(tmp_path):
    arm = load_arm(write(tmp_path, "one.sdf", sdf("model://one/hand.stl")), frame="arm")
    assert arm.warnings == (
        "arm.model: one.sdf: collision meshes are missing: model://one/hand.stl of 'arm'",
        "arm.model: one.sdf: model://one/hand.stl is missing; the arm is drawn without it",
    )


def test_a_joint_of_sdf_that_follows_another_is_refused(tmp_path):
    follower = (
        '<link name="hand"><inertial><mass>1</mass></inertial></link><joint name="bend" '
        'type="revolute"><parent>arm</parent><child>hand</child><axis><xyz>1 0 0</xyz>'
        '<mimic joint="turn"><multiplier>2</multiplier><offset>0.1</offset>'
        "<reference>0</reference></mimic></axis></joint>"
    )
    write_box(tmp_path / "hand.stl")
    file = write(tmp_path, "one.sdf", sdf("hand.stl", follower))
    assert "'bend' follows 'turn' (mimic)" in refusal(file, frame="hand")
    assert load_arm(file, frame="arm").joints == ("turn",)

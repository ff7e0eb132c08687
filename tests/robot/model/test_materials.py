"""Colours and textures: no motion depends on them, so that none of them refuses a robot."""

import pytest
from model_files import shape, urdf, write
from PIL import Image

from drake_rnn import InvalidInputError, load_arm
from drake_rnn.playback.arm_drawing import require_looks

SPHERE = '<visual><geometry><sphere radius="0.1"/></geometry>{}</visual>'
COLOUR = "colours that are not numbers from 0 to 1 are left out: "
TEXTURE = "textures that are no picture or missing are left out: "
SDF = (
    '<sdf version="1.9"><model name="m"><link name="base"/><link name="tip"><visual name="v">'
    "<geometry><sphere><radius>0.1</radius></sphere></geometry><material>{}</material></visual>"
    '</link><joint name="w" type="fixed"><parent>world</parent><child>base</child></joint>'
    '<joint name="j" type="revolute"><parent>base</parent><child>tip</child><axis><xyz>0 0 1</xyz>'
    "<limit><lower>-1</lower><upper>1</upper><velocity>1</velocity></limit></axis></joint></model>"
    "</sdf>"
)
MJCF = (
    '<mujoco model="m"><worldbody><body name="tip"><inertial pos="0 0 0" mass="1" '
    'diaginertia="1 1 1"/><joint name="j" type="hinge" axis="0 0 1" range="-1 1"/>'
    '<geom type="sphere" size="0.1" rgba="{}"/></body></worldbody></mujoco>'
)


def material(inside, name="m"):
    return urdf(hand=SPHERE.format(f'<material name="{name}">{inside}</material>'))


def named(inside):
    """A material of the robot, which a link names."""
    whole = f'<material name="m">{inside}</material>'
    return urdf(hand=SPHERE.format('<material name="m"/>'), links=whole)


def colour(rgba):
    return f'<color rgba="{rgba}"/>'


def texture(name):
    return f'<texture filename="{name}"/>'


#: Name of the file, what it holds, and how the warning ends; empty if there is none.
MODELS = {
    "five numbers": ("a.urdf", named(colour(".1 .1 .1 0 1")), f"{COLOUR}'.1 .1 .1 0 1'"),
    "three numbers": ("a.urdf", material(colour("1 0 0")), f"{COLOUR}'1 0 0'"),
    "words": ("a.urdf", material(colour("red red red 1")), f"{COLOUR}'red red red 1'"),
    "NaN": ("a.urdf", material(colour("nan 0 0 1")), f"{COLOUR}'nan 0 0 1'"),
    "bytes": ("a.urdf", material(colour("255 0 0 1")), f"{COLOUR}'255 0 0 1'"),
    "no numbers": ("a.urdf", material("<color/>"), f"{COLOUR}''"),
    "five numbers in SDF": ("a.sdf", SDF.format("<diffuse>1 1 1 0 1</diffuse>"), "'1 1 1 0 1'"),
    "three numbers in SDF": ("a.sdf", SDF.format("<diffuse>1 1 1</diffuse>"), ""),
    "three numbers in MJCF": ("a.xml", MJCF.format("1 0 0"), f"{COLOUR}'1 0 0'"),
    "a colour": ("a.urdf", named(colour("1 0 0 1")), ""),
    "a package of nowhere": (
        "a.urdf", named(texture("package://nowhere/x.png")), f"{TEXTURE}'package://nowhere/x.png'",
    ),
    "a texture on the web": ("a.urdf", material(texture("http://no.invalid/x.png")), "x.png'"),
    "a texture that is none": ("a.urdf", material(texture("/etc/hostname")), "'/etc/hostname'"),
    "a texture of its package": ("robot/urdf/a.urdf", named(texture("package://robot/x.png")), ""),
    "a texture beside it": ("robot/a.urdf", named(texture("x.png")), ""),
    "a material of no name": ("a.urdf", urdf(hand=SPHERE.format("<material/>")), ""),
    "an undefined material": (
        "a.urdf", material("", "blue"), "materials that are not defined are left out: blue",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("name", "text", "said"), MODELS.values(), ids=MODELS)
def test_what_cannot_be_shown_is_warned_of_and_left_out(tmp_path, name, text, said):
    (tmp_path / "robot").mkdir()
    Image.new("RGB", (2, 2)).save(tmp_path / "robot" / "x.png")
    arm = load_arm(write(tmp_path, name, text), frame="tip")
    assert arm.n in {1, 5}
    warnings = [text for text in arm.warnings if "left out" in text]
    assert len(warnings) == bool(said)
    assert all(text.endswith(said) for text in warnings)


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("passwd", "root", "cannot be read: error: The file"),
        ("a.urdf", urdf(kinds=("revolute",) * 4 + ("fixed",)), "has 4 joints in a chain; the arm "),
        ("a.urdf", urdf(), "has no meshes that can be read"),
        ("a.urdf", urdf(hand=shape("no.stl")), "has no meshes that can be read"),
    ],
)
def test_looks_that_no_playback_can_show_are_refused_before_a_run(tmp_path, name, text, said):
    # Without it the arm is drawn as its own model says, with a warning.
    pytest.importorskip("fast_simplification", reason="needs the extra looks")
    model = write(tmp_path, "own.urdf", urdf())
    arm = load_arm(model, frame="tip", looks=str(write(tmp_path, name, text)))
    with pytest.raises(InvalidInputError, match=r"^arm\.looks: ") as caught:
        require_looks(arm)
    assert said in str(caught.value)

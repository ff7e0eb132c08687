"""Models that would take a process with them, its memory or its time: each gets a sentence."""

from time import process_time

import pytest
from model_files import urdf, write
from refusing import refusal

from drake_rnn import load_arm, load_experiment
from drake_rnn.robot.clearance.arm_capsules import capsules_of
from drake_rnn.robot.model import ros_packages
from row_helpers import assert_each, each

JOINT = (
    '<link name="b"/><link name="l1"/>'
    '<joint name="w" type="fixed"><parent>world</parent><child>b</child></joint>'
    '<joint name="j1" type="revolute"><parent>b</parent><child>l1</child>'
    "<axis><xyz>0 0 1</xyz><limit><lower>-2</lower><upper>2</upper></limit></axis></joint>"
)


def sdf(inside=""):
    return f'<sdf version="1.7"><model name="z">{JOINT}{inside}</model></sdf>'


def including(*names, more=""):
    return sdf("".join(f"<include{more}><uri>{name}</uri></include>" for name in names))


def mjcf(inside="", more=""):
    joint = '<joint name="j1" range="-90 90"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    body = f'<body name="l1">{joint}{inside}</body>'
    return f"<mujoco><worldbody>{body}</worldbody>{more}</mujoco>"


def nested(tag, times=1500):
    return f"<{tag}>" * times + f"</{tag}>" * times


def xacro(inside):
    return f'<robot name="x" xmlns:xacro="http://ros.org/xacro">{inside}<link name="l1"/></robot>'


def valued(expression):
    return xacro(f'<xacro:property name="a" value="{expression}"/><link name="${{a}}"/>')


def doubled(name):
    return including(name, name, more=' merge="true"')


#: Files of a model, the last of which is loaded, and what is said.
MODELS = {
    "URDF": ({"m.urdf": urdf(links=nested("a"))}, "m.urdf is nested too deeply: it may have 200"),
    "SDF": ({"m.sdf": sdf(nested("a"))}, "nested too deeply"),
    "MJCF": ({"m.xml": mjcf(nested("body"))}, "nested too deeply"),
    "defaults of MJCF": ({"m.xml": mjcf(more=nested("default"))}, "nested too deeply"),
    "MJCF of deep parts": (
        {
            "p.xml": mjcf(nested("body", 150)),
            "m.xml": mjcf("<body>" * 90 + '<include file="p.xml"/>' + "</body>" * 90),
        },
        "is nested too deeply",
    ),
    "an SDF that includes itself": ({"m.sdf": including("m.sdf")}, "include each other without e"),
    "two that include each other": (
        {"a.sdf": including("m.sdf"), "m.sdf": including("a.sdf")},
        "its files include each other without end",
    ),
    "one that includes its folder": (
        {
            "f/model.config": "<model><sdf>m.sdf</sdf></model>",
            "f/m.sdf": including("../f"),
        },
        "its files include each other without end",
    ),
    "doubled includes": (
        {"s0.sdf": sdf()} | {f"s{k + 1}.sdf": doubled(f"s{k}.sdf") for k in range(15)},
        "its files include each other without end",
    ),
    "a picture": (
        {"a.png": "PNG", "m.sdf": including("a.png")},
        "'a.png', which it includes, is n",
    ),
    "a world": (
        {"w.sdf": "<sdf><world/></sdf>", "m.sdf": including("w.sdf")},
        "'w.sdf', which it includes, is no model",
    ),
    "no file": ({"m.sdf": including("no.sdf")}, "there is no file 'no.sdf', which it includes"),
    "no name": ({"m.sdf": including("")}, "there is no file '', which it includes"),
    "deep inside": ({"a.sdf": sdf(nested("a")), "m.sdf": including("a.sdf")}, "'a.sdf' is nested"),
    "a part of the same frame": (
        {"p.urdf": '<robot name="p"><link name="l1"/></robot>', "m.sdf": including("p.urdf")},
        "holds 2 models; it must hold one; what it includes becomes a part",
    ),
    "MJCF that includes itself": ({"m.xml": mjcf('<include file="m.xml"/>')}, "without end"),
    "doubled parts of MJCF": (
        {"p0.xml": mjcf()}
        | {f"p{k + 1}.xml": mjcf(2 * f'<include file="p{k}.xml"/>') for k in range(15)},
        "include or attach each other without end",
    ),
    "MJCF that attaches itself": (
        {
            "m.xml": mjcf(
                '<attach model="a" prefix="a"/>', '<asset><model name="a" file="m.xml"/></asset>'
            )
        },
        "include or attach each other without end",
    ),
    "replicas of replicas": (
        {"m.xml": mjcf(3 * '<replicate count="1000">' + '<geom size="0.1"/>' + 3 * "</replicate>")},
        "its replicas have more than 100000 elements",
    ),
}


def refused(folder, files, said):
    written = [write(folder, name, text) for name, text in files.items()]
    began = process_time()
    message = refusal(lambda: load_arm(written[-1], frame="l1"))
    assert said in message, message
    assert process_time() - began < 5.0


def test_nothing_that_is_endless_is_followed(tmp_path):
    assert_each(lambda files, said: refused(tmp_path, files, said), MODELS)


#: What macros compute, and what is said.
MACROS = {
    "a power": (valued("${9**9**9}"), "a whole number is beyond that of any other number"),
    "a power in parts": (
        xacro(
            '<xacro:property name="p0" value="9"/>'
            + "".join(
                f'<xacro:property name="p{k + 1}" value="${{p{k} * p{k}}}"/>' for k in range(60)
            )
            + '<link name="${p60}"/>'
        ),
        "a whole number is beyond",
    ),
    "a shift": (
        valued("${1 &lt;&lt; 10**12}"),
        "a whole number is beyond that of any other number",
    ),
    "a text": (valued("${'a'*10**9}"), "has 1000000000 entries, and may have 1000000"),
    "a list": (valued("${[0]*10**10}"), "entries, and may have 1000000"),
    "a list within": (valued("${len([0]*10**10)}"), "entries, and may have 1000000"),
    "a wide text": (valued("${'a'.ljust(10**9)}"), "takes more than 1 GB of memory"),
    "a text that doubles": (
        xacro(
            '<xacro:property name="p0" value="aaaa"/>'
            + "".join(
                f'<xacro:property name="p{k + 1}" value="${{p{k}}}${{p{k}}}"/>' for k in range(40)
            )
            + '<link name="${p40}"/>'
        ),
        "entries, and may have 1000000",
    ),
    "parentheses": (
        valued("${" + 500 * "(" + "1" + 500 * ")" + "}"),
        "too many nested parentheses",
    ),
    "signs": (valued("${" + 50_000 * "-" + "1}"), "cannot be expanded"),
    "a macro of itself": (
        xacro('<xacro:macro name="m" params=""><xacro:m/></xacro:macro><xacro:m/>'),
        "contain each other without end",
    ),
    "a file of itself": (xacro('<xacro:include filename="m.xacro"/>'), "without end"),
    "other names": (valued("${__import__('os')._exit(3)}"), "__import__"),
}


@each(("text", "said"), MACROS.values(), ids=list(MACROS))
def test_macros_have_bounds(tmp_path_factory, text, said):
    pytest.importorskip("xacro")
    refused(tmp_path_factory.mktemp("macros"), {"m.xacro": text}, said)


@pytest.mark.long
def test_macros_that_take_long_are_ended(tmp_path, monkeypatch):
    """Ten million of them; what no count sees ends after some seconds of the processor."""
    pytest.importorskip("xacro")
    many = "".join(
        f'<xacro:macro name="m{k + 1}" params="">{10 * f"<xacro:m{k}/>"}</xacro:macro>'
        for k in range(7)
    )
    text = xacro(
        f'<xacro:macro name="m0" params=""><link name="q"/></xacro:macro>{many}<xacro:m7/>'
    )
    file = write(tmp_path, "m.xacro", text)
    bounds = {"most_memory": 10**8, "most_seconds": 1, "most_bytes": 1000}
    monkeypatch.setattr(ros_packages, "_BOUNDS", bounds)
    assert "takes more than 1 s of the processor" in refusal(lambda: load_arm(file, frame="l1"))
    file = write(tmp_path, "m.xacro", xacro('<xacro:arg name="a" default="1"/>' + 200 * "<link/>"))
    assert "becomes longer than 0.001 MB" in refusal(lambda: load_arm(file, frame="l1"))


# Shapes without a size.


def of_link(kind, shape):
    """An arm whose link l1 has a shape."""
    inside = f"<{kind}><geometry>{shape}</geometry></{kind}>"
    return (
        f'<robot name="z"><link name="b"/><link name="l1">{inside}</link><link name="t"/>'
        '<joint name="j1" type="revolute"><parent link="b"/><child link="l1"/><axis xyz="0 0 1"/>'
        '<limit lower="-2" upper="2" velocity="2" effort="9"/></joint><joint name="f" type="fixed">'
        '<origin xyz="0.3 0 0"/><parent link="l1"/><child link="t"/></joint></robot>'
    )


NO_SIZE = {
    "box": '<box size="0 0 0"/>',
    "sphere": '<sphere radius="0"/>',
    "cylinder": '<cylinder radius="0" length="0"/>',
    "capsule": '<capsule radius="0" length="0"/>',
    "ellipsoid": '<drake:ellipsoid a="0" b="0" c="0"/>',
    "mesh": '<mesh filename="m.obj" scale="0 0 0"/>',
}
FLAT = {
    "box": '<box size="0.1 0 0.1"/>',
    "cylinder": '<cylinder radius="0.1" length="0"/>',
    "capsule": '<capsule radius="0" length="0.1"/>',
}


@each(("kind", "shape"), NO_SIZE.items())
def test_a_drawn_shape_of_no_size_is_left_out(tmp_path_factory, kind, shape):
    folder = tmp_path_factory.mktemp("sizes")
    write(
        folder, "m.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    )
    arm = load_arm(write(folder, "z.urdf", of_link("visual", shape)), frame="t")
    assert f"drawn shapes of no size are left out: the {kind} of 'l1'" in arm.warnings[0]
    arm = load_arm(write(folder, "z.urdf", of_link("collision", shape)), frame="t")
    assert (
        f"shapes without thickness are taken as 1 um thick: the {kind} of 'l1'" in arm.warnings[0]
    )


@each(("kind", "shape"), FLAT.items())
def test_a_flat_shape_keeps_its_other_sizes(tmp_path_factory, kind, shape):
    folder = tmp_path_factory.mktemp("flat")
    arm = load_arm(write(folder, "z.urdf", of_link("collision", shape)), frame="t")
    assert arm.warnings[0].endswith(f"1 um thick: the {kind} of 'l1'")


def test_a_flat_box_of_sdf_is_no_cube_of_a_metre(tmp_path):
    """Before, each shape of SDF with a size of 0 or less had that of its default."""
    box = '<collision name="c"><geometry><box><size>0.1 0 0.1</size></box></geometry></collision>'
    file = write(
        tmp_path, "m.sdf", sdf().replace('<link name="l1"/>', f'<link name="l1">{box}</link>')
    )
    arm = load_arm(file, frame="l1")
    assert "1 um thick: the box of 'l1'" in arm.warnings[0]
    (capsule,) = (each for each in capsules_of(arm)[0] if each.body == "l1")
    assert capsule.radius < 0.08


@pytest.mark.parametrize("law", ["adaptive", "pseudoinverse", "simultaneous_learning"])
def test_a_frame_on_the_axis_of_the_only_joint_is_told(tmp_path, law):
    """Before, IndexError."""
    text = of_link("visual", '<box size="1 1 1"/>').replace("0.3 0 0", "0 0 0.3")
    document = {
        "arm": {"model": str(write(tmp_path, "z.urdf", text)), "frame": "t"},
        "start": [0.0],
        "path": {"kind": "rest"},
        "law": {"kind": law},
        "limits": {"velocity": 1.0, "acceleration": 5.0},
        "period": 0.01,
        "duration": 1.0,
    }
    said = refusal(lambda: load_experiment(document))
    assert said.startswith("start: no joint moves the task at the start: at [0.0] each axis of j1")

"""Models of arms that cannot be read or mean nothing, and wrong use of those that can."""

import pytest
from model_files import INERTIA, shape, urdf
from refusing import refusal

from drake_rnn import load_arm
from row_helpers import each

FIVE = urdf()


def limited(lower="-2", upper="2", effort="200", velocity="1.5"):
    return urdf(limit=f'lower="{lower}" upper="{upper}" effort="{effort}" velocity="{velocity}"')


def of_inertia(old, new):
    return urdf(inertia=INERTIA.replace(old, new))


def jointed(parent, child, links=""):
    """The arm of five joints, with one more."""
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return urdf(links=f'{links}<joint name="more" type="fixed">{ends}</joint>')


def second(new):
    """The arm of five joints, with other words for the type of its second joint."""
    return FIVE.replace('name="joint2" type="revolute"', f'name="joint2" {new}')


def mimicking(leader):
    return FIVE.replace('<axis xyz="0 1 0"/>', f'<axis xyz="0 1 0"/><mimic joint="{leader}"/>', 1)


#: What the file holds, and what is said of it.
URDFS = {
    "nothing": ("", "XML_ERROR_EMPTY_DOCUMENT"),
    "blanks": ("  \n", "XML_ERROR_EMPTY_DOCUMENT"),
    "text": ("hello", "XML_ERROR_PARSING_TEXT"),
    "a page of the web": (
        "<html><body>404</body></html>",
        "no URDF, SDF or MJCF: its outermost element is <html>",
    ),
    "half a file": (FIVE[: len(FIVE) // 2], "Failed to parse XML file"),
    "a tag that ends otherwise": (FIVE.replace("</robot>", "</robt>"), "MISMATCHED_ELEMENT"),
    "bytes of a program": (bytes(range(256)), "cannot be read"),
    "SDF": ('<sdf version="1.7"><model name="m"><link name="tip"/></model></sdf>', "no movable j"),
    "MJCF": ('<mujoco><worldbody><body name="tip"/></worldbody></mujoco>', "no movable joint"),
    "no links": ('<robot name="five"></robot>', "arm.frame: no frame 'tip'"),
    "no joints": ('<robot name="five"><link name="tip"/></robot>', "no movable joint between"),
    "joints that do not move": (urdf(kinds=("fixed",) * 5), "no movable joint between"),
    "no name": (FIVE.replace(' name="five"', ""), "must have a name attribute"),
    "a link without a name": (FIVE.replace(' name="link2"', ""), "link tag is missing name"),
    "a joint without a name": (FIVE.replace(' name="joint2"', ""), "joint tag is missing name"),
    "a joint without a type": (second(""), "joint 'joint2' is missing type"),
    "a joint of no type": (second('type="hinge"'), "unrecognized type: 'hinge'"),
    "a planar joint": (second('type="planar"'), "'joint2' is a planar joint and must have"),
    "two links of one name": (FIVE.replace('<link name="link3"', '<link name="link2"'), "'link2'"),
    "two joints of one name": (FIVE.replace('name="joint3"', 'name="joint2"'), "joint2"),
    "no parent": (FIVE.replace('<parent link="link1"/>', ""), "doesn't have a parent node"),
    "no child": (FIVE.replace('<child link="link2"/>', ""), "doesn't have a child node"),
    "an unknown parent": (FIVE.replace('<parent link="link1"', '<parent link="lnk1"'), "'lnk1'"),
    "an unknown child": (FIVE.replace('<child link="link2"', '<child link="lnk2"'), "'lnk2'"),
    "a link joined to itself": (
        FIVE.replace('<parent link="link1"', '<parent link="link2"'),
        "itself",
    ),
    "a loop through the base": (jointed("tip", "base"), "form one or more loops"),
    "a loop": (jointed("link5", "link2"), "form one or more loops"),
    "reversed position limits": (
        limited(lower="2", upper="-2"),
        "arm.model: the limits of 'joint1': lower is 2, above upper, -2",
    ),
    "equal position limits": (limited("1", "1"), "position_lower: must be below position_upper"),
    "a word for a limit": (
        limited("low"),
        "'joint1': lower must be a finite decimal number, not 'l",
    ),
    "NaN for a limit": (
        limited("nan"),
        "'joint1': lower must be a finite decimal number, not 'nan'",
    ),
    "infinity for a limit": (
        limited(upper="inf"),
        "the limits of 'joint1': upper must be a finite decimal number, not 'inf'; without",
    ),
    "underscores in a limit": (
        limited(upper="1_0"),
        "upper must be a finite decimal number, not '1_0",
    ),
    "a negative velocity": (
        limited(velocity="-1.5"),
        "arm.model: the limits of 'joint1': velocity must not be negative, as -1.5 is",
    ),
    "NaN for a velocity": (
        limited(velocity="nan"),
        "velocity must be a finite decimal number, not",
    ),
    "a velocity that is none": (
        limited(velocity="1e-12"),
        "velocity: must be at least 1e-06, not [",
    ),
    "a place beyond the moon": (
        FIVE.replace('"0.2 0 0"', '"1e30 0 0"', 1),
        "is 1e+30 m from the link that it belongs to; it may be up to 1000 m",
    ),
    "entities of a document type": (
        '<!DOCTYPE robot [<!ENTITY effort SYSTEM "/etc/hostname">]>'
        + FIVE.replace('"200"', '"&effort;"'),
        "has a document type, <!DOCTYPE ...>; write out what its entities stand for",
    ),
    "a ball of too fine a mesh": (
        urdf(
            hand='<collision><geometry><sphere radius="0.01"/></geometry>'
            '<drake:proximity_properties><drake:mesh_resolution_hint value="1e-6"/>'
            "</drake:proximity_properties></collision>"
        ),
        "drake:mesh_resolution_hint: must be at least 0.04 of the ball's radius, 0.0004 m",
    ),
    "a negative effort": (
        limited(effort="-200"),
        "arm.model: the limits of 'joint1': effort must not be negative, as -200 is",
    ),
    "an axis of no direction": (FIVE.replace('"0 1 0"', '"0 0 0"', 1), "'joint2' axis is zero"),
    "an axis of two numbers": (FIVE.replace('"0 1 0"', '"0 1"', 1), "Expected 3 values"),
    "an axis by its letter": (FIVE.replace('"0 1 0"', '"y"', 1), "Expected 3 values"),
    "an axis of NaN": (FIVE.replace('"0 1 0"', '"nan 1 0"', 1), "Expected 3 values"),
    "a place of two numbers": (FIVE.replace('"0.2 0 0"', '"0.2 0"', 1), "Expected 3 values"),
    "a decimal comma": (FIVE.replace('"0.2 0 0"', '"0,2 0 0"', 1), "got 0,2 0 0"),
    "a place of NaN": (FIVE.replace('"0.2 0 0"', '"nan 0 0"', 1), "got nan 0 0"),
    "a place at infinity": (FIVE.replace('"0.2 0 0"', '"inf 0 0"', 1), "got inf 0 0"),
    "a negative mass": (of_inertia('"2"', '"-2"'), "mass of 'link1' must be at least 0, not -2 kg"),
    "a mass of NaN": (of_inertia('"2"', '"nan"'), "attribute 'value' got 'nan'"),
    "a mass with a unit": (of_inertia('"2"', '"2kg"'), "could not convert string to float: '2kg'"),
    "an inertia of NaN": (of_inertia('ixx="0.02"', 'ixx="nan"'), "attribute 'ixx' got 'nan'"),
    "a joint that follows itself": (mimicking("joint2"), "cannot mimic themselves"),
}

#: What is told of a model that is taken nevertheless.
DOUBTFUL = {
    "limits in degrees": (limited("-170", "170"), "of more than two turns; are they in degrees?"),
    "a joint that follows none": (mimicking("jont1"), "one that there is not move on their own: j"),
    "an impossible inertia": (of_inertia('ixx="0.02"', 'ixx="0.2"'), "no body has the inertia giv"),
    "a negative inertia": (
        of_inertia('ixx="0.02"', 'ixx="-0.02"'),
        "no body has the inertia given",
    ),
    "a mesh that is missing": (urdf(hand=shape("no.stl")), "no.stl is missing; the arm is drawn"),
    "a mesh of no package": (
        urdf(hand=shape("package://no/x.stl")),
        "folder of no in arm.packages",
    ),
    "a mesh that is a folder": (
        urdf(hand=shape("/tmp")),
        "the mesh /tmp cannot be read: it is a fol",
    ),
    "a mesh that is a device": (
        urdf(hand=shape("/dev/null")),
        "/dev/null cannot be read: it is no re",
    ),
    "a mesh on the web": (urdf(hand=shape("http://no.invalid/x.stl")), "x.stl is missing"),
    "a mesh of CAD": (urdf(hand=shape("x.step")), "x.step is missing"),
    "a joint that floats": (second('type="floating"'), "floating joints are fixed: joint2"),
    "velocities of 0": (limited(velocity="0"), "a limit of 0 is taken for an unknown velocity"),
}

#: How a good model is used, and what is said of it.
USES = {
    "an unknown frame": ({"frame": "nowhere"}, "arm.frame: no frame 'nowhere' in five.urdf"),
    "a frame of no name": ({"frame": ""}, "arm.frame: no frame '' in five.urdf"),
    "a frame by number": ({"frame": 3}, "arm.frame: must be text, not 3"),
    "no frame": ({"frame": None}, "arm.frame: must be given; the chains of five.urdf end in tip"),
    "the base": ({"frame": "base"}, "arm.frame: no movable joint between the base and 'base'"),
    "an unknown joint": ({"joints": ["joint9"]}, "arm.joints: no movable joint 'joint9'"),
    "a joint twice": ({"joints": ["joint1"] * 2}, "arm.joints: 'joint1' is given twice"),
    "a joint that is no list": ({"joints": "joint1"}, "arm.joints: must be a list, not 'joint1'"),
    "none of the joints": ({"joints": []}, "arm.frame: no movable joint between"),
    "a lock on nothing": ({"lock": {"joint9": 0}}, "arm.lock: no movable joint 'joint9'"),
    "a lock beyond the limits": ({"lock": {"joint1": 9}}, "arm.lock.joint1: may be -2 to 2, not 9"),
    "a lock at NaN": (
        {"lock": {"joint1": float("nan")}},
        "arm.lock.joint1: must be a finite number",
    ),
    "all joints locked": (
        {"lock": dict.fromkeys(("joint1", "joint2", "joint3", "joint4", "joint5"), 0)},
        "arm.frame: no movable joint",
    ),
    "a short home": ({"home": [0]}, "arm.home: has 1 entry for 5 joints"),
    "an unknown tip": ({"tip": "nowhere"}, "arm.tip: no frame 'nowhere' in five.urdf"),
    "two tips": ({"tip": "tip", "tool": {"tip": "end"}}, "arm.tip: cannot be combined with a tool"),
    "a package that is missing": ({"packages": {"a": "/nowhere"}}, "arm.packages.a: no folder '/n"),
    "packages in a list": ({"packages": ["a"]}, "arm.packages: must be a mapping"),
    "an unknown key": ({"colour": 3}, "arm.colour: no such key; it may be model, frame"),
    "limits that are missing": ({"limits": "no.yaml"}, "arm.limits: no file 'no.yaml'"),
    "a tool by name": ({"tool": "pen"}, "arm.tool: must be a mapping of keys to values, not 'pen'"),
    "a tool of the model's name": (
        {"tool": {}},
        "arm.tool.tip: five.urdf has a frame 'tip' already",
    ),
    "a tool on nothing": (
        {"tool": {"mount": "no", "tip": "end"}},
        "arm.tool: no frame 'no' in five",
    ),
    "gravity by number": ({"gravity": 9.81}, "arm.gravity: must be a list of numbers, not 9.81"),
    "gravity in millimetres": ({"gravity": [0, 0, -9810]}, "arm.gravity: may be at most 300 m/s^2"),
    "no mass": ({"mass_scale": 0}, "arm.mass_scale: must be greater than 0, not 0"),
}

#: Name of a file, what it holds, and what is said of it.
FORMATS = {
    "half of SDF": ("x.sdf", "<sdf", "cannot be read: "),
    "SDF without a model": ("x.sdf", '<sdf version="1.7"></sdf>', "exactly one <model>"),
    "SDF of the future": ("x.sdf", '<sdf version="9.9"><model name="m"/></sdf>', "version 9.9"),
    "SDF without a link": (
        "x.sdf",
        '<sdf version="1.7"><model name="m"/></sdf>',
        "at least one link",
    ),
    "half of MJCF": ("x.xml", "<mujoco", "cannot be read: "),
    "MJCF without a file": (
        "x.xml",
        '<mujoco><include file="no.xml"/></mujoco>',
        "'no.xml' that it",
    ),
    "a mesh": ("x.stl", "solid", "arm: no arm '"),
    "a text file": ("x.txt", FIVE, "arm: no arm '"),
    "half of xacro": ("x.xacro", FIVE[:-8], "cannot be read: "),
}


def written(folder, name, content):
    file = folder / name
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    return file


@each(("content", "said"), URDFS.values(), ids=URDFS)
def test_a_model_that_is_none_is_refused(tmp_path, content, said):
    file = written(tmp_path, "five.urdf", content)
    assert said in refusal(lambda: load_arm(file, frame="tip"))


@each(("content", "said"), DOUBTFUL.values(), ids=DOUBTFUL)
def test_a_model_that_is_doubtful_is_warned_of(tmp_path, content, said):
    arm = load_arm(written(tmp_path, "five.urdf", content), frame="tip")
    assert any(said in warning for warning in arm.warnings), arm.warnings


@each(("fields", "said"), USES.values(), ids=USES)
def test_wrong_use_is_refused(tmp_path, fields, said):
    file = written(tmp_path, "five.urdf", FIVE)
    assert refusal(lambda: load_arm(file, **{"frame": "tip", **fields})).startswith(said)


@pytest.mark.parametrize(("name", "content", "said"), FORMATS.values(), ids=FORMATS)
def test_other_formats_are_refused_likewise(tmp_path, name, content, said):
    file = written(tmp_path, name, content)
    assert said in refusal(lambda: load_arm(file, frame="tip"))


@pytest.mark.parametrize("model", ["folder.urdf", "nowhere.urdf"])
def test_what_is_no_file_is_refused(tmp_path, model):
    (tmp_path / "folder.urdf").mkdir()
    said = refusal(lambda: load_arm(tmp_path / model, frame="tip"))
    assert said == f"arm.model: no file {str(tmp_path / model)!r}"

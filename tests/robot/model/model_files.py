"""Small models with meshes, as makers publish them."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from drake_rnn import InvalidInputError, load_arm

INERTIA = (
    '<inertial><mass value="2"/>'
    '<inertia ixx="0.02" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial>'
)
LIMIT = 'lower="-2" upper="2" effort="200" velocity="1.5"'
AXES = ("0 0 1", "0 1 0", "0 1 0", "0 0 1", "0 1 0")
START = [0.1, -0.5, 0.8, 0.4, 0.3]


def shape(uri, kind="visual", more=""):
    """A visual or collision element with a mesh."""
    return f'<{kind}><geometry><mesh filename="{uri}"/></geometry>{more}</{kind}>'


def urdf(hand="", links="", limit=LIMIT, inertia=INERTIA, kinds=("revolute",) * 5):
    """An arm of five joints, 0.2 m from each to the next; ``hand`` goes into its last link."""
    text = '<link name="base"/>'
    for number, (axis, kind) in enumerate(zip(AXES, kinds, strict=True), start=1):
        inside = inertia + (hand if number == len(AXES) else "")
        parent = f"link{number - 1}" if number > 1 else "base"
        text += (
            f'<link name="link{number}">{inside}</link>'
            f'<joint name="joint{number}" type="{kind}"><parent link="{parent}"/>'
            f'<child link="link{number}"/><origin xyz="{0.2 if number > 1 else 0} 0 0"/>'
            f'<axis xyz="{axis}"/><limit {limit}/></joint>'
        )
    tip = (
        '<link name="tip"/><joint name="end" type="fixed"><parent link="link5"/>'
        '<child link="tip"/><origin xyz="0.2 0 0"/></joint>'
    )
    return f'<robot name="five">{text}{tip}{links}</robot>'


def write(folder, name, text):
    """A file with this text; folders are made as needed."""
    file = Path(folder) / name
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text)
    return file


def write_box(file, extents=(0.1, 0.04, 0.02)):
    """A mesh of a box in the format of the file's ending."""
    file.parent.mkdir(parents=True, exist_ok=True)
    trimesh.creation.box(extents).export(file)
    return file


def five(folder, name="five.urdf", **parts):
    """The arm of five joints from a file in ``folder``."""
    return load_arm(write(folder, name, urdf(**parts)), frame="tip")


def refusal(*arguments, **fields):
    """What the refusal of an arm says: always one line."""
    with pytest.raises(InvalidInputError) as caught:
        load_arm(*arguments, **fields)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def experiment(arm, start=START, duration=0.5, **more):
    """A circle of 20 mm by the pseudoinverse, from rest to rest."""
    return {
        "arm": arm,
        "start": list(start),
        "path": {
            "kind": "circle",
            "size": 0.02,
            "period": duration,
            "timing": "quintic",
            "laps": 1,
        },
        "law": {"kind": "pseudoinverse"},
        "period": 1e-3,
        "duration": duration,
        **more,
    }


def same_kinematics(one, other, rtol=0.0, atol=1e-15):
    """Whether two arms of five joints move alike."""
    for q in np.random.default_rng(0).uniform(-1.5, 1.5, (5, 5)):
        for name in ("p_WE", "R_WE", "J", "J_omega"):
            np.testing.assert_allclose(
                getattr(one.kinematics(), name)(q),
                getattr(other.kinematics(), name)(q),
                rtol=rtol,
                atol=atol,
                err_msg=name,
            )

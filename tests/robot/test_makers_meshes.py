"""The capsules of shipped arms hold their makers' robots, and pairs that can touch are kept."""

import sys
from pathlib import Path

import numpy as np
import pytest

from drake_rnn import load_arm
from drake_rnn.inputs.documents import read_yaml
from drake_rnn.models import MODELS
from drake_rnn.robot.clearance.arm_capsules import capsules_of, outside_of
from drake_rnn.robot.clearance.arm_clearance import arm_clearance
from drake_rnn.robot.clearance.arm_shapes import Enclosing, arm_shapes

HAND = {"model": "franka_hand", "frame": "hand_tcp"}
HERE = Path(__file__).parent
POINTS = sorted((HERE / "makers_points").glob("*.yaml"))


def outside(capsules, points):
    """How far a point is outside of all of a body's capsules at most [m]."""
    gaps = []
    for capsule in capsules:
        p, d = capsule.ends[0], capsule.ends[1] - capsule.ends[0]
        s = np.clip((points - p) @ d / max(float(d @ d), 1e-300), 0.0, 1.0)
        gaps.append(np.linalg.norm(points - p - s[:, None] * d, axis=1) - capsule.radius)
    return np.min(gaps, axis=0).max()


@pytest.mark.parametrize("shapes", ["coarse", "fine"])
@pytest.mark.parametrize("file", POINTS, ids=lambda file: file.stem)
def test_capsules_hold_the_farthest_points_of_the_makers_meshes(file, shapes):
    """In 26 directions of each link's frame; the file says of which meshes."""
    arm = load_arm(file.stem, shapes=shapes)
    capsules, _ = capsules_of(arm)
    farthest = read_yaml(file)
    assert len(farthest) == arm.n + 1
    for body, points in farthest.items():
        own = [capsule for capsule in capsules if capsule.body == body]
        assert outside(own, np.array(points)) <= 1e-6, body


@pytest.mark.parametrize("name", [file.stem for file in POINTS])
def test_what_is_drawn_is_within_the_capsules(name):
    """So that a drawn arm does not seem to touch what is kept clear."""
    arm = load_arm(name)
    shapes = arm_shapes(arm)
    capsules, _ = capsules_of(arm, shapes)
    drawn = [part for part in shapes.parts if part.body != "tool"]
    assert {part.body for part in drawn} == {c.body for c in capsules if c.body != "tool"}
    for part in drawn:
        own = [capsule for capsule in capsules if capsule.body == part.body]
        assert outside(own, part.points) <= 1e-3, part.body
    _, doubts = arm_clearance(arm, [], arm.home)
    assert doubts == ()


@pytest.mark.parametrize("name", [file.stem for file in POINTS])
def test_fine_capsules_keep_home_free_and_say_how_they_were_fitted(name):
    """More of them than of coarse ones, which take less space; the file has what was reached."""
    arm, fine = load_arm(name, tool=None), load_arm(name, tool=None, shapes="fine")
    clearance, doubts = arm_clearance(fine, [], arm.home)
    assert doubts == ()
    assert clearance.gaps(arm.home).min() > 0.01
    coarse, _ = arm_clearance(arm, [], arm.home)
    assert len(clearance.arm.bodies) > len(coarse.arm.bodies)
    assert set(clearance.arm.bodies) == set(coarse.arm.bodies)
    stated = read_yaml(Path(arm.description.capsules))["fine"]
    assert stated["outside"] == 0.0
    assert stated["excess"] <= 1.42
    assert f"fit_capsules.py {name} models/{name}/capsules.yaml --fine" in stated["made_by"]


@pytest.mark.parametrize("shapes", ["coarse", "fine"])
@pytest.mark.parametrize("name", ["panda", "fr3"])
def test_capsules_of_the_shipped_hand_hold_the_makers_and_what_is_drawn(name, shapes):
    """On a Panda and an FR3; with either shapes nothing of the hand is left out or near at home."""
    arm = load_arm(name, gripper=HAND, shapes=shapes)
    capsules, _ = capsules_of(arm)
    for body, points in read_yaml(HERE / "makers_points" / "grippers" / "franka_hand.yaml").items():
        own = [capsule for capsule in capsules if capsule.body == f"gripper_{body}"]
        assert len(own) > (shapes == "fine")
        assert outside(own, np.array(points)) <= 1e-6, body
        drawn = [part for part in arm_shapes(arm).parts if part.body == f"gripper_{body}"]
        assert len(drawn) == 1
        assert outside(own, drawn[0].points) <= 0.0, body
    clearance, doubts = arm_clearance(arm, [], arm.home)
    assert doubts == ()
    assert clearance.gaps(arm.home).min() > 0.01
    stated = read_yaml(MODELS / "franka_hand" / "capsules.yaml")["fine"]
    assert stated["outside"] == 0.0
    assert stated["excess"] <= 1.5


@pytest.mark.long
@pytest.mark.parametrize("shapes", ["coarse", "fine"])
def test_capsules_of_the_shipped_hand_hold_every_vertex_and_face(shapes, monkeypatch):
    """Of the meshes and boxes of example-robot-data: collision and visual ones, of three bodies."""
    pytest.importorskip("example_robot_data")
    pytest.importorskip("trimesh")
    monkeypatch.setattr(sys, "path", [*sys.path, str(HERE.parents[1] / "benchmarks")])
    from makers_meshes import GRIPPERS, gripper_surfaces

    monkeypatch.setitem(GRIPPERS, "franka_hand", GRIPPERS["franka_hand"][:1])
    capsules, _ = capsules_of(load_arm("panda", gripper=HAND, shapes=shapes))
    names = ("hand", "leftfinger", "rightfinger")
    for body, triangles in gripper_surfaces("franka_hand", names, []).items():
        own = [capsule for capsule in capsules if capsule.body == f"gripper_{body}"]
        every = [Enclosing(np.array(c.ends), c.radius) for c in own]
        assert outside(own, triangles.reshape(-1, 3)) <= 1e-6, body
        assert outside_of(triangles, every) <= 1e-6, body


@pytest.mark.long
@pytest.mark.parametrize("shapes", ["coarse", "fine"])
@pytest.mark.parametrize("name", ["panda", "ur5"])
def test_capsules_hold_every_vertex_of_the_meshes_of_example_robot_data(name, shapes, monkeypatch):
    """Collision and visual meshes, 8 and 7 links; fine capsules hold every face as well."""
    pytest.importorskip("example_robot_data")
    pytest.importorskip("trimesh")
    monkeypatch.setattr(sys, "path", [*sys.path, str(HERE.parents[1] / "benchmarks")])
    from makers_meshes import SOURCES, sources_of, surfaces_of

    monkeypatch.setitem(SOURCES, name, SOURCES[name][:1])
    arm = load_arm(name, tool=None, shapes=shapes)
    capsules, _ = capsules_of(arm)
    [(source, folder)] = sources_of(name, [])
    surfaces = surfaces_of(arm, source, folder)
    assert {(s.body, s.role) for s in surfaces} == {
        (capsule.body, role) for capsule in capsules for role in ("collision", "visual")
    }
    for surface in surfaces:
        own = [capsule for capsule in capsules if capsule.body == surface.body]
        assert outside(own, surface.vertices) <= 1e-6, (surface.body, surface.role)
        if shapes == "fine":
            triangles = surface.vertices[surface.faces]
            every = [Enclosing(np.array(c.ends), c.radius) for c in own]
            assert outside_of(triangles, every) <= 1e-6, (surface.body, surface.role)


# Postures in which two links are in contact by the meshes of example-robot-data.
CONTACTS = {
    "panda": [
        ("panda_link5", "panda_link7", [0, 0, 0, -1.5, 0, 0.377, 2.173]),
        ("panda_link2", "panda_link5", [1.188, 0.1478, 1.2765, -2.9371, -1.894, 0.9925, -0.1939]),
    ],
    "ur5": [
        ("base_link", "upper_arm_link", [-2.74889357, 1.57079633, 0, 0, 0, 0]),
        ("forearm_link", "wrist_2_link", [0, 0, 0, 1.57079633, 0, 0]),
    ],
}


@pytest.mark.parametrize("name", CONTACTS)
def test_links_that_touch_are_not_called_apart(name):
    arm = load_arm(name)
    clearance, doubts = arm_clearance(arm, [], arm.home)
    assert doubts == ()
    for first, second, q in CONTACTS[name]:
        pairs = [k for k, names in enumerate(clearance.names) if set(names) == {first, second}]
        assert clearance.gaps(np.array(q, dtype=float), pairs=np.array(pairs)).min() < 0.005


def test_one_capsule_of_a_body_that_has_several_can_be_left_out():
    """The barrel of the UR5's upper arm cannot touch the base, the rest of the link can."""
    arm = load_arm("ur5", tool=None)
    clearance, _ = arm_clearance(arm, [], arm.home)
    upper = [k for k, body in enumerate(clearance.arm.bodies) if body == "upper_arm_link"]
    base = [k for k, body in enumerate(clearance.arm.bodies) if body == "base_link"]
    own = {tuple(pair) for pair in clearance.own.tolist()}
    assert (len(base), len(upper)) == (2, 4)
    assert own & {(a, b) for a in base for b in upper} == {(a, b) for a in base for b in upper[1:]}

"""Planning scenes as obstacles: where MoveIt has their objects, and what is said of the rest."""

import json

import numpy as np
import pytest
import trimesh
from pydrake.math import RigidTransform, RollPitchYaw

from drake_rnn import InvalidInputError, load_arm, load_experiment, make_obstacles, simulate
from drake_rnn.robot.clearance.capsules import Capsule
from drake_rnn.robot.clearance.model_obstacle import SceneObstacle, all_obstacles
from row_helpers import each

#: As MoveIt 2 writes it; quaternions have the real part last, and cylinders the radius first.
NEW = """(noname)+
* a shelf
0.5 0 0.25
0 0 0.70710678118654757 0.70710678118654757
2
box
0.5 0.2 0.02
0.1 0 0.1
0 0 0 1
0 0 0 0
cylinder
0.05 0.3
0 0.1 0
0 0 0 1
1 0 0 1
1
grasp
0 0 0
0 0 0 1
* ball
-0.5 0 0.5
0 0 0 1
1
sphere
0.1
0 0 0
0 0 0 1
0 0 0 0
0
.
"""
#: As MoveIt wrote it before it had poses of objects, with a mesh, a cone and a plane.
OLD = """scene
* parts
3
mesh
4 4
0 0 0
0.1 0 0
0 0.1 0
0 0 0.1
0 1 2
0 1 3
0 2 3
1 2 3
0.4 0 0.3
0 0 0 1
0 0 0 0
cone
0.05 0.2
0.4 0.4 0.3
0 0 0 1
0 0 0 0
plane
0 0 2 0.2
0 0 0
0 0 0 1
0 0 0 0
.
"""
#: As MotionBenchMaker writes it.
MESSAGE = """
name: kitchen
robot_model_name: panda
fixed_frame_transforms:
  - header: {frame_id: world}
    child_frame_id: counter
    transform: {translation: [0, 0, 0.1], rotation: [0, 0, 0, 1]}
allowed_collision_matrix: {entry_names: [can], entry_values: [{enabled: [true]}]}
robot_state: {joint_state: {name: [], position: []}}
world:
  collision_objects:
    - id: can
      header: {frame_id: world}
      pose: {position: [0.5, 0, 0.25], orientation: [0, 0, 0.70710678118654757, 7.0710678118654757e-01]}
      primitives:
        - {type: cylinder, dimensions: [0.3, 0.05]}
        - {type: 1, dimensions: [0.1, 0.2, 3e-1]}
      primitive_poses:
        - {position: [0, 0.1, 0], orientation: [0, 0, 0, 1]}
        - {position: {x: 0.1, y: 0, z: 0}, orientation: {x: 0, y: 0, z: 0, w: 1}}
    - id: ball
      header: {frame_id: counter}
      primitives: [{type: SPHERE, dimensions: [0.1]}]
      primitive_poses: [{position: [0, 0.5, 0]}]
  octomap: {octomap: {data: [1]}}
"""  # noqa: E501


def scene(tmp_path, text, name="s.scene", **fields):
    file = tmp_path / name
    file.write_text(text)
    return make_obstacles([{"kind": "scene", "file": str(file), "name": "s", **fields}])


def test_the_text_of_moveit_places_shapes_in_objects(tmp_path):
    box, cylinder, ball = scene(tmp_path, NEW)
    assert [o.name for o in (box, cylinder, ball)] == ["s/a shelf", "s/a shelf 2", "s/ball"]
    X = RigidTransform(RollPitchYaw(0, 0, np.pi / 2), [0.5, 0, 0.25])
    np.testing.assert_allclose(box.center, [0.5, 0.1, 0.35], atol=1e-14)
    np.testing.assert_allclose(box.R_WO, X.rotation().matrix(), atol=1e-12)
    assert box.size.tolist() == [0.5, 0.2, 0.02]
    np.testing.assert_allclose(cylinder.center, [0.4, 0, 0.25], atol=1e-14)
    assert (cylinder.radius, cylinder.length) == (0.05, 0.3)
    assert (ball.center.tolist(), ball.radius) == ([-0.5, 0, 0.5], 0.1)


def test_older_text_has_shapes_alone_and_what_has_no_shape_of_its_own_is_enclosed(tmp_path):
    mesh, cone, plane = scene(tmp_path, OLD)
    assert (mesh.kind, cone.kind) == ("box", "capsule")
    assert mesh.corners.min(axis=0) == pytest.approx([0.4, 0, 0.3], abs=0.05)
    rim = 0.05 * np.array([[np.cos(t), np.sin(t), -2.0] for t in np.linspace(0, 7, 99)])
    tip, middle = [0, 0, 0.1], [0.4, 0.4, 0.3]
    assert Capsule(body="cone", ends=cone.ends, radius=cone.radius).holds(
        np.vstack((rim, tip)) + middle
    )
    inside = np.abs((0.1 * np.eye(3) + [0.4, 0, 0.3] - mesh.center) @ mesh.R_WO) - 0.5 * mesh.size
    assert inside.max() < 1e-9
    # 2 z + 0.2 = 0, and what is below is solid.
    np.testing.assert_allclose(plane.point, [0, 0, -0.1])
    np.testing.assert_allclose(plane.normal_W, [0, 0, 1], atol=1e-12)


@pytest.mark.parametrize("name", ["s.yaml", "s.json"])
def test_a_message_places_objects_in_its_frames(tmp_path, name):
    text = MESSAGE
    if name == "s.json":
        ruamel = pytest.importorskip("ruamel.yaml")
        text = json.dumps(ruamel.YAML(typ="safe").load(MESSAGE))
    moved = {"translation": [0, 0, 1.0], "rpy": [0, 0, np.pi]}
    cylinder, box, ball = scene(tmp_path, text, name, **moved)
    np.testing.assert_allclose(cylinder.center, [-0.4, 0, 1.25], atol=1e-12)
    assert (cylinder.radius, cylinder.length) == (0.05, 0.3)
    np.testing.assert_allclose(box.center, [-0.5, -0.1, 1.25], atol=1e-12)
    assert box.size.tolist() == [0.1, 0.2, 0.3]
    np.testing.assert_allclose(ball.center, [0, -0.5, 1.1], atol=1e-12)


def test_a_mesh_may_be_a_file_or_vertices(tmp_path):
    trimesh.creation.box([200.0, 100.0, 50.0]).export(tmp_path / "box.stl")
    corners = np.array(np.meshgrid([0, 0.2], [0, 0.1], [0, 0.05])).reshape(3, -1).T.tolist()
    vertices = ", ".join(f"{{x: {x}, y: {y}, z: {z}}}" for x, y, z in corners)
    text = (
        "world: {collision_objects: [{id: m, meshes: [{resource: 'file://"
        f"{tmp_path}/box.stl', dimensions: [0.001, 0.001, 0.001]}}, {{vertices: [{vertices}]}}],"
        " mesh_poses: [{position: [0.5, 0, 0]}, {position: [0, 0.5, 0]}]}]}"
    )
    one, other = scene(tmp_path, text, "s.yaml")
    for box, center in ((one, [0.5, 0, 0]), (other, [0.1, 0.55, 0.025])):
        np.testing.assert_allclose(box.center, center, atol=1e-7)
        np.testing.assert_allclose(np.sort(box.size), [0.05, 0.1, 0.2], atol=1e-6)


def test_what_is_ignored_is_told_in_one_line_and_the_arm_keeps_clear(tmp_path):
    (tmp_path / "kitchen.yaml").write_text(MESSAGE)
    obstacles = [{"kind": "scene", "file": str(tmp_path / "kitchen.yaml")}]
    changes = {"obstacles": obstacles, "duration": 0.05, "window": None, "accept": None}
    experiment = load_experiment("adaptive_nephroid_known", changes)
    assert (
        "obstacles[0]: kitchen.yaml: 2 objects; world is taken as the base; its "
        "allowed_collision_matrix, octomap are ignored" in experiment.warnings
    )
    assert "scene 1/can" in [o.name for o in experiment.obstacles]
    assert simulate(experiment).metrics["distance_min_m"] > 0.0


def test_an_object_that_is_named_twice_keeps_the_shapes_of_both(tmp_path):
    text = OLD.replace("\n.\n", "\n* parts\n1\nsphere\n0.1\n1 0 0\n0 0 0 1\n0 0 0 0\n.\n")
    assert [part.kind for part in scene(tmp_path, text)][2:] == ["half_space", "ball"]


def test_an_orientation_of_zeros_in_a_message_is_none_and_told(tmp_path):
    """As messages of ROS 1 have it, which were not filled in."""
    text = MESSAGE.replace("[0, 0, 0.70710678118654757, 7.0710678118654757e-01]", "[0, 0, 0, 0]")
    cylinder, *_ = scene(tmp_path, text, "s.yaml")
    np.testing.assert_allclose(cylinder.center, [0.5, 0.1, 0.25], atol=1e-12)
    (note,) = SceneObstacle(name="s", file=str(tmp_path / "s.yaml")).notes
    assert note.endswith("orientations of zeros are ignored")


REFUSED = {
    "nothing": ("s.scene", "", "is no scene of MoveIt: its second line must begin an object"),
    "cut short": ("s.scene", NEW[:60], "object 'a shelf': ends within an object"),
    "a shape of no name": (
        "s.scene",
        NEW.replace("sphere", "torus"),
        "object 'ball': no shape 'torus'; it may be box, sphere, cylinder, cone or mesh",
    ),
    "a word for a number": ("s.scene", NEW.replace("0.05 0.3", "0.05 x"), "object 'a shelf': must"),
    "no size": ("s.scene", NEW.replace("0.05 0.3", "0 0.3"), "must be larger than 0 m"),
    "a long quaternion": ("s.scene", NEW.replace("0 0 0 1", "0 0 0 3"), "the length 1, not 3"),
    "cut between objects": (
        "s.scene",
        NEW[: NEW.index("* ball")],
        "is not whole: MoveIt ends a scene with a line '.', and it has none",
    ),
    "more after the end": ("s.scene", NEW + NEW, "goes on after the line '.', which ends a scene"),
    "a quaternion of zeros": (
        "s.scene",
        NEW.replace("-0.5 0 0.5\n0 0 0 1", "-0.5 0 0.5\n0 0 0 0"),
        "object 'ball': a quaternion must have the length 1, not 0",
    ),
    "a cylinder of one size": (
        "s.scene",
        NEW.replace("0.05 0.3", "0.05"),
        "object 'a shelf': a cylinder has 2 numbers in a line, not 1",
    ),
    "a position of two": (
        "s.scene",
        NEW.replace("0.1 0 0.1", "0.1 0.1"),
        "object 'a shelf': a position has 3 numbers in a line, not 2",
    ),
    "a box of four sizes": (
        "s.scene",
        NEW.replace("0.5 0.2 0.02", "0.5 0.2 0.02 1"),
        "object 'a shelf': a position has 3 numbers in a line, not 1",
    ),
    "more shapes than it counts": (
        "s.scene",
        OLD.replace("\n3\nmesh", "\n2\nmesh"),
        "object 'parts': holds more than its 2 shapes",
    ),
    "fewer shapes than it has": (
        "s.scene",
        NEW.replace("\n2\nbox", "\n1\nbox"),
        "object 'a shelf': no count at 'cylinder'",
    ),
    "too many": ("s.scene", NEW.replace("\n2\n", "\n999\n"), "no count at '999'"),
    "no scene": ("s.yaml", "a: 1", "is no planning scene: it has no world with collision_obj"),
    "no YAML": ("s.yaml", "a: [", "is no YAML: line 2, column 1: did not find"),
    "no JSON": ("s.json", "{", "is no JSON: "),
    "several frames": (
        "s.yaml",
        MESSAGE.replace("{frame_id: counter}", "{frame_id: hand}"),
        "its objects are in several frames, hand, world",
    ),
    "another count of poses": (
        "s.yaml",
        MESSAGE.replace("primitive_poses: [{position: [0, 0.5, 0]}]", "primitive_poses: [{}, {}]"),
        "object 'ball': primitive_poses: must be 1, one for each of primitives",
    ),
    # MoveIt would keep the shapes that it had: to drop them would free their space.
    "an object that is changed": (
        "s.yaml",
        MESSAGE.replace("- id: ball", "- operation: 2\n      id: can"),
        "object 'can': operation: may be add or remove, 0 or 1, not 2",
    ),
    "a mesh that is not there": (
        "s.yaml",
        "world: {collision_objects: [{id: m, meshes: [{resource: 'package://x/y.stl'}]}]}",
        "object 'm': there is no mesh 'package://x/y.stl' that can be read",
    ),
}


@each(("name", "text", "said"), REFUSED.values(), ids=REFUSED)
def test_what_is_no_scene_is_refused_by_the_name_of_file_and_object(tmp_path, name, text, said):
    with pytest.raises(InvalidInputError) as caught:
        scene(tmp_path, text, name)
    assert f"obstacles[0].file: {name}: " in str(caught.value)
    assert said in str(caught.value)


def test_an_object_that_a_later_one_of_its_name_replaces_is_told(tmp_path):
    file = tmp_path / "s.yaml"
    file.write_text(MESSAGE.replace("- id: ball", "- id: can"))
    obstacle = SceneObstacle(file=str(file))
    assert "earlier objects of the name 'can' are ignored" in " ".join(obstacle.notes)
    # What is taken away on purpose is not.
    file.write_text(MESSAGE.replace("- id: ball", "- operation: 1\n      id: can"))
    obstacle = SceneObstacle(file=str(file))
    assert not obstacle.parts
    assert "earlier" not in " ".join(obstacle.notes)


ALONE = """
id: can
header: {frame_id: FRAME}
operation: 0
primitives: [{type: 1, dimensions: [0.1, 0.2, 0.3]}]
primitive_poses: [{position: {x: 0.5, y: 0, z: 0.2}, orientation: {x: 0, y: 0, z: 0, w: 1}}]
"""
WORLD = "world: {collision_objects: [{" + ", ".join(ALONE.split("\n")[1:-1]) + "}]}"


@pytest.mark.parametrize(
    "text", [ALONE, f"---{ALONE}---\n", WORLD, "- " + "\n  ".join(ALONE.strip().split("\n"))]
)
def test_an_object_alone_is_a_scene(tmp_path, text):
    (box,) = scene(tmp_path, text.replace("FRAME", "world"), "s.yaml")
    assert box.center.tolist() == [0.5, 0.0, 0.2]
    assert (box.name, box.size.tolist()) == ("s/can", [0.1, 0.2, 0.3])


@pytest.fixture(scope="module")
def lifted(tmp_path_factory):
    """An arm of one joint on a post, which is turned, and with a link that is locked."""
    folder = tmp_path_factory.mktemp("arm")
    body = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    links = "".join(f'<link name="{n}">{body}</inertial></link>' for n in ("foot", "top", "arm"))
    text = f"""<robot name="r">{links}<link name="tip"/>
      <joint name="post" type="fixed"><origin xyz="0 0 0.5" rpy="0 0 {np.pi / 2}"/>
        <parent link="foot"/><child link="top"/></joint>
      <joint name="turn" type="revolute"><axis xyz="0 0 1"/><parent link="top"/>
        <child link="arm"/><limit lower="-2" upper="2" velocity="1" effort="9"/></joint>
      <joint name="end" type="fixed"><origin xyz="0.3 0 0"/><parent link="arm"/>
        <child link="tip"/></joint></robot>"""
    (folder / "r.urdf").write_text(text)
    return load_arm(folder / "r.urdf", frame="tip")


@pytest.mark.parametrize(
    ("frame", "center"),
    [
        ("top", [0.0, 0.5, 0.7]),
        ("/top", [0.0, 0.5, 0.7]),
        ("foot", [0.5, 0.0, 0.2]),
        ("world", [0.5, 0.0, 0.2]),
        ("odom", [0.5, 0.0, 0.2]),
    ],
)
def test_a_frame_that_is_fixed_to_the_base_carries_its_objects(tmp_path, lifted, frame, center):
    (tmp_path / "s.yaml").write_text(ALONE.replace("FRAME", frame))
    sections = [{"kind": "scene", "file": str(tmp_path / "s.yaml")}]
    ((box,), (note,)) = all_obstacles(sections, lifted.pose_in_base)
    np.testing.assert_allclose(box.center, center, atol=1e-12)
    taken = "is at [0.0, 0.0, 0.5] m in the base" if "top" in frame else "is taken as the base"
    assert f"1 object; {frame} {taken}" in note


@pytest.mark.parametrize("frame", ["arm", "tip", "/tip"])
def test_a_frame_that_moves_is_refused_unless_it_is_placed(tmp_path, lifted, frame):
    (tmp_path / "s.yaml").write_text(ALONE.replace("FRAME", frame))
    section = {"kind": "scene", "file": str(tmp_path / "s.yaml")}
    said = f"obstacles.0.: s.yaml: its objects are placed in the frame '{frame.strip('/')}', which "
    with pytest.raises(InvalidInputError, match=said + "moves with r; its base is foot; state"):
        all_obstacles([section], lifted.pose_in_base)
    with pytest.raises(InvalidInputError, match=f"{said}may not be the base; give pose_in_base"):
        make_obstacles([section])
    ((box,), _) = all_obstacles([{**section, "translation": [0, 0, 1]}], lifted.pose_in_base)
    np.testing.assert_allclose(box.center, [0.5, 0.0, 1.2])


def test_a_run_refuses_a_scene_in_a_link_of_its_arm(tmp_path):
    """And in one that the model has not, which is called as all others are."""
    for frame, what in (("panda_link7", "moves with panda"), ("panda_hand", "may be a link of")):
        (tmp_path / "s.yaml").write_text(ALONE.replace("FRAME", frame))
        obstacles = [{"kind": "scene", "file": str(tmp_path / "s.yaml")}]
        with pytest.raises(InvalidInputError, match=f"frame '{frame}', which {what}"):
            load_experiment("adaptive_nephroid_known", {"obstacles": obstacles})


def test_frames_are_stated_in_one_another(tmp_path):
    """A transform is in the frame of its own header."""
    shelf = """
  - header: {frame_id: counter}
    child_frame_id: shelf
    transform: {translation: [0.2, 0, 0], rotation: [0, 0, 0, 1]}
allowed"""
    text = MESSAGE.replace("\nallowed", shelf).replace(
        "header: {frame_id: counter}\n      prim", "header: {frame_id: shelf}\n      prim"
    )
    *_, ball = scene(tmp_path, text, "s.yaml")
    np.testing.assert_allclose(ball.center, [0.2, 0.5, 0.1], atol=1e-12)
    circle = text.replace(
        "header: {frame_id: world}\n    child", "header: {frame_id: shelf}\n    child"
    )
    with pytest.raises(InvalidInputError, match="fixed_frame_transforms: 'shelf' is stated in its"):
        scene(tmp_path, circle, "s.yaml")

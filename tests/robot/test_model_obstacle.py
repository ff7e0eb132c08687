"""Obstacles from model files: where Drake says that they are, holding all that they stand for."""

import json

import numpy as np
import pytest
import trimesh
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from drake_rnn import InvalidInputError, load_experiment, make_obstacles, simulate
from drake_rnn.robot.clearance.model_obstacle import enclosing_box

POSE = {"translation": [0.6, -0.2, 0.1], "rpy": [0.2, -0.1, 0.7]}
X_WM = RigidTransform(RollPitchYaw(POSE["rpy"]), POSE["translation"])
SHORT = {"accept": None, "duration": 0.05, "window": None}


def urdf(tmp_path, links, joints="", name="table"):
    file = tmp_path / f"{name}.urdf"
    file.write_text(f'<robot name="{name}">{links}{joints}</robot>')
    return file


def link(name, *shapes, role="collision"):
    each = "".join(
        f'<{role}><origin xyz="{xyz}" rpy="{rpy}"/><geometry>{shape}</geometry></{role}>'
        for shape, xyz, rpy in shapes
    )
    return f'<link name="{name}">{each}</link>'


def fixed(parent, child, xyz="0 0 0", rpy="0 0 0", kind="fixed"):
    return (
        f'<joint name="to_{child}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="0 0 1"/></joint>'
    )


def placed(file, body):
    """Where Drake has a body of a model whose frame is at the pose."""
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(file))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    return X_WM @ plant.GetBodyByName(body).EvalPoseInWorld(context)


def made(file, fields=None):
    stated = {"kind": "model", "file": str(file), "name": "table", **POSE}
    return make_obstacles([{**stated, **(fields or {})}])


def holds(obstacle, points, tolerance=1e-12):
    """Whether a box or a capsule holds points of the world, up to rounding [m]."""
    if obstacle.kind == "box":
        inside = np.abs((points - obstacle.center) @ obstacle.R_WO) - 0.5 * obstacle.size
        return inside.max() <= tolerance
    p, d = obstacle.ends[0], obstacle.ends[1] - obstacle.ends[0]
    along = np.clip((points - p) @ d / max(d @ d, 1e-300), 0.0, 1.0)
    away = np.linalg.norm(points - p - along[:, None] * d, axis=1)
    return away.max() <= obstacle.radius + tolerance


def test_exact_shapes_are_where_drake_has_them(tmp_path):
    top = link("top", ('<box size="0.8 0.5 0.04"/>', "0.1 0 0.02", "0 0 0.3"))
    leg = link(
        "leg",
        ('<sphere radius="0.03"/>', "0 0 -0.1", "0 0 0"),
        ('<drake:capsule radius="0.02" length="0.3"/>', "0 0.1 0", "0.4 0.5 0"),
    )
    joint = fixed("top", "leg", "0.2 0.1 -0.3", "0.3 0.2 0.1")
    file = urdf(tmp_path, top + leg, joint)
    box, ball, capsule = made(file)
    assert [o.name for o in (box, ball, capsule)] == ["table/top", "table/leg", "table/leg 2"]
    X = placed(file, "top") @ RigidTransform(RollPitchYaw(0, 0, 0.3), [0.1, 0, 0.02])
    np.testing.assert_allclose(box.center, X.translation(), atol=1e-14)
    np.testing.assert_allclose(box.R_WO, X.rotation().matrix(), atol=1e-14)
    np.testing.assert_array_equal(box.size, [0.8, 0.5, 0.04])
    X_WL = placed(file, "leg")
    np.testing.assert_allclose(ball.center, X_WL @ np.array([0, 0, -0.1]), atol=1e-14)
    X = X_WL @ RigidTransform(RollPitchYaw(0.4, 0.5, 0), [0, 0.1, 0])
    ends = [X @ np.array([0, 0, z]) for z in (-0.15, 0.15)]
    np.testing.assert_allclose(capsule.ends, ends, atol=1e-14)
    assert (ball.radius, capsule.radius) == (0.03, 0.02)


def test_an_sdf_may_have_half_spaces_poses_and_bodies_that_nothing_holds(tmp_path):
    file = tmp_path / "room.sdf"
    file.write_text(
        '<sdf version="1.9"><model name="room"><pose>0 0 0.2 0 0 0.1</pose>'
        '<link name="floor"><collision name="c"><geometry><plane><normal>0 0 1</normal></plane>'
        '</geometry></collision></link><link name="cup"><pose>0.3 0 0.1 0 0.2 0</pose>'
        '<collision name="c"><geometry><sphere><radius>0.05</radius></sphere></geometry>'
        "</collision></link></model></sdf>"
    )
    floor, cup = made(file)
    np.testing.assert_allclose(floor.normal_W, X_WM.rotation().col(2), atol=1e-14)
    np.testing.assert_allclose(floor.point, X_WM @ np.array([0, 0, 0.2]), atol=1e-14)
    np.testing.assert_allclose(cup.center, placed(file, "cup").translation(), atol=1e-14)


def test_a_cylinder_is_one_where_drake_has_it(tmp_path):
    shape = ('<cylinder radius="0.02" length="0.6"/>', "0 0.1 0", "0.4 0.5 0")
    file = urdf(tmp_path, link("post", shape))
    (found,) = made(file)
    assert (found.kind, found.radius, found.length) == ("cylinder", 0.02, 0.6)
    X = placed(file, "post") @ RigidTransform(RollPitchYaw(0.4, 0.5, 0), [0, 0.1, 0])
    np.testing.assert_allclose(found.center, X.translation(), atol=1e-14)
    np.testing.assert_allclose(found.axis_W, X.rotation().col(2), atol=1e-14)
    corners = np.abs(found.corners - found.center).max(axis=0)
    rim = np.sqrt(1.0 - found.axis_W**2)
    np.testing.assert_allclose(corners, 0.3 * np.abs(found.axis_W) + 0.02 * rim, atol=1e-14)


@pytest.mark.parametrize(
    ("shape", "kind"),
    [
        ('<drake:ellipsoid a="0.3" b="0.2" c="0.02"/>', "box"),
        ('<drake:ellipsoid a="0.3" b="0.02" c="0.02"/>', "capsule"),
    ],
)
def test_what_is_round_is_held_by_the_smaller_of_box_and_capsule(tmp_path, shape, kind):
    """Points all over its surface; the volume is at most 2.1 times that of the shape."""
    (found,) = made(urdf(tmp_path, link("post", (shape, "0 0 0", "0 0 0"))))
    assert found.kind == kind
    u = np.random.default_rng(0).normal(size=(5000, 3))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    points = u * [float(shape.split(f'{axis}="')[1].split('"')[0]) for axis in "abc"]
    assert holds(found, (X_WM @ points.T).T)
    if kind == "box":
        reach = np.abs((X_WM @ points.T).T - found.center) @ np.abs(found.R_WO)
        assert reach.max() > 0.49 * found.size.max()


@pytest.mark.parametrize("ending", ["obj", "stl", "dae"])
def test_every_vertex_of_a_mesh_is_held(tmp_path, ending):
    """In metres, also of a mesh of millimetres that the model scales."""
    mesh = trimesh.creation.torus(100.0, 20.0)
    mesh.apply_transform(trimesh.transformations.random_rotation_matrix(np.array([0.3, 0.5, 0.7])))
    mesh.export(tmp_path / f"ring.{ending}")
    shape = f'<mesh filename="ring.{ending}" scale="0.001 0.001 0.001"/>'
    (found,) = made(urdf(tmp_path, link("ring", (shape, "0.1 0 0", "0 0 1"))))
    X = X_WM @ RigidTransform(RollPitchYaw(0, 0, 1), [0.1, 0, 0])
    points = (X @ (1e-3 * np.array(mesh.vertices)).T).T
    # Formats of single precision round each number.
    assert holds(found, points, 1e-12 if ending == "obj" else 2e-8)
    # Flat as it is: a box along the model's axes would have several times this volume.
    assert found.kind == "box"
    assert found.size.prod() < 1.2 * 0.24 * 0.24 * 0.04


def test_what_is_drawn_counts_where_nothing_is_for_collisions(tmp_path):
    ball = ('<sphere radius="0.03"/>', "0 0 0", "0 0 0")
    both = link("b", ball).replace("</link>", link("", (ball[0], "9 9 9", "0 0 0"), role="visual"))
    links = link("a", ball, role="visual") + both.replace('<link name="">', "") + ""
    names = [o.name for o in made(urdf(tmp_path, links, fixed("a", "b")))]
    assert names == ["table/a", "table/b"]


def test_a_box_of_points_is_the_smaller_of_two():
    rng = np.random.default_rng(1)
    turned = rng.uniform(-0.5, 0.5, (500, 3)) * [1.0, 0.2, 0.1]
    R = RollPitchYaw(0.4, 0.3, 0.8).ToRotationMatrix().matrix()
    box = enclosing_box(turned @ R.T + [1.0, 2.0, 3.0])
    assert box.volume < 1.1 * 1.0 * 0.2 * 0.1
    assert np.linalg.det(box.R) == pytest.approx(1.0)
    straight = enclosing_box(rng.uniform(-0.5, 0.5, (500, 3)))
    np.testing.assert_array_equal(straight.R, np.eye(3))
    # A single point, too.
    assert enclosing_box(np.ones((1, 3))).volume < 1e-24


BALL = link("a", ('<sphere radius="0.03"/>', "0 0 0", "0 0 0"))
DOOR = BALL + link("door", ('<sphere radius="0.03"/>', "0 0 0", "0 0 0"))


@pytest.mark.parametrize(
    ("text", "fields", "said"),
    [
        (BALL, {"file": "nowhere.urdf"}, r"obstacles\[0\].file: no file 'nowhere.urdf'"),
        ("", {}, r"obstacles\[0\].file: table.urdf "),
        ('<link name="a"/>', {}, r"obstacles\[0\].file: table.urdf has no geometry"),
        (
            DOOR + fixed("a", "door", kind="continuous"),
            {},
            r"obstacles\[0\].file: table.urdf: the joint 'to_door' is continuous; all must be ",
        ),
        (
            link("a", ('<mesh filename="lost.stl"/>', "0 0 0", "0 0 0")),
            {},
            r"obstacles\[0\].file: table.urdf: its mesh 'lost.stl' is missing",
        ),
        (
            link("a", ('<mesh filename="table.urdf.stl"/>', "0 0 0", "0 0 0")),
            {},
            r"obstacles\[0\].file: table.urdf: its mesh 'table.urdf.stl' cannot be read: ",
        ),
        (
            link("a", ('<sphere radius="-1"/>', "0 0 0", "0 0 0")),
            {},
            r"obstacles\[0\].file: table.urdf",
        ),
        (
            link("a", ('<sphere radius="1"/>', "0 0 500", "0 0 0")),
            {},
            r"obstacles\[0\].file: table.urdf: BallObstacle.center: must be within 100 m",
        ),
        (BALL + "<", {}, r"obstacles\[0\].file: table.urdf is neither URDF nor SDF"),
        (BALL, {"translation": [0, 0]}, r"obstacles\[0\].translation: must have 3 entries"),
        (BALL, {"rpy": [0, 0, 90]}, r"obstacles\[0\].rpy: must be angles"),
        (BALL, {"center": [0, 0, 0]}, r"obstacles\[0\].center: no such key"),
        (BALL, {"file": 3}, r"obstacles\[0\].file: must be text, not 3"),
    ],
)
def test_what_is_no_obstacle_is_refused(tmp_path, text, fields, said):
    file = urdf(tmp_path, text)
    (tmp_path / "table.urdf.stl").write_text("no mesh")
    with pytest.raises(InvalidInputError, match=said) as error:
        made(file, fields)
    assert "\n" not in str(error.value)


def test_shapes_that_drake_would_leave_out_are_refused(tmp_path):
    """A height map would be no obstacle, and no one would know."""
    file = tmp_path / "hill.sdf"
    file.write_text(
        '<sdf version="1.9"><model name="hill"><link name="a"><collision name="c"><geometry>'
        "<heightmap><uri>a.png</uri></heightmap></geometry></collision><collision name='d'>"
        "<geometry><sphere><radius>0.05</radius></sphere></geometry></collision></link></model></sdf>"
    )
    with pytest.raises(InvalidInputError, match=r"file: hill\.sdf"):
        made(file)


def test_models_count_with_all_of_their_shapes(tmp_path):
    """200 in all; and names that are given twice are those of bodies."""
    shapes = [('<sphere radius="0.01"/>', f"{k} 0 0", "0 0 0") for k in range(60)]
    file = urdf(tmp_path, link("a", *shapes))
    entry = {"kind": "model", "file": str(file)}
    assert len(make_obstacles([entry] * 3)) == 180
    with pytest.raises(InvalidInputError, match="obstacles: may be up to 200, not 240"):
        make_obstacles([entry] * 4)
    with pytest.raises(InvalidInputError, match=r"obstacles\[1\].name: 'b/a' is given twice"):
        make_obstacles([{**entry, "name": "b"}] * 2)


def test_the_document_of_a_run_names_the_file_wherever_it_is_saved(tmp_path):
    """A relative name is that of the document's folder; the saved one runs again, bit for bit."""
    (tmp_path / "scene").mkdir()
    urdf(
        tmp_path / "scene", link("post", ('<cylinder radius="0.03" length="1"/>', "0 0 0", "0 0 0"))
    )
    document = load_experiment("adaptive_nephroid_known", SHORT).document.contents()
    document["obstacles"] = [
        {"kind": "model", "file": "table.urdf", "translation": [0.6, 0.4, 0.5]},
        {"kind": "half_space", "point": [0, 0, -0.2], "normal": [0, 0, 1]},
    ]
    (tmp_path / "scene" / "mine.yaml").write_text(json.dumps(document, default=list))
    experiment = load_experiment(tmp_path / "scene" / "mine.yaml")
    assert [o.name for o in experiment.obstacles] == ["model 1/post", "half_space 2"]
    result = simulate(experiment)
    result.save(tmp_path / "out")
    again = simulate(load_experiment(tmp_path / "out" / "experiment.yaml"))
    for name, series in result.series.items():
        np.testing.assert_array_equal(again.series[name], series, err_msg=name)
    assert again.metrics["distance_min_m"] == result.metrics["distance_min_m"]


OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n"


@pytest.mark.parametrize("vertex", ["nan 0 0", "0 inf 0", "0 0 1e999", "a 0 0", "1 0", "0 0 -NaN"])
def test_a_vertex_that_is_no_finite_number_is_refused(tmp_path, vertex):
    """Drake takes it for 0."""
    (tmp_path / "box.obj").write_text(OBJ.replace("1 0 0", vertex, 1))
    file = urdf(tmp_path, link("box", ('<mesh filename="box.obj"/>', "0 0 0", "0 0 0")))
    with pytest.raises(InvalidInputError, match=r"'box\.obj' cannot be read: .* not finite: 'v "):
        made(file)
    surface = {"kind": "model", "model": str(file)}
    with pytest.raises(
        InvalidInputError, match=r"environment\.model: its mesh 'box\.obj' cannot b"
    ):
        load_experiment("contact_inclined", {"environment": surface})


@pytest.mark.parametrize("ending", ["stl", "ply", "dae", "gltf", "glb", "off"])
def test_so_is_one_of_any_other_format(tmp_path, ending):
    box = trimesh.creation.box()
    box.vertices[0, 0] = np.nan
    box.export(tmp_path / f"box.{ending}")
    file = urdf(tmp_path, link("box", (f'<mesh filename="box.{ending}"/>', "0 0 0", "0 0 0")))
    with pytest.raises(InvalidInputError, match=rf"box\.{ending}' cannot be read: "):
        made(file)


@pytest.mark.parametrize(
    "vertex", ["1 0 0", " 1.0e0\t0 0 ", "1. .0 0 0.5 0.5 0.5", "+1 -0 0 1", "1 0 0\r"]
)
def test_vertices_in_any_way_of_writing_are_read(tmp_path, vertex):
    (tmp_path / "box.obj").write_text(OBJ.replace("1 0 0", vertex, 1))
    file = urdf(tmp_path, link("box", ('<mesh filename="box.obj"/>', "0 0 0", "0 0 0")))
    assert len(made(file)) == 1

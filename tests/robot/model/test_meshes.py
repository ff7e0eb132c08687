"""Meshes of models: in which formats they may be, where they are found, and what if they fail."""

import base64
import json
import multiprocessing
import re
import tempfile
from pathlib import Path

import numpy as np
import pytest
import trimesh
from model_files import experiment, five, refusal, shape, urdf, write, write_box
from PIL import Image
from pydrake.geometry import Role
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from drake_rnn import InvalidInputError, load_arm, make_experiment, simulate, write_playback
from drake_rnn.inputs.files import cache_folder, cached_file
from drake_rnn.robot.model.meshes import gltf_file
from scene_helpers import extents


def drawn(arm):
    """Half the extents [m] of the boxes round all that is drawn."""
    return extents(arm, Role.kIllustration)


def colours(file):
    """Colours of a glTF file's materials, as shares of light."""
    materials = json.loads(file.read_text())["materials"]
    return [material["pbrMetallicRoughness"]["baseColorFactor"] for material in materials]


@pytest.mark.parametrize("ending", ["stl", "dae", "obj", "ply", "glb", "STL"])
def test_a_mesh_is_drawn_in_its_size_and_its_orientation_whatever_its_format(tmp_path, ending):
    """1e-6 m: single precision. z is up in robots and y in glTF: a turn too few would show."""
    write_box(tmp_path / f"meshes/hand.{ending}")
    arm = five(tmp_path, hand=shape(f"meshes/hand.{ending}"))
    assert arm.warnings == ()
    (half,) = drawn(arm)
    np.testing.assert_allclose(half, [0.05, 0.02, 0.01], atol=1e-6)


def test_collada_is_read_in_its_unit(tmp_path):
    """Millimetres; rounding of single precision."""
    file = write_box(tmp_path / "hand.dae", (100.0, 40.0, 20.0))
    millimetres = '<unit name="millimeter" meter="0.001" /></asset>'
    file.write_text(file.read_text().replace("</asset>", millimetres))
    (half,) = drawn(five(tmp_path, hand=shape("hand.dae")))
    np.testing.assert_allclose(half, [0.05, 0.02, 0.01], atol=1e-6)


def test_the_scale_of_a_mesh_is_kept(tmp_path):
    write_box(tmp_path / "hand.stl", (100.0, 40.0, 20.0))
    scaled = shape("hand.stl").replace("/></geometry>", ' scale="1e-3 1e-3 1e-3"/></geometry>')
    (half,) = drawn(five(tmp_path, hand=scaled))
    np.testing.assert_allclose(half, [0.05, 0.02, 0.01], atol=1e-6)


def test_a_mesh_without_colours_has_that_of_its_model(tmp_path, monkeypatch):
    """2/255: colours are stored in 8 bits. Another test may make the same mesh meanwhile."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    file = write_box(tmp_path / "hand.stl")
    (colour,) = colours(gltf_file(file, (0.5, 0.0, 0.25, 1.0)))
    np.testing.assert_allclose(colour, [0.5**2.2, 0.0, 0.25**2.2, 1.0], atol=2 / 255)
    named = '<material name="hue"/>'
    hue = '<material name="hue"><color rgba="1 0 0 1"/></material>'
    before = set(cache_folder().glob("meshes/*"))
    five(tmp_path, hand=shape("hand.stl", more=named), links=hue)
    (made,) = set(cache_folder().glob("meshes/*")) - before
    ((red, green, blue, opacity),) = colours(made)
    assert red > 0.5
    assert green == blue == 0.0
    assert opacity == 1.0


def test_a_mesh_keeps_its_own_colours_and_textures(tmp_path):
    box = trimesh.creation.box((0.1, 0.1, 0.1))
    material = trimesh.visual.material.PBRMaterial(baseColorFactor=[0, 0, 255, 255])
    box.visual = trimesh.visual.TextureVisuals(material=material)
    box.export(tmp_path / "blue.dae")
    (colour,) = colours(gltf_file(tmp_path / "blue.dae", (1.0, 0.0, 0.0, 1.0)))
    assert colour[0] == colour[1] == 0.0
    assert colour[2] > 0.5
    Image.new("RGB", (8, 8), (10, 200, 30)).save(tmp_path / "skin.png")
    write(tmp_path, "skin.mtl", "newmtl skin\nKd 1 1 1\nmap_Kd skin.png\n")
    corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n"
    text = f"mtllib skin.mtl\n{corners}usemtl skin\nf 1/1 2/2 3/3\n"
    gltf = gltf_file(write(tmp_path, "skin.obj", text), None)
    assert len(json.loads(gltf.read_text())["images"]) == 1
    Image.new("RGB", (8, 8), (200, 10, 30)).save(tmp_path / "skin.png")
    assert gltf_file(tmp_path / "skin.obj", None) != gltf


def test_materials_of_one_name_and_different_colours_are_no_obstacle(tmp_path):
    write_box(tmp_path / "hand.stl")
    red, blue = (
        f'<material name="x"><color rgba="{c}"/></material>' for c in ("1 0 0 1", "0 0 1 1")
    )
    arm = five(tmp_path, hand=shape("hand.stl", more=red) + shape("hand.stl", more=blue))
    assert len(drawn(arm)) == 2


def test_a_mesh_is_converted_once(tmp_path, monkeypatch):
    write_box(tmp_path / "hand.stl", (0.11, 0.1, 0.1))
    five(tmp_path, hand=shape("hand.stl"))
    monkeypatch.setattr("drake_rnn.robot.model.meshes._gltf", None)
    assert five(tmp_path, hand=shape("hand.stl")).warnings == ()
    write_box(tmp_path / "hand.stl", (0.12, 0.1, 0.1))
    assert "cannot be read" in five(tmp_path, hand=shape("hand.stl")).warnings[0]


def test_a_missing_mesh_is_left_out_with_one_warning(tmp_path):
    """Before, the arm was refused."""
    hand = shape("meshes/a.stl") + shape("meshes/b.stl") + shape("meshes/a.stl", "collision")
    (*_, warning) = five(tmp_path, hand=hand).warnings
    assert warning == (
        "arm.model: five.urdf: 2 meshes, meshes/a.stl first, are missing; the arm is drawn without "
        "them"
    )
    one = five(tmp_path, hand=shape("package://five_parts/a.stl"))
    assert one.warnings == (
        "arm.model: five.urdf: package://five_parts/a.stl is missing; the arm is drawn without it; "
        "give the folder of five_parts in arm.packages",
    )
    assert drawn(one) == []


@pytest.mark.parametrize("ending", ["stl", "dae", "obj", "gltf.zip"])
def test_a_broken_mesh_is_left_out_with_one_warning(tmp_path, ending):
    write(tmp_path, f"hand.{ending}", "this is no mesh")
    (warning,) = five(tmp_path, hand=shape(f"hand.{ending}")).warnings
    assert warning.startswith(f"arm.model: five.urdf: the mesh {tmp_path}/hand.{ending} cannot be")
    assert "\n" not in warning


def test_a_mesh_with_a_vertex_of_nan_is_left_out_with_one_warning(tmp_path):
    box = trimesh.creation.box()
    box.vertices[0, 0] = np.nan
    box.export(tmp_path / "hand.stl")
    arm = five(tmp_path, hand=shape("hand.stl"))
    assert len(arm.warnings) == 1
    assert "it has a vertex that is not finite; the arm is drawn without it" in arm.warnings[0]


def test_collision_meshes_make_no_contact_and_primitives_stay(tmp_path):
    """Before, STL was refused: MakeConvexHull only applies to .obj, .vtk, and .gltf meshes."""
    write_box(tmp_path / "hand.stl")
    ball = '<collision><geometry><sphere radius="0.01"/></geometry></collision>'
    arm = five(tmp_path, hand=shape("hand.stl", "collision") + ball)
    assert arm.warnings == (
        "arm.model: five.urdf: collision meshes count for distances, but make no contact: those of "
        "link5",
    )
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
    arm.add_to(plant)
    assert len(scene_graph.model_inspector().GetAllGeometryIds(Role.kProximity)) == 1


def test_a_collision_mesh_meant_for_drake_stays(tmp_path):
    write_box(tmp_path / "hand.obj")
    rigid = "<drake:proximity_properties><drake:rigid_hydroelastic/></drake:proximity_properties>"
    arm = five(tmp_path, hand=shape("hand.obj", "collision", rigid))
    assert arm.warnings == ()
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
    arm.add_to(plant)
    assert len(scene_graph.model_inspector().GetAllGeometryIds(Role.kProximity)) == 1


# Where meshes are found.


@pytest.mark.parametrize(
    "place",
    [
        "five_description/meshes/hand.stl",  # the model's own package, by its folder's name
        "renamed/meshes/hand.stl",  # by its package.xml
        "five/meshes/hand.stl",  # without _description
    ],
)
def test_a_package_is_found_above_the_model(tmp_path, place):
    package = tmp_path / place.split("/")[0]
    write_box(tmp_path / place)
    write(package, "package.xml", "<package><name>five_description</name></package>")
    file = write(package, "urdf/five.urdf", urdf(hand=shape(URI)))
    assert load_arm(file, frame="tip").warnings == ()


URI = "package://five_description/meshes/hand.stl"


def test_a_package_is_found_where_ros_looks(tmp_path, monkeypatch):
    file = write(tmp_path, "here/five.urdf", urdf(hand=shape(URI)))
    assert "arm.packages" in load_arm(file, frame="tip").warnings[0]
    ros, ament = tmp_path / "ros", tmp_path / "ament"
    write_box(ros / "five_description/meshes/hand.stl")
    write(
        ros / "five_description",
        "package.xml",
        "<package><name>five_description</name><maintainer email='a@b.c'>a</maintainer></package>",
    )
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(ros))
    assert load_arm(file, frame="tip").warnings == ()
    monkeypatch.delenv("ROS_PACKAGE_PATH")
    write_box(ament / "share/five_description/meshes/hand.stl")
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/nowhere:{ament}")
    assert load_arm(file, frame="tip").warnings == ()


def test_a_package_that_is_given_goes_before_one_that_is_found(tmp_path):
    write_box(tmp_path / "five_description/meshes/hand.stl", (0.1, 0.1, 0.1))
    write_box(tmp_path / "other/meshes/hand.stl", (0.2, 0.2, 0.2))
    file = write(tmp_path, "five_description/five.urdf", urdf(hand=shape(URI)))
    packages = {"five_description": str(tmp_path / "other")}
    (half,) = drawn(load_arm(file, frame="tip", packages=packages))
    np.testing.assert_allclose(half, 0.1, atol=1e-6)
    assert refusal(file, frame="tip", packages={"five_description": "/nowhere"}) == (
        "arm.packages.five_description: no folder '/nowhere'"
    )


def test_paths_may_have_spaces_and_be_relative_or_absolute(tmp_path, monkeypatch):
    folder = tmp_path / "my robots"
    mesh = write_box(folder / "the hand.stl")
    for uri in ("the hand.stl", str(mesh), mesh.as_uri(), "./the hand.stl"):
        file = write(folder, "my five.urdf", urdf(hand=shape(uri)))
        assert load_arm(file, frame="tip").warnings == (), uri
    monkeypatch.chdir(tmp_path)
    assert load_arm("my robots/my five.urdf", frame="tip").warnings == ()


# The cache.


def make(number):
    return cached_file("race/file", lambda: b"x" * 1_000_000).read_bytes() == b"x" * 1_000_000


# JAX, where another test has loaded it, is not used by what is forked here.
@pytest.mark.long
@pytest.mark.filterwarnings("ignore:os.fork:RuntimeWarning")
def test_processes_that_race_for_a_file_all_get_it_whole():
    with multiprocessing.get_context("fork").Pool(8) as pool:
        assert all(pool.map(make, range(64), chunksize=1))
    assert len(list((cache_folder() / "race").iterdir())) == 1


def test_a_cache_that_cannot_be_written_is_said(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(write(tmp_path, "file", "")))
    write_box(tmp_path / "hand.stl")
    message = refusal(write(tmp_path, "five.urdf", urdf(hand=shape("hand.stl"))), frame="tip")
    assert message.startswith("XDG_CACHE_HOME: cannot keep ")


def test_a_user_without_a_home_has_a_cache_that_nobody_else_writes(monkeypatch, tmp_path):
    def no_home():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(Path, "home", no_home)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    file = cached_file("a.txt", lambda: b"kept")
    assert file.read_bytes() == b"kept"
    assert file.parent.parent == tmp_path
    assert file.parent.stat().st_mode & 0o777 == 0o700
    file.parent.chmod(0o777)
    with pytest.raises(InvalidInputError, match="XDG_CACHE_HOME: must be given: this user has no"):
        cached_file("a.txt", lambda: b"kept")


# A whole run.


@pytest.mark.parametrize("ending", ["stl", "dae"])
def test_a_run_of_an_arm_with_meshes_plays_back(tmp_path, ending):
    """Before, a traceback after the run. 2 um: the pseudoinverse at 1 kHz, by Euler's scheme."""
    write_box(tmp_path / f"hand.{ending}")
    write(tmp_path, "five.urdf", urdf(hand=shape(f"hand.{ending}")))
    arm = {"model": str(tmp_path / "five.urdf"), "frame": "tip"}
    result = simulate(make_experiment(experiment(arm)))
    assert result.metrics["position_error_max_m"] < 1e-4
    page = write_playback(result, tmp_path / "playback.html", 8).read_text()
    (scene,) = re.findall(r'<script id="playback-scene" [^>]*>(.*?)</script>', page)
    sent = [base64.b64decode(command) for command in json.loads(scene)]
    assert any(b"_meshfile_object" in command for command in sent)

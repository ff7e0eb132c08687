"""Arms drawn by another model of them: where the meshes lie, what else changes, what is refused."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from pydrake.geometry import Meshcat, MeshcatParams

from drake_rnn import InvalidInputError, load_arm, load_experiment, simulate
from drake_rnn.playback import write_playback
from drake_rnn.playback.arm_drawing import DrawnArm, meshes_of
from drake_rnn.robot import arm_description as looks_file
from drake_rnn.robot.clearance.arm_capsules import capsules_of

pytest.importorskip("fast_simplification")

LINK = """
<link name="{name}"><inertial><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
<visual><origin xyz="{xyz}" rpy="{rpy}"/><geometry><mesh filename="ball.stl"/></geometry></visual>
</link>"""
JOINT = """
<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>
<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>
<limit lower="-2" upper="2" velocity="1" effort="1"/></joint>"""


def robot(folder, name, base, elbow):
    """A model of two joints; the frame of its second link and its place are given by its maker.

    Args:
        folder: Where it is written.
        name: Its name.
        base: Height of the first axis.
        elbow: Roll of the second link's frame, which leaves the joint's axis where it is.
    """
    trimesh.creation.icosphere(subdivisions=3, radius=0.1).export(folder / "ball.stl")
    c, s = round(np.cos(elbow), 12), round(np.sin(elbow), 12)
    text = "".join(
        (
            LINK.format(name="base", xyz="0 0 0", rpy="0 0 0"),
            LINK.format(name="upper", xyz="0.2 0 0", rpy="0 0 0"),
            # The centre of this ball is 0.1 m above the elbow in the first model's axes.
            LINK.format(name="lower", xyz=f"0 {0.1 * s} {0.1 * c}", rpy="0 0 0"),
            JOINT.format(
                name="one", parent="base", child="upper", xyz=f"0 0 {base}", rpy="0 0 0",
                axis="0 0 1",
            ),
            JOINT.format(
                name="two", parent="upper", child="lower", xyz="0.4 0 0", rpy=f"{elbow} 0 0",
                axis=f"0 {c} {-s}",
            ),
        )
    )  # fmt: skip
    file = folder / f"{name}.urdf"
    file.write_text(f'<robot name="{name}">{text}</robot>')
    return file


def test_meshes_lie_where_they_do_in_the_makers_model_whatever_its_frames(tmp_path):
    ours, theirs = (robot(tmp_path, n, 0.3, a) for n, a in (("ours", 0.0), ("theirs", 0.7)))
    arm = load_arm(ours, frame="lower", looks=str(theirs))
    placed = {body.name(): X_BG for body, X_BG, _ in meshes_of(arm, arm.plant())}
    np.testing.assert_allclose(placed["upper"].translation(), [0.2, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(placed["lower"].translation(), [0.0, 0.0, 0.1], atol=1e-9)


def test_a_model_whose_joints_lie_elsewhere_is_refused(tmp_path):
    ours = robot(tmp_path, "ours", 0.3, 0.0)
    arm = load_arm(ours, frame="lower", looks=str(robot(tmp_path, "higher", 0.3, 0.0)))
    assert meshes_of(arm, arm.plant())
    text = robot(tmp_path, "longer", 0.3, 0.0).read_text().replace("0.4 0 0", "0.45 0 0")
    (tmp_path / "longer.urdf").write_text(text)
    other = load_arm(ours, frame="lower", looks=str(tmp_path / "longer.urdf"))
    with pytest.raises(InvalidInputError, match=r"longer.urdf: two is 50 mm off the arm's axis"):
        meshes_of(other, other.plant())


def test_meshes_are_simplified_to_the_number_of_triangles(tmp_path):
    file = robot(tmp_path, "ours", 0.3, 0.0)
    full = 3 * len(trimesh.load_mesh(tmp_path / "ball.stl").faces)
    for triangles, expected in ((600, 600), (100_000, full)):
        arm = load_arm(file, frame="lower", looks=str(file), triangles=triangles)
        meshes = [mesh for _, _, mesh in meshes_of(arm, arm.plant())]
        loaded = [trimesh.load_scene(str(mesh.source().path())).to_mesh() for mesh in meshes]
        assert sum(len(mesh.faces) for mesh in loaded) == pytest.approx(expected, rel=0.02)
        for mesh in loaded:
            # The triangles cut a ball of 0.1 m by some millimetres.
            radius = np.linalg.norm(mesh.vertices, axis=1)
            assert 0.095 < radius.min() < radius.max() < 0.103


def test_the_arm_s_own_shapes_give_way_and_its_tool_stays(tmp_path):
    file = robot(tmp_path, "ours", 0.3, 0.0)
    tool = {"ball": 0.01, "length": 0.1, "mass": 0.1}
    names = []
    for looks in (None, str(file)):
        arm = load_arm(file, frame="lower", tool=tool, looks=looks)
        drawn = DrawnArm(arm, Meshcat(MeshcatParams(port=None, host="localhost")))
        names.append([drawn.inspector.GetName(geometry) for _, geometry in drawn.geometries()])
    own, made = names
    links = [name for name in made if "looks_" in name]
    assert len(links) == 3
    # The three links' own shapes are gone, and the tool's are as they were.
    kept = [name for name in made if name not in links]
    assert len(kept) == len(own) - 3
    assert set(kept) < set(own)


def test_looks_change_no_bit_of_a_run_nor_masses_nor_capsules(looked_at):
    document = {"duration": 0.2}
    plain, other = (
        simulate(load_experiment("pinv_line", document | {"arm": arm}))
        for arm in ("panda", {"model": "panda", "looks": looked_at})
    )
    assert plain.series.keys() == other.series.keys()
    for name, series in plain.series.items():
        np.testing.assert_array_equal(series, other.series[name])
    arms = [load_arm("panda"), load_arm("panda", looks=looked_at)]
    M = [arm.kinematics().M(arm.home) for arm in arms]
    np.testing.assert_array_equal(*M)
    assert str(capsules_of(arms[0])) == str(capsules_of(arms[1]))


@pytest.fixture
def looked_at():
    """The package, where it is installed, or else the arm's own file."""
    arm = load_arm("panda")
    file, _ = looks_file.looks_file(looks_file.PACKAGE, arm.model)
    return looks_file.PACKAGE if file else str(arm.model)


def test_without_the_package_the_arm_is_drawn_as_its_model_says(monkeypatch):
    monkeypatch.setattr(looks_file, "_ROBOTS", looks_file.Path("nowhere"))
    arm = load_arm("panda", looks="example-robot-data")
    (warning,) = arm.warnings
    assert "needs example-robot-data, which is not installed" in warning
    assert "pip install 'example-robot-data>=6' 'fast-simplification>=0.1'" in warning
    assert arm.looks is None


def test_an_arm_or_file_that_is_not_there_is_refused():
    with pytest.raises(InvalidInputError, match="example-robot-data has no puma560; it may be pan"):
        load_arm("puma560", looks="example-robot-data")
    with pytest.raises(InvalidInputError, match=r"arm.looks: no file 'nowhere.urdf'; it may be"):
        load_arm("panda", looks="nowhere.urdf")


@pytest.mark.long
@pytest.mark.parametrize("name", ["panda", "ur5"])
def test_the_makers_meshes_lie_in_the_capsules_of_the_arm(name):
    """But for what the meshes that are drawn lose with most of their triangles."""
    arm = load_arm(name, looks="example-robot-data", triangles=100_000)
    if arm.looks is None:
        pytest.skip("needs example-robot-data")
    capsules, _ = capsules_of(arm)
    for body, X_BG, mesh in meshes_of(arm, arm.plant()):
        points = trimesh.load_scene(str(mesh.source().path())).to_mesh().vertices
        # glTF's y is up.
        points = X_BG @ (points[:, [0, 2, 1]] * [1, -1, 1]).T
        own = [each for each in capsules if each.body == body.name()]
        away = np.min([outside(points.T, each) for each in own], axis=0)
        assert away.max() < 0.002
        assert away.min() < 0.0


@pytest.mark.long
@pytest.mark.parametrize("name", ["panda", "ur5"])
def test_a_page_with_the_makers_meshes_stays_small(tmp_path, name):
    if load_arm(name, looks="example-robot-data").looks is None:
        pytest.skip("needs example-robot-data")
    document = {"arm": {"model": name, "looks": "example-robot-data"}, "duration": 20.0}
    result = simulate(load_experiment("pinv_letter", document | {"window": None, "accept": None}))
    page = write_playback(result, tmp_path / "playback.html")
    assert page.stat().st_size < 6e6


def outside(points, capsule):
    """Distance of points, shape (k, 3), from a capsule; below 0 within it [m]."""
    a, b = np.array(capsule.ends)
    s = np.clip((points - a) @ (b - a) / max((b - a) @ (b - a), 1e-12), 0.0, 1.0)
    return np.linalg.norm(points - a - s[:, None] * (b - a), axis=1) - capsule.radius

"""Playbacks of a tool that presses against a surface, read without a browser."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import umsgpack
from pydrake.common.eigen_geometry import Quaternion
from test_playback import Page

from drake_rnn.environments import ElasticSurface, ModelSurface, Plate
from drake_rnn.experiment import load_experiment
from drake_rnn.playback import write_playback
from drake_rnn.playback.path_drawings import LENGTH, _along, reference_force
from drake_rnn.playback.replay import (
    ReplayedContact,
    project,
    replayed_contact,
    replayed_motion,
    ribbon,
)
from drake_rnn.runs.result import Result
from drake_rnn.runs.simulation import simulate

RATE = 64
UP = np.array([0.0, 0.0, 1.0])
ORIGIN = np.zeros(3)
# A path that leaves the plate soon after its start.
EDGE = {
    "path": {"kind": "circle", "plane": "xy", "size": 0.03, "period": 4.0, "timing": "sin2"},
    "environment": {"kind": "plate", "friction": 0.3, "size": 0.1, "offset": [0.045, 0, 0]},
    "duration": 1.5,
}
# A ball with a radius of 0.3 m and its top at the model's origin; it may look like a green box.
DOME = """<robot name="dome" xmlns:drake="http://drake.mit.edu"><link name="dome">
  <inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
  {visual}
  <collision><origin xyz="0 0 -0.3"/><geometry><sphere radius="0.3"/></geometry>
    <drake:proximity_properties><drake:rigid_hydroelastic/>
      <drake:mesh_resolution_hint value="0.02"/></drake:proximity_properties></collision>
</link></robot>"""
GREEN_BOX = """<visual><geometry><box size="0.04 0.04 0.04"/></geometry>
  <material name="green"><color rgba="0 1 0 1"/></material></visual>"""


def run(name: str, **changes: Any) -> Result:
    return simulate(load_experiment(name, {"window": None, **changes}))


def page_of(result: Result, folder: Path) -> Page:
    return Page(write_playback(result, folder / "playback.html"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("playback")


@pytest.fixture(scope="module")
def approach() -> Result:
    """A run that starts 5 mm above the plate."""
    return run("contact_approach", duration=1.5)


@pytest.fixture(scope="module")
def approach_page(approach: Result, folder: Path) -> Page:
    return page_of(approach, folder)


@pytest.fixture(scope="module")
def edge() -> Result:
    return run("contact_edge", **EDGE)


@pytest.fixture(scope="module")
def edge_page(edge: Result, folder: Path) -> Page:
    return page_of(edge, folder)


@pytest.fixture(scope="module")
def elastic() -> Result:
    """Two seconds along a tricuspid on an elastic surface."""
    path = {"kind": "deltoid", "plane": "xy", "size": 0.02, "period": 4.0, "timing": "sin2"}
    return run("motion_force_tricuspid", path=path, duration=2.0)


@pytest.fixture(scope="module")
def inclined() -> Result:
    return run("contact_inclined", duration=0.2)


@pytest.fixture(scope="module")
def inclined_page(inclined: Result, folder: Path) -> Page:
    return page_of(inclined, folder)


def touches(result: Result) -> np.ndarray:
    return result.series["contact_force"] @ contact_of(result).normal > 0.0


def contact_of(result: Result) -> ReplayedContact:
    found = replayed_contact(replayed_motion(result))
    assert found is not None
    return found


def vertices(page: Page, path: str) -> np.ndarray:
    data = page.objects[path]["geometries"][0]["data"]["attributes"]["position"]["array"]
    data = data.data if isinstance(data, umsgpack.Ext) else bytes(data)
    return np.frombuffer(data, dtype=np.float32).reshape(-1, 3).astype(float)


def traced_vertices(page: Page) -> np.ndarray:
    return vertices(page, "/traced/path")


def with_force(result: Result, force: np.ndarray) -> Result:
    return dataclasses.replace(result, series=result.series | {"contact_force": force})


def heights(points: np.ndarray, result: Result) -> np.ndarray:
    """Return the heights above the surface, or above its plane beyond the edges."""
    contact = contact_of(result)
    return (points - contact.p_WS) @ contact.normal


@pytest.mark.long
def test_nothing_is_drawn_before_the_tool_touches(approach: Result, approach_page: Page) -> None:
    touch = approach.time[np.argmax(touches(approach))]
    assert touch > 0.3
    time, faces = approach_page.grows("/traced/path")
    assert (time[0], faces[0]) == (pytest.approx(touch), 0)
    assert len(time) >= 5


@pytest.mark.long
def test_strokes_appear_one_after_another(approach_page: Page) -> None:
    time, faces = approach_page.grows("/traced/path")
    assert np.all(np.diff(time) >= 0)
    assert np.all(np.diff(faces) >= 0)
    assert time[-1] == pytest.approx(1.5)


@pytest.mark.long
def test_once_contact_is_lost_the_drawing_stays_as_it_is(edge: Result, edge_page: Page) -> None:
    lost = edge.time[np.flatnonzero(touches(edge))[-1]]
    assert lost < 1.2
    time, _ = edge_page.grows("/traced/path")
    assert time[-1] == pytest.approx(lost)


@pytest.mark.long
def test_nothing_is_drawn_beyond_the_edge(edge: Result, edge_page: Page) -> None:
    """The path continues there, and so does the ball, which touches the edge with its side."""
    plate = edge.experiment.contact.surface
    behind = contact_of(edge).p_WS[0] + plate.offset[0] - plate.size / 2.0
    assert edge.series["p_WE"][touches(edge), 0].min() < behind - 5e-3
    assert traced_vertices(edge_page)[:, 0].min() > behind - 1e-3
    seen = dict(edge_page.tracks["/force", ".visible"])
    points = dict(edge_page.tracks["/force", ".position"])
    assert min(points[frame][0] for frame in seen if seen[frame]) > behind - 1e-6
    assert vertices(edge_page, "/desired/path")[:, 0].min() < behind - 5e-3


@pytest.mark.parametrize("kind", ["approach", "edge", "inclined"])
def test_both_paths_lie_on_the_surface(kind: str, request: pytest.FixtureRequest) -> None:
    """They are invisibly little above it, the traced one on top."""
    result, page = request.getfixturevalue(kind), request.getfixturevalue(f"{kind}_page")
    traced = heights(traced_vertices(page), result)
    desired = heights(vertices(page, "/desired/path"), result)
    assert 1e-4 < desired.min() <= desired.max() < traced.min() - 2e-4
    assert traced.max() < 1e-3


@pytest.mark.long
def test_the_trace_is_where_the_tool_was(elastic: Result, tmp_path: Path) -> None:
    n = contact_of(elastic).normal
    tool = elastic.series["p_WE"][touches(elastic)]
    away = traced_vertices(page_of(elastic, tmp_path))[:, None] - tool[None]
    lateral = np.linalg.norm(away - (away @ n)[..., None] * n, axis=2)
    assert lateral.min(axis=1).max() < 1.5e-3
    assert lateral.min(axis=0).max() < 1.5e-3


def test_a_tool_that_leaves_and_comes_back_leaves_a_gap(elastic: Result, tmp_path: Path) -> None:
    force = np.tile(UP, (len(elastic.time), 1))
    force[80:120] = 0.0
    page = page_of(with_force(elastic, force), tmp_path)
    tool = elastic.series["p_WE"][:, :2]
    distance = np.linalg.norm(traced_vertices(page)[:, None, :2] - tool[None], axis=2).min(axis=0)
    assert distance[90:110].min() > 2e-3
    assert distance[:80].max() < 1.5e-3
    assert distance[120:].max() < 1.5e-3


def test_strokes_are_where_the_surface_pushes_back(edge: Result) -> None:
    force = np.zeros((len(edge.time), 3))
    force[3:5, 2], force[9, 2], force[20:, 2] = 1.0, 1e-9, 5.0
    # Neither friction alone nor a pull counts as contact.
    force[12, 0], force[15, 2] = 2.0, -1.0
    strokes = contact_of(with_force(edge, force)).strokes()
    ends = [(stroke.start, stroke.stop) for stroke in strokes]
    assert ends == [(3, 5), (9, 10), (20, len(edge.time))]


def test_a_touch_of_one_sample_is_a_dot(edge: Result, tmp_path: Path) -> None:
    force = np.zeros((len(edge.time), 3))
    force[40] = UP
    page = page_of(with_force(edge, force), tmp_path)
    time, faces = page.grows("/traced/path")
    assert time.tolist() == pytest.approx(2 * [edge.time[40]])
    assert faces[-1] > faces[0]
    dot = traced_vertices(page)
    np.testing.assert_allclose(dot.mean(axis=0)[:2], edge.series["p_WE"][40, :2], atol=1e-4)
    assert 5e-4 < np.ptp(dot, axis=0)[:2].max() < 3e-3


def test_a_run_without_a_touch_can_be_shown(edge: Result, tmp_path: Path) -> None:
    page = page_of(with_force(edge, np.zeros((len(edge.time), 3))), tmp_path)
    assert page.data["grows"] == []
    assert "/traced/path" not in page.objects
    assert not any(visible for _, visible in page.tracks["/force", ".visible"])


def test_the_arrow_is_as_long_as_the_force(approach: Result, approach_page: Page) -> None:
    assert vertices(approach_page, "/force")[:, 2].max() == pytest.approx(LENGTH)
    scales = dict(approach_page.tracks["/force", ".scale"])
    turns = dict(approach_page.tracks["/force", ".quaternion"])
    places = dict(approach_page.tracks["/force", ".position"])
    for sample in (75, 100, 125, -1):
        frame = round(approach.time[sample] * RATE)
        force = approach.series["contact_force"][sample]
        x, y, z, w = turns[frame]
        arrow = Quaternion([w, x, y, z]).rotation() @ [0.0, 0.0, LENGTH * scales[frame][2]]
        # The scale in the caption: 10 cm for 5 N.
        np.testing.assert_allclose(arrow, 0.02 * force, atol=1e-6)
        contact = contact_of(approach).contact[sample]
        np.testing.assert_allclose(places[frame], contact, atol=1e-6)
    assert heights(np.array(list(places.values())), approach) == pytest.approx(0.0, abs=1e-9)


def test_the_arrow_is_seen_while_there_is_a_force(approach: Result, approach_page: Page) -> None:
    seen = np.array([visible for _, visible in approach_page.tracks["/force", ".visible"]])
    force = np.linalg.norm(approach.series["contact_force"], axis=1)
    there = np.interp(np.arange(len(seen)) / RATE, approach.time, force) > 0.005
    assert not seen[0]
    assert seen[-1]
    np.testing.assert_array_equal(seen, there)


def test_the_arm_never_hides_the_arrow(approach_page: Page) -> None:
    """The arrow is inside the tool."""
    of = approach_page.properties
    assert of["/force/<object>", "material.depthTest"] is False
    assert of["/force/<object>", "renderOrder"] > 0


def test_the_caption_says_how_long_an_arrow_is(approach_page: Page, inclined_page: Page) -> None:
    for page in (approach_page, inclined_page):
        assert page.data["legend"]["force"] == "force, 5 N = 10 cm"
        assert "force, 5 N = 10 cm</li>" in page.text


@pytest.mark.parametrize(
    ("held", "expected"), [(5.0, 5.0), (12.0, 5.0), (40.0, 20.0), (330.0, 200.0), (0.0, 5.0)]
)
def test_the_scale_is_round_and_holds_arrows_in_the_picture(
    edge: Result, held: float, expected: float
) -> None:
    force = np.tile(held * UP, (len(edge.time), 1))
    scale = reference_force(contact_of(with_force(edge, force)))
    assert scale == pytest.approx(expected)
    assert held / scale * LENGTH <= 0.3


@pytest.mark.parametrize("kind", ["edge", "inclined"])
def test_the_plate_is_where_the_tool_presses(kind: str, request: pytest.FixtureRequest) -> None:
    result, page = request.getfixturevalue(kind), request.getfixturevalue(f"{kind}_page")
    contact, plate = contact_of(result), result.experiment.contact.surface
    X_WP = page.poses["/surface/plate"]
    np.testing.assert_allclose(X_WP, plate.pose(contact.p_WS).GetAsMatrix4(), atol=1e-9)
    np.testing.assert_allclose(X_WP[:3, 2], contact.normal, atol=1e-6)
    (box,) = page.objects["/surface/plate"]["geometries"]
    sizes = sorted(box[name] for name in ("width", "height", "depth"))
    np.testing.assert_allclose(sizes, [plate.thickness, plate.size, plate.size])
    # The arrow begins at its face.
    face = X_WP[:3, 3] + plate.thickness / 2.0 * contact.normal
    for _, point in page.tracks["/force", ".position"]:
        assert contact.normal @ (point - face) == pytest.approx(0.0, abs=1e-6)


def test_the_inclined_plate_is_tilted_by_30_degrees(inclined_page: Page) -> None:
    tilt = math.degrees(math.acos(inclined_page.poses["/surface/plate"][2, 2]))
    assert tilt == pytest.approx(30.0, abs=1e-3)


def test_an_elastic_surface_is_a_thin_clear_sheet(elastic: Result, tmp_path: Path) -> None:
    """It has neither thickness nor edges: it is shown as far as the drawing reaches."""
    page = page_of(elastic, tmp_path)
    (material,) = page.objects["/surface/plate"]["materials"]
    assert material["transparent"]
    assert material["opacity"] < 1.0
    (box,) = page.objects["/surface/plate"]["geometries"]
    assert box["depth"] <= 0.005
    face = page.poses["/surface/plate"][:3, 3] + box["depth"] / 2.0 * UP
    assert heights(face[None], elastic) == pytest.approx(0.0, abs=1e-9)
    within = np.abs(vertices(page, "/desired/path") - face)[:, :2]
    assert within.max() < min(box["width"], box["height"]) / 2.0
    assert "force, 0.1 N = 10 cm" in page.text


@pytest.mark.parametrize("visual", [GREEN_BOX, ""])
@pytest.mark.long
def test_a_model_is_drawn_as_its_file_shows_it(visual: str, tmp_path: Path) -> None:
    """Without illustration geometry, its collision geometry is drawn."""
    (tmp_path / "dome.urdf").write_text(DOME.format(visual=visual))
    model = {"kind": "model", "model": str(tmp_path / "dome.urdf"), "offset": [0, 0.01, 0]}
    result = run("contact_approach", duration=0.02, environment=model)
    page = page_of(result, tmp_path)
    (path,) = [path for path in page.objects if path.startswith("/surface/")]
    (geometry,) = page.objects[path]["geometries"]
    assert geometry["type"] == ("BoxGeometry" if visual else "SphereGeometry")
    (material,) = page.objects[path]["materials"]
    assert (material["color"] == 0x00FF00) == bool(visual)
    at = np.eye(4)
    while path:
        at = page.poses.get(path, np.eye(4)) @ at
        path = path.rpartition("/")[0]
    middle = np.add(contact_of(result).p_WS, [0.0, 0.01, 0.0 if visual else -0.3])
    np.testing.assert_allclose(at[:3, 3], middle, atol=1e-9)


def test_points_are_projected_onto_a_plane_along_its_normal() -> None:
    surface = ElasticSurface(stiffness=100.0, normal=[1.0, 0.0, 1.0])
    points = np.array([[0.3, 0.2, 0.5], [-0.1, 0.0, 0.0]])
    placed = project(points, surface, np.array([0.0, 0.0, 0.1]))
    np.testing.assert_allclose((placed - [0.0, 0.0, 0.1]) @ [1.0, 0.0, 1.0], 0.0, atol=1e-12)
    np.testing.assert_allclose(np.cross(points - placed, [1.0, 0.0, 1.0]), 0.0, atol=1e-12)


@pytest.mark.parametrize("raised", [-0.02, 0.0, 0.02])
def test_points_are_projected_onto_a_curved_model(raised: float, tmp_path: Path) -> None:
    """The search begins at the plane, which may be inside the model."""
    (tmp_path / "dome.urdf").write_text(DOME.format(visual=""))
    dome = ModelSurface(model=str(tmp_path / "dome.urdf"), offset=[0.0, 0.0, raised])
    aside = np.array([0.0, 0.05, 0.1, 0.2])
    points = np.column_stack((aside, np.zeros(4), [-0.1, 0.0, 0.1, 0.2]))
    placed = project(points, dome, ORIGIN)
    np.testing.assert_allclose(placed[:, :2], points[:, :2], atol=1e-12)
    np.testing.assert_allclose(placed[:, 2], np.sqrt(0.09 - aside**2) - 0.3 + raised, atol=3e-6)


def test_beyond_a_model_points_are_projected_onto_its_plane(tmp_path: Path) -> None:
    (tmp_path / "dome.urdf").write_text(DOME.format(visual=""))
    dome = ModelSurface(model=str(tmp_path / "dome.urdf"))
    placed = project(np.array([[0.4, 0.0, 0.1]]), dome, ORIGIN)
    np.testing.assert_allclose(placed, [[0.4, 0.0, 0.0]], atol=1e-12)


def test_a_ribbon_is_flat_and_as_wide_as_asked() -> None:
    n = np.array([0.6, 0.0, 0.8])
    one, other = np.array([0.8, 0.0, -0.6]), np.array([0.0, 1.0, 0.0])
    points = np.array([ORIGIN, one, one + other])
    corners, faces, reached = ribbon(points, n, 0.1)
    np.testing.assert_allclose(n @ corners, 0.0, atol=1e-12)
    across = np.column_stack((corners.T @ one, corners.T @ other))
    np.testing.assert_allclose(across.min(axis=0), -0.05, atol=1e-3)
    np.testing.assert_allclose(across.max(axis=0), 1.05, atol=1e-3)
    # All triangles face along the normal, and the faces reach each point.
    a, b, c = (corners[:, index].T for index in faces)
    assert np.all(np.cross(b - a, c - a) @ n >= 0.0)
    assert reached[0] == 0
    assert reached[-1] == faces.shape[1]
    assert np.all(np.diff(reached) > 0)


def test_the_ring_goes_where_the_tool_is_to_be(inclined: Result, inclined_page: Page) -> None:
    contact = contact_of(inclined)
    for frame, point in inclined_page.tracks["/desired/point", ".position"]:
        sample = np.argmin(np.abs(inclined.time - frame / RATE))
        away = point - inclined.series["p_WE_desired"][sample]
        across = away - (away @ contact.normal) * contact.normal
        assert np.linalg.norm(across) < 1e-4
    # The ring is on the surface, around the tool's ball.
    ring = vertices(inclined_page, "/desired/point")
    np.testing.assert_allclose(ring @ contact.normal, 0.0, atol=1e-6)
    assert 0.01 < np.linalg.norm(ring, axis=1).min() < np.linalg.norm(ring, axis=1).max() < 0.02


@pytest.mark.parametrize("kind", ["approach", "edge", "inclined"])
def test_near_views_show_the_drawing_and_the_arrow_from_its_side_of_the_surface(
    kind: str, request: pytest.FixtureRequest
) -> None:
    contact = contact_of(request.getfixturevalue(kind))
    views = request.getfixturevalue(f"{kind}_page").data["views"]
    arrow = contact.contact + LENGTH * contact.normal
    for name, shown in (
        ("close", np.concatenate((contact.course, arrow))),
        ("path", contact.course),
    ):
        assert np.dot(views[name]["direction"], contact.normal) > 0.25
        held = np.array(views[name]["points"])
        assert (held.min(axis=0) <= shown.min(axis=0) + 1e-3).all()
        assert (held.max(axis=0) >= shown.max(axis=0) - 1e-3).all()
        # Near enough for a drawing of 3 cm to be seen.
        assert np.ptp(held, axis=0).max() < 0.7


def test_an_inclined_plate_is_seen_from_its_side(inclined_page: Page, inclined: Result) -> None:
    """Its slope is across the line of sight, and the ground is seen from not far above."""
    uphill = contact_of(inclined).normal * [1, 1, 0]
    for name in ("arm", "close"):
        direction = np.array(inclined_page.data["views"][name]["direction"])
        assert abs(direction @ uphill) / np.linalg.norm(uphill) < 0.6, name
    assert 0.2 < inclined_page.data["views"]["arm"]["direction"][2] < 0.5


def test_a_post_carries_a_plate_above_the_ground(inclined_page: Page) -> None:
    assert inclined_page.objects["/stand"]["geometries"][0]["type"] == "CylinderGeometry"
    x, y, _ = inclined_page.poses["/stand"][:3, 3]
    np.testing.assert_allclose([x, y], inclined_page.poses["/surface/plate"][:2, 3], atol=1e-9)


@pytest.mark.parametrize("count", [1, 2])
def test_the_shortest_runs_can_be_shown(inclined: Result, tmp_path: Path, count: int) -> None:
    series = {name: values[:count] for name, values in inclined.series.items()}
    short = dataclasses.replace(inclined, time=inclined.time[:count], series=series)
    page = page_of(short, tmp_path)
    assert "/surface/plate" in page.objects
    assert len(page.tracks["/force", ".position"]) == count


def test_a_posture_without_a_force_can_be_shown(edge: Result, tmp_path: Path) -> None:
    force = edge.series["contact_force"].copy()
    force[-5:] = np.nan
    page = page_of(with_force(edge, force), tmp_path)
    for track in (".position", ".quaternion", ".scale"):
        assert np.isfinite([value for _, value in page.tracks["/force", track]]).all()


def test_all_tracks_are_equally_long(edge_page: Page) -> None:
    """Each track repeats on its own: they stay in step only if all are equally long."""
    assert {keys[-1][0] for keys in edge_page.tracks.values()} == {1.5 * RATE}


def test_a_run_without_contact_has_neither_surface_nor_force(tmp_path: Path) -> None:
    page = page_of(run("slc_nephroid_known", duration=0.1), tmp_path)
    assert not [path for path in page.objects if path.startswith(("/surface", "/force"))]
    assert not [path for path, _ in page.tracks if path.startswith(("/surface", "/force"))]
    assert page.data["legend"]["force"] is None


def test_a_plate_is_not_clear(edge_page: Page, edge: Result) -> None:
    assert isinstance(edge.experiment.contact.surface, Plate)
    (material,) = edge_page.objects["/surface/plate"]["materials"]
    assert material["opacity"] == 1.0


@pytest.mark.parametrize("result", ["approach", "inclined"])
def test_an_arrow_points_along_every_force(result: str, request: pytest.FixtureRequest) -> None:
    """Also along the surface's axes and into it, after the shortest rotation from the normal."""
    contact = contact_of(request.getfixturevalue(result))
    axes = contact.R_WS.matrix()
    directions = [*axes.T, *-axes.T, *np.random.default_rng(0).normal(size=(20, 3))]
    for direction in directions:
        direction = direction / np.linalg.norm(direction)
        R = _along(direction, contact).matrix()
        np.testing.assert_allclose(R[:, 2], direction, atol=1e-12)
        np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-12)
        assert np.linalg.det(R) == pytest.approx(1.0)
        turned = math.acos(np.clip((np.trace(R @ axes.T) - 1) / 2, -1, 1))
        tilted = math.acos(np.clip(direction @ contact.normal, -1, 1))
        assert turned == pytest.approx(tilted, abs=1e-6)
    np.testing.assert_allclose(_along(contact.normal, contact).matrix(), axes, atol=1e-12)

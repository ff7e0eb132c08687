"""Playbacks, read without a browser: whether the page shows the run."""

from __future__ import annotations

import base64
import dataclasses
import json
import logging
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import umsgpack
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RotationMatrix

from drake_rnn import colours, load_arm
from drake_rnn.errors import InvalidInputError
from drake_rnn.experiment import load_experiment, make_experiment
from drake_rnn.playback import write_playback
from drake_rnn.robot.postures import SelfMotion
from drake_rnn.runs.result import Result
from drake_rnn.runs.simulation import simulate
from shared_runs import shared_run

DURATION = 1.5
PLANAR = {
    "arm": "planar6",
    "task": "xy",
    "path": {"kind": "circle", "plane": "xy", "size": 0.05, "period": 1.0},
    "law": {"kind": "simultaneous_learning", "jacobian": "known"},
    "limits": {"acceleration": 20.0},
    "period": 1e-3,
    "duration": 1.0,
}
ADJUSTED = {
    "arm": "planar6",
    "task": "xy",
    "integrator": {"scheme": "runge_kutta3", "step": 5e-4},
    "duration": 2.0,
}
RESTING = {"path": {"kind": "rest", "offset": [0.05, 0, 0]}, "duration": 1.0, "window": None}


def floats(text: str) -> np.ndarray:
    """Return numbers that a page holds."""
    return np.frombuffer(base64.b64decode(text), dtype="<f4").astype(float)


class Page:
    """The scene, its properties and the animation that a page sends to the viewer."""

    def __init__(self, file: Path) -> None:
        self.text = file.read_text(encoding="utf-8")
        self.objects: dict[str, Any] = {}
        self.properties: dict[tuple[str, str], Any] = {}
        self.poses: dict[str, np.ndarray] = {}
        self.tracks: dict[tuple[str, str], list[tuple[int, Any]]] = {}
        self.options: dict[str, Any] = {}
        for block in self._json("playback-scene"):
            self._take(umsgpack.unpackb(base64.b64decode(block)))
        self.data = self._json("playback-data")

    def _json(self, name: str) -> Any:
        """Return what a script of the page holds as data."""
        (text,) = re.findall(
            rf'<script id="{name}" type="application/json">(.*?)</script>', self.text
        )
        return json.loads(text)

    def grows(self, place: str) -> tuple[np.ndarray, np.ndarray]:
        """Return times [s], and the number of faces of a mesh that are seen from then on."""
        (found,) = [each for each in self.data["grows"] if each["path"] == place]
        return floats(found["time"]), floats(found["faces"]).astype(int)

    def _take(self, command: Mapping[str, Any]) -> None:
        if command["type"] == "set_object":
            self.objects[command["path"]] = command["object"]
        elif command["type"] == "set_transform":
            self.poses[command["path"]] = np.reshape(command["matrix"], (4, 4), order="F")
        elif command["type"] == "set_property":
            self.properties[command["path"], command["property"]] = command["value"]
        elif command["type"] == "set_animation":
            self.options = command["options"]
            for animation in command["animations"]:
                self.rate = animation["clip"]["fps"]
                for track in animation["clip"]["tracks"]:
                    keys = [(key["time"], key["value"]) for key in track["keys"]]
                    self.tracks[animation["path"], track["name"]] = keys


@pytest.fixture(scope="module")
def run() -> Result:
    changes = {"duration": DURATION, "window": None}
    return simulate(load_experiment("slc_nephroid_known", changes))


@pytest.fixture(scope="module")
def planar() -> Result:
    return simulate(make_experiment(PLANAR))


@pytest.fixture(scope="module")
def page(run: Result, tmp_path_factory: pytest.TempPathFactory) -> Page:
    file = tmp_path_factory.mktemp("playback") / "playback.html"
    assert write_playback(run, file) == file
    return Page(file)


@pytest.fixture(scope="module")
def adjusted() -> Result:
    return shared_run("modified_state_adjustment", {"log_period": 5e-4})


@pytest.fixture(scope="module")
def adjusted_page(adjusted: Result, tmp_path_factory: pytest.TempPathFactory) -> Page:
    return Page(write_playback(adjusted, tmp_path_factory.mktemp("playback") / "playback.html"))


@pytest.fixture(scope="module")
def planar_adjusted() -> Result:
    arm = load_arm("planar6")
    target = SelfMotion(arm, arm.home, "xy").somewhere(1.0)
    law = {"kind": "state_adjustment", "target": target.tolist()}
    return simulate(make_experiment({**ADJUSTED, "law": law}))


def links(run: Result) -> list[str]:
    return [f"panda_link{k}" for k in range(1, run.experiment.arm.n + 1)]


def pose(run: Result, sample: int, body: str) -> tuple[np.ndarray, np.ndarray]:
    return pose_at(run, run.series["position"][sample], body)


def pose_at(run: Result, q: np.ndarray, body: str) -> tuple[np.ndarray, np.ndarray]:
    arm = run.experiment.arm
    plant = arm.plant()
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, arm.posture(plant, q))
    X_WB = plant.EvalBodyPoseInWorld(context, plant.GetBodyByName(body))
    return X_WB.rotation().matrix(), X_WB.translation()


def test_every_link_is_drawn(run: Result, page: Page) -> None:
    for link in ("panda_link0", *links(run)):
        assert any(path.startswith(f"/arm/panda/{link}/") for path in page.objects), link


def test_both_paths_are_solid_and_of_different_colours(page: Page) -> None:
    meshes = [page.objects[path] for path in ("/desired/path", "/traced/path")]
    for mesh in meshes:
        (geometry,) = mesh["geometries"]
        assert geometry["type"] == "BufferGeometry"
        # A line would be only one pixel wide.
        assert mesh["object"]["type"] == "Mesh"
    desired, traced = (mesh["materials"][0]["color"] for mesh in meshes)
    assert desired != traced


@pytest.mark.parametrize("rate", [64, 30])
def test_every_frame_of_every_link_is_there(run: Result, tmp_path: Path, rate: int) -> None:
    page = Page(write_playback(run, tmp_path / "playback.html", rate))
    assert page.rate == rate
    frames = list(range(int(DURATION * rate) + 1))
    for link in links(run):
        for track in (".position", ".quaternion"):
            keys = page.tracks[f"/arm/panda/{link}", track]
            assert [time for time, _ in keys] == frames, (link, track)


def test_the_arm_stands_where_the_run_had_it(run: Result, page: Page) -> None:
    for link in links(run):
        for sample in (0, -1):
            R, p = pose(run, sample, link)
            _, position = page.tracks[f"/arm/panda/{link}", ".position"][sample]
            _, (x, y, z, w) = page.tracks[f"/arm/panda/{link}", ".quaternion"][sample]
            np.testing.assert_allclose(position, p, atol=1e-9)
            np.testing.assert_allclose(Quaternion([w, x, y, z]).rotation(), R, atol=1e-9)


def test_points_move_along_desired_and_traced_path(run: Result, page: Page) -> None:
    for path, name in (("/desired/point", "p_WE_desired"), ("/traced/point", "p_WE")):
        keys = page.tracks[path, ".position"]
        assert len(keys) == DURATION * 64 + 1
        for sample in (0, 75, -1):
            _, point = keys[round(run.time[sample] * 64)]
            np.testing.assert_allclose(point, run.series[name][sample], atol=1e-9)


def test_the_trace_grows(page: Page) -> None:
    """At least every twentieth of a second, from nothing to the whole path."""
    time, faces = page.grows("/traced/path")
    assert (time[0], faces[0]) == (0.0, 0)
    assert time[-1] == pytest.approx(DURATION)
    assert np.diff(time).max() < 0.05
    assert np.all(np.diff(faces) > 0)
    corners = page.objects["/traced/path"]["geometries"][0]["data"]["index"]["array"]
    assert faces[-1] == len(corners.data) / 4 / 3


def test_the_trace_lies_on_the_traced_path(run: Result, page: Page) -> None:
    data = page.objects["/traced/path"]["geometries"][0]["data"]["attributes"]["position"]["array"]
    points = np.frombuffer(data.data, dtype=np.float32).reshape(-1, 3)
    trace = run.series["p_WE"]
    distance = np.linalg.norm(points[:, None] - trace[None], axis=2).min(axis=1)
    assert distance.max() < 6e-3
    # All of the path is covered.
    distance = np.linalg.norm(points[:, None] - trace[None], axis=2).min(axis=0)
    assert distance.max() < 6e-3


def test_no_stroke_is_drawn_where_the_pen_is_lifted(tmp_path: Path) -> None:
    changes = {"path.period": 1.2, "duration": 1.2, "window": None, "accept": None}
    letter = simulate(load_experiment("pinv_letter", changes))
    page = Page(write_playback(letter, tmp_path / "playback.html"))
    heights = letter.series["p_WE_desired"][:, 2]
    plane, lifted = heights[0], heights.max() - heights[0]
    assert lifted == pytest.approx(0.02, abs=1e-4)
    for place in ("/desired/path", "/traced/path"):
        data = page.objects[place]["geometries"][0]["data"]["attributes"]["position"]["array"]
        points = np.frombuffer(data.data, dtype=np.float32).reshape(-1, 3)
        assert points[:, 2].max() - plane < 0.4 * lifted
        # All three strokes are there, as wide as the letter is.
        assert np.ptp(points[:, 0]) > 0.05
        assert np.ptp(points[:, 1]) > 0.05
    time, faces = page.grows("/traced/path")
    # Nothing grows during the two moves.
    assert (np.diff(faces) >= 0).all()
    assert np.diff(time).max() > 0.05
    corners = page.objects["/traced/path"]["geometries"][0]["data"]["index"]["array"]
    assert faces[-1] == len(corners.data) / 4 / 3


def test_the_page_has_a_clock_of_its_own(page: Page) -> None:
    """Meshcat's would run beside it. All tracks are as long as the run."""
    assert page.options["play"] is False
    assert {keys[-1][0] for keys in page.tracks.values()} == {DURATION * 64}
    assert page.data["duration"] == DURATION


def test_axes_are_hidden_and_the_camera_looks_at_the_arm_from_above(page: Page) -> None:
    assert page.properties["/Axes", "visible"] is False
    for view in page.data["views"].values():
        assert view["direction"][2] >= 0.0
        assert np.linalg.norm(view["direction"]) == pytest.approx(1.0)


def test_the_view_of_the_path_faces_its_plane(page: Page) -> None:
    """The nephroid lies in the plane of y and z."""
    assert abs(page.data["views"]["path"]["direction"][0]) > 0.99


def test_views_hold_what_they_are_of(run: Result, page: Page) -> None:
    """In no direction does any link or the path reach farther than the points to be shown."""
    poses = [pose(run, k, link)[1] for link in links(run) for k in range(0, run.time.size, 10)]
    directions = np.random.default_rng(0).normal(size=(100, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    path = run.series["p_WE_desired"]
    for view, points in (("arm", np.array(poses)), ("arm", path), ("close", path), ("path", path)):
        held = np.array(page.data["views"][view]["points"])
        assert ((points @ directions.T).max(0) <= (held @ directions.T).max(0) + 2e-3).all(), view


def test_a_planar_arm_is_seen_from_above(planar: Result, tmp_path: Path) -> None:
    page = Page(write_playback(planar, tmp_path / "playback.html"))
    assert page.data["views"]["arm"]["direction"][2] > 0.9
    for path, name in (("/desired/point", "p_WE_desired"), ("/traced/point", "p_WE")):
        _, point = page.tracks[path, ".position"][-1]
        np.testing.assert_allclose(point[:2], planar.series[name][-1], atol=1e-9)
        assert point[2] == pytest.approx(0.0, abs=1e-12)


def test_size_and_name(run: Result, page: Page) -> None:
    # The viewer alone is 2.2 MB.
    assert len(page.text) < 3e6
    assert f"<title>{run.experiment.name}</title>" in page.text


def test_nothing_is_loaded_from_elsewhere(page: Page) -> None:
    # The viewer contains addresses that it never requests, as test_browser.py checks.
    assert not re.findall(r"<(?:script|link|img)[^>]+(?:src|href)=\"(?!data:)", page.text)
    assert not re.findall(r"@import|url\(\s*[\"']?http", page.text)
    assert not re.findall(r"fetch\(\"(?!data:)", page.text)


def test_a_name_is_text(run: Result, tmp_path: Path) -> None:
    document = dataclasses.replace(run.experiment.document, name="<b>{x}")
    experiment = dataclasses.replace(run.experiment, document=document)
    named = dataclasses.replace(run, experiment=experiment)
    text = write_playback(named, tmp_path / "playback.html").read_text()
    assert "&lt;b&gt;{x}" in text
    assert "<b>{x}" not in text


def test_a_run_that_broke_off_plays_until_then(run: Result, tmp_path: Path) -> None:
    position = run.series["position"].copy()
    position[50:] = np.nan
    broken = dataclasses.replace(run, series=run.series | {"position": position})
    page = Page(write_playback(broken, tmp_path / "playback.html"))
    keys = page.tracks["/arm/panda/panda_link7", ".position"]
    assert len(keys) == math.ceil(run.time[49] * 64) + 1
    assert np.isfinite([point for _, point in keys]).all()


@pytest.mark.parametrize("count", [1, 2])
def test_the_shortest_runs_can_be_shown(run: Result, tmp_path: Path, count: int) -> None:
    series = {name: values[:count] for name, values in run.series.items()}
    short = dataclasses.replace(run, time=run.time[:count], series=series)
    page = Page(write_playback(short, tmp_path / "playback.html"))
    assert len(page.tracks["/arm/panda/panda_link7", ".position"]) == count
    # A single sample makes no path.
    assert ("/desired/path" in page.objects) == (count > 1)
    assert "/desired/point" in page.objects


def test_an_arm_that_rests_can_be_shown(run: Result, tmp_path: Path) -> None:
    position = np.tile(run.series["position"][0], (run.time.size, 1))
    resting = dataclasses.replace(run, series=run.series | {"position": position})
    page = Page(write_playback(resting, tmp_path / "playback.html"))
    assert len(page.tracks["/traced/point", ".position"]) == DURATION * 64 + 1


def test_no_posture(run: Result, tmp_path: Path) -> None:
    series = {name: values[:0] for name, values in run.series.items()}
    empty = dataclasses.replace(run, time=run.time[:0], series=series)
    with pytest.raises(InvalidInputError, match="no posture"):
        write_playback(empty, tmp_path / "playback.html")


@pytest.mark.parametrize("rate", [0, -1, 32.0, True, None])
def test_invalid_frame_rates(run: Result, tmp_path: Path, rate: Any) -> None:
    with pytest.raises(InvalidInputError, match="frames_per_second: must be a positive integer"):
        write_playback(run, tmp_path / "playback.html", rate)


def test_files_that_cannot_be_written(run: Result, tmp_path: Path) -> None:
    for file in (tmp_path, tmp_path / "absent" / "playback.html"):
        with pytest.raises(InvalidInputError, match=re.escape(str(file))):
            write_playback(run, file)


def test_it_is_silent(
    run: Result,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
) -> None:
    level = logging.getLogger("drake").level
    write_playback(run, tmp_path / "playback.html")
    assert capfd.readouterr() == ("", "")
    assert not caplog.records
    assert logging.getLogger("drake").level == level


def test_a_tool_past_the_task_frame_is_not_drawn(tmp_path: Path) -> None:
    """Its tip would look like what follows the path, which is the flange."""
    pages = {}
    for frame in ("panda_link8", "tip"):
        changes = {"duration": 0.1, "arm": {"model": "panda", "frame": frame}}
        result = simulate(load_experiment("slc_nephroid_known", changes))
        pages[frame] = Page(write_playback(result, tmp_path / f"{frame}.html"))
    tool = ("/drake/arm/panda/tool", "visible"), ("/arm/panda/tool", "visible")
    assert any(pages["panda_link8"].properties.get(place) is False for place in tool)
    assert not any(pages["tip"].properties.get(place) is False for place in tool)


@pytest.mark.long
def test_a_ghost_stands_in_the_target_posture(adjusted: Result, adjusted_page: Page) -> None:
    page = adjusted_page
    for k in range(1, 8):
        R, p = pose_at(adjusted, adjusted.experiment.target, f"iiwa_link_{k}")
        ghost = f"/target/iiwa14/iiwa_link_{k}"
        np.testing.assert_allclose(page.poses[ghost][:3, :3], R, atol=1e-9)
        np.testing.assert_allclose(page.poses[ghost][:3, 3], p, atol=1e-9)
        assert any(path.startswith(f"{ghost}/") for path in page.objects), ghost
        # The arm reaches it, and it does not move.
        _, position = page.tracks[f"/arm/iiwa14/iiwa_link_{k}", ".position"][-1]
        np.testing.assert_allclose(position, p, atol=1e-4)
    assert not [path for path, _ in page.tracks if path.startswith("/target")]


def test_the_ghost_is_clear_and_gives_way_to_the_arm(adjusted_page: Page) -> None:
    page = adjusted_page
    layers = [path for path in page.objects if path.startswith("/target/")]
    seen = []
    for path in layers:
        look = {name: value for (at, name), value in page.properties.items() if path in at}
        # Coincident surfaces would flicker: the ghost is drawn as if farther away.
        assert look["material.polygonOffset"] is True
        assert look["material.polygonOffsetUnits"] > 0
        assert look["castShadow"] is False
        if look.get("material.colorWrite", True):
            seen += page.objects[path]["materials"]
    assert 2 * len(seen) == len(layers)
    assert {material["color"] for material in seen} == {int(colours.TARGET[1:], 16)}
    assert all(material["transparent"] and material["opacity"] <= 0.6 for material in seen)


def test_no_ghost_of_base_and_tool(adjusted_page: Page) -> None:
    bodies = {path.split("/")[3] for path in adjusted_page.objects if path.startswith("/target/")}
    assert "iiwa_link_0" not in bodies
    assert "tool" not in bodies


def test_only_a_target_has_a_ghost_and_a_legend(page: Page, adjusted_page: Page) -> None:
    assert "target posture</li>" in adjusted_page.text
    assert "target posture</li>" not in page.text
    assert not [path for path in page.objects if path.startswith("/target")]


def test_the_ghost_of_a_mesh_has_the_ghosts_colour(planar_adjusted: Result, tmp_path: Path) -> None:
    """A mesh has colours of its own: its convex hull replaces it."""
    corners = [f"v {x} {y} {z}" for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    faces = [f"f {face}" for face in ("1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5")]
    own = ["mtllib part.mtl", "usemtl own"]
    (tmp_path / "part.obj").write_text("\n".join(own + corners + faces))
    (tmp_path / "part.mtl").write_text("newmtl own\nKd 1 0 0\n")
    mesh = '<mesh filename="part.obj" scale="0.02 0.02 0.02"/>'
    arm = planar_adjusted.experiment.arm
    model = re.sub("<cylinder [^>]*/>", mesh, arm.model.read_text())
    (tmp_path / "meshed.urdf").write_text(model)
    meshed = {"model": str(tmp_path / "meshed.urdf"), "frame": "tip", "home": arm.home.tolist()}
    law = planar_adjusted.experiment.document.law
    result = simulate(make_experiment({**ADJUSTED, "law": law, "arm": meshed, "duration": 0.1}))
    page = Page(write_playback(result, tmp_path / "playback.html"))
    kinds: dict[str, set[str]] = {"arm": set(), "target": set()}
    for path, sent in page.objects.items():
        if (place := path.split("/")[1]) in kinds:
            kinds[place].add(sent["object"]["type"])
    assert "_meshfile_object" in kinds["arm"]
    assert kinds["target"] == {"Mesh"}


@pytest.mark.parametrize("kind", ["adjusted", "planar_adjusted"])
def test_start_and_target_are_seen_apart(
    kind: str, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    page = Page(write_playback(request.getfixturevalue(kind), tmp_path / "playback.html"))
    ghosts = [path for path in page.poses if re.fullmatch("/target/[^/]+/[^/]+", path)]
    last = np.array([page.poses[path][:3, 3] for path in ghosts])
    first = np.array(
        [page.tracks[path.replace("/target", "/arm"), ".position"][0][1] for path in ghosts]
    )
    view = page.data["views"]["arm"]
    held = np.array(view["points"])
    assert (held.min(axis=0) <= np.minimum(first, last).min(axis=0) + 1e-3).all()
    assert (held.max(axis=0) >= np.maximum(first, last).max(axis=0) - 1e-3).all()
    # The largest motion is mostly across the line of sight.
    moved = last - first
    most = moved[np.argmax(np.linalg.norm(moved, axis=1))]
    along = abs(most @ view["direction"]) / np.linalg.norm(most)
    assert math.sqrt(1.0 - along**2) > 0.7


def test_a_legend_names_what_can_be_seen(page: Page, adjusted_page: Page) -> None:
    """A tool that stays where it is draws no path."""
    assert all(f"</i>{name}</li>" in page.text for name in ("desired", "traced", "desired point"))
    assert "</i>point to stay at</li>" in adjusted_page.text
    assert "</i>traced</li>" not in adjusted_page.text


@pytest.mark.parametrize("kind", ["adjusted", "planar_adjusted", "resting"])
def test_a_point_that_stays_is_a_ball_and_no_path(
    kind: str, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    if kind == "resting":
        result = simulate(load_experiment("slc_nephroid_known", RESTING))
    else:
        result = request.getfixturevalue(kind)
    page = Page(write_playback(result, tmp_path / "playback.html"))
    assert "/desired/path" not in page.objects
    assert "/desired/point" in page.objects
    for view in page.data["views"].values():
        assert np.ptp(view["points"], axis=0).min() > 0.0
        assert np.isfinite(view["direction"]).all()


def test_a_path_that_turns_shows_its_axes_and_those_of_the_arm(tmp_path):
    """1e-6: what an animation keeps of a pose."""
    path = {
        "kind": "waypoints",
        "positions": [[0, 0, 0], [0, 0.1, 0]],
        "times": [0, 1],
        "rpy": [[0, 0, 0], [0.3, 0, 0]],
    }
    document = {"arm": "panda", "task": "pose", "path": path, "law": {"kind": "pseudoinverse"}}
    experiment = make_experiment({**document, "period": 1e-3, "duration": 1.0})
    result = simulate(experiment)
    page = Page(write_playback(result, tmp_path / "turning.html"))
    for number, t in ((0, 0.0), (11, 1.0)):
        shown = page.poses[f"/desired/axes/{number:02d}"]
        np.testing.assert_allclose(shown[:3, :3], experiment.desired.orientation(t)[0], atol=1e-9)
        np.testing.assert_allclose(shown[:3, 3], experiment.desired.position(t)[0], atol=1e-9)
    _, (x, y, z, w) = page.tracks["/traced/axes", ".quaternion"][-1]
    R_WE = experiment.arm.kinematics().R_WE(result.series["position"][-1])
    shown = RotationMatrix(Quaternion(np.array([w, x, y, z]))).matrix()
    np.testing.assert_allclose(shown, R_WE, atol=1e-6)

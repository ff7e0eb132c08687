"""Runs along open paths, sequences and trajectories of Drake's, from end to end."""

import json

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.trajectories import PiecewisePolynomial, PiecewisePose

from drake_rnn import (
    Circle,
    InvalidInputError,
    Line,
    Part,
    Result,
    Sequence,
    fastest,
    load_arm,
    load_experiment,
    make_experiment,
    simulate,
    write_playback,
)
from drake_rnn.experiment import read_document
from drake_rnn.figures import drawable, write_figures
from drake_rnn.robot.rotation import rotation_error
from shared_runs import shared_run

BASE = {
    "arm": "panda",
    "law": {"kind": "pseudoinverse"},
    "period": 1e-3,
    "duration": 1.2,
    "limits": {"velocity": 1.0, "acceleration": 5.0},
}
LINE = {"kind": "line", "by": [0.05, 0.08, 0.03], "period": 1.0, "timing": "quintic"}
UR5_START = [0.0, -1.9, -1.8, -1.0, 1.57, 0.0]
PANDA = load_arm("panda")


def run(path, **changes):
    return simulate(make_experiment({**BASE, "path": path, **changes}))


def newton(kinematics, q, p_WE, R_WE):
    """Return the posture of a six-joint arm near ``q`` with this pose."""
    for _ in range(30):
        error = np.concatenate(
            (rotation_error(kinematics.R_WE(q), R_WE), p_WE - kinematics.p_WE(q))
        )
        q = q + np.linalg.solve(np.vstack((kinematics.J_omega(q), kinematics.J(q))), error)
        if np.abs(error).max() < 1e-13:
            return q
    raise AssertionError("no posture found")


@pytest.mark.parametrize("name", ["pinv_waypoints_ur5", "pinv_csv_ur5"])
@pytest.mark.long
def test_the_joints_are_those_of_inverse_kinematics_all_along(name):
    """Six joints have no choice; 1e-4 rad: the poses are 1.5e-5 off, and J is 0.24 at the least."""
    experiment = load_experiment(name, {"duration": 3.0})
    result = simulate(experiment)
    kinematics, q = experiment.arm.kinematics(), experiment.start
    for t, reached in zip(result.time[::5], result.series["position"][::5], strict=True):
        p, R = experiment.desired.position(t)[0], experiment.desired.orientation(t)[0]
        q = newton(kinematics, q, p, R)
        np.testing.assert_allclose(reached, q, atol=1e-4)


@pytest.mark.parametrize("name", ["pinv_line", "pinv_line_ur5", "pinv_waypoints", "pinv_csv"])
@pytest.mark.long
def test_shipped_open_paths_keep_what_they_promise(name):
    result = shared_run(name)
    accept = result.experiment.document.accept
    assert all(bound.holds(result.metrics[metric]) for metric, bound in accept.items())
    assert result.warnings == []


def test_an_open_path_is_as_accurate_as_a_closed_one_of_like_speed():
    """The secant's error grows with the curvature of the joint motion, not with being open."""
    line = run({**LINE, "timing": "uniform"}, window=[0.2, 0.9]).metrics
    speed = np.linalg.norm(LINE["by"])
    circle = {"kind": "circle", "size": 0.05, "period": 2 * np.pi * 0.05 / speed, "plane": "yz"}
    closed = run(circle, window=[0.2, 0.9]).metrics
    assert line["position_error_max_m"] < 2 * closed["position_error_max_m"]


def test_the_arm_rests_where_the_path_ends():
    result = run(LINE, duration=1.5)
    late = result.time > 1.05
    end = result.series["p_WE"][0] + LINE["by"]
    np.testing.assert_allclose(result.series["p_WE"][late] - end, 0, atol=1e-6)
    assert np.abs(result.series["velocity"][late]).max() < 1e-4


def test_joints_drift_only_from_a_path_that_returns():
    back = {**LINE, "by": [-x for x in LINE["by"]]}
    there_and_back = {"kind": "sequence", "parts": [{"path": LINE}, {"path": back}]}
    found = run(there_and_back, duration=2.0)
    assert 0.0 < found.metrics["joint_drift_max_rad"] < 1e-2
    assert "joint_drift" in drawable(found)
    open_run = run(LINE)
    assert not [name for name in open_run.metrics if name.startswith("joint_drift")]
    assert "joint_drift" not in drawable(open_run)


@pytest.mark.parametrize("duration", [0.5, 1.0, pytest.param(1.2, marks=pytest.mark.long)])
@pytest.mark.long
def test_the_end_is_marked_once_it_is_reached(tmp_path, duration):
    result = run(LINE, duration=duration)
    write_figures(result, tmp_path, ["path_3d", "path_plane"])
    page = write_playback(result, tmp_path / "playback.html").read_text()
    assert ('<i class="square desired"></i>end' in page) == (duration >= 1.0)


def test_a_closed_path_has_no_end_in_the_playback(tmp_path):
    result = run({"kind": "circle", "size": 0.02, "period": 1.0, "laps": 1, "timing": "sin2"})
    assert (
        '<i class="square desired"></i>end'
        not in write_playback(result, tmp_path / "page.html").read_text()
    )


@pytest.mark.long
def test_a_law_that_should_return_the_joints_shows_its_angles_along_an_open_path(tmp_path):
    document = read_document("naljdf_clover", {"duration": 1.0})
    document["path"] = {"kind": "line", "by": [0.03, 0.0, 0.02], "period": 0.8, "timing": "quintic"}
    document = {key: value for key, value in document.items() if key not in {"accept", "window"}}
    result = simulate(make_experiment(document))
    assert result.metrics["position_error_max_m"] < 1e-3
    assert "joint_drift" not in drawable(result)
    write_figures(result, tmp_path, ["overview", "joint_angles"])


def test_the_path_changes_while_it_is_followed_without_a_jump():
    """At full speed, out of a circle without end, on the true motion."""
    path = {
        "kind": "sequence",
        "parts": [
            {"path": {"kind": "circle", "size": 0.03, "period": 2.0}, "bridge": 0.5, "lasts": 0.7},
            {"path": LINE, "bridge": 0.5},
        ],
    }
    found = run(path, duration=2.8).metrics
    assert found["position_error_max_m"] < 1e-5
    assert found["limit_ratio_2_max"] < 1.0


@pytest.mark.long
def test_a_drift_free_law_follows_through_a_pause():
    """And its joints return, as after each lap."""
    lap = {"path.size": 0.015, "path.period": 4, "path.laps": 2, "path.pause": 0.4}
    changes = {**lap, "duration": 8.4, "accept": None}
    found = simulate(load_experiment("naljdf_clover", changes)).metrics
    assert found["position_error_max_m"] < 3e-6
    assert found["joint_drift_max_rad"] < 1e-3


# Paths made in Python.


def pose_trajectory():
    kinematics = PANDA.kinematics()
    R, p = RotationMatrix(kinematics.R_WE(PANDA.home)), kinematics.p_WE(PANDA.home)
    poses = [
        RigidTransform(R @ RotationMatrix.MakeYRotation(turn), p + np.array([0.0, way, 0.0]))
        for way, turn in ((0.0, 0.0), (0.05, 0.2), (0.08, 0.0))
    ]
    return PiecewisePose.MakeLinear([0.0, 0.5, 1.0], poses)


@pytest.mark.long
def test_an_experiment_takes_a_path_in_place_of_its_documents(tmp_path):
    line = Line(by=LINE["by"], period=1.0, timing="quintic")
    written, made = run(LINE), make_experiment(BASE, line)
    result = simulate(made)
    np.testing.assert_array_equal(result.series["position"], written.series["position"])
    other = written.experiment.with_path(line)
    assert other.path is line
    assert other.document.path == {"kind": "given"}

    result.save(tmp_path)
    with pytest.warns(UserWarning, match="path: was made in Python; the saved path is shown"):
        led = Result.load(tmp_path)
    times = np.linspace(0.0, 1.0, 77)
    ways = [[each.position(t)[0] for t in times] for each in (led.experiment.desired, made.desired)]
    np.testing.assert_allclose(*ways, rtol=0.0, atol=1e-9)
    assert led.experiment.document.path == {"kind": "given"}
    loaded = Result.load(tmp_path, line)
    np.testing.assert_array_equal(loaded.series["position"], result.series["position"])
    assert write_figures(loaded, tmp_path / "figures", ["overview", "path_3d"])


@pytest.mark.long
def test_a_trajectory_of_drakes_runs_with_metrics_figures_and_playback(tmp_path):
    result = simulate(make_experiment({**BASE, "task": "pose"}, pose_trajectory()))
    assert result.metrics["position_error_max_m"] < 5e-6
    assert result.metrics["orientation_error_max_rad"] < 5e-5
    assert {"orientation_error", "path_3d"} <= set(drawable(result))
    page = write_playback(result, tmp_path / "page.html").read_text()
    assert '<i class="square desired"></i>end' in page
    assert json.dumps(result.metrics)


def test_a_sequence_made_in_python_may_hold_a_trajectory():
    p = PANDA.kinematics().p_WE(PANDA.home)
    points = np.column_stack([p, p + np.array([0.0, 0.05, 0.0])])
    there = PiecewisePolynomial.CubicShapePreserving([0.0, 1.0], points, True)
    around = Circle(size=0.02, period=1.0, timing="quintic", laps=1)
    path = Sequence(parts=[there, Part(path=around, lasts=1.2)])
    found = simulate(make_experiment({**BASE, "duration": 2.2}, path)).metrics
    assert found["position_error_max_m"] < 1e-5


@pytest.mark.parametrize("wrong", [3.0, "circle", {"kind": "circle"}, Circle])
def test_what_is_no_path_is_refused(wrong):
    with pytest.raises(InvalidInputError, match=r"^path: must be of class Path, not"):
        make_experiment(BASE, wrong)


# Documents.


def test_files_in_parts_are_found_beside_the_document(tmp_path):
    (tmp_path / "way.csv").write_text("t,x,y,z\n0,0,0,0\n1,0.02,0.03,0\n")
    (tmp_path / "run.yaml").write_text(
        "arm: panda\nlaw: {kind: pseudoinverse}\nperiod: 1e-3\nduration: 1.0\npath:\n"
        "  kind: sequence\n  parts: [{path: {kind: waypoints, file: way.csv}}]\n"
    )
    experiment = load_experiment(tmp_path / "run.yaml")
    assert experiment.desired.duration == 1.0


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ({"kind": "sequence", "parts": [LINE]}, "path.parts.0: must be a mapping with a path"),
        (
            {"kind": "sequence", "parts": [{"path": {**LINE, "bye": 1}}]},
            "path.parts.0.path.bye: no",
        ),
        ({"kind": "sequence", "parts": [{"path": LINE, "last": 1}]}, "path.parts.0.last: no such"),
        ({"kind": "sequence", "parts": [{"path": {"kind": "lin"}}]}, "path.parts.0.path.kind: no"),
        ({"kind": "sequence", "parts": []}, "path.parts: must be a list of one part or more"),
        ({**LINE, "frame": "eye"}, "path.frame: no frame 'eye' in the model"),
        ({"kind": "given"}, "path: was made in Python, which a document does not hold"),
    ],
)
def test_a_bad_section_is_refused_by_its_key(path, message):
    with pytest.raises(InvalidInputError, match=message):
        make_experiment({**BASE, "path": path})


def test_a_path_in_the_frame_of_the_tool_follows_its_axes():
    experiment = make_experiment({**BASE, "path": {**LINE, "frame": "tool"}})
    way = experiment.desired.position(2.0)[0] - experiment.p_WE_start
    np.testing.assert_allclose(way, experiment.R_WE_start @ LINE["by"], atol=1e-12)


def test_a_task_in_a_plane_refuses_a_frame_that_leaves_it():
    document = {**BASE, "arm": "planar6", "task": "xy", "law": {"kind": "pseudoinverse"}}
    simulate(make_experiment({**document, "path": {**LINE, "by": [0.0, 0.05, 0.0]}}))
    experiment = make_experiment({**document, "path": {**LINE, "by": [0.0, 0.0, 0.05]}})
    with pytest.raises(InvalidInputError, match="path: leaves the plane of task xy"):
        simulate(experiment)


# As fast as the bounds allow.


def test_a_line_is_run_as_fast_as_its_bounds_allow():
    told = []
    document = {
        **BASE,
        "path": {**LINE, "timing": "sin2"},
        "duration": 3.0,
        "window": [0.0, 2.0],
        "limits": {"velocity": 0.3, "acceleration": 1.0, "jerk": 10.0},
    }
    found = fastest(make_experiment(document), told.append)
    assert 0.99 <= max(found.result.metrics[f"limit_ratio_{k}_max"] for k in (1, 2, 3)) <= 1.0
    assert found.experiment.path.timing == "ramps"
    end = found.result.series["p_WE"][-1] - found.result.series["p_WE"][0]
    np.testing.assert_allclose(end, LINE["by"], atol=1e-5)
    assert told[0] == (
        "runs the path once, from rest to rest: path.timing: ramps, not sin2; path.laps: 1, not "
        "its default; duration: the path's, not 3 s; no window"
    )


def test_waypoints_with_a_period_are_stretched_and_those_with_times_refused():
    path = {"kind": "waypoints", "positions": [[0, 0, 0], [0.03, 0.05, 0], [0.06, 0, 0.03]]}
    document = {**BASE, "limits": {"velocity": 0.3, "acceleration": 1.0}}
    found = fastest(make_experiment({**document, "path": {**path, "period": 1.0}}))
    assert found.experiment.document.path["period"] == pytest.approx(found.stretch)
    for more, message in (
        ({"times": [0, 1, 2]}, "path.period: must be given, for the path to be stretched"),
        ({"speed": 0.1}, "path.period: must be given, for the path to be stretched"),
        (
            {"period": 1.0, "through": "straight", "blend_time": 0.1},
            "path.blend_time: would not be stretched",
        ),
    ):
        with pytest.raises(InvalidInputError, match=message):
            fastest(make_experiment({**document, "path": {**path, **more}}))

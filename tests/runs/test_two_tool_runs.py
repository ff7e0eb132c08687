"""Runs of an arm with two tools: limits, batches, and experiments that keep what they accept."""

from pathlib import Path

import numpy as np
import pytest

from drake_rnn import load_arm, make_experiment, run_many, simulate
from drake_rnn.batch.compiled_runs import CompiledRuns
from shared_runs import shared_run

TWO_ARMS = Path(__file__).parents[1] / "data" / "two_arms.urdf"
HOME = load_arm("panda").home
PAIR = {"arm": "panda", "base": {"translation": [0.9, 0, 0], "rpy": [0, 0, np.pi]}}
TASK = [
    {"kind": "position"},
    {"kind": "orientation"},
    {"kind": "position", "of": "relative"},
    {"kind": "orientation", "of": "relative"},
]
CIRCLE = {"kind": "circle", "plane": "yz", "size": 0.03, "period": 4}
LIMITS = {"velocity": 1.0, "acceleration": 3.0}


def document(task=TASK, task_frame="centre", **changes):
    arm = {"model": "panda", "pair": {**PAIR, "task_frame": task_frame}}
    base = {"arm": arm, "task": task, "law": {"kind": "adaptive"}, "limits": LIMITS}
    return {**base, "path": CIRCLE, "period": 2e-3, "duration": 0.5, **changes}


@pytest.mark.nightly
@pytest.mark.parametrize(
    "name", ["adaptive_two_tools", "adaptive_two_tools_draw", "adaptive_two_tools_learned"]
)
def test_an_experiment_does_what_it_accepts(name):
    assert all(verdict.met for verdict in shared_run(name).verdicts)


@pytest.mark.long
def test_a_batch_moves_both_arms_as_a_diagram_does():
    """Kinematics of many differ by rounding: some 1e-13 rad after 50 samples of known J."""
    experiment = make_experiment(document(duration=0.1, log_period=2e-3))
    result, many = simulate(experiment), run_many([experiment], record=["position"])
    np.testing.assert_allclose(many.series["position"][0], result.series["position"], atol=1e-10)
    for name in ("frame_position_error_max_m", "frame_orientation_error_max_rad"):
        assert many.row(0)[name] == pytest.approx(result.metrics[name], rel=1e-3, abs=1e-11)


def test_the_pose_of_a_frame_is_a_task_of_any_law():
    """A network that knows no lists follows a path of one tool as seen from the other one."""
    for kind in ("pseudoinverse", "zeroing"):
        contents = document("xyz", "relative", law={"kind": kind}, limits={}, window=[0.3, 0.5])
        assert simulate(make_experiment(contents)).metrics["position_error_max_m"] < 1e-4


@pytest.mark.long
@pytest.mark.parametrize("kind", ["projection", "zeroing"])
def test_networks_do_twelve_rows_of_both_tools(kind):
    """The centre follows its path while both poses are held, once the path's first speed is met."""
    contents = document(law={"kind": kind}, limits={}, window=[0.3, 0.5])
    metrics = simulate(make_experiment(contents)).metrics
    for name in ("position_error_max_m", "frame_position_error_max_m"):
        assert metrics[name] < 1e-4
    for name in ("orientation_error_max_rad", "frame_orientation_error_max_rad"):
        assert metrics[name] < 1e-3


def random_document(rng):
    """Objectives of random frames, far from the start, under random limits, also of positions."""
    frames = ["first", "second", "relative", "centre"]
    task = [{"kind": "position", "axes": str(rng.choice(["xyz", "xy", "z"]))}]
    if rng.random() < 0.5:
        task.append({"kind": "orientation"})
    task.append({"kind": "position", "of": str(rng.choice(frames[1:3]))})
    if rng.random() < 0.5:
        task.append({"kind": "orientation", "of": "relative", "weight": 10 ** rng.uniform(-2, 2)})
    elif rng.random() < 0.5:
        axis = {
            "kind": "axis",
            "of": str(rng.choice(frames)),
            "toward": rng.normal(size=3).tolist(),
        }
        task.append({**axis, "within": float(rng.uniform(0.05, 1.0))})
    limits = {"velocity": float(rng.uniform(0.2, 2)), "acceleration": float(rng.uniform(0.5, 10))}
    if rng.random() < 0.5:
        limits["jerk"] = float(rng.uniform(10, 200))
    room = rng.uniform(0.02, 0.3, (2, 14))
    limits["position_lower"] = (np.tile(HOME, 2) - room[0]).tolist()
    limits["position_upper"] = (np.tile(HOME, 2) + room[1]).tolist()
    law = {"kind": "adaptive", "jacobian": str(rng.choice(["known", "learned"]))}
    path = {"kind": "rest", "offset": rng.uniform(-0.4, 0.4, 3).tolist()}
    changes = {"on_unreachable": "follow", "period": 4e-3, "seed": int(rng.integers(1000))}
    frame = str(rng.choice(["centre", "first"]))
    return document(task, frame, law=law, path=path, limits=limits, duration=0.6, **changes)


def require_limits(count, seed):
    rng, worst, least = np.random.default_rng(seed), 0.0, np.inf
    for _ in range(count):
        contents = random_document(rng)
        metrics = simulate(make_experiment(contents)).metrics
        least = min(least, metrics["joint_limit_margin_min_rad"])
        assert least >= -1e-9, contents
        for name in ("velocity", "acceleration", *({"jerk"} & contents["limits"].keys())):
            order = ("velocity", "acceleration", "jerk").index(name) + 1
            worst = max(worst, metrics[f"limit_ratio_{order}_max"])
            assert worst <= 1 + 1e-9, contents
    return worst, least


@pytest.mark.long
def test_limits_of_all_joints_are_kept_whatever_is_asked_for():
    """Position limits lie close round the start, and arms come to them."""
    _, least = require_limits(6, 0)
    assert least < 0.01


@pytest.mark.nightly
def test_limits_are_kept_in_a_thousand_random_cases():
    require_limits(1000, 1)


def two_joints_each(path, **changes):
    """x of the centre along a path, x and y between the tools held."""
    tool = {"tool": {"length": 0.1}}
    arm = {"model": str(TWO_ARMS), "frame": "left_tool", **tool, "home": [0.4, 0.5, -0.3, 0.6]}
    arm["pair"] = {"frame": "right_tool", **tool}
    task = [{"kind": "position", "axes": "x"}, {"kind": "position", "of": "relative", "axes": "xy"}]
    return document(task) | {"arm": arm, "path": path, "limits": LIMITS} | changes


@pytest.mark.long
@pytest.mark.parametrize(
    "contents",
    [
        two_joints_each({"kind": "line", "by": [-0.03, 0, 0], "period": 1}, duration=0.1),
        pytest.param(document(duration=0.1), marks=pytest.mark.nightly),
    ],
    ids=["two joints each", "seven joints each"],
)
def test_compiled_runs_have_the_errors_of_a_diagram(contents):
    """By JAX, from the same source; the limit cycle of a start that saturates keeps the digits."""
    experiment = make_experiment(contents)
    values, metrics = CompiledRuns([experiment]).run(), simulate(experiment).metrics
    for name in ("position_error_max_m", "frame_position_error_max_m"):
        assert float(values[name][0]) == pytest.approx(metrics[name], rel=1e-6)


def test_two_arms_of_one_model_hold_what_they_are_asked_for():
    path = {"kind": "line", "by": [-0.03, 0, 0], "period": 1, "timing": "quintic"}
    contents = two_joints_each(path, duration=2.0, window=[1.5, 2.0])
    metrics = simulate(make_experiment(contents)).metrics
    assert metrics["position_error_max_m"] < 1e-6
    assert metrics["frame_position_error_max_m"] < 1e-6

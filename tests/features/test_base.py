"""Mobile bases: the joints that carry an arm, their shapes, and the differential drive."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder
from scipy.integrate import solve_ivp

from drake_rnn import (
    AddLoop,
    Circle,
    IdealArm,
    InvalidInputError,
    PathSource,
    SampledController,
    arm_clearance,
    load_arm,
    load_experiment,
    make_experiment,
    make_obstacles,
    simulate,
)
from drake_rnn.features.base import DifferentialDrive, chord
from drake_rnn.robot.arm_description import BaseDescription
from drake_rnn.robot.clearance.arm_shapes import points_round
from drake_rnn.runs.limit_use import conclusion_of
from drive_stops import aside, stop

CART = {"model": "cart"}
SMALL_CIRCLE = {"kind": "circle", "plane": "xy", "size": 0.05, "period": 6}
MOUNT = np.array([0.1, 0.0, 0.24])


@pytest.fixture(scope="module")
def panda() -> Any:
    return load_arm("panda", base=CART)


def test_an_arm_stands_where_its_base_does(panda: Any) -> None:
    alone, rng = load_arm("panda").kinematics(), np.random.default_rng(0)
    assert panda.n == 10
    assert panda.joints[:3] == ("base_x", "base_y", "base_yaw")
    for q in rng.uniform(-1.0, 1.0, (5, 10)):
        turn = RotationMatrix.MakeZRotation(q[2]).matrix()
        there = np.array([q[0], q[1], 0.0]) + turn @ (MOUNT + alone.p_WE(q[3:]))
        np.testing.assert_allclose(panda.kinematics().p_WE(q), there, atol=1e-14)


def test_a_base_has_limits_of_its_own(panda: Any) -> None:
    bounds = panda.limits.bounds
    np.testing.assert_array_equal(bounds["velocity"][:4], [0.5, 0.5, 0.8, 2.175])
    np.testing.assert_array_equal(bounds["acceleration"][:4], [0.5, 0.5, 1.0, 15.0])
    np.testing.assert_array_equal(bounds["jerk"][:4], [5.0, 5.0, 10.0, 7500.0])
    np.testing.assert_array_equal(panda.limits.position_upper[:3], [10.0, 10.0, np.inf])
    assert panda.endless.tolist() == [False, False, True] + 7 * [False]


@pytest.mark.parametrize("name", ["fr3", "gen3", "iiwa14", "puma560", "ur5"])
def test_any_arm_may_stand_on_it(name: str) -> None:
    alone, carried = load_arm(name), load_arm(name, base=CART | {"start": [1.0, 2.0, 0.0]})
    assert carried.joints[3:] == alone.joints
    there = alone.kinematics().p_WE(alone.home) + MOUNT + [1.0, 2.0, 0.0]
    np.testing.assert_allclose(carried.kinematics().p_WE(carried.home), there, atol=1e-14)


def test_a_base_may_be_locked_moved_and_taken_away(panda: Any) -> None:
    locked = panda.replace(lock={"base_yaw": 0.5})
    assert locked.joints[:3] == ("base_x", "base_y", "panda_joint1")
    there = panda.kinematics().p_WE(np.concatenate(([0.0, 0.0, 0.5], panda.home[3:])))
    np.testing.assert_allclose(locked.kinematics().p_WE(locked.home), there, atol=1e-14)
    assert panda.replace(base=None).joints == load_arm("panda").joints
    plant, X_WB = MultibodyPlant(0.0), RigidTransform([1.0, 2.0, 0.5])
    panda.add_to(plant, X_WB)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, panda.posture(plant, panda.home))
    p = plant.GetFrameByName(panda.frame).CalcPoseInWorld(context).translation()
    expected = X_WB @ panda.kinematics().p_WE(panda.home)
    np.testing.assert_allclose(p, expected, atol=1e-14)


def test_what_is_kept_clear_holds_what_is_drawn() -> None:
    base = BaseDescription(model="cart").complete()
    assert base.bounds
    for shape in base.shapes or ():
        corners = np.asarray(points_round(shape.shape))
        # The hull of the corners, filled at random, holds the shape.
        rng = np.random.default_rng(1)
        points = rng.dirichlet(np.full(len(corners), 0.3), 3000) @ corners
        points = shape.X_HG @ np.concatenate((points, corners)).T
        away = []
        for bound in base.bounds:
            local = bound.X_HG.inverse() @ points
            half = 0.5 * float(bound.length or 0.0)
            local[2] -= np.clip(local[2], -half, half)
            away.append(np.linalg.norm(local, axis=0) - float(bound.radius or 0.0))
        assert np.min(away, axis=0).max() <= 1e-9


def test_a_base_is_kept_clear_of_obstacles_and_of_the_arm(panda: Any) -> None:
    box = {"kind": "box", "center": [1.0, 0.0, 0.1], "size": [0.2, 0.2, 0.2]}
    clearance, doubts = arm_clearance(panda, make_obstacles([box]), panda.home)
    assert not doubts
    pairs = [frozenset(pair) for pair in clearance.names]
    assert frozenset(("base", "tool")) in pairs
    of_box = [k for k, (a, b) in enumerate(clearance.names) if {a, b} & {"base"} and b != "base"]
    q = panda.home.copy()
    gaps = []
    for q[0] in (0.0, 0.3):
        gaps.append(clearance.gaps(q)[of_box].min())
    # 0.34 m forward of its middle the base ends; the box begins at 0.9 m.
    assert min(clearance.gaps(q).min(), gaps[1]) <= 0.9 - 0.3 - 0.34 + 1e-9


def document(**changes: Any) -> dict[str, Any]:
    """Return a document of a drive that turns while it follows a target."""
    return {
        "arm": {"model": "panda", "base": CART | {"drive": "differential"}},
        "path": {"kind": "circle", "plane": "xy", "size": 0.6, "period": 6},
        "law": {"kind": "adaptive", "kappa": 500},
        "limits": {
            "velocity": [0.5, 0.5, 0.8] + 7 * [0.5],
            "acceleration": [0.5, 0.5, 1.0] + 7 * [1.0],
            "jerk": None,
        },
        "period": 1e-3,
        "duration": 1.5,
    } | changes


@pytest.mark.long
def test_a_drive_goes_where_one_that_never_slips_would() -> None:
    result = simulate(make_experiment(document()))
    assert result.metrics["base_slip_max_m_s"] < 1e-15
    assert result.metrics["base_speed_ratio_max"] > 0.1
    assert result.metrics["base_speed_ratio_max"] <= 1.0 + 1e-9
    assert result.metrics["base_acceleration_ratio_max"] <= 1.0 + 1e-9


def test_a_law_that_sees_no_joint_positions_leads_a_drive_without_slip() -> None:
    held = {"law": {"kind": "pseudoinverse"}, "duration": 0.3}
    result = simulate(make_experiment(document(**held)))
    assert result.metrics["base_slip_max_m_s"] < 1e-15
    assert result.metrics["position_error_max_m"] < 1e-4


def test_a_holonomic_base_slips_on_the_same_path() -> None:
    held = {"arm": {"model": "panda", "base": CART}}
    result = simulate(make_experiment(document(**held)))
    q, v = result.series["position"], result.series["velocity"]
    aside = np.cos(q[:, 2]) * v[:, 1] - np.sin(q[:, 2]) * v[:, 0]
    assert np.abs(aside).max() > 0.05


#: A path that begins at speed: whoever bounds no acceleration is at that speed at once.
AT_SPEED = {
    "arm": {"model": "panda", "base": CART},
    "path": {"kind": "circle", "plane": "xy", "size": 0.6, "period": 8},
    "law": {"kind": "pseudoinverse"},
    "limits": {"acceleration": None, "jerk": None},
    "duration": 0.1,
}


def accelerations_told(**changes: Any) -> tuple[float, list[str], str]:
    """Return by how much a limit of acceleration is exceeded, and what is said of it."""
    result = simulate(make_experiment(document(**(AT_SPEED | changes))))
    told = [said for said in result.warnings if "acceleration" in said]
    excess = result.metrics.get("acceleration_violation_max_rad_s2", np.nan)
    return excess, told, conclusion_of(result).limits


def test_a_base_that_starts_faster_than_it_can_is_told() -> None:
    changes = {"limits": {}}
    excess, told, limits = accelerations_told(**changes)
    # The tool is at 0.5 m/s within a millisecond, part of which is the arm's.
    assert excess > 50.0
    assert told == [
        f"limits: the arm exceeds a limit of acceleration by {excess:.3g} rad/s^2 or m/s^2; "
        "this law does not keep it; safety: {bounds: true} does"
    ]
    assert limits == "limits broken: acceleration"
    # What keeps it is told of nothing.
    excess, told, limits = accelerations_told(**changes, safety={"bounds": True})
    assert excess <= 1e-9
    assert (told, limits) == ([], "limits kept")
    # An arm that stands has motors, which lag: its limit is that of those who keep it.
    _, told, limits = accelerations_told(**changes, arm="panda", path=SMALL_CIRCLE)
    assert (told, limits) == ([], "")


def test_a_base_without_a_limit_of_acceleration_is_told() -> None:
    _, told, _ = accelerations_told()
    assert len(told) == 1
    assert told[0].startswith(
        "arm.base.acceleration: no limit is given for base_x, base_y, base_yaw, so nothing"
    )


def test_a_chord_ends_where_its_arc_does() -> None:
    rng = np.random.default_rng(3)
    for heading, speed, turning in rng.uniform([-3.0, -1.0, -2.0], [3.0, 1.0, 2.0], (5, 3)):
        period = 0.5  # as long as that, so that an error of any order would show

        def rate(t: float, p: Any, h: float = heading, u: float = speed, w: float = turning) -> Any:
            return [u * np.cos(h + w * t), u * np.sin(h + w * t)]

        end = solve_ivp(rate, (0.0, period), [0.0, 0.0], rtol=1e-12, atol=1e-14).y[:, -1]
        xy = np.array(chord(heading, speed, turning, period)) * period
        np.testing.assert_allclose(xy, end, atol=1e-11)


def test_a_drive_stops_beside_where_its_joints_would_by_themselves() -> None:
    """Why obstacles are refused: what is certified of a stop is 4.6 cm beside what a cart does."""
    fastest, limits = np.array([0.5, 0.8]), np.array([0.5, 1.0])
    way = stop(fastest, limits)

    def rate(t: float, pose: Any) -> Any:
        forward, turning = np.maximum(fastest - limits * t, 0.0)
        return [forward * np.cos(pose[2]), forward * np.sin(pose[2]), turning]

    end = solve_ivp(rate, (0.0, 1.0), np.zeros(3), rtol=1e-10, atol=1e-12, max_step=0.01).y[:, -1]
    np.testing.assert_allclose(way[-1, 1:], end, atol=1e-5)
    # Straight on, and turned as far: v^2 / (2 a) of each.
    np.testing.assert_allclose(way[-1, [0, 3]], 0.5 * fastest**2 / limits, atol=1e-5)
    assert 0.045 < aside(way) < 0.046
    # Of half the speeds both ways are a quarter as long, and apart by a sixteenth.
    assert aside(stop(0.5 * fastest, limits)) == pytest.approx(aside(way) / 16.0, rel=0.02)
    assert aside(stop(fastest * [1.0, 0.0], limits)) == 0.0


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"obstacles": []}, "obstacles"),
        ({"law": {"kind": "joint_drift_free", "scheme": "naljdf"}}, "arm.base.drive"),
        ({"level": "dynamic"}, "level"),
        ({"faults": [{"joint": 5, "time": 1.0}]}, "faults"),
        ({"safety": {}}, "safety"),
    ],
)
def test_what_a_drive_cannot_do_is_refused(changes: dict[str, Any], key: str) -> None:
    with pytest.raises(InvalidInputError, match=f"^{key}"):
        make_experiment(document(**changes))


def test_a_loop_of_ones_own_must_lead_its_drive() -> None:
    arm = make_experiment(document()).arm
    law = make_experiment(document()).law
    for around in (None, DifferentialDrive()):
        builder = DiagramBuilder()
        source = PathSource(
            Circle(size=0.1, period=6.0), arm.kinematics().p_WE(arm.home), preview=1e-3
        )
        builder.AddNamedSystem("path", source)
        controller = SampledController(law, 1e-3, wrapper=around)
        if around is None:
            with pytest.raises(InvalidInputError, match="must lead the differential drive"):
                AddLoop(builder, IdealArm(arm), controller, source)
        else:
            AddLoop(builder, IdealArm(arm), controller, source)


@pytest.mark.parametrize(
    ("base", "message"),
    [
        ({"model": "tram"}, "no base 'tram'; may be cart|no base 'tram'"),
        ({"drive": "legs"}, "drive"),
        ({"velocity": [0.5, 0.5]}, "velocity"),
        ({"velocity": [0.5, 0.0, 0.5]}, "velocity: must be three numbers above 0"),
        ({"area": [[1, 1], [0, 0]]}, "area: must be two corners"),
        ({"area": [[0, 0], [1, 1]], "drive": "differential"}, "area: must be left out"),
        ({"name": "panda_link1"}, "the arm has 'panda_link1' already"),
        ({"name": " "}, "name: must be a name"),
    ],
)
def test_bad_bases_are_refused(base: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        load_arm("panda", base=base)


def random_document(number: int) -> dict[str, Any]:
    """Return a random base, drive, target and limits; targets are also far out of reach."""
    rng = np.random.default_rng([550, number])
    drive = ("holonomic", "differential")[number % 2]
    start = [*rng.uniform(-1.0, 1.0, 2).tolist(), float(rng.uniform(-3.0, 3.0))]
    base: dict[str, Any] = {"model": "cart", "drive": drive, "start": start}
    if drive == "holonomic":
        base["area"] = [[-1.2, -1.2], [1.2, 1.2]]
    limits: dict[str, Any] = {
        "velocity": rng.uniform(0.1, 1.0, 10).tolist(),
        "acceleration": rng.uniform(0.3, 3.0, 10).tolist(),
        "jerk": rng.uniform(5.0, 50.0, 10).tolist() if rng.random() < 0.5 else None,
    }
    learned = rng.random() < 0.3
    path = {"kind": "circle", "plane": str(rng.choice(["xy", "yz", "xz"]))}
    path |= {"size": float(rng.uniform(0.1, 2.0)), "period": float(rng.uniform(2.0, 20.0))}
    path |= {"offset": rng.uniform(-0.5, 0.5, 3).tolist()}
    return {
        "arm": {"model": "panda", "base": base},
        "path": path,
        "law": {"kind": "adaptive"} | ({"jacobian": "learned"} if learned else {}),
        "limits": limits,
        "on_unreachable": "follow",
        "period": 2e-3,
        "duration": 0.8,
        "seed": number,
    }


def beyond(number: int) -> float:
    """Return by how much a random case is beyond any of its bounds, as a share of it."""
    result = simulate(make_experiment(random_document(number)))
    values = [result.metrics[f"limit_ratio_{k}_max"] for k in (1, 2)]
    if result.experiment.limits.jerk is not None:
        values.append(result.metrics["limit_ratio_3_max"])
    if number % 2:
        values += [result.metrics[f"base_{x}_ratio_max"] for x in ("speed", "acceleration")]
        assert result.metrics["base_slip_max_m_s"] < 1e-12
    assert result.metrics["joint_limit_margin_min_rad"] >= -1e-9
    return max(values) - 1.0


def test_bounds_hold_in_random_cases() -> None:
    assert max(map(beyond, range(4))) < 1e-9


@pytest.mark.nightly
def test_bounds_hold_in_a_thousand_random_cases() -> None:
    assert max(map(beyond, range(1000))) < 1e-9


def test_the_shipped_experiments_say_what_they_have() -> None:
    assert load_experiment("adaptive_base").arm.base.drive == "holonomic"
    assert load_experiment("adaptive_differential_base").arm.base.drive == "differential"

"""Rows that slow links of two arms down before each other: what they allow and what not."""

from functools import cache

import daqp
import numpy as np
import pytest

from drake_rnn import InvalidInputError, load_experiment, make_experiment, run_many, simulate
from drake_rnn.laws.scheme import MutualAvoidance, MutualRows
from drake_rnn.robot.clearance.clearance import CriticalPoints
from shared_runs import shared_run

INNER, OUTER = 0.01, 0.035
NAMES = ["projection_two_arms", "projection_two_arms_printed"]
# A lap of 4 s from rest to rest, at 100 Hz; until its middle forearms meet.
SHORT = {"path.period": 4, "duration": 2.5, "period": 1e-2, "accept": None}


@cache
def experiment(name="projection_two_arms", **changes):
    keys = {key.replace("__", "."): value for key, value in changes.items()}
    return load_experiment(name, {**SHORT, **keys})


@cache
def near_posture():
    """A posture on the way without rows, in which both forearms are as near as `INNER` or less."""
    made = experiment(law__mutual_avoidance=None)
    position = run_many([made], record=["position"]).series["position"][0]
    gaps = made.clearance.between_arms.gaps(position).min(axis=1)
    return position[np.argmax(gaps < 0.5 * (INNER + OUTER))]


def critical(gap, J):
    """One link whose point is before the other arm, along x."""
    return CriticalPoints(np.array([gap]), np.array([[0.1, 0.0, 0.0]]), J[None])


def rows_of(points, **settings):
    """Rows of one link, whose point is a function of the posture."""
    return MutualRows(MutualAvoidance(inner=0.02, outer=0.1, **settings), 1, points)


def stepped(gaps, v, **settings):
    """C and d at the last of some distances, with what was remembered on the way."""
    rows = rows_of(lambda q: critical(q, np.eye(3)), **settings)
    state = rows.init({}, np.random.default_rng(0))
    for gap in gaps:
        (C, d), state = rows.step(state, {"position": gap}, 1e-3, v)
    return C, d


def test_a_link_may_approach_as_it_did_at_first_and_less_and_less_until_none():
    """By S = sin^2: all of it at d2, half of it half way, none from d1 on; what recedes, always."""
    v = np.array([0.5, 0.0, 0.0])
    for gap, share in ((0.0999999, 1.0), (0.06, 0.5), (0.02, 0.0), (0.01, 0.0)):
        C, d = stepped([0.11, 0.0999999, gap], v)
        assert C @ v * share == pytest.approx(d, abs=1e-6)
        assert (C @ -v <= d).all()
    assert stepped([0.11], v)[1] > 100.0


def test_of_a_link_that_begins_near_no_approach_is_remembered():
    v = np.array([0.5, 0.0, 0.0])
    assert stepped([0.09, 0.09], v)[1] == pytest.approx([0.0])


def test_without_fading_no_approach_is_allowed_from_outer_on():
    assert stepped([0.11, 0.0999], np.ones(3), fading=False)[1] == pytest.approx([0.0])


def test_a_scalar_product_hinges_on_no_axes_and_that_of_coordinates_does():
    """The velocity leads away in the mean, though not along each axis of every frame."""
    rng, v = np.random.default_rng(0), np.array([-0.1, 0.05, 0.0])
    refused = {"scalar": 0, "coordinates": 0}
    for R in np.linalg.qr(rng.normal(size=(200, 3, 3)))[0]:
        points = CriticalPoints(np.array([0.03]), (R @ [0.1, 0.02, 0.0])[None], R[None])
        for product in refused:
            rows = rows_of(lambda q, points=points: points, product=product)
            state = rows.init({}, rng)
            (C, d), _ = rows.step(state, {"position": v}, 1e-3, v)
            refused[product] += bool((C @ v > d + 1e-12).any())
    assert refused["scalar"] == 0
    assert refused["coordinates"] > 50


def test_critical_points_are_those_of_the_nearest_capsules_and_move_as_their_jacobians_say():
    clearance, q, h = experiment().clearance, near_posture(), 1e-6
    points = clearance.critical_points(q)
    gaps = clearance.between_arms.gaps(q)
    assert points.gaps.min() == pytest.approx(gaps.min(), abs=1e-15)
    # Seven links of each arm; each is moved by joints of its own arm alone.
    assert points.J.shape == (14, 3, 14)
    assert not points.J[:7, :, 7:].any()
    assert not points.J[7:, :, :7].any()
    # Along the way between the points, what the nearest points change by themselves does not count.
    unit = points.ways / np.linalg.norm(points.ways, axis=1)[:, None]
    least = np.argmin(points.gaps)
    other = 7 + np.argmin(points.gaps[7:]) if least < 7 else np.argmin(points.gaps[:7])
    for joint, e in enumerate(np.eye(14)):
        ahead, back = (clearance.critical_points(q + s * h * e).gaps[least] for s in (1, -1))
        slope = sum(-unit[k] @ points.J[k, :, joint] for k in (least, other))
        assert (ahead - back) / (2 * h) == pytest.approx(slope, abs=1e-6)


@pytest.mark.parametrize("network", ["lvi", "simplified_lvi", "dual"])
def test_a_network_comes_to_the_optimum_of_its_program_with_rows(network):
    """As daqp has it, where a row and bounds are in force and the task can be done all the same."""
    # With small gains a program of signals that stay stays as well.
    gains = {"law__feedback": 1e-6, "law__return_gain": 1e-6}
    law = experiment(law__network=network, limits__velocity=0.06, **gains).law
    rng, h = np.random.default_rng(0), 1e-2
    u = {name: 0.3 * rng.normal(size=s) for name, (_, s) in law.inputs.parts.items()}
    u |= {"position": near_posture(), "a_WE_desired": 0.0 * u["a_WE_desired"]}
    points = law.clearance.critical_points(u["position"])
    nearest = points.gaps.argmin()
    approach = points.ways[nearest] @ points.J[nearest]
    u["v_WE_desired"] = u["J"] @ (0.1 * approach / np.linalg.norm(approach))
    reading = law.sampled(h)
    x = reading.initial_state(rng, u)
    for k in range(100):
        x = reading.step(k * h, x, u, h)
    rows = law.mutual_rows
    further, _ = rows.step(rows.init(u, rng), u, h, np.zeros(14))
    program = law.scheme.program(u, further)
    A, b = program.A / law.damping, program.b / law.damping
    upper = np.concatenate((program.box[1], program.d))
    lower = np.concatenate((program.box[0], np.full(rows.size, -1e3)))
    H, f = np.eye(14) + A.T @ A, program.c - A.T @ b
    ought, *_, info = daqp.solve(H, f, np.ascontiguousarray(program.C), upper, lower)
    np.testing.assert_allclose(reading.state.by_name(x)["v"], ought, atol=1e-9)
    assert np.abs(info["lam"][14:]).max() > 1e-6
    assert np.abs(info["lam"][:14]).max() > 1e-6


@pytest.mark.parametrize("name", NAMES)
def test_a_batch_moves_both_arms_as_a_diagram_does(name):
    made = experiment(name, duration=0.3, log_period=1e-2, law__mutual_avoidance__outer=0.038)
    result, many = simulate(made), run_many([made], record=["position"])
    np.testing.assert_allclose(many.series["position"][0], result.series["position"], atol=1e-12)
    for key in ("arms_distance_min_m", "distance_min_m"):
        assert many.row(0)[key] == pytest.approx(result.metrics[key], abs=1e-12)


@pytest.mark.long
@pytest.mark.parametrize("name", NAMES)
def test_arms_that_meet_stay_apart_with_rows(name):
    """Without rows forearms overlap by more than 1 cm; with them they stay `INNER` apart."""
    without = experiment(law__mutual_avoidance=None)
    apart, meeting = (run_many([each]).row(0) for each in (experiment(name), without))
    assert meeting["arms_distance_min_m"] < -0.01
    assert apart["arms_distance_min_m"] > INNER
    assert apart["position_error_max_m"] < 1e-4


@pytest.mark.long
def test_rows_are_no_certificate():
    """Where two pairs of a link are as near, they take turns, sample by sample, and arms meet."""
    contents = experiment().document.contents()
    pair = {**contents["arm"]["pair"], "base": {"translation": [0.0, 0.304, 0.0]}}
    pair["task_frame"] = "second"
    task = [{"kind": "position"}, {"kind": "position", "of": "first"}]
    path = {**contents["path"], "plane": "yz", "size": 0.105, "period": 4}
    changes = {"arm": {"model": "panda", "pair": pair}, "task": task, "path": path}
    made = make_experiment({**contents, **changes, "period": 2e-3, "duration": 1.8})
    assert run_many([made]).row(0)["arms_distance_min_m"] < 0.0


@pytest.mark.nightly
@pytest.mark.parametrize("name", NAMES)
def test_an_experiment_does_what_it_accepts(name):
    assert all(verdict.met for verdict in shared_run(name).verdicts)


def test_nothing_is_guaranteed_and_a_warning_says_so():
    made = experiment()
    assert made.guarantees.command.distance is None
    assert any("certifies no distance" in each for each in made.warnings)
    assert not any("does not avoid them" in each for each in made.warnings)


def test_six_rows_of_positions_are_no_pose():
    law = experiment().law
    assert law.task_size == 6
    assert "R_WE" not in law.inputs


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"arm": "panda", "task": "xyz"}, r"law\.mutual_avoidance: is of two arms that one law"),
        ({"obstacles": None}, r"obstacles: must be given with law\.mutual_avoidance"),
        (
            {"period": None, "integrator": {"step": 1e-3}},
            r"integrator: must be left out with law\.mutual_avoidance",
        ),
        ({"law.discretization": "euler"}, r"mutual_avoidance: needs discretization: implicit or"),
        ({"law.mutual_avoidance.outer": 0.01}, r"outer: must be greater than inner, 0\.01 m"),
        ({"level": "torque"}, r"level: torque|law: must command torques"),
    ],
)
def test_what_does_not_go_with_rows_is_refused(changes, message):
    with pytest.raises(InvalidInputError, match=message):
        load_experiment("projection_two_arms", {"accept": None, **changes})


def random_document(rng):
    """Arms at any distance, tools that are led anywhere, limits round the start."""
    contents = load_experiment("projection_two_arms").document.contents()
    room, home = rng.uniform(0.02, 0.3, (2, 14)), experiment().start
    limits = {"velocity": float(rng.uniform(0.2, 2)), "acceleration": float(rng.uniform(0.5, 10))}
    limits["position_lower"] = (home - room[0]).tolist()
    limits["position_upper"] = (home + room[1]).tolist()
    inner = float(rng.uniform(0.005, 0.03))
    rows = {"inner": inner, "outer": inner + float(rng.uniform(0.005, 0.1))}
    rows |= {"product": str(rng.choice(["scalar", "coordinates"])), "fading": bool(rng.integers(2))}
    law = {"kind": "projection", "bounds": "velocity", "mutual_avoidance": rows}
    law |= {"network": str(rng.choice(["lvi", "simplified_lvi", "dual"]))}
    law |= {"gain": float(10 ** rng.uniform(2, 8))}
    base = {"translation": [0.0, float(rng.uniform(0.28, 0.5)), 0.0]}
    pair = {**contents["arm"]["pair"], "base": base}
    return {
        **{key: value for key, value in contents.items() if key not in ("accept", "name")},
        "arm": {"model": "panda", "pair": pair},
        "law": law,
        "limits": limits,
        "path": {"kind": "rest", "offset": rng.uniform(-0.4, 0.4, 3).tolist()},
        "safety": {"bounds": True},
        "on_unreachable": "follow",
        "period": 1e-2,
        "duration": 0.5,
    }


def require_limits(count, seed):
    rng, rows_in_force = np.random.default_rng(seed), 0
    for _ in range(count):
        contents = random_document(rng)
        metrics = run_many([make_experiment(contents)]).row(0)
        assert metrics["joint_limit_margin_min_rad"] >= -1e-9, contents
        for order in (1, 2):
            assert metrics[f"limit_ratio_{order}_max"] <= 1 + 1e-9, contents
        outer = contents["law"]["mutual_avoidance"]["outer"]
        rows_in_force += metrics["arms_distance_min_m"] < outer
    return rows_in_force


@pytest.mark.long
def test_limits_of_all_joints_are_kept_beside_the_rows():
    """By the box behind the network; rows are in force in some of the cases."""
    assert require_limits(20, 0) > 2


@pytest.mark.nightly
def test_limits_are_kept_in_a_thousand_random_cases():
    require_limits(1000, 1)

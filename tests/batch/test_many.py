"""Many runs at once: company does not matter, and failures stay alone."""

import numpy as np
import pytest

from drake_rnn import (
    CompiledRuns,
    InvalidInputError,
    JointLimits,
    Positive,
    SampledLaw,
    SimulationError,
    load_experiment,
    make_experiment,
    run_many,
    simulate,
    validated,
    why_not,
)
from drake_rnn.arrays.algebra import solve, vecmat
from drake_rnn.batch.grouping import blocks
from drake_rnn.batch.run import robots_of
from seeing_law import SeesTask

GAINS = {"slc_nephroid_known": "kappa", "slc_four_ring_fast": "rho", "naljdf_table1": "rate"}


def varied(name, count, duration, tool=False):
    """Return variants of a shipped experiment, each with its own start, gain, limits and seed."""
    base = load_experiment(name, {"duration": duration, "window": None})
    rng = np.random.default_rng(1)
    document = base.document.contents()
    gain = document["law"].get(GAINS[name], 4.0)
    made = []
    for seed in range(count):
        law = {**document["law"], GAINS[name]: gain * rng.uniform(0.8, 1.2)}
        start = base.start + rng.normal(0.0, 0.02, base.start.size)
        limits = {"acceleration": rng.uniform(3.0, 8.0)}
        own = {"law": law, "start": start.tolist(), "limits": limits, "seed": seed}
        if tool:
            length = rng.uniform(0.05, 0.15)
            ball = {"ball": 0.003, "shaft": 0.005, "length": length, "mass": 0.05}
            own["arm"] = {"model": document["arm"], "tool": ball}
        made.append(make_experiment({**document, **own}))
    return made


@pytest.mark.long
@pytest.mark.parametrize("name", GAINS)
def test_a_run_has_the_same_bits_alone_and_in_any_company(name):
    experiments = varied(name, 37, 0.08)
    whole = run_many(experiments, record=["position"])
    few = run_many(experiments[3:11], record=["position"])
    for number in (3, 10):
        alone = run_many([experiments[number]], record=["position"])
        for many, row in ((whole, number), (few, number - 3)):
            assert np.array_equal(many.series["position"][row], alone.series["position"][0])
            assert many.row(row) == alone.row(0)


def test_arms_and_paths_of_their_own_are_run_as_drake_runs_them():
    experiments = varied("slc_nephroid_known", 5, 0.05, tool=True)
    document = experiments[0].document.contents()
    circle = {"kind": "circle", "size": 0.05, "period": 2.0}
    experiments.append(make_experiment({**document, "path": circle}))
    many = run_many(experiments)
    for number, experiment in enumerate(experiments):
        q = simulate(experiment, series="none").series["position"][-1]
        assert many.position[number] == pytest.approx(q, abs=1e-12)


def test_different_laws_periods_and_durations_keep_their_order():
    names = ["slc_nephroid_known", "naljdf_table1", "slc_nephroid_known", "fastest_square"]
    durations = [0.02, 0.04, 0.06, 0.02]
    pairs = zip(names, durations, strict=True)
    experiments = [load_experiment(name, {"duration": d, "window": None}) for name, d in pairs]
    many = run_many(experiments, record=["position"])
    assert [times[-1] for times in many.time] == durations
    for number, experiment in enumerate(experiments):
        assert many.row(number) == run_many([experiment]).row(0)
    # Only some have a bound on the jerk, or a demand that it cuts.
    assert "saturated_fraction" not in many.row(3)
    assert "saturated_fraction" in many.row(0)


def test_window_laps_and_settling_are_those_of_simulate():
    base = load_experiment("slc_nephroid_known").document.contents()
    circle = {"kind": "circle", "size": 1e-5, "period": 0.05, "offset": [1e-4, 0.0, 0.0]}
    own = {"path": circle, "duration": 0.13, "window": [0.03, 0.1], "settling_tolerance_m": 5e-5}
    law = {**base["law"], "kappa": 20.0}
    experiment = make_experiment({**base, **own, "law": law})
    row, metrics = run_many([experiment]).row(0), simulate(experiment).metrics
    assert {"lap_drift_max_rad", "joint_drift_max_rad", "settling_time_s"} <= row.keys()
    assert 0.0 < row["settling_time_s"] < 0.13
    # Differences of velocities over a tick and over 10 ms enlarge rounding.
    assert row == pytest.approx(metrics, rel=1e-7, abs=1e-9)


def test_a_start_outside_of_limits_and_a_target_are_measured():
    experiment = load_experiment("null_space_adjustment", {"duration": 0.08})
    row, metrics = run_many([experiment]).row(0), simulate(experiment).metrics
    for name in ("joint_error_max_rad", "end_effector_drift_max_m", "joint_limit_margin_min_rad"):
        assert row[name] == pytest.approx(metrics[name], abs=1e-9)


@validated
class Fragile(SeesTask, SampledLaw):
    """A law that follows its path, and breaks where it is told to."""

    limits: JointLimits
    gain: Positive = 5.0
    breaks_at: Positive = 1e9
    solves: bool = False

    takes_many = True

    def step(self, t, x, u, period):
        off = self.gain * (u["p_WE_desired"] - u["p_WE"])
        broken = np.asarray(t >= self.breaks_at - 1e-9)
        if self.solves:
            # Singular where it breaks: NumPy then solves for no robot at all.
            scale = np.where(broken, 0.0, np.ones((*off.shape[:-1], 1)))
            off = solve(scale[..., None] * np.eye(3), off[..., None])[..., 0]
            return vecmat(off, u["J"])
        return np.where(broken, np.nan, vecmat(off, u["J"]))


def fragile(**law):
    return make_experiment(
        {
            "arm": "panda",
            "path": {"kind": "circle", "size": 0.05, "period": 1.0, "offset": [0.001, 0.0, 0.0]},
            "law": {"kind": f"{__name__}:Fragile", **law},
            "period": 1e-3,
            "duration": 0.05,
        }
    )


@pytest.mark.parametrize("solves", [False, True])
def test_a_run_that_fails_is_a_row_and_stops_no_other(solves):
    gains, breaks = (4.0, 5.0, 6.0, 7.0), (1e9, 0.02, 1e9, 0.001)
    experiments = [
        fragile(gain=gain, breaks_at=at, solves=solves)
        for gain, at in zip(gains, breaks, strict=True)
    ]
    many = run_many(experiments)
    assert many.status == ("complete", "failed", "complete", "failed")
    assert many.until == pytest.approx([0.05, 0.02, 0.05, 0.001])
    reason = r"Fragile.step raised LinAlgError" if solves else "Fragile.step: v is no longer finite"
    assert list(many.failures) == [1, 3]
    assert many.failures[1].startswith(reason)
    for number in (0, 2):
        # As if the others were not there.
        assert many.row(number) == run_many([experiments[number]]).row(0)
    for number in (1, 3):
        with pytest.raises(SimulationError) as failure:
            simulate(experiments[number])
        assert failure.value.time == pytest.approx(many.until[number])
        assert many.row(number) == pytest.approx(failure.value.result.metrics, abs=1e-9)


def test_a_law_that_never_works_fails_at_once():
    many = run_many([fragile(breaks_at=1e-6), fragile()])
    assert many.status == ("failed", "complete")
    assert many.until[0] == pytest.approx(0.001)


def test_progress_ends_at_the_whole():
    told = []
    run_many(varied("slc_nephroid_known", 2, 0.3), told.append)
    assert len(told) <= 100
    assert told == sorted(told)
    assert told[-1] == pytest.approx(1.0, abs=0.011)


def test_nothing_to_run_is_an_empty_table():
    many = run_many([])
    assert len(many) == 0
    assert not many.metrics


def test_only_known_series_are_recorded():
    with pytest.raises(InvalidInputError, match=r"^record: may be position, not 'force'"):
        run_many([], record=["force"])


def among_balls(seed, duration=0.05, **changes):
    """Return an adaptive law's run among two balls at random places beside its path."""
    rng = np.random.default_rng(seed)
    sides = np.array([[0.0, 0.3, 0.1], [0.1, -0.3, 0.0]]) + rng.uniform(-0.03, 0.03, (2, 3))
    centers = np.array([0.4, 0.0, 0.5]) + sides
    balls = [
        {"kind": "ball", "center": center.tolist(), "radius": rng.uniform(0.03, 0.06)}
        for center in centers
    ]
    own = {"obstacles": balls, "duration": duration, "window": None, "accept": None}
    return load_experiment("adaptive_obstacles", {**own, **changes})


def test_scenes_with_obstacles_of_their_own_run_side_by_side_as_alone():
    scenes = [among_balls(seed) for seed in range(3)]
    assert len(blocks(robots_of(scenes))) == 1
    many = run_many(scenes)
    assert len({tuple(state["gaps"]) for state in many.state}) == 3
    for number, scene in enumerate(scenes):
        alone = run_many([scene])
        np.testing.assert_array_equal(many.position[number], alone.position[0])
        assert many.row(number)["distance_min_m"] == alone.row(0)["distance_min_m"]
        for name, part in alone.state[0].items():
            np.testing.assert_array_equal(many.state[number][name], part)


def test_scenes_of_other_shapes_do_not_share_a_step():
    ball, wall = among_balls(0), {"kind": "half_space", "point": [0, 0, -0.5], "normal": [0, 0, 1]}
    walled = among_balls(0, obstacles=[{**each} for each in ball.document.obstacles[:1]] + [wall])
    assert len(blocks(robots_of([ball, walled]))) == 2


@pytest.mark.long
def test_one_build_serves_scenes_and_agrees_with_numpy_in_each():
    """Also with other limits and gains; in C if there is a compiler."""
    pytest.importorskip("jax")
    scenes = [among_balls(seed, 0.3) for seed in range(2)]
    scenes += [among_balls(2, 0.3, **{"limits.velocity": 0.4, "law.kappa": 500.0})]
    compiled, wanted = run_many(scenes, compiled=True), run_many(scenes)
    for number in range(len(scenes)):
        off = compiled.position[number] - wanted.position[number]
        # Near its start the law enlarges differences of rounding.
        assert np.abs(off).max() < 1e-5
        gaps = wanted.state[number]["gaps"]
        assert compiled.state[number]["gaps"] == pytest.approx(gaps, abs=1e-4)
    distances = compiled.metrics["distance_min_m"]
    assert distances == pytest.approx(wanted.metrics["distance_min_m"], abs=1e-6)


# Lines that lead the tools into each other.
NEARER = {"path.by": [0.25, 0.1, 0.0], "duration": 2.0}
FACING = {"rpy": [0.0, 0.0, float(np.pi)]}


def pair(x, seed=0, **changes):
    """Two arms that face each other, each of which moves towards the other one."""
    line = {"kind": "line", "by": [0.1, 0.1, 0.0], "period": 2.0, "offset": [0.0, 0.02 * seed, 0.0]}
    return load_experiment(
        {
            "arm": "panda",
            "path": line,
            "law": {"kind": "adaptive", "kappa": 1000},
            "limits": {"velocity": 0.5, "acceleration": 1.0},
            "obstacles": [],
            "second": {"base": {"translation": [x, 0.1, 0.0], **FACING}},
            "on_unreachable": "follow",
            "period": 1e-3,
            "duration": 0.05,
            "log_period": 1e-3,
            "seed": seed,
        },
        changes,
    )


@pytest.mark.long
def test_two_arms_beside_each_other_move_as_in_their_diagram_in_any_company():
    """The second one sees in a sample what the first one has just chosen; bases differ."""
    pairs = [pair(0.9), pair(0.86, seed=1), load_experiment(pair(0.9), {"second": None})]
    assert blocks(robots_of(pairs)) == [[0, 1], [2]]
    many = run_many(pairs, record=["position"])
    for number, experiment in enumerate(pairs[:2]):
        result, one = simulate(experiment), run_many([experiment], record=["position"])
        for found, of_diagram, alone in (
            (many, result, one),
            (many.second, result.second, one.second),
        ):
            position = found.series["position"][number]
            np.testing.assert_allclose(position, of_diagram.series["position"], atol=1e-11)
            assert found.row(number) == pytest.approx(of_diagram.metrics, rel=1e-7, abs=1e-7)
            np.testing.assert_array_equal(position, alone.series["position"][0])
            assert found.row(number) == alone.row(0)
    # A run with one arm has no second one.
    assert not many.second.row(2)
    assert many.row(2)


@pytest.mark.long
def test_compiled_pairs_keep_clear_of_each_other_and_move_as_in_their_diagram():
    """Arms that knew nothing of each other would touch; one build serves both bases."""
    pytest.importorskip("jax")
    pairs = [pair(x, **NEARER) for x in (0.9, 0.86)]
    many = run_many(pairs, compiled=True, record=["position"])
    blind = [load_experiment(pairs[0], {"second": None, "obstacles": None})]
    (q,) = run_many(blind, compiled=True, record=["position"]).series["position"]
    for number, experiment in enumerate(pairs):
        assert experiment.clearance.least_along(np.concatenate((q, q), axis=1)[::10]).min() < 0.0
        for found in (many, many.second):
            assert 0.005 < found.row(number)["distance_min_m"] < 0.02
            assert found.row(number)["acceleration_violation_max_rad_s2"] < 1e-9
    # The base for which it was not built.
    result = simulate(pairs[1], compiled=True)
    for found, of_diagram in ((many, result), (many.second, result.second)):
        position = found.series["position"][1]
        np.testing.assert_allclose(position, of_diagram.series["position"], atol=1e-9)


def test_a_second_arm_that_follows_the_first_one_is_refused_with_the_reason():
    pytest.importorskip("jax")
    follows = {"base": {"translation": [0.9, 0.0, 0.0], **FACING}, "follows": True}
    experiment = pair(0.9, second={**follows, "path": {"kind": "rest"}})
    assert why_not(experiment).startswith("second.follows: a batch knows all paths beforehand")
    with pytest.raises(InvalidInputError, match=r"^second: a compiled run has none; run_many has"):
        CompiledRuns([pair(0.9)])

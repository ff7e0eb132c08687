"""An arm that torques alone move: limits, what is least, what is learned, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

import torque_tables
from drake_rnn import InvalidInputError, load_experiment, simulate, write_figures
from drake_rnn.features.pairs import refusal
from drake_rnn.figures import drawable
from drake_rnn.figures.registry import FIGURES
from drake_rnn.runs.limit_use import conclusion_of, uses
from row_helpers import each
from shared_runs import shared_run

SHIPPED = [
    "computed_torque",
    "dual_criteria_torque",
    "minimum_torque",
    "rods3_long",
    "rods3_short",
    "torque_payload_learned",
]
SHORT = {"path.size": 0.03, "path.period": 0.5, "duration": 0.5, "accept": None}


@pytest.mark.long
@pytest.mark.parametrize("name", SHIPPED)
def test_it_comes_to_what_its_document_expects(name):
    result = shared_run(name)
    for metric, accepted in result.experiment.document.accept.items():
        assert accepted.holds(result.metrics[metric]), (metric, result.metrics[metric])


def test_a_limit_of_torque_holds_that_the_path_would_exceed():
    """0.95 of what the path takes without it; Drake's plant is given no more than that."""
    free = simulate(load_experiment("computed_torque", SHORT)).metrics["torque_ratio_max"]
    share = 0.95 * free
    for law in ({}, {"law.network": "simplified_lvi", "law.gain": 100.0}):
        changes = {**SHORT, **law, "law.torque_share": share}
        metrics = simulate(load_experiment("computed_torque", changes)).metrics
        assert metrics["torque_ratio_max"] == pytest.approx(share, rel=1e-9)
        assert metrics["saturated_fraction"] > 0.0


def test_the_bound_of_torque_holds_with_the_law_and_breaks_of_an_arm_with_less_of_it():
    """A path that asks for 2.8 times the limits: they are commanded, or the 1.25 that it was told.

    Where they hold by construction that is judged, and shown where bounds are.
    """
    fast = {"path.size": 0.1, "path.period": 0.3, "duration": 0.2, "accept": None}
    made = load_experiment("computed_torque", fast)
    kept = simulate(made)
    (verdict,) = kept.verdicts
    assert (verdict.metric, verdict.met, verdict.bound.at_most) == (
        "torque_ratio_max",
        True,
        1 + 1e-9,
    )
    assert kept.metrics["saturated_fraction"] > 0.5
    weak = replace(made, law=replace(made.law, torque_limits=1.25 * made.arm.effort))
    broken = simulate(weak)
    assert broken.verdicts == []
    commanded = np.abs(broken.series["torque"] / made.arm.effort).max()
    assert commanded == broken.metrics["torque_ratio_max"] == pytest.approx(1.25, rel=1e-9)
    assert any("1.25 times its joint's limit" in text for text in broken.warnings)
    for result, is_broken in ((kept, False), (broken, True)):
        use = uses(result)[-1]
        assert (use.name, use.broken) == ("torque", is_broken)
        assert ("torque" in conclusion_of(result).broken) == is_broken


def test_with_a_known_model_the_error_is_that_of_the_plants_steps():
    """Drake's steps are of the first order: a fourth of the period leaves a fourth of the error."""
    errors = []
    for period in (2e-3, 5e-4):
        changes = {**SHORT, "period": period, "plant": {"time_step": period}}
        result = simulate(load_experiment("computed_torque", changes))
        errors.append(result.metrics["position_error_max_m"])
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)


@pytest.mark.long
def test_joints_that_the_network_lets_beyond_their_limits_are_told():
    """Beyond that of the acceleration for a moment, by a tenth; velocities stay within theirs."""
    result = shared_run("minimum_torque")
    excess = result.metrics["acceleration_violation_max_rad_s2"]
    assert 0.0 < excess < 2.0
    (sentence,) = result.warnings
    assert f"not kept by construction; beyond its limit is acceleration by {excess:.3g}" in sentence
    assert conclusion_of(result).limits == "limits broken: acceleration"
    assert not shared_run("computed_torque").warnings


def size_of_motion(result):
    return np.sqrt((torque_tables.of_motion(result) ** 2).sum(axis=1).mean())


@pytest.mark.long
def test_least_torques_are_less_than_those_of_computed_torque_on_the_same_path():
    """By a quarter; the joints swing for it, and that takes more work."""
    least, easy = shared_run("minimum_torque"), shared_run("computed_torque")
    assert size_of_motion(least) < 0.8 * size_of_motion(easy)
    assert least.metrics["joint_work_J"] > easy.metrics["joint_work_J"]


@pytest.mark.long
def test_within_less_torque_than_the_path_takes_a_network_finds_other_torques():
    """Clipped computed torque leaves the path by more than ten times as much."""
    clipped = simulate(
        load_experiment("computed_torque", {"law.torque_share": 0.25, "accept": None})
    )
    network = shared_run("dual_criteria_torque").metrics["position_error_max_m"]
    assert clipped.metrics["position_error_max_m"] > 10.0 * network


def mass_errors(result):
    """Return |M - M_hat| / |M| at each stored sample."""
    kinematics, series = result.experiment.arm.kinematics(), result.series
    true = np.array([kinematics.M(q) for q in series["position"]])
    learned = series["M_hat"]
    off = true - 0.5 * (learned + learned.swapaxes(1, 2))
    return np.linalg.norm(off, axis=(1, 2)) / np.linalg.norm(true, axis=(1, 2))


def test_the_mass_matrix_is_learned_with_a_small_excitation():
    """After 50 ms of a nearly resting arm to a hundredth; then it lags behind what changes."""
    law = {"mass": "learned", "excitation": 0.001}
    changes = {**SHORT, **{f"law.{key}": value for key, value in law.items()}}
    result = simulate(load_experiment("computed_torque", changes))
    errors, time = mass_errors(result), result.time
    assert errors[0] > 0.5
    assert errors[np.searchsorted(time, 0.05)] < 0.01
    assert errors[time > 0.05].max() < 0.15
    assert result.metrics["position_error_max_m"] < 1.5e-3


@pytest.mark.long
def test_a_payload_that_is_not_known_is_learned():
    """Without learning the arm leaves the path by centimetres, with the same belief.

    It does so in the first half of the lap.
    """
    known = simulate(
        load_experiment(
            "torque_payload_learned", {"law.mass": "known", "duration": 2, "accept": None}
        )
    )
    assert known.metrics["position_error_max_m"] > 0.03
    learned = shared_run("torque_payload_learned")
    assert learned.metrics["position_error_max_m"] < 1.2e-3
    # The weight of 1.9 kg on some 0.5 m, beside what the law believes.
    assert np.abs(learned.series["torque_hat"][-1]).max() > 5.0


@pytest.mark.long
def test_the_figure_of_torques_has_their_limits(tmp_path):
    """Torques of unlike joints are drawn as shares, between bounds that are kept: half of them."""
    result = simulate(load_experiment("computed_torque", {**SHORT, "law.torque_share": 0.5}))
    assert {"overview", "joint_torques"} <= {*drawable(result)}
    write_figures(result, tmp_path, ["overview", "joint_torques"])
    (axes,) = FIGURES["joint_torques"].draw(result).axes
    flat = [line for line in axes.lines if np.ptp(line.get_ydata()) == 0.0]
    assert sorted(line.get_ydata()[0] for line in flat) == [-0.5, 0.5]


def test_metrics_of_torque_are_those_of_the_series():
    result = simulate(load_experiment("computed_torque", {**SHORT, "log_period": 1e-3}))
    torque, limit = result.series["torque"], result.experiment.arm.effort
    ratio = np.abs(torque / limit).max()
    assert result.metrics["torque_ratio_max"] == pytest.approx(ratio, rel=1e-12)
    power = np.abs(torque * result.series["velocity"]).sum(axis=1)[:-1]
    work = (power * np.diff(result.time)).sum()
    assert result.metrics["joint_work_J"] == pytest.approx(work, rel=1e-9)


@each(
    ("changes", "said"),
    [
        ({"level": "kinematic"}, "level: must be torque, not kinematic, with this law"),
        ({"level": "dynamic"}, "level: must be torque, not dynamic, with this law"),
        ({"law": {"kind": "adaptive"}}, "law: must command torques at level: torque"),
        ({"feedback": "commanded"}, "feedback: must be measured at level: torque"),
        ({"task": "pose"}, "task: may be"),
        ({"plant": {"bandwidth": 50.0}}, "plant.bandwidth: must be left out at level: torque"),
        ({"plant": {"time_step": 5e-4}}, "plant.time_step: must be the controller's period"),
        ({"faults": [{"joint": 2, "time": 0.5}]}, "faults: must be left out at level: torque"),
        ({"safety": {"bounds": True}}, "safety: must be left out at level: torque"),
        ({"law.torque_limits": [80.0] * 7}, "law.torque_limits: follows from arm"),
        ({"arm": {"model": "panda", "mass_scale": 2.0}}, "arm.mass_scale: must be 1"),
    ],
)
def test_what_torques_do_not_go_with_is_refused(changes, said):
    with pytest.raises(InvalidInputError, match=said):
        simulate(load_experiment("computed_torque", {**SHORT, **changes}))


@pytest.mark.nightly
@pytest.mark.parametrize("first", range(0, 1000, 250))
def test_no_random_case_exceeds_a_limit_of_torque(first):
    """Networks that have not converged, learned matrices, excitation, four arms."""
    found = [torque_tables.excess(seed) for seed in range(first, first + 250)]
    assert max(beyond for beyond, _ in found) <= 1e-9
    assert sum(acts for _, acts in found) > 100


@pytest.mark.long
def test_the_report_of_three_rods_is_met():
    """Least torques whip and exceed limits; a network with damping is smooth and within them.

    The model has ten times the limits of the report, which are a share of 0.1 here.
    """
    limits = np.array([54.0, 24.0, 6.0])

    def torques(movement, **law):
        changes = {f"law.{key}": value for key, value in law.items()}
        name = f"rods3_{movement}"
        if changes:
            result = simulate(load_experiment(name, {**changes, "accept": None}))
        else:
            result = shared_run(name)
        return np.abs(result.series["torque"]), result.metrics["position_error_max_m"]

    short, _ = torques("short")
    assert (short.max(axis=0) > limits).tolist() == [False, False, True]
    whips, _ = torques("long")
    assert whips.argmax(axis=0).min() > 0.8 * len(whips)
    damped, _ = torques("long", damping=10.0)
    assert (damped.max(axis=0) > limits).tolist() == [False, True, False]
    assert (whips.max(axis=0) > 2.0 * damped.max(axis=0)).all()
    for movement, most in (("short", 5e-4), ("long", 4e-4)):
        kept = {"network": "simplified_lvi", "damping": 10.0, "torque_share": 0.1}
        bounded, error = torques(movement, **kept)
        assert (bounded <= limits * (1.0 + 1e-9)).all()
        assert error < most


@each(
    ("host", "key"),
    [
        ("batch", "level"),
        ("compiled run", "law"),
        ("compiled step", "law"),
        ("law in C", "law"),
        ("live", "level"),
        ("drive", "law"),
    ],
)
def test_no_other_host_runs_it(host, key):
    """What needs Drake's plant runs in Drake alone; there its steps may be compiled."""
    combination = load_experiment("computed_torque").combination
    assert (refusal(replace(combination, host=host)) or "").startswith(f"{key}: ")
    for able in ("simulate", "compiled law"):
        assert refusal(replace(combination, host=able)) is None


@pytest.mark.long
def test_compiled_steps_make_the_same_torques():
    """Up to rounding, in 20 ms of a network and of a mass matrix that is learned."""
    for name in ("dual_criteria_torque", "torque_payload_learned"):
        experiment = load_experiment(name, {"duration": 0.02, "accept": None})
        plain, compiled = simulate(experiment), simulate(experiment, compiled=True)
        off = np.abs(plain.series["torque"] - compiled.series["torque"]).max()
        assert off < 1e-6

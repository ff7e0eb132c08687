"""Derivatives of a run's metric through the closed loop, and the metrics themselves."""

import numpy as np
import pytest

from drake_rnn import InvalidInputError, load_experiment, run_many, simulate, value_and_gradient
from drake_rnn.batch import CompiledRuns, Slopes

pytest.importorskip("jax")

RMS = "position_error_rms_m"


def experiment(name, duration, **changes):
    changes = {key.replace("__", "."): value for key, value in changes.items()}
    return load_experiment(name, {"duration": duration, "window": None, **changes})


def slope_by_differences(slopes, key, relative):
    """Central difference of the metric with respect to one gain."""
    k = slopes.keys.index(key)
    ahead, behind = slopes.start.copy(), slopes.start.copy()
    ahead[k] *= 1.0 + relative
    behind[k] *= 1.0 - relative
    values, _ = slopes.at(np.stack([ahead, behind]))
    return (values[0] - values[1]) / (ahead[k] - behind[k])


@pytest.mark.long
def test_value_and_derivatives_of_a_run():
    """Differences of 1e-4 of a gain: curvature is 1e-8, rounding 1e-12 of the metric."""
    # 10 cm off its path: the bound of the feedback binds at first.
    made = experiment("slc_nephroid_known", 0.8, law__feedback_limit=0.1)
    slopes = Slopes(made, ["law.kappa", "law.return_gain", "law.feedback_limit"], RMS, rows=2)
    values, found = slopes.at(np.tile(slopes.start, (2, 1)))
    assert values[0] == values[1] == pytest.approx(simulate(made).metrics[RMS], rel=1e-9)
    for key, slope in zip(slopes.keys, found[0], strict=True):
        assert slope == pytest.approx(slope_by_differences(slopes, key, 1e-4), rel=1e-6)
    # A larger pull home can only harm, a larger bound only help.
    assert found[0, 1] > 0.0 > found[0, 2]


#: Relative tolerances of differences of 1e-4 of a gain: some metrics are curved (those of the joint
#: drift approach the derivative to 1e-9 as differences shrink), one that hardly depends on a gain
#: has few digits, and where a law changes its course a quotient mixes both sides.
CASES = [
    ("slc_nephroid", 0.3, {"law.kappa": 1e-6, "law.rho": 1e-6}, RMS),
    ("naljdf_table1", 1.0, {"law.position_gain": 1e-5}, "position_error_max_m"),
    ("motion_force_cat", 0.5, {"law.gain": 1e-5}, "force_error_rms_N"),
]
#: Other metrics and laws, whose runs take longer to compile.
FURTHER = [
    ("slc_nephroid_known", 0.3, {"law.kappa": 1e-3}, "singular_value_min"),
    ("slc_nephroid_known", 0.3, {"law.kappa": 1e-3}, "joint_limit_margin_min_rad"),
    ("slc_nephroid_warm_up", 2.5, {"law.kappa": 1e-3, "law.rho": 1e-6}, RMS),
    ("slc_nephroid_known", 3.0, {"law.kappa": 1e-3}, "joint_drift_max_rad"),
    ("slc_nephroid_known", 3.0, {"law.kappa": 1e-5}, "velocity_error_max_m_s"),
    ("null_space_adjustment", 1.0, {"law.ramp_time": 1e-4}, "joint_error_max_rad"),
]


@pytest.mark.nightly
@pytest.mark.parametrize(("name", "duration", "keys", "metric"), FURTHER)
def test_further_derivatives_are_those_of_differences(name, duration, keys, metric):
    test_derivatives_are_those_of_differences(name, duration, keys, metric)


@pytest.mark.long
@pytest.mark.parametrize(("name", "duration", "keys", "metric"), CASES)
def test_derivatives_are_those_of_differences(name, duration, keys, metric):
    made = experiment(name, duration)
    slopes = Slopes(made, list(keys), metric, rows=2)
    values, found = slopes.at(np.tile(slopes.start, (2, 1)))
    assert values[0] == pytest.approx(run_many([made]).metrics[metric][0], rel=1e-7)
    for key, slope in zip(keys, found[0], strict=True):
        assert slope != 0.0
        assert slope == pytest.approx(slope_by_differences(slopes, key, 1e-4), rel=keys[key])


@pytest.mark.nightly
@pytest.mark.parametrize(
    "name",
    ["slc_nephroid_printed", "slc_nephroid_warm_up", "galjdf_table1", "pinv_waypoints",
     "modified_state_adjustment", "null_space_adjustment"],
)  # fmt: skip
def test_further_compiled_runs_are_those_of_numpy(name):
    test_compiled_runs_are_those_of_numpy(name)


@pytest.mark.long
@pytest.mark.parametrize(
    "name", ["slc_nephroid", "naljdf_table1", "motion_force_cat", "recursive_circle"]
)
def test_compiled_runs_are_those_of_numpy(name):
    """All metrics that can be taken; 1e-7 of a metric that is itself rounding in part."""
    # As shipped, Drake integrates it.
    sampled = {"period": 1e-3} if name == "modified_state_adjustment" else {}
    runs = [experiment(name, 0.1, seed=seed, **sampled) for seed in (1, 2)]
    wanted = run_many(runs).metrics
    found = CompiledRuns(runs).run()
    assert "position_error_rms_m" in found
    for metric, values in found.items():
        assert values == pytest.approx(wanted[metric], rel=1e-7, abs=1e-10), metric


REFUSED = [
    ({"keys": ["kappa"]}, "keys: must be numbers of the law, as law.KEY, not 'kappa'"),
    ({"keys": ["path.size"]}, "keys: must be numbers of the law, as law.KEY, not 'path.size'"),
    ({"keys": []}, "keys: must be given, each once, not []"),
    ({"keys": ["law.kappa", "law.kappa"]}, "keys: must be given, each once"),
    ({"keys": ["law.kapa"]}, "law.kapa: no such key of SimultaneousLearning; nearest: kappa"),
    ({"keys": ["law.feedback_limit"]}, "law.feedback_limit: is not given; give it a number"),
    ({"keys": ["law.jacobian"]}, "law.jacobian: must be a number, not 'known'"),
    ({"metric": "force_error_rms_N"}, "metric: 'force_error_rms_N' cannot be taken of this run"),
    ({"experiment": "chain_circle"}, "filter: a compiled run has none; run_many has"),
    ({"experiment": "slc_nephroid_dynamic"}, "level: dynamic needs Drake's plant"),
]


@pytest.mark.parametrize(("changed", "message"), REFUSED)
def test_what_has_no_derivative_is_refused(changed, message):
    asked = {"experiment": "slc_nephroid_known", "keys": ["law.kappa"], "metric": RMS, **changed}
    with pytest.raises(InvalidInputError) as refused:
        value_and_gradient(**asked)
    assert message in str(refused.value)


def test_runs_that_differ_in_more_than_numbers_are_refused():
    with pytest.raises(InvalidInputError, match="differ in nothing but numbers"):
        CompiledRuns(["slc_nephroid_known", "naljdf_table1"], [RMS])


def test_a_law_with_a_random_start_says_that_it_has_no_derivative():
    made = experiment("slc_nephroid_known", 0.1)
    assert Slopes(made, ["law.kappa"], RMS).start == 4.0
    drawn = load_experiment("motion_force_tricuspid_printed", {"duration": 0.1, "window": None})
    if not drawn.law.multipliers_initial:
        drawn = load_experiment(drawn, {"law.multipliers_initial": 1.0})
    with pytest.raises(InvalidInputError, match="sets the law's initial state"):
        Slopes(drawn, ["law.multipliers_initial"], RMS)

"""Many runs at once are the runs of Drake's diagrams."""

import numpy as np
import pytest

from agreement import agreement, every_step
from drake_rnn import (
    InvalidInputError,
    load_experiment,
    make_experiment,
    run_many,
    simulate,
    why_not,
)

# One of each kind: law, reading, path, orientation, dither of each model, arm.
QUICK = [
    "fastest_square",
    "motion_force_cat",
    "naljdf_clover",
    "null_space_adjustment",
    "pinv_waypoints_ur5",
    "recursive_circle",
    "slc_nephroid",
    "slc_nephroid_known",
    "slc_nephroid_warm_up",
]
# As printed, the recursive network amplifies rounding a thousandfold and more within 0.1 s.
PRINTED = ["recursive_circle_printed", "recursive_square_printed"]
REST = [
    "chain_circle",
    "chain_square",
    "fastest_circle",
    "galjdf_clover",
    "galjdf_clover_bound",
    "galjdf_clover_fig2",
    "galjdf_clover_fig3",
    "galjdf_clover_iiwa",
    "galjdf_table1",
    "man_clover",
    "naljdf_nephroid",
    "motion_force_cat_return",
    "motion_force_learning_rates",
    "motion_force_learning_rates_paper",
    "motion_force_tricuspid",
    "motion_force_tricuspid_learned",
    "motion_force_tricuspid_literal",
    "motion_force_tricuspid_printed",
    "motion_force_tricuspid_w",
    "motion_force_tricuspid_wholly_printed",
    "naljdf_clover_fig3",
    "naljdf_clover_iiwa",
    "naljdf_table1",
    "pinv_circle",
    "pinv_circle_smooth",
    "pinv_csv",
    "pinv_csv_ur5",
    "pinv_line",
    "pinv_line_ur5",
    "pinv_sequence",
    "pinv_square",
    "pinv_square_smooth",
    "pinv_waypoints",
    "recursive_regulation",
    "recursive_square",
    "rnn_circle",
    "rnn_circle_smooth",
    "rnn_square",
    "rnn_square_smooth",
    "slc_four_ring",
    "slc_four_ring_fast",
    "slc_four_ring_per_joint",
    "slc_nephroid_fast",
    "slc_nephroid_known_precise",
    "slc_nephroid_printed",
    "slc_nephroid_unbounded",
    "slc_nephroid_virtual",
    "stretched_circle",
    "stretched_square",
]
# From a histogram, whose bins are 1.2 % wide.
MEDIANS = {"jacobian_error_median", "jacobian_error_excited_median"}
# Differences of velocities over 10 ms, and what divides them: rounding is 1e10 times as large.
ROUGH = ("jerk", "snap", "crackle", "limit_ratio_3", "limit_ratio_4", "limit_ratio_5")


def check(name, duration):
    compare(every_step(name, duration))


def compare(experiment):
    found = agreement(experiment)
    assert found.position < 1e-9
    assert found.many.keys() == found.drake.keys()
    for metric, value in found.many.items():
        # Shares of steps may differ in one step at the edge of a bound.
        steps = 1.01 / found.steps if metric.endswith("fraction") else 0.0
        rough = 1e-4 if metric.startswith(ROUGH) or "jerk" in metric else 1e-7
        rough = 0.006 if metric in MEDIANS else rough
        assert value == pytest.approx(found.drake[metric], rel=rough, abs=max(1e-7, steps)), metric


@pytest.mark.parametrize("name", QUICK)
def test_joints_and_metrics_are_those_of_the_diagram(name):
    check(name, 0.07)


# A filter before the arm, and what the law sees of arm and path.
FILTERED = [
    {"feedback": "unfiltered"},
    {"feedback": "unfiltered", "filter.precompensate": True},
    {"feedback": "commanded"},
    {"feedback": "commanded", "filter.delay_desired": True},
]


@pytest.mark.parametrize("changes", FILTERED, ids=str)
@pytest.mark.parametrize(
    "name", ["slc_nephroid_known", pytest.param("naljdf_clover", marks=pytest.mark.long)]
)
def test_behind_a_filter_arms_move_as_in_the_diagram(name, changes):
    """Also of a law whose command is a ramp; the limits make it as late as its gain allows."""
    filtered = {"filter": {"kind": "moving_average"}, "limits.acceleration": 25.0}
    if name == "slc_nephroid_known":
        filtered |= {"law.acceleration_bound": "none"}
    once = {"duration": 0.3, "window": None, "accept": None, "log_period": 1e-3}
    experiment = load_experiment(name, {**filtered, **changes, **once})
    compare(experiment)


@pytest.mark.nightly
@pytest.mark.parametrize("name", REST)
def test_those_of_every_other_shipped_experiment_as_well(name):
    check(name, load_experiment(name).path_delay + 0.5)


@pytest.mark.nightly
@pytest.mark.parametrize("name", ["slc_nephroid_known", "slc_nephroid_warm_up", "naljdf_table1"])
def test_whole_runs_agree(name):
    check(name, None)


@pytest.mark.parametrize("name", PRINTED)
def test_a_network_that_amplifies_rounding_does_so_in_the_diagram_as_well(name):
    experiment = every_step(name, 0.1)
    document = experiment.document.contents()
    near = make_experiment({**document, "start": (experiment.start + 1e-15).tolist()})
    apart = np.abs(
        simulate(near).series["position"] - simulate(experiment).series["position"]
    ).max()
    assert apart > 1e-10
    assert agreement(experiment).position < 100 * apart


@pytest.mark.long
def test_which_shipped_experiments_can_run():
    for name in (*QUICK, *PRINTED, *REST):
        assert why_not(load_experiment(name)) is None


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("naljdf_clover_dynamic", "level: dynamic needs Drake's plant"),
        ("contact_circle", "level: dynamic needs Drake's plant"),
        ("slc_nephroid_known_continuous", "integrator: is Drake's"),
        ("horizon_circle", "law: RecedingHorizon plans ahead"),
        ("moaljdf_parallelogram", "law: JointDriftFree sees M, bias, gravity"),
    ],
)
def test_why_not_says_what_a_batch_cannot_do_and_run_many_refuses_it(name, reason):
    experiment = load_experiment(name)
    assert why_not(experiment).startswith(reason)
    able = load_experiment("slc_nephroid_known")
    with pytest.raises(InvalidInputError, match=rf"^experiments\[1\]: {reason}"):
        run_many([able, experiment])

"""A second arm beside the first one: neither touches the other, and one can follow the other."""

import numpy as np
import pytest

from drake_rnn import InvalidInputError, Result, load_experiment, simulate
from drake_rnn.runs.simulation import build_diagram
from shared_runs import shared_run

HELD = 1e-9
FACING = {"translation": [0.8, 0.0, 0.0], "rpy": [0.0, 0.0, float(np.pi)]}
LINE = {"kind": "line", "by": [0.2, 0.3, 0.0], "period": 5.0, "timing": "quintic"}
LINE |= {"offset": [0.0, 0.15, 0.0]}
TWO = {
    "arm": "panda",
    "path": LINE,
    "law": {"kind": "adaptive", "kappa": 1000},
    "limits": {"velocity": 0.5, "acceleration": 1.0},
    "obstacles": [],
    "second": {"base": FACING},
    "period": 1e-3,
    "duration": 0.3,
}


def in_first_base(experiment, points):
    return points @ experiment.base.R.T + experiment.base.translation


#: Just after both arms are where they then rest.
ARRIVED = {"duration": 7.2, "window": [7.0, 7.2]}


@pytest.mark.long
@pytest.mark.parametrize("changes", [ARRIVED, pytest.param({}, marks=pytest.mark.nightly)])
def test_arms_that_change_sides_pass_each_other_and_arrive_with_every_bound_held(changes):
    result = shared_run("adaptive_two_arms", changes)
    for run in (result, result.second):
        for metric, accepted in run.experiment.document.accept.items():
            assert accepted.holds(run.metrics[metric]), metric
    # The least distance is one of both: it is the same, seen from either.
    one, other = (run.metrics["distance_min_m"] for run in (result, result.second))
    assert one == pytest.approx(other, abs=1e-5)
    # Arms that know nothing of each other would collide, 1.84 s on: both move alike.
    blind = {"obstacles": None, "second": None, "accept": None, "duration": 2.0, "window": None}
    alone = simulate(load_experiment("adaptive_two_arms", blind)).series["position"]
    both = np.concatenate((alone, alone), axis=1)
    assert result.experiment.clearance.least_along(both).min() < 0.0


@pytest.mark.long
def test_with_the_jerk_bounded_they_keep_clear_too():
    limits = {"velocity": 0.5, "acceleration": 1.0, "jerk": 20.0}
    changes = {"limits": limits, "duration": 4, "period": 4e-3, "law.kappa": 250}
    result = simulate(load_experiment(TWO, changes))
    for run in (result, result.second):
        assert run.metrics["distance_min_m"] >= 0.005
        assert run.metrics["held_jerk_violation_max_rad_s3"] < 20.0 * HELD
        assert run.metrics["acceleration_violation_max_rad_s2"] < HELD


@pytest.mark.long
def test_a_tool_that_follows_the_other_keeps_its_place_beside_it():
    """The begin of the shipped run, which `make nightly` makes whole."""
    short = {"duration": 3, "window": None, "accept": None}
    result = simulate(load_experiment("adaptive_two_arms_together", short))
    apart = result.series["p_WE"] - in_first_base(result.experiment, result.second.series["p_WE"])
    assert np.ptp(apart, axis=0).max() < 1e-8
    assert np.ptp(result.series["p_WE"], axis=0).max() > 0.05


def test_it_follows_where_the_other_tool_is_not_where_it_should_be():
    """The leader starts 5 cm off its path; the follower is beside it at once."""
    path = {"kind": "nephroid", "plane": "yz", "size": 0.04, "period": 8, "offset": [0.05, 0, 0]}
    second = {"base": {**FACING, "translation": [0.95, 0, 0]}, "follows": True}
    changes = {"path": path, "second": {**second, "path": {"kind": "rest"}}}
    result = simulate(load_experiment(TWO, changes))
    assert np.linalg.norm(np.ptp(result.series["p_WE"], axis=0)) > 1e-3
    # The leader is at its bound of the acceleration, within which the follower cannot do the same.
    assert result.second.metrics["position_error_max_m"] < 1e-4
    assert result.metrics["position_error_max_m"] > 0.03


def test_both_arms_are_in_one_diagram_and_results_are_written_and_read(tmp_path):
    experiment = load_experiment(TWO)
    diagram, _ = build_diagram(experiment)
    names = {system.get_name() for system in diagram.GetSystems()}
    assert {"controller", "second_controller", "second_arm", "neighbour"} <= names
    result = simulate(experiment)
    result.save(tmp_path / "two")
    read = Result.load(tmp_path / "two")
    np.testing.assert_array_equal(read.second.series["position"], result.second.series["position"])
    assert read.second.metrics == result.second.metrics
    assert read.experiment.second.clearance.count == experiment.second.clearance.count


@pytest.mark.long
def test_a_run_of_two_arms_has_the_same_bits_twice():
    one, other = (simulate(load_experiment(TWO)) for _ in range(2))
    for run, again in ((one, other), (one.second, other.second)):
        np.testing.assert_array_equal(run.series["position"], again.series["position"])


def test_far_from_each_other_each_moves_as_it_would_alone():
    far = {"base": {**FACING, "translation": [3.0, 0.0, 0.0]}}
    result = simulate(load_experiment(TWO, {"second": far}))
    alone = simulate(load_experiment(TWO, {"second": None}))
    for run in (result, result.second):
        np.testing.assert_array_equal(run.series["position"], alone.series["position"])


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"obstacles": None}, "obstacles: must be given with second"),
        ({"second": {"base": FACING, "period": 1e-2}}, "second.period: is shared by both arms"),
        ({"second": {"base": FACING, "pahts": LINE}}, "second.pahts: no such key; nearest: path"),
        ({"second": {"base": {"place": 1}}}, "second.base.place: no such key"),
        ({"second": {"base": FACING, "follows": 1}}, "second.follows: must be true or false"),
        ({"second": {"base": FACING, "path": {"kind": "lime"}}}, "second: path.kind: no path"),
        ({"second": {"base": {"translation": [0.2, 0, 0]}}}, "start: .* apart there"),
        ({"second": {"base": FACING, "law": {"kind": "simultaneous_learning"}}}, "second: "),
        ({"law.avoidance": "none"}, "second: needs laws that keep clear of what is beside"),
        ({"law.other": 1}, "law.other: follows from second; leave it out"),
    ],
)
def test_what_two_arms_cannot_do_is_refused_before_a_run(changes, said):
    with pytest.raises(InvalidInputError, match=said):
        load_experiment(TWO, changes)

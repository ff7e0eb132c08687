"""Which metrics a run is expected to keep: those of the limits that law and filter keep."""

import pytest

from drake_rnn import load_experiment
from drake_rnn.experiment import Acceptance, expected_bounds
from drake_rnn.robot.limits import DERIVATIVE_UNITS

POSITION = "joint_limit_margin_min_rad"
RATIOS = {name: f"limit_ratio_{k}_max" for k, name in enumerate(DERIVATIVE_UNITS, start=1)}
FIRST = ("velocity", "acceleration")
FIVE = {RATIOS[name] for name in DERIVATIVE_UNITS}


def expected(name, **changes):
    changes = {key.replace("__", "."): value for key, value in changes.items()}
    return expected_bounds(load_experiment(name, {"accept": None, **changes}))


@pytest.mark.parametrize(
    ("name", "changes", "metrics"),
    [
        # It knows of no limit, whatever limits the experiment has.
        ("pinv_circle", {}, set()),
        ("chain_circle", {}, FIVE),
        ("horizon_circle", {}, {POSITION, *FIVE}),
        ("slc_nephroid_known", {}, {POSITION, RATIOS["velocity"], RATIOS["acceleration"]}),
        (
            "slc_nephroid_known",
            {"law__position_bound": "printed"},
            {RATIOS["velocity"], RATIOS["acceleration"]},
        ),
        # Noise, or motors, move the arm otherwise than the law says.
        ("slc_nephroid", {}, set()),
        ("slc_nephroid", {"dither__model": "virtual"}, {POSITION, *map(RATIOS.get, FIRST)}),
        ("slc_nephroid_known", {"level": "dynamic"}, set()),
        ("slc_nephroid_unbounded", {}, {POSITION, RATIOS["velocity"]}),
        ("naljdf_clover", {}, {RATIOS["acceleration"]}),
        (
            "naljdf_clover",
            {"law__bounds": "all"},
            {POSITION, RATIOS["velocity"], RATIOS["acceleration"]},
        ),
        ("modified_state_adjustment", {}, {POSITION, RATIOS["velocity"]}),
        ("rnn_circle", {}, {POSITION, RATIOS["velocity"]}),
        ("recursive_circle_printed", {}, {RATIOS["crackle"]}),
        ("motion_force_tricuspid", {}, {POSITION, RATIOS["velocity"]}),
    ],
)
def test_only_limits_that_are_kept_by_construction_are_expected_to_be(name, changes, metrics):
    assert expected(name, **changes).keys() == metrics


def test_behind_a_filter_positions_are_means_of_those_of_a_law_that_keeps_them():
    """Unless a precompensation changes them, or the law sees the filtered arm."""
    law = {"kind": "recursive", "gains": [100.0]}
    means = {"law": law, "filter": {"kind": "moving_average"}, "duration": 60.0}
    assert POSITION in expected("chain_circle", **means)
    assert POSITION not in expected("chain_circle", law=law, duration=60.0)
    slow = {**means, "law": {**law, "gains": [0.1]}, "feedback": "commanded"}
    assert POSITION not in expected("chain_circle", **slow)


def test_a_limit_that_is_not_there_is_not_expected_to_be_kept():
    free = expected("motion_force_tricuspid", limits="none")
    assert POSITION not in free


def test_what_a_document_expects_comes_before_what_its_law_keeps():
    wanted = {RATIOS["velocity"]: {"at_most": 0.5}, "position_error_max_m": {"at_most": 1.0}}
    bounds = expected_bounds(load_experiment("rnn_circle", {"accept": wanted}))
    assert bounds[RATIOS["velocity"]].at_most == 0.5
    assert bounds["position_error_max_m"].at_most == 1.0
    assert isinstance(bounds[POSITION], Acceptance)

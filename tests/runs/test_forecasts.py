"""What is said of a path before a run, and still said after it."""

import pytest

from drake_rnn import check_experiment, fastest, load_experiment, make_experiment, simulate
from drake_rnn.experiment import Forecast
from drake_rnn.runs.evaluation import (
    limit_caveats,
    standing,
)

ASKS = Forecast("path: asks joint1 for an acceleration of 2.51 rad/s^2", "acceleration")
NEAR = Forecast("path: near-singular posture")
BEYOND = "acceleration_violation_max_rad_s2"


@pytest.mark.parametrize(
    ("metrics", "stands"),
    [
        ({BEYOND: 0.0}, False),
        ({BEYOND: 0.0, "saturated_fraction": 0.0}, False),
        # The limit was kept, but the path was not.
        ({BEYOND: 0.0, "saturated_fraction": 0.1}, True),
        ({BEYOND: 0.01}, True),
        ({"velocity_violation_max_rad_s": 0.0}, True),
        ({}, True),
    ],
)
def test_a_forecast_stands_unless_the_run_disproves_it(metrics, stands):
    assert standing([ASKS, NEAR], metrics) == ([ASKS.text] if stands else []) + [NEAR.text]


@pytest.mark.long
def test_a_law_that_takes_its_path_within_the_limit_is_not_warned_of_it():
    """NALJDF returns to its posture, and needs 0.99 of what the least velocities do."""
    limit = {"limits.acceleration": 0.335, "path.timing": "ramps", "accept": None}
    experiment = load_experiment("naljdf_clover", limit)
    assert any(
        "asks elbow_joint for an acceleration" in said for said in check_experiment(experiment)
    )
    result = simulate(experiment)
    assert result.metrics["limit_ratio_2_max"] <= 1.0
    assert result.warnings == []


@pytest.mark.long
def test_the_fastest_run_within_its_bounds_is_not_warned_of_them():
    found = fastest(load_experiment("naljdf_clover"))
    assert found.result.metrics["limit_ratio_2_max"] <= 1.0
    assert found.result.warnings == []


def test_a_limit_that_the_law_does_not_keep_is_said_after_the_run():
    """A pseudoinverse that is 0.1 m off at the start leaps, beyond every velocity limit."""
    path = {"kind": "circle", "size": 0.05, "period": 10.0, "offset": [0.1, 0.0, 0.0]}
    law = {"kind": "pseudoinverse", "feedback": 200.0}
    document = {"arm": "panda", "path": path, "law": law, "period": 1e-3, "duration": 0.1}
    result = simulate(make_experiment(document))
    excess = result.metrics["velocity_violation_max_rad_s"]
    assert excess > 1.0
    said = f"limits: the arm exceeds a limit of velocity by {excess:.3g} rad/s"
    assert any(text.startswith(said) for text in result.warnings)


def test_motors_that_exceed_a_limit_which_the_law_keeps_of_its_command_are_told_of():
    experiment = load_experiment("slc_nephroid_dynamic")
    assert limit_caveats(experiment, {"acceleration_violation_max_rad_s2": 4.6}) == [
        "limits: the arm exceeds a limit of acceleration by 4.6 rad/s^2; the law keeps it of the "
        "command, and motors follow that with errors"
    ]

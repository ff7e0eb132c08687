"""The measures of the recursive network's claims, on numbers that are known."""

from types import SimpleNamespace

import numpy as np
import pytest

from drake_rnn import load_experiment
from drake_rnn.claims.papers import recursive as measures


@pytest.mark.parametrize(
    ("name", "third_gain", "rate"),
    [
        ("recursive_circle_printed", None, 3376.2),
        ("recursive_square_printed", None, -13411.0),
        ("recursive_square_printed", 2e5, 7379.4),
    ],
)
def test_growth_rate(name, third_gain, rate):
    """Those of tests/laws/test_recursive.py, which takes them from the law itself."""
    assert measures.growth_rate(None, name, third_gain) == pytest.approx(rate, abs=0.1)


def test_ratios_are_of_the_orders_that_are_asked_for():
    metrics = {f"limit_ratio_{order}_max": 10.0 - order for order in range(1, 6)}
    run = lambda *_: SimpleNamespace(metrics=metrics)  # noqa: E731
    assert measures.largest_ratio(run, "any") == 9.0
    assert measures.largest_ratio(run, "any", orders=[3, 4]) == 7.0
    assert measures.smallest_ratio(run, "any", orders=[3, 4]) == 6.0


def test_displayed_signals_are_compared_with_the_bounds_from_the_second_order_on():
    experiment = load_experiment("recursive_circle")
    levels = np.zeros((5, 4, 7))
    levels[2, :, 3] = [-0.05, 0.05, 0.1, 0.1]  # bounds 0.1, 0.1, 0.2, 0.2
    levels[4, 1, 0] = -0.08
    run = lambda *_: SimpleNamespace(series={"levels": levels}, experiment=experiment)  # noqa: E731
    assert measures.displayed_ratio(run, "any") == pytest.approx(0.8)


def test_two_levels_reach_a_target_at_rest_and_five_do_not():
    name = "recursive_circle_printed"
    assert measures.first_level_off_target(None, name, 2, 1e-5, 0.2) < 1.0
    assert measures.first_level_off_target(None, name, 5, 1e-2, 20.0) > 1e4


def test_what_changes_do_to_the_posture_is_the_largest_difference_of_a_joint():
    def run(name, changes=None):
        position = np.zeros((4, 7))
        position[2, 5] = -0.25 if changes else 0.0
        return SimpleNamespace(series={"position": position})

    assert measures.posture_apart(run, "any", {"limits.acceleration": 1.0}) == 0.25


def test_a_gain_leaves_a_projection_whose_set_is_divided_by_it():
    assert measures.scaled_projection_apart(None) < 1e-14

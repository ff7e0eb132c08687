"""Metrics of what a law tells of itself, of motors that follow a command, and of a posture."""

import numpy as np
import pytest
from motions import FREE, columns, cut, metrics, metrics_of_parts, motion

from drake_rnn.measures import RunMetrics, Yardsticks

TIME = np.arange(4.0)


def test_a_command_is_missed_by_the_joint_and_by_the_tip_that_is_farthest_from_it():
    """The second joint by 0.25 rad at 1 s, and the tip by 3 m and 4 m at 2 s."""
    position = columns([1.0, 1.0, 1.0, 1.0], [2.0, 2.0, 2.0, 2.0])
    commanded = position + columns([0.0, 0.125, 0.125, 0.0], [0.125, -0.25, 0.125, 0.0])
    tip = columns([5.0, 5.0, 5.0, 5.0], [6.0, 6.0, 6.0, 6.0])
    told = tip + columns([0.0, 1.0, -3.0, 0.0], [0.0, 0.0, 4.0, 2.0])
    moved = motion(
        TIME, position=position, position_commanded=commanded, p_WE=tip, p_WE_commanded=told
    )
    found = metrics(moved)
    assert found["command_error_max_rad"] == 0.25
    assert found["command_error_max_m"] == 5.0
    for parts in ([moved], cut(moved, 1), cut(moved, 2)):
        taken = RunMetrics(Yardsticks.of(FREE, None, 1e-3))
        for part in parts:
            taken.add(part)
        assert taken.following.worst == (0.25, 1, 1.0)


def test_the_displacement_that_a_law_tells_is_compared_with_the_way_from_the_start():
    """Both count from where they begin. At 2 s they differ by 3 m and 4 m, at 3 s by 1 m."""
    p_WE = columns([7.0, 8.0, 9.0, 7.0], [1.0, 1.0, 2.0, 3.0])
    told = columns([2.0, 3.0, 7.0, 2.0], [4.0, 4.0, 1.0, 5.0])
    moved = motion(TIME, p_WE=p_WE)
    assert metrics(moved, observed={"displacement": told})["invariant_error_max_m"] == 5.0
    halves = [{"displacement": told[:2]}, {"displacement": told[1:]}]
    in_parts = metrics_of_parts(cut(moved, 1), observed=halves)
    assert in_parts["invariant_error_max_m"] == 5.0


def test_what_a_law_tells_is_taken_once_for_each_step():
    """Saturated at one step of four, also if that step ends a part and begins the next one."""
    moved = motion(TIME)
    told = {
        "saturated": np.array([[0.0], [1.0], [0.0], [0.0]]),
        "acceleration_demand": columns([1.0, -3.0, 2.0, 0.5]),
        "orientation_rank": np.array([[3.0], [2.0], [3.0], [3.0]]),
    }
    first = {name: values[:2] for name, values in told.items()}
    second = {name: values[1:] for name, values in told.items()}
    for found in (
        metrics(moved, observed=told),
        metrics_of_parts(cut(moved, 1), observed=[first, second]),
    ):
        assert found["saturated_fraction"] == 0.25
        assert found["joint_acceleration_demand_max_rad_s2"] == 3.0
        assert found["orientation_rank_min"] == 2.0


def test_a_contact_that_the_law_believes_lost_is_lost_from_then_on():
    told = {"contact_lost": np.array([[0.0], [0.0], [1.0], [1.0]])}
    moved = motion(TIME)
    assert metrics(moved, observed=told)["contact_lost_time_s"] == 2.0
    never = {"contact_lost": np.zeros((4, 1))}
    assert "contact_lost_time_s" not in metrics(moved, observed=never)


def test_the_error_to_a_target_is_that_in_the_end_and_settles_where_it_stays_small():
    """Of the worst joint: 0.5, 0.005, 0.25 and 0.0078125 rad; 0.01 rad is arrived."""
    position = columns([0.5, 0.0, -0.25, 0.0078125], [0.0, -0.005, 0.0, 0.0])
    found = metrics(motion(TIME, position=1.0 + position, target=np.ones(2)))
    assert found["joint_error_max_rad"] == pytest.approx(0.0078125, rel=1e-12)
    assert found["joint_settling_time_s"] == 3.0


def test_orientation_errors_are_those_of_the_window():
    angle = np.array([9.0, 3.0, 1.0, 9.0])
    found = metrics(motion(TIME, orientation_error=angle), window=(1, 2))
    assert found["orientation_error_max_rad"] == 3.0
    assert found["orientation_error_rms_rad"] == np.sqrt(5.0)

"""What judges the claims on motion-force control, on motions that are known."""

from types import SimpleNamespace

import numpy as np
import pytest

from drake_rnn.claims import SimulatedRuns, read_claims
from drake_rnn.claims.papers.motion_force import (
    effort,
    network_speed,
    residual_at_rest,
    third_element_apart,
    tip_off_the_start,
    work,
)

TIME = np.linspace(0.0, 2.0, 201)


def moved(name, changes):
    """Two joints at 0.3 and 0.4 rad/s for 2 s; a tip that also sinks."""
    velocity = np.tile([0.3, -0.4], (TIME.size, 1))
    p_WE = np.column_stack((0.03 * TIME, -0.04 * TIME, -0.5 * TIME))
    series = {
        "velocity": velocity,
        "p_WE": p_WE,
        "position": velocity,
        "network_velocity": velocity,
    }
    experiment = SimpleNamespace(
        limits=SimpleNamespace(require=lambda *_: np.array([0.5, 0.5])),
        arm=SimpleNamespace(
            kinematics=lambda: SimpleNamespace(gravity=lambda q: np.array([2.0, 5.0]))
        ),
    )
    return SimpleNamespace(time=TIME, series=series, experiment=experiment)


def test_effort_is_the_square_of_the_speed_over_time():
    assert effort(moved, "any") == pytest.approx(0.25 * 2.0)


def test_work_is_against_gravity_whichever_way_the_joints_turn():
    assert work(moved, "any") == pytest.approx((2.0 * 0.3 + 5.0 * 0.4) * 2.0)


def test_the_networks_speed_is_a_share_of_its_bound():
    assert network_speed(moved, "any") == pytest.approx(0.8)


def test_the_tips_distance_is_that_along_the_surface():
    assert tip_off_the_start(moved, "any") == pytest.approx(0.05 * 2.0)


def test_the_network_comes_to_rest_where_its_constraints_hold():
    """After 1 ms, its time constant, it is on its way; after 5 s there."""
    assert residual_at_rest(moved, 1e-3) > 1e-2
    assert residual_at_rest(moved, 5.0) < 1e-9


def test_a_law_that_learns_is_told_no_jacobian_but_that_of_the_rotation():
    claims = read_claims("motion_force")
    run, count = SimulatedRuns().run, claims.measures["true_jacobians"]
    assert count(run, "motion_force_cat") == 1.0
    assert count(run, "motion_force_cat", position_only=True) == 0.0
    assert count(run, "motion_force_tricuspid_printed") == 2.0


def test_rotations_with_the_same_w_differ_in_signs_alone():
    """Up to twice the largest element; their squares are the same."""
    assert 1.5 < third_element_apart(moved) <= 2.0
    assert third_element_apart(moved, squared=True) == 0.0

"""Metrics of motions whose answers are known."""

from math import inf, nan, pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from motions import FREE, TOLERANCE, J, columns, cut, metrics, metrics_of_parts, motion

from drake_rnn import JointLimits
from drake_rnn.measures import violation_metric

# Joints.


def test_a_sine_has_the_speed_and_acceleration_of_a_sine():
    """0.3 sin(2 t): speed 0.6, acceleration 1.2 less (2 h)^2/24 of it, the error of a secant."""
    h = 1e-3
    time = np.arange(0, 2 * pi, h)
    found = metrics(
        motion(
            time, position=columns(0.3 * np.sin(2 * time)), velocity=columns(0.6 * np.cos(2 * time))
        )
    )
    assert found["joint_velocity_max_rad_s"] == 0.6
    assert found["joint_acceleration_max_rad_s2"] == pytest.approx(1.2, rel=(2 * h) ** 2 / 20)
    assert found["joint_velocity_initial_rad_s"] == pytest.approx(0.6 * np.cos(2 * h), rel=1e-15)
    assert found["joint_acceleration_initial_rad_s2"] == pytest.approx(1.2 * h, rel=1e-5)


def test_acceleration_is_the_change_of_velocity_over_each_steps_own_length():
    found = metrics(motion([0, 1, 1.5, 4], velocity=columns([0.0, 1.0, 2.5, -2.5])))
    assert found["joint_acceleration_max_rad_s2"] == 3.0
    assert found["joint_acceleration_initial_rad_s2"] == 1.0


@pytest.mark.parametrize("place", [0, 1, 2, 3])
def test_steps_that_rounding_sets_apart_are_one_step(place):
    """Their own secant would be noise divided by 1e-16 s; nor may the change be lost."""
    time, velocity = np.arange(4.0), np.array([0.0, 2.0, 3.0, 3.0])
    time = np.insert(time, place + 1, time[place] + 1e-12)
    jumped = np.insert(velocity, place + 1, velocity[place])
    found = metrics(motion(time, velocity=columns(jumped)))
    assert found["joint_acceleration_max_rad_s2"] == pytest.approx(2.0, rel=1e-9)
    lost = np.insert(velocity, place, velocity[place])
    found = metrics(motion(time, velocity=columns(lost)))
    assert found["joint_acceleration_max_rad_s2"] == pytest.approx(2.0, rel=1e-9)


def test_velocities_are_taken_over_the_whole_run_and_errors_in_the_window():
    time = np.arange(11.0)
    early = np.where(time < 5, 1.0, 0.5)
    moving = motion(time, velocity=columns(early), p_WE=columns(early), v_WE=columns(early))
    found = metrics(moving, window=(5.0, 10.0))
    assert found["joint_velocity_max_rad_s"] == 1.0
    assert found["joint_acceleration_max_rad_s2"] == 0.5
    assert found["position_error_max_m"] == found["position_error_rms_m"] == 0.5
    assert found["velocity_error_max_m_s"] == 0.5
    assert metrics(moving)["position_error_max_m"] == 1.0


def test_a_windows_ends_belong_to_it_in_spite_of_rounding():
    time = np.arange(0, 1, 0.1)
    assert time[3] > 0.3
    error = np.where(np.arange(10) == 3, 1.0, 0.0)
    assert (
        metrics(motion(time, p_WE=columns(error)), window=(0.1, 0.3))["position_error_max_m"] == 1
    )


# Errors.


def test_errors_are_of_the_norm_and_of_the_worst_component():
    found = metrics(
        motion(
            [0, 1], p_WE=[[3.0, 4.0], [0, 0]] * np.ones((2, 2)), v_WE=np.array([[0, 0], [5, 12]])
        )
    )
    assert found["position_error_max_m"] == 5.0
    assert found["position_error_component_max_m"] == 4.0
    assert found["position_error_rms_m"] == pytest.approx(5 / np.sqrt(2), rel=1e-15)
    assert found["velocity_error_max_m_s"] == 13.0


def test_settling_time_is_the_first_for_good():
    time = np.arange(6.0)
    error = np.array([2, 0.5, 1.5, 0.9, 0.1, 0.2]) * TOLERANCE
    settled = motion(time, p_WE=columns(error))
    assert metrics(settled)["settling_time_s"] == 3.0
    assert metrics(settled, window=(4.5, 5))["settling_time_s"] == 3.0


@given(st.lists(st.floats(0, 3), min_size=1, max_size=20))
def test_settling_time_is_the_first_after_which_no_error_is_too_large(errors):
    error = np.array(errors) * TOLERANCE
    found = metrics(motion(np.arange(error.size), p_WE=columns(error)))
    settled = [k for k in range(error.size) if (error[k:] < TOLERANCE).all()]
    assert found.get("settling_time_s") == (settled[0] if settled else None)


def test_drift_is_between_the_ends_of_the_window():
    time = np.arange(5.0)
    position = columns([0.0, 1.0, 5.0, 1.25, 9.0], [0.0, 2.0, 5.0, 1.5, 9.0])
    found = metrics(motion(time, position=position), window=(1, 3))
    assert found["joint_drift_max_rad"] == 0.5
    assert found["joint_drift_mean_rad"] == 0.375


def test_drift_of_a_lap_is_from_its_beginning_to_the_last_step_whatever_the_window():
    time = np.arange(5.0)
    position = columns([0.0, 1.0, 5.0, 1.25, 1.5], [0.0, 2.0, 5.0, 1.5, 1.0])
    lap = motion(time, position=position, lap_start=1.0 + 1e-12)
    for window in (None, (1, 3), (7, 8)):
        assert metrics(lap, window=window)["lap_drift_max_rad"] == 1.0
    assert "lap_drift_max_rad" not in metrics(motion(time, position=position))
    seeking = motion(time, position=position, lap_start=1.0, target=np.zeros(2))
    assert "lap_drift_max_rad" not in metrics(seeking)


def test_end_effector_drift_is_from_its_start_over_the_whole_run():
    time = np.arange(4.0)
    found = metrics(motion(time, p_WE=columns([1.0, 4.0, 1.0, 2.0])), window=(1.5, 1.6))
    assert found["end_effector_drift_max_m"] == 3.0
    assert found["end_effector_drift_end_m"] == 1.0
    assert "joint_drift_max_rad" not in found


# Limits.

LIMITS = JointLimits(
    position_lower=np.array([-1.0, -2.0]),
    position_upper=np.array([1.0, 2.0]),
    velocity=np.array([0.5, 4.0]),
    acceleration=np.array([10.0, 2.0]),
)


def test_within_the_limits_nothing_is_violated():
    found = metrics(
        motion([0, 1], position=columns([0.0, 0.75]), velocity=columns([0.0, 0.25])), LIMITS
    )
    assert found["joint_limit_margin_min_rad"] == 0.25
    for name in ("position", "velocity", "acceleration"):
        assert found[violation_metric(name)] == 0.0
    assert found["limit_ratio_1_max"] == 0.5
    assert found["limit_ratio_2_max"] == 0.025


@pytest.mark.parametrize(
    ("fields", "violations"),
    [
        ({"position": columns([0.0, 1.125])}, {"position": 0.125}),
        ({"position": columns([0.0, 0.0], [0.0, -2.25])}, {"position": 0.25}),
        ({"velocity": columns([0.0, 0.75])}, {"velocity": 0.25}),
        ({"velocity": columns([0.0, 0.0], [0.0, -3.0])}, {"acceleration": 1.0}),
        (
            {"position": columns([0.0, 1.125]), "velocity": columns([0.0, 0.75])},
            {"position": 0.125, "velocity": 0.25},
        ),
    ],
)
def test_each_limit_has_its_own_violation_in_its_unit(fields, violations):
    found = metrics(motion([0, 1], **fields), LIMITS)
    for name in ("position", "velocity", "acceleration"):
        assert found[violation_metric(name)] == violations.get(name, 0.0)


@pytest.mark.parametrize(
    ("limit", "name"),
    [
        ("position", "position_violation_max_rad"),
        ("velocity", "velocity_violation_max_rad_s"),
        ("crackle", "crackle_violation_max_rad_s5"),
    ],
)
def test_a_violations_name_ends_in_its_unit(limit, name):
    assert violation_metric(limit) == name


def test_a_bound_that_one_joint_has_is_that_joints_own():
    half = JointLimits(
        position_lower=np.array([-inf, -1.0]),
        position_upper=np.array([inf, 1.0]),
        velocity=np.array([inf, 2.0]),
    )
    found = metrics(motion([0, 1], velocity=columns([0.0, 50.0], [0.0, 1.0])), half)
    assert found["limit_ratio_1_max"] == 0.5
    assert found["joint_limit_margin_min_rad"] == 1.0


def test_the_envelope_is_that_of_the_limit_ahead():
    """0.5 rad before a limit a joint may do -0.1 + sqrt(2 * 2.25 * 0.5) = 1.4 rad/s."""
    envelope = {"envelope_offset": [0.1, 0.1], "envelope_deceleration": [2.25, np.inf]}
    bounds = {"position_lower": -1.0, "position_upper": 1.0, "velocity": 9.0, **envelope}
    limits = JointLimits.unlimited(2).replace(**bounds)
    place = {"position": columns([0.5, -0.5], [0.99, 0.99])}
    within = metrics(motion([0, 1], **place, velocity=columns([1.15, -0.9], [5.0, 5.0])), limits)
    assert within["envelope_margin_min_rad_s"] == pytest.approx(0.25)
    assert within["envelope_ratio_max"] == pytest.approx(1.25 / 1.5)
    assert within["envelope_violation_max_rad_s"] == 0.0
    beyond = metrics(motion([0, 1], **place, velocity=columns([1.15, -1.65], [5.0, 5.0])), limits)
    assert beyond["envelope_violation_max_rad_s"] == pytest.approx(0.25)
    assert beyond["envelope_ratio_max"] == pytest.approx(1.75 / 1.5)


def test_without_limits_there_are_no_metrics_of_limits():
    found = metrics(motion([0, 1], velocity=columns([0.0, 1.0])))
    assert not {name for name in found if {*name.split("_")} & {"limit", "bound", "envelope"}}


def test_a_joint_is_at_its_bound_within_a_percent_of_it():
    """Two joints at 0.5 and at 4 rad/s; the second one is there twice."""
    velocity = columns([0.1, 0.496, 0.49, -0.1], [3.9, -3.97, 3.97, 0.0])
    found = metrics(motion(np.arange(4.0), velocity=velocity), LIMITS)
    assert found["velocity_bound_fraction"] == 0.5
    assert found["velocity_bound_joint"] == 2
    assert found["acceleration_bound_fraction"] == 1.0
    assert found["acceleration_bound_joint"] == 2
    slow = metrics(motion(np.arange(4.0), velocity=0.1 * velocity), LIMITS)
    assert slow["velocity_bound_fraction"] == slow["acceleration_bound_fraction"] == 0.0
    assert not {name for name in slow if name.endswith("bound_joint")}


# Derivatives beyond the acceleration.

HIGHER = {"jerk": 0.5, "snap": 0.25, "crackle": 2.0}
STEP = 0.01  # between the velocities of which the metrics take differences [s]


def swing(amplitude=0.3, rate=2.0, period=1e-3, until=2 * pi):
    """Of the first joint; the second one swings the other way and half as far."""
    time = np.arange(0, until, period)
    velocity = amplitude * rate * np.cos(rate * time)
    return motion(time, velocity=columns(velocity, -velocity / 2))


def bounded(**bounds):
    limits = {"velocity": 10.0, **bounds}
    return FREE.replace(**limits)


@pytest.mark.parametrize("period", [1e-4, 1e-3, 2e-3, 5e-3])
def test_a_sine_has_the_jerk_snap_and_crackle_of_differences_over_10_ms(period):
    """Of order i: A w (2 sin(w d / 2) / d)^(i - 1); 1e-4 for the crest between two samples."""
    rate, amplitude = 2.0, 0.3
    found = metrics(swing(amplitude, rate, period), bounded(**HIGHER))
    for order, (name, bound) in enumerate(HIGHER.items(), start=3):
        exact = amplitude * rate * (2 * np.sin(rate * STEP / 2) / STEP) ** (order - 1)
        assert found[f"limit_ratio_{order}_max"] == pytest.approx(exact / bound, rel=1e-4), name
        # Which in turn is the derivative but for (w d)^2 / 24 of it for each order.
        assert exact == pytest.approx(amplitude * rate**order, rel=order * (rate * STEP) ** 2 / 20)
    beyond = found[violation_metric("crackle")]
    assert beyond == pytest.approx(0.3 * 2**5 - 2.0, rel=1e-3)


@pytest.mark.parametrize("limits", [FREE, bounded(), bounded(jerk=0.5)])
def test_every_run_has_its_jerk(limits):
    """Of two sines of amplitudes 0.3 and 0.15 and rate 2; 0.5 % for the steps at the ends."""
    found = metrics(swing(), limits)
    assert found["joint_jerk_max_rad_s3"] == pytest.approx(0.3 * 2**3, rel=1e-3)
    rms = 0.3 * 2**3 / np.sqrt(2) * np.sqrt((1 + 0.25) / 2)
    assert found["joint_jerk_rms_rad_s3"] == pytest.approx(rms, rel=5e-3)


def test_each_joint_has_its_own_bound():
    found = metrics(swing(), bounded(jerk=[10.0, 0.1]))
    assert found["limit_ratio_3_max"] == pytest.approx(0.3 * 8 / 2 / 0.1, rel=1e-3)


@pytest.mark.parametrize("missing", HIGHER)
def test_without_a_bound_there_is_no_ratio(missing):
    kept = {name: bound for name, bound in HIGHER.items() if name != missing}
    absent = f"limit_ratio_{3 + list(HIGHER).index(missing)}_max"
    expected = {f"limit_ratio_{k}_max" for k in (1, 3, 4, 5)} - {absent}
    for limits in (bounded(**kept), bounded(**kept, **{missing: inf})):
        found = metrics(swing(), limits)
        assert {name for name in found if name.startswith("limit_ratio")} == expected


def test_of_a_run_too_short_for_differences_there_is_none():
    found = metrics(swing(until=0.055), bounded(**HIGHER))
    assert "limit_ratio_1_max" in found
    assert not {f"limit_ratio_{k}_max" for k in (3, 4, 5)} & found.keys()
    assert not {name for name in found if "jerk" in name}


def test_a_polynomial_has_exactly_its_derivatives():
    """Velocity t^4 / 24 over 2 s: jerk 2 and snap 2 at the end but for the last 10 ms, crackle 1.

    1e-4: rounding of a velocity of 0.7 rad/s by 1e-16, divided by (10 ms)^4.
    """
    time = np.linspace(0, 2, 2001)
    found = metrics(
        motion(time, velocity=columns(time**4 / 24)), bounded(jerk=1, snap=1, crackle=1)
    )
    assert found["limit_ratio_5_max"] == pytest.approx(1.0, rel=1e-4)
    assert found["limit_ratio_4_max"] == pytest.approx(2.0 - 1.5 * STEP, rel=1e-6)
    assert found["limit_ratio_3_max"] == pytest.approx((2.0 - STEP) ** 2 / 2, rel=1e-4)


@pytest.mark.parametrize("at", [None, 5, 40])
def test_the_jerk_of_held_velocities_is_that_from_one_to_the_next(at):
    """A velocity to and fro by 1 mrad/s each ms has 2000 rad/s^3; over 10 ms there is none.

    The same of a run that is taken in two parts.
    """
    time = 1e-3 * np.arange(100)
    whole = motion(time, velocity=columns(1e-3 * (np.arange(100) % 2)), tick=1e-3)
    parts = [whole] if at is None else list(cut(whole, at))
    found = metrics_of_parts(parts, bounded(jerk=1500.0))
    assert found["held_jerk_violation_max_rad_s3"] == pytest.approx(500.0)
    assert found["jerk_violation_max_rad_s3"] == 0.0
    kept = metrics_of_parts(parts, bounded(jerk=2001.0))
    assert kept["held_jerk_violation_max_rad_s3"] == 0.0


@pytest.mark.parametrize(
    ("tick", "limits"), [(None, {"jerk": 1.0}), (1e-3, {}), (1e-3, {"jerk": inf})]
)
def test_without_a_bound_or_of_velocities_that_are_not_held_there_is_no_held_jerk(tick, limits):
    time = 1e-3 * np.arange(100)
    found = metrics(motion(time, tick=tick), bounded(**limits))
    assert "held_jerk_violation_max_rad_s3" not in found


# The law.


def test_jacobian_errors_are_of_the_window_and_those_along_the_motion_apart():
    """J_hat is wrong by 3 in its second column, and by 4 in the first one at two times of four."""
    wrong = np.array([[0.0, 3.0], [0.0, 0.0]])
    worse = np.array([[4.0, 3.0], [0.0, 0.0]])
    J_hat = J - np.array([wrong, wrong, worse, worse])
    along_first = columns([0.0, 1.0, 2.0, 1.0])
    learned = motion(np.arange(4.0), velocity=along_first, J_hat=J_hat)
    found = metrics(learned, window=(1, 3))
    assert found["jacobian_error_max"] == 5.0
    assert found["jacobian_error_median"] == 5.0
    assert found["jacobian_error_excited_median"] == 4.0
    found = metrics(learned, window=(0, 1))
    assert found["jacobian_error_max"] == 3.0
    assert found["jacobian_error_excited_median"] == 0.0


def test_what_is_learned_at_rest_is_not_along_any_motion():
    found = metrics(motion([0, 1], J_hat=np.zeros((2, 2, 2))))
    assert found["jacobian_error_max"] == pytest.approx(np.sqrt(5), rel=1e-15)
    assert "jacobian_error_excited_median" not in found


def test_the_networks_acceleration_is_told_where_it_is_not_the_arms():
    arm, network = columns([0.0, 1.5]), columns([0.0, 1.0])
    found = metrics(motion([0, 1], velocity=arm, network_velocity=network))
    assert found["joint_acceleration_max_rad_s2"] == 1.5
    assert found["network_acceleration_max_rad_s2"] == 1.0
    same = metrics(motion([0, 1], velocity=arm))
    assert "network_acceleration_max_rad_s2" not in same


def test_singular_values_are_those_of_motions_of_the_tip():
    """Along x by 0.25 m a radian of the second joint, along y by 2 m a radian of the first."""
    turned = np.array([[0.0, 0.25], [2.0, 0.0]])
    found = metrics(motion([0, 1], J=np.array([turned, turned])))
    assert found["singular_value_min"] == pytest.approx(0.25, rel=1e-8)


def test_smallest_singular_value_is_that_of_the_worst_posture():
    """1e-8: it is found as the root of an eigenvalue of J J^T."""
    found = metrics(motion([0, 1], J=np.array([J, [[1.0, 0.0], [0.0, 0.5]]])))
    assert found["singular_value_min"] == pytest.approx(0.5, rel=1e-14)
    singular = np.array([J, [[1.0, 1.0], [1.0, 1.0]]])
    assert metrics(motion([0, 1], J=singular))["singular_value_min"] < 1e-7


# What there is nothing to say of.


def test_metrics_that_do_not_apply_are_absent():
    found = metrics(motion([0, 1], p_WE=columns([1.0, 1.0])))
    assert "settling_time_s" not in found
    assert "jacobian_error_max" not in found
    assert "limit_ratio_2_max" not in found


def test_a_window_that_was_not_reached_leaves_its_metrics_out():
    found = metrics(motion([0, 1], J_hat=np.zeros((2, 2, 2))), window=(5, 6))
    assert not {name for name in found if "error" in name}
    assert "joint_drift_max_rad" not in found
    assert found["settling_time_s"] == 0.0
    assert "joint_velocity_max_rad_s" in found


def test_a_run_of_one_step_or_none_has_what_one_can_say_of_it():
    found = metrics(motion([0.0], velocity=columns([0.25])), LIMITS)
    assert found["joint_velocity_max_rad_s"] == 0.25
    assert "joint_acceleration_max_rad_s2" not in found
    assert metrics(motion([]), LIMITS) == {}


def test_numbers_that_are_not_finite_are_left_out():
    """A run that diverged; its squares overflow."""
    huge = columns([0.0, 1e200])
    found = metrics(motion([0, 1], p_WE=huge, velocity=huge), LIMITS)
    assert found["joint_velocity_max_rad_s"] == 1e200
    assert "position_error_rms_m" not in found
    broken = columns([0.0, nan])
    found = metrics(motion([0, 1], position=broken, velocity=broken), LIMITS)
    assert not [name for name in found if "violation" in name]
    assert "joint_velocity_max_rad_s" not in found

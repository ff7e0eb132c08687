"""Figures of runs that seek a target posture."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from drake_rnn import load_arm
from drake_rnn.colours import BOUND
from drake_rnn.experiment import load_experiment, make_experiment
from drake_rnn.figures import drawable, write_figures
from drake_rnn.figures.style import SERIES
from drake_rnn.robot.postures import SelfMotion
from drake_rnn.runs.result import words_of
from drake_rnn.runs.simulation import simulate
from figure_helpers import (
    assert_no_text_is_cut_off,
    changed,
    curves,
    draw,
    is_dashed,
    panel,
    skeleton,
)

COMMON = [
    "overview",
    "joint_angles",
    "joint_velocities",
    "joint_accelerations",
    "acceleration_norm",
    "position",
    "position_error",
]
ALWAYS = ["postures", "stroboscope", "angles_to_target", "joint_error", "end_effector"]
OF_TARGET = [*ALWAYS, "moving_bounds"]


@pytest.fixture(scope="module")
def modified():
    return simulate(load_experiment("modified_state_adjustment", {"duration": 2.0}))


@pytest.fixture(scope="module")
def null_space():
    return simulate(load_experiment("null_space_adjustment", {"duration": 1.0}))


@pytest.fixture(scope="module")
def untargeted():
    return simulate(load_experiment("slc_nephroid_known", {"duration": 0.1, "window": None}))


def adjusted(arm_name, task, duration):
    """Return a run of another arm towards a posture that it can reach."""
    arm = load_arm(arm_name)
    target = SelfMotion(arm, arm.home, task).somewhere(0.5)
    law = {"kind": "state_adjustment", "target": target.tolist(), "rise_time": 2.0}
    document = {"arm": arm_name, "task": task, "law": law, "period": 1e-3, "duration": duration}
    return simulate(make_experiment(document))


@pytest.fixture(scope="module")
def planar():
    return adjusted("planar6", "xy", 0.5)


@pytest.fixture(scope="module")
def pose():
    return adjusted("panda", "pose", 0.2)


def labelled(ax, name):
    (line,) = [line for line in ax.lines if line.get_label() == name]
    return line


def test_figures_of_a_target_are_drawn_only_if_there_is_one(modified, null_space, untargeted):
    assert sorted(drawable(modified)) == sorted([*COMMON, *OF_TARGET])
    # Its bounds do not move.
    assert sorted(drawable(null_space)) == sorted([*COMMON, *ALWAYS])
    assert not {*OF_TARGET} & {*drawable(untargeted)}


def test_a_point_to_go_to_is_a_path_and_one_to_stay_at_is_none(untargeted):
    for offset, is_path in (([0.1, 0.0, 0.0], True), ([0.0, 0.0, 0.0], False)):
        path = {"kind": "rest", "offset": offset}
        resting = changed(untargeted, path=path)
        paths = {"path_3d", "path_plane"} if is_path else set()
        assert {*drawable(resting)} & {"path_3d", "path_plane"} == paths


@pytest.mark.parametrize("name", OF_TARGET)
def test_panels_have_units_and_no_text_is_cut_off(modified, planar, name):
    for result in (modified, planar):
        figure = draw(result, name)
        assert_no_text_is_cut_off(figure)
        for ax in figure.get_axes():
            assert ax.get_xlabel().endswith("]")


def test_postures_are_those_of_start_end_and_target(modified):
    ax = panel(modified, "postures")
    experiment, q = modified.experiment, modified.series["position"]
    for name, posture in (("start", q[0]), ("end", q[-1]), ("target", experiment.target)):
        drawn = np.stack(labelled(ax, name).get_data_3d(), axis=1)
        np.testing.assert_array_equal(drawn, skeleton(modified, posture))
    hand = np.ravel(labelled(ax, "end effector").get_data_3d())
    np.testing.assert_allclose(hand, experiment.p_WE_start, atol=1e-12)
    assert labelled(ax, "target").get_zorder() >= labelled(ax, "end").get_zorder()


@pytest.mark.parametrize("name", ["postures", "stroboscope"])
def test_lengths_are_the_same_along_all_axes(modified, planar, name):
    ax = panel(modified, name)
    limits = np.array([ax.get_xlim3d(), ax.get_ylim3d(), ax.get_zlim3d()])
    ranges = np.ptp(limits, axis=1)
    np.testing.assert_allclose(ax.get_box_aspect() / ranges, (ax.get_box_aspect() / ranges)[0])
    flat = panel(planar, name)
    assert flat.name != "3d"
    assert flat.get_aspect() == 1.0
    np.testing.assert_array_equal(
        np.stack(flat.lines[0].get_data(), axis=1),
        skeleton(planar, planar.series["position"][0])[:, :2],
    )


def test_stroboscope_flashes_at_equal_intervals_until_the_arm_rests(modified):
    ax = panel(modified, "stroboscope")
    (bar,) = ax.child_axes
    assert bar.get_xlabel() == "time [s]"
    sticks = [np.stack(line.get_data_3d(), axis=1) for line in ax.lines[:-2]]
    poses = [skeleton(modified, q) for q in modified.series["position"]]
    at = [int(np.argmin([np.abs(stick - pose).max() for pose in poses])) for stick in sticks]
    assert at[0] == 0
    assert len({*np.diff(at)}) == 1
    assert len(at) > 15
    # The rest of the motion is too small to be visible.
    left = np.abs(modified.series["position"][at[-1]] - modified.series["position"][-1]).max()
    assert left < 0.02
    darkness = [-sum(to_rgb(line.get_color())) for line in ax.lines[:-2]]
    assert (np.diff(darkness) > 0).all()
    assert bar.get_xlim()[1] == pytest.approx(modified.time[at[-1]] + modified.time[at[1]] / 2)


def test_drift_is_shown_in_the_unit_that_fits_beside_the_networks_own(modified, null_space):
    ax = panel(modified, "end_effector")
    assert ax.get_ylabel() == "end-effector drift [mm]"
    moved = 1e3 * (modified.series["p_WE"] - modified.series["p_WE"][0])
    for name, values in zip("xyz", moved.T, strict=True):
        np.testing.assert_array_equal(labelled(ax, name).get_ydata(), values)
    distance = labelled(ax, "distance").get_ydata()
    assert distance.max() == pytest.approx(
        1e3 * modified.metrics["end_effector_drift_max_m"], rel=1e-3
    )
    told = np.stack([line.get_ydata() for line in ax.lines if is_dashed(line)], axis=1)
    np.testing.assert_allclose(told, 1e3 * modified.series["displacement"], atol=1e-9)
    fine = panel(null_space, "end_effector")
    assert fine.get_ylabel() == "end-effector drift [µm]"
    # This law has no multipliers.
    assert not any(map(is_dashed, fine.lines))


def test_orientation_is_shown_where_it_is_held(pose):
    panels = draw(pose, "end_effector").get_axes()
    assert [ax.get_ylabel() for ax in panels] == [
        "end-effector drift [mm]",
        "orientation error [mrad]",
    ]
    np.testing.assert_array_equal(
        panels[1].lines[0].get_ydata(), 1e3 * pose.series["orientation_error"]
    )


def test_every_joint_has_its_target(modified):
    target = modified.experiment.target
    for k, ax in enumerate(draw(modified, "joint_angles").get_axes()[:7]):
        levels = [line.get_ydata()[0] for line in ax.lines if is_dashed(line)]
        assert target[k] in levels
        assert ax.get_ylim()[0] < target[k] < ax.get_ylim()[1]
    marks = panel(modified, "angles_to_target").lines[7:]
    for k, mark in enumerate(marks):
        (x,), y = mark.get_data()
        assert x == modified.time[-1]
        assert y == pytest.approx([target[k]])
        assert mark.get_color() == SERIES[k]


def test_joint_error_is_the_distance_to_the_target(modified):
    ax = panel(modified, "joint_error")
    off = np.abs(modified.series["position"] - modified.experiment.target)
    np.testing.assert_allclose(curves(ax), off, atol=1e-15)
    assert ax.get_yscale() == "log"
    bound, settled = ax.lines[7:]
    assert set(bound.get_ydata()) == {0.01}
    assert set(settled.get_xdata()) == {modified.metrics["joint_settling_time_s"]}
    unsettled = replace(modified, metrics={})
    assert len(panel(unsettled, "joint_error").lines) == 8


def test_moving_bounds_are_the_series_and_drawn_once(modified):
    ax = panel(modified, "moving_bounds")
    np.testing.assert_array_equal(curves(ax), modified.series["network_velocity"])
    lower, own, upper = [line for line in ax.lines if is_dashed(line)]
    np.testing.assert_array_equal(upper.get_ydata(), modified.series["velocity_upper"][:, 0])
    np.testing.assert_array_equal(lower.get_ydata(), modified.series["velocity_lower"][:, 0])
    # The sixth joint starts near its limit; its bound differs until it has left it.
    assert own.get_color() == BOUND
    assert [text.get_text() for text in ax.texts] == ["6"]
    apart = np.isfinite(own.get_ydata())
    sixth = modified.series["velocity_lower"][:, 5]
    np.testing.assert_array_equal(own.get_ydata()[apart], sixth[apart])
    np.testing.assert_array_equal(sixth[~apart], lower.get_ydata()[~apart])
    assert 0 < apart.sum() < 0.5 * apart.size


def test_an_envelope_far_beyond_the_curves_does_not_flatten_them(modified):
    far = {name: 50 * modified.series[name] for name in ("velocity_lower", "velocity_upper")}
    ax = panel(replace(modified, series={**modified.series, **far}), "moving_bounds")
    assert ax.get_ylim()[1] < 3 * np.abs(modified.series["velocity"]).max()


def test_a_resting_path_is_shown_on_axes_of_one_scale_and_from_zero(modified):
    ranges = [np.ptp(ax.get_ylim()) for ax in draw(modified, "position").get_axes()]
    assert ranges == pytest.approx([ranges[0]] * 3)
    ax = panel(modified, "position_error")
    assert ax.lines[0].get_ydata()[0] == 0.0
    # No line is drawn along the axis down to zero.
    masked = ax.transScale.transform(np.array([[0.0, 0.0]]))[0, 1]
    assert not np.isfinite(masked)


def test_overview_of_a_target(modified, null_space):
    page = draw(modified, "overview")
    assert [ax.get_ylabel() for ax in page.get_axes()] == [
        "y [m]",
        "end-effector drift [mm]",
        "joint angle [rad]",
        r"$|q_i - q_{i,\mathrm{target}}|$ [rad]",
        "joint velocity [rad/s]",
        "largest $|\\ddot q_i|$ [rad/s²]",
        "limit [-]",
    ]
    texts = {text.get_text() for part in page.subfigs for text in part.texts}
    assert {
        words_of("joint_error_max_rad"),
        words_of("joint_settling_time_s"),
        words_of("end_effector_drift_max_m"),
        words_of("end_effector_drift_end_m"),
        words_of("invariant_error_max_m"),
        words_of("joint_velocity_initial_rad_s"),
        words_of("joint_acceleration_initial_rad_s2"),
    } <= texts
    velocities = draw(null_space, "overview").get_axes()[4]
    levels = {line.get_ydata()[0] for line in velocities.lines if is_dashed(line)}
    assert levels == {-1.5, 1.5}


def write_own(result, folder):
    """Write what has more to show of these laws than of others."""
    write_figures(result, folder, sorted({"overview", *OF_TARGET} & {*drawable(result)}))


@pytest.mark.long
def test_values_that_are_not_finite_and_a_single_sample(modified, tmp_path):
    series = {name: values.copy() for name, values in modified.series.items()}
    for values in series.values():
        values[-2:] = np.nan
    series["position"][-1] = np.inf
    write_own(replace(modified, series=series), tmp_path)
    for values in series.values():
        values[:] = np.nan
    write_own(replace(modified, series=series), tmp_path)
    first = {name: values[:1] for name, values in modified.series.items()}
    one = replace(modified, time=modified.time[:1], series=first)
    assert drawable(one) == []
    for name in ("postures", "stroboscope"):
        draw(one, name)

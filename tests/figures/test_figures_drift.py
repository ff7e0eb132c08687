"""Figures of laws that command accelerations and return the joints to their start."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.colors import to_hex

from drake_rnn.experiment import load_experiment
from drake_rnn.figures import drawable, write_figures
from drake_rnn.figures.campaign import sweep_figure
from drake_rnn.figures.style import SERIES
from drake_rnn.jobs.requests import Row
from drake_rnn.runs.result import words_of
from drake_rnn.runs.simulation import simulate
from figure_helpers import (
    assert_no_text_is_cut_off,
    curves,
    draw,
    is_dashed,
    panel,
    skeleton,
)
from shared_runs import shared_run

OF_PATH = ["position_error_axes", "velocity_error", "joint_drift", "motion"]


@pytest.fixture(scope="module")
def galjdf():
    return shared_run("galjdf_clover")


@pytest.fixture(scope="module")
def naljdf():
    return shared_run("naljdf_clover")


@pytest.fixture(scope="module")
def moaljdf():
    return shared_run("moaljdf_parallelogram_printed", {"duration": 1.0, "accept": None})


@pytest.fixture(scope="module")
def windowed():
    return simulate(load_experiment("slc_nephroid_known", {"duration": 2.0, "window": [1, 2]}))


def errors(result, name):
    return result.series[name] - result.series[f"{name}_desired"]


@pytest.mark.long
def test_which_figures_there_are(galjdf, moaljdf, windowed):
    assert {*OF_PATH} < {*drawable(galjdf)}
    assert "joint_torques" not in drawable(galjdf)
    assert {*OF_PATH, "joint_torques"} < {*drawable(moaljdf)}
    # They apply to any law that follows a path.
    assert {*OF_PATH} < {*drawable(windowed)}


@pytest.mark.parametrize("name", [*OF_PATH, "joint_torques"])
@pytest.mark.long
def test_panels_have_units_and_no_text_is_cut_off(galjdf, moaljdf, name):
    for result in (galjdf, moaljdf):
        if name not in drawable(result):
            continue
        figure = draw(result, name)
        assert_no_text_is_cut_off(figure)
        for ax in figure.get_axes():
            assert ax.get_xlabel().endswith("]")


@pytest.mark.long
def test_position_error_axis_by_axis_in_the_unit_that_fits(galjdf, naljdf):
    for result, unit, scale in ((galjdf, "mm", 1e3), (naljdf, "µm", 1e6)):
        ax = panel(result, "position_error_axes")
        assert ax.get_ylabel() == f"position error [{unit}]"
        norm, *axes = (line.get_ydata() for line in ax.lines)
        np.testing.assert_array_equal(np.stack(axes, axis=1), scale * errors(result, "p_WE"))
        largest = scale * result.metrics["position_error_max_m"]
        assert norm.max() == pytest.approx(largest, rel=1e-2)


def test_the_prediction_is_drawn_on_the_velocity_error(galjdf):
    ax = panel(galjdf, "velocity_error")
    assert ax.get_ylabel() == "velocity error [µm/s]"
    np.testing.assert_array_equal(curves(ax, 3), 1e6 * errors(galjdf, "v_WE"))
    told = [line for line in ax.lines if is_dashed(line) and len(line.get_ydata())]
    drawn = np.stack([line.get_ydata() for line in told], axis=1)
    np.testing.assert_array_equal(drawn, 1e6 * galjdf.series["velocity_error_predicted"])
    # Each has the colour of its axis and is drawn over it.
    assert [line.get_color() for line in told] == [line.get_color() for line in ax.lines[:3]]
    assert np.abs(drawn - curves(ax, 3)).max() < 0.05 * np.abs(drawn).max()


def test_no_prediction_is_drawn_for_a_law_without_one(moaljdf, windowed):
    for result in (moaljdf, windowed):
        lines = panel(result, "velocity_error").lines
        assert len(lines) == result.series["p_WE"].shape[1]
        assert not any(map(is_dashed, lines))


def test_drift_is_from_the_start_and_what_is_left_at_the_end(galjdf):
    top, bottom = draw(galjdf, "joint_drift").get_axes()
    q = galjdf.series["position"]
    np.testing.assert_array_equal(curves(top, 6), q - q[0])
    for k, mark in enumerate(top.lines[6:]):
        assert mark.get_marker() == "o"
        assert mark.get_color() == SERIES[k]
        assert [*mark.get_xdata(), *mark.get_ydata()] == [10.0, q[-1, k] - q[0, k]]
    assert bottom.get_ylabel() == "drift at the end [mrad]"
    heights = np.array([bar.get_height() for bar in bottom.patches])
    np.testing.assert_array_equal(heights, 1e3 * np.abs(q[-1] - q[0]))
    metrics = galjdf.metrics
    assert heights.max() == pytest.approx(1e3 * metrics["joint_drift_max_rad"], rel=1e-6)
    (mean,) = {*bottom.lines[0].get_ydata()}
    assert mean == pytest.approx(1e3 * metrics["joint_drift_mean_rad"], rel=1e-6)
    (note,) = top.texts
    assert note.get_text() == f"at the end: mean {mean:.3g}, largest {heights.max():.3g} mrad"


def test_drift_is_that_of_the_window(windowed):
    top, bottom = draw(windowed, "joint_drift").get_axes()
    at = int(np.argmin(np.abs(windowed.time - 1.0)))
    assert (curves(top, 7)[at] == 0.0).all()
    left = max(bar.get_height() for bar in bottom.patches)
    unit = {"rad": 1.0, "mrad": 1e3}[bottom.get_ylabel().split("[")[1][:-1]]
    assert left == pytest.approx(unit * windowed.metrics["joint_drift_max_rad"], rel=1e-3)


def test_a_run_that_ended_before_its_window_has_a_drift_of_its_own(windowed):
    early = windowed.time < 0.8
    series = {name: values[early] for name, values in windowed.series.items()}
    short = replace(windowed, time=windowed.time[early], series=series)
    q = short.series["position"]
    np.testing.assert_array_equal(curves(panel(short, "joint_drift"), 7), q - q[0])


def test_torques_are_the_series(moaljdf):
    ax = panel(moaljdf, "joint_torques")
    assert ax.get_ylabel() == "joint torque [N m]"
    np.testing.assert_array_equal(curves(ax, 6), moaljdf.series["torque"])


def test_motion_is_the_arm_along_a_lap_of_its_path(galjdf, moaljdf):
    ax = panel(galjdf, "motion")
    *sticks, base, hand, traced = ax.lines
    poses = np.array([skeleton(galjdf, q) for q in galjdf.series["position"]])
    shown = np.array([np.stack(line.get_data_3d(), axis=1) for line in sticks])
    at = [int(np.argmin(np.abs(poses - stick).max(axis=(1, 2)))) for stick in shown]
    assert at[0] == 0
    assert len({b - a for a, b in pairwise(at)}) == 1
    tips = np.stack(traced.get_data_3d(), axis=1)
    np.testing.assert_allclose(tips, galjdf.series["p_WE"][: len(tips)], atol=1e-12)
    # The whole lap, except its end, where the arm nearly rests.
    assert np.linalg.norm(tips[-1] - tips[0]) < 1e-3
    np.testing.assert_array_equal(np.ravel(hand.get_data_3d()), tips[0])
    assert np.ravel(base.get_data_3d()) == pytest.approx(poses[0, 0])
    # A horizontal path is seen from above.
    assert ax.elev > 30
    flat = panel(moaljdf, "motion")
    assert flat.name != "3d"
    assert flat.get_aspect() == 1.0


def test_a_path_in_an_upright_plane_is_looked_at_from_the_side(windowed):
    assert panel(windowed, "motion").elev < 30


def test_an_acceleration_that_was_cut_is_shown():
    changes = {"limits.acceleration": 0.45, "duration": 6.0, "accept": None}
    cut = simulate(load_experiment("galjdf_clover", changes))
    assert cut.metrics["saturated_fraction"] > 0
    ax = panel(cut, "acceleration_norm")
    arm, asked, bound = (line.get_ydata() for line in ax.lines)
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["asked for", "bound"]
    np.testing.assert_array_equal(asked, np.abs(cut.series["acceleration_demand"][1:]).max(axis=1))
    assert asked.max() > arm.max() == pytest.approx(0.45)
    assert {*bound} == {0.45}
    assert ax.get_ylim()[1] > asked.max()


def test_bounds_that_are_infinite_are_not_drawn(moaljdf):
    for name in ("joint_accelerations", "acceleration_norm"):
        ax = panel(moaljdf, name)
        assert not any(map(is_dashed, ax.lines))
        assert "inf" not in "".join(text.get_text() for text in ax.texts)


def test_overview(galjdf, moaljdf, windowed):
    def labels(result):
        return [ax.get_ylabel() for ax in draw(result, "overview").get_axes()]

    common = ["y [m]", "position error [mm]", "velocity error [µm/s]", "joint drift [rad]"]
    force = "largest $|\\ddot q_i|$ [rad/s²]"
    assert labels(galjdf) == [
        *common,
        force,
        "smallest singular value of $J$ [m]",
        "limit [-]",
    ]
    common[2] = "velocity error [mm/s]"
    assert labels(moaljdf) == [*common, force, "joint torque [N m]"]
    texts = {text.get_text() for part in draw(galjdf, "overview").subfigs for text in part.texts}
    assert {
        words_of("position_error_max_m"),
        words_of("velocity_error_max_m_s"),
        words_of("joint_drift_mean_rad"),
        words_of("joint_drift_max_rad"),
        words_of("joint_acceleration_demand_max_rad_s2"),
        words_of("saturated_fraction"),
        words_of("singular_value_min"),
    } <= texts
    # Other laws have their own panels.
    assert labels(windowed)[1:3] == ["position error [m]", "joint angle [rad]"]


@pytest.mark.long
def test_values_that_are_not_finite(galjdf, moaljdf, tmp_path):
    """In the figures that have more to show of these laws than of others."""
    own = {*OF_PATH, "joint_torques", "acceleration_norm", "overview"}
    for result in (galjdf, moaljdf):
        names = sorted(own & {*drawable(result)})
        series = {name: values.copy() for name, values in result.series.items()}
        for values in series.values():
            values[-2:] = np.nan
        write_figures(replace(result, series=series), tmp_path, names)
        for name in series.keys() - {"p_WE_desired", "v_WE_desired"}:
            series[name][:] = np.nan
        write_figures(replace(result, series=series), tmp_path, names)


# The figure of a sweep over lambda and the schemes.


@pytest.fixture
def pictured(monkeypatch, tmp_path):
    """Return a function that draws a sweep and returns its axes."""

    def draw_sweep(keys, rows, metrics, **units):
        drawn = []
        monkeypatch.setattr(
            "drake_rnn.figures.campaign.save", lambda figure, file: drawn.append(figure)
        )
        assert sweep_figure(keys, rows, metrics, tmp_path / "sweep.png", units) is not None
        return [ax for ax in drawn[0].get_axes() if ax.get_visible()]

    return draw_sweep


WEIGHTS = [0.1, 0.5, 1, 2, 3, 5, 10, 50, 100]


def weighed():
    """Return rows with errors that scale like those of GALJDF and NALJDF."""
    return [
        Row((scheme, weight), {"error": 1e-4 * (weight if scheme == "a" else 1), "speed": 0.5})
        for scheme in "ab"
        for weight in WEIGHTS
    ]


def test_a_sweep_is_over_the_key_of_numbers_whichever_comes_first(pictured):
    turned = [Row(row.values[::-1], row.metrics) for row in weighed()]
    for keys, rows in ((["scheme", "weight"], weighed()), (["weight", "scheme"], turned)):
        (ax,) = pictured(keys, rows, ["error"])
        assert ax.get_xlabel() == "weight"
        assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
        assert [line.get_label() for line in ax.lines] == ["scheme = a", "scheme = b"]
        np.testing.assert_array_equal(ax.lines[0].get_xdata(), WEIGHTS)
        assert len({(to_hex(line.get_color()), line.get_marker()) for line in ax.lines}) == 2


def test_axes_of_a_sweep_are_named_with_their_units(pictured):
    rows = [Row((x,), {"joint_jerk_max_rad_s3": x, "saturated_fraction": 0.1 * x}) for x in (1, 2)]
    panels = pictured(["kappa"], rows, ["joint_jerk_max_rad_s3", "saturated_fraction"], kappa="1/s")
    assert [ax.get_xlabel() for ax in panels] == ["kappa [1/s]"] * 2
    assert [ax.get_ylabel() for ax in panels] == [
        "joint jerk max [rad/s³]",
        "saturated fraction [-]",
    ]


@pytest.mark.parametrize("count", range(1, 13))
def test_no_row_of_a_page_is_half_empty(pictured, count):
    names = [f"metric {k}" for k in range(count)]
    rows = [Row((x,), {name: k + x for k, name in enumerate(names)}) for x in (1.0, 2.0)]
    panels = pictured(["x"], rows, names)
    lengths = [ax.get_subplotspec().colspan for ax in panels]
    parts = panels[0].get_subplotspec().get_gridspec().ncols
    assert sum(map(len, lengths)) == parts * len({ax.get_subplotspec().rowspan for ax in panels})


def test_values_are_labelled_where_there_is_room(pictured):
    weights = [1, 2, 2.1, 100]
    (ax,) = pictured(["x"], [Row((x,), {"error": x}) for x in weights], ["error"])
    assert [text.get_text() for text in ax.get_xticklabels()] == ["1", "2", "", "100"]


def test_a_duplicate_metric_is_left_out_and_a_constant_one_looks_constant(pictured):
    rows = [Row(row.values, {**row.metrics, "again": row.metrics["error"]}) for row in weighed()]
    panels = pictured(["scheme", "weight"], rows, ["error", "again", "speed"])
    assert [ax.get_ylabel() for ax in panels] == ["error", "speed"]
    # Nearly constant, and drawn so.
    assert panels[1].get_ylim()[0] == 0.0

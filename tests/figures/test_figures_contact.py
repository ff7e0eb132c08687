"""Figures of a tool that presses against a surface."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_hex

from drake_rnn.colours import FORCE
from drake_rnn.experiment import load_experiment
from drake_rnn.figures import drawable, write_figures
from drake_rnn.figures.campaign import learning_figure
from drake_rnn.figures.force_panels import force_spectrum
from drake_rnn.figures.task_panels import (
    force_scale,
    surface_axes,
    surface_coordinates,
)
from drake_rnn.jobs.requests import Row
from drake_rnn.runs.result import words_of
from drake_rnn.runs.simulation import simulate
from figure_helpers import assert_no_text_is_cut_off, changed, draw, is_dashed, panel
from shared_runs import shared_run

OF_CONTACT = ["normal_force", "force_error", "path_on_surface", "orientation_error"]
# Those that have more to show of these laws than of others.
OWN = {*OF_CONTACT, "jacobian", "jacobian_error", "joint_velocities", "overview"}


def run(name, **changes):
    return simulate(load_experiment(name, {"accept": None, **changes}))


@pytest.fixture(scope="module")
def level():
    # Kinematic level: the force rises from zero to 0.1 N on a spring of 100 N/m.
    changes = {"duration": 4.0, "window": [1.0, 4.0], "accept": None}
    return shared_run("motion_force_tricuspid", changes)


@pytest.fixture(scope="module")
def inclined():
    changes = {"path.period": 2.5, "duration": 2.5, "window": [1.0, 2.5], "accept": None}
    return shared_run("contact_inclined", changes)


@pytest.fixture(scope="module")
def learned():
    return run("motion_force_cat", duration=1.0, window=None)


@pytest.fixture(scope="module")
def free():
    return run("slc_nephroid_known", duration=0.5, window=None)


def with_series(result, **series):
    return replace(result, series=result.series | series)


def read_noisily(result, sigma):
    """Return a result with a force sensor that adds noise."""
    noise = np.random.default_rng(0).normal(0.0, sigma, result.time.size)
    return with_series(result, normal_force_measured=result.series["normal_force"] + noise)


def labelled(ax, name):
    (line,) = [line for line in ax.lines if line.get_label() == name]
    return line


def entries(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def curve(ax):
    (drawn,) = [part for part in ax.collections if isinstance(part, LineCollection)]
    return drawn


@pytest.mark.long
def test_which_figures_there_are(level, learned, free):
    assert {*OF_CONTACT} < {*drawable(level)}
    # The path on the surface replaces it.
    assert "path_plane" not in drawable(level)
    assert {*OF_CONTACT, "jacobian", "jacobian_error"} < {*drawable(learned)}
    assert not {*OF_CONTACT} & {*drawable(free)}
    assert "path_plane" in drawable(free)


@pytest.mark.parametrize(
    "name",
    [*OF_CONTACT, "position_error", "position_error_axes", "velocity_error", "joint_velocities"],
)
def test_panels_have_units_and_no_text_is_cut_off(level, inclined, learned, name):
    for result in (level, inclined, learned, read_noisily(level, 0.02)):
        figure = draw(result, name)
        assert_no_text_is_cut_off(figure)
        for ax in figure.get_axes():
            assert ax.get_ylabel().endswith("]")


# Force.


def test_the_force_is_the_series_in_a_band_about_what_is_desired(level):
    ax = panel(level, "normal_force")
    assert ax.get_ylabel() == "normal force [N]"
    force = labelled(ax, "force")
    np.testing.assert_array_equal(force.get_xdata(), level.time)
    np.testing.assert_array_equal(force.get_ydata(), level.series["normal_force"])
    desired = level.series["normal_force_desired"]
    np.testing.assert_array_equal(labelled(ax, "desired").get_ydata(), desired)
    (band,) = [part for part in ax.collections if isinstance(part, PolyCollection)]
    edges = band.get_paths()[0].vertices[:, 1]
    assert (edges.min(), edges.max()) == pytest.approx((0.095, 0.105))
    assert band.get_label() == "±5 %"
    # The force has settled into the band before the shaded window begins.
    settled = level.time >= 1.0
    assert np.abs(force.get_ydata() - desired)[settled].max() < 0.05 * 0.1
    assert "window" in entries(ax)
    assert ax.get_ylim()[0] == 0.0


def test_small_forces_have_a_unit_of_their_own(level):
    names = ("normal_force", "normal_force_desired", "normal_force_measured")
    light = with_series(level, **{name: 1e-2 * level.series[name] for name in names})
    ax = panel(light, "normal_force")
    assert ax.get_ylabel() == "normal force [mN]"
    np.testing.assert_allclose(labelled(ax, "desired").get_ydata(), 1.0)


def test_the_settling_panel_shows_the_time_before_the_window(level, learned):
    _, settling = draw(level, "normal_force").get_axes()
    assert settling.get_xlim() == pytest.approx((0.0, 1.0))
    drawn = settling.lines[1].get_ydata()
    np.testing.assert_array_equal(drawn, level.series["normal_force"][: drawn.size])
    assert len(draw(learned, "normal_force").get_axes()) == 1


def test_the_measured_force_is_drawn_behind_the_true_one(level, learned):
    for result in (level, learned):
        assert "measured" not in entries(panel(result, "normal_force"))
    noisy = read_noisily(level, 0.02)
    ax = panel(noisy, "normal_force")
    measured = labelled(ax, "measured")
    np.testing.assert_array_equal(measured.get_ydata(), noisy.series["normal_force_measured"])
    assert measured.get_zorder() < labelled(ax, "true").get_zorder()
    low, high = ax.get_ylim()
    assert low < measured.get_ydata().min() <= measured.get_ydata().max() < high


def test_noise_is_shown_beside_the_error_but_does_not_drown_it(level):
    largest = level.metrics["force_error_max_N"]
    ax = panel(read_noisily(level, 0.3 * largest), "force_error")
    assert entries(ax) == ["true", "measured"]
    assert np.ptp(ax.get_ylim()) > 2.0 * 1e3 * largest
    drowned = panel(read_noisily(level, 10 * largest), "force_error")
    assert drowned.get_legend() is None


def test_measured_and_true_force_can_be_told_apart(level):
    error = level.metrics["force_error_max_N"]
    force = level.series["normal_force"]
    offset = with_series(level, normal_force_measured=force + 0.1 * error)
    for result, least in ((offset, 3.0), (read_noisily(level, 0.3 * error), 0.5)):
        ax = panel(result, "force_error")
        measured, true = labelled(ax, "measured"), labelled(ax, "true")
        assert measured.get_color() != true.get_color()
        # A smooth measurement is visible on both sides of the true force.
        assert measured.get_linewidth() >= least * true.get_linewidth()
        assert measured.get_zorder() < true.get_zorder()
    # A smaller difference would not be visible.
    close = with_series(level, normal_force_measured=force + 0.03 * error)
    assert panel(close, "force_error").get_legend() is None


def test_a_contact_that_is_lost_is_marked(level):
    lost = replace(level, metrics=level.metrics | {"contact_lost_time_s": 2.5})
    whole, settling = draw(lost, "normal_force").get_axes()
    assert {*labelled(whole, "contact lost").get_xdata()} == {2.5}
    assert "contact lost" not in [line.get_label() for line in settling.lines]


def test_the_force_error_is_that_of_the_window(level):
    ax = panel(level, "force_error")
    assert ax.get_ylabel() == "force error [mN]"
    assert ax.get_xlim() == pytest.approx((1.0, 4.0))
    error = level.series["normal_force"] - level.series["normal_force_desired"]
    drawn = ax.lines[0]
    np.testing.assert_array_equal(drawn.get_ydata(), 1e3 * error[level.time >= 1.0 - 1e-9])
    (note,) = ax.texts
    # The largest error over all steps, not over the samples.
    assert f"largest {1e3 * level.metrics['force_error_max_N']:.3g} mN" in note.get_text()


def test_a_sine_has_its_amplitude_in_the_spectrum_and_a_mean_none(level):
    time = level.time
    error = 0.02 + 0.01 * np.sin(2 * np.pi * 5.0 * time)
    desired = level.series["normal_force_desired"]
    swinging = with_series(level, normal_force=desired + error)
    frequency, amplitude = force_spectrum(swinging)
    peak = int(np.argmax(amplitude))
    # Over three seconds, the resolution is a third of a hertz.
    assert frequency[peak] == pytest.approx(5.0, abs=1 / 3)
    # Between two frequencies, a Hann window loses 15 % at most.
    assert 0.0085 <= amplitude[peak] <= 0.0101
    assert amplitude[np.abs(frequency - 5.0) > 2.0].max() < 1e-4
    assert frequency[0] > 0.0
    assert frequency[-1] < 50.0
    ax = draw(swinging, "force_error").get_axes()[1]
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
    assert ax.get_xlim() == pytest.approx((frequency[0], 50.0))
    np.testing.assert_array_equal(ax.lines[0].get_ydata(), amplitude)
    assert (ax.get_xlabel(), ax.get_ylabel()[-3:]) == ("frequency [Hz]", "[N]")


# The surface.


def test_a_level_surface_has_the_axes_of_the_base(level):
    axes, names = surface_axes(level)
    np.testing.assert_array_equal(axes, np.eye(3)[:2])
    assert names == ["x", "y"]


@pytest.mark.parametrize(
    ("normal", "names"),
    [
        ([0.5, 0.0, 0.866], ["x", "y"]),
        ([0.0, 0.5, 0.866], ["x", "y"]),
        ([0.0, 0.0, -1.0], ["x", "−y"]),
        ([2.0, 0.0, 0.0], ["y", "z"]),
        ([0.0, -1.0, 0.0], ["x", "z"]),
    ],
)
def test_axes_lie_in_the_surface_and_are_seen_from_above(level, normal, names):
    document = level.experiment.document
    # A path this small is within tolerance of every plane.
    turned = changed(
        level,
        environment=document.environment | {"normal": normal},
        path=document.path | {"size": 1e-6},
    )
    axes, found = surface_axes(turned)
    n = np.array(normal) / np.linalg.norm(normal)
    np.testing.assert_allclose(np.cross(*axes), n, atol=1e-12)
    np.testing.assert_allclose(axes @ axes.T, np.eye(2), atol=1e-12)
    assert found == names


def test_the_curve_from_above_is_where_the_tool_was_and_how_hard_it_pressed(level, inclined):
    for result in (level, inclined):
        ax = panel(result, "path_on_surface")
        assert ax.get_aspect() == 1.0
        drawn = curve(ax)
        segments = np.array(drawn.get_segments())
        points = np.concatenate((segments[:1, 0], segments[:, 1]))
        # With the height above the surface, they give the points in space.
        p_WE, origin = result.series["p_WE"], result.series["p_WE_desired"][0]
        n = result.experiment.contact.surface.normal_W
        height = np.outer((p_WE - origin) @ n, n)
        back = origin + 1e-3 * points @ surface_axes(result)[0] + height
        np.testing.assert_allclose(back, p_WE, atol=1e-12)
        force = result.series["normal_force"]
        np.testing.assert_allclose(drawn.get_array(), (force[1:] + force[:-1]) / 2)
        bar = draw(result, "path_on_surface").get_axes()[1]
        assert bar.get_ylabel() == "normal force [N]"
        # Forces of the approach are below the scale: the palest colour, and an arrow.
        within = result.time >= 1.0
        low, high = drawn.get_clim()
        assert force[0] < low <= force[within].min()
        assert force[within].max() <= high
        assert low <= 0.95 * result.series["normal_force_desired"][-1] + 1e-12


def pressed(result, shares):
    """Return a result with these shares of the desired force in the window, in turn."""
    force = result.series["normal_force"].copy()
    within = result.time >= 1.0 - 1e-9
    force[within] = 0.1 * np.resize(shares, int(within.sum()))
    return with_series(result, normal_force=force)


@pytest.mark.parametrize("shares", [[0.9914, 1.0086], [0.9986], [1.0]])
def test_a_run_that_is_hardly_off_has_one_colour(level, shares):
    drawn = curve(panel(pressed(level, shares), "path_on_surface"))
    rgba = drawn.to_rgba(drawn.get_array())[level.time[:-1] >= 1.0]
    assert {to_hex(colour).upper() for colour in rgba} == {FORCE}


@pytest.mark.parametrize("shares", [[1.0], [0.8, 1.0], [0.97, 1.3], [0.0, 1.0], [0.0, 7.0], [3.0]])
def test_the_desired_force_is_in_the_middle_of_a_colour(level, shares):
    edges, colours = force_scale(pressed(level, shares))
    assert (np.diff(edges) > 0).all()
    assert len(edges) == colours.N + 1
    assert 3 <= colours.N <= 9 or min(shares) == 3.0
    k = int(np.searchsorted(edges, 0.1)) - 1
    assert edges[k : k + 2].mean() == pytest.approx(0.1)
    assert edges[k + 1] - edges[k] >= 0.02 * 0.1 - 1e-12
    assert to_hex(colours.colors[k]).upper() == FORCE
    assert edges[0] <= 0.1 * min(0.95, *shares) + 1e-12
    assert edges[-1] >= 0.1 * max(1.05, *shares) - 1e-12


def test_the_desired_path_in_space_is_drawn_where_the_tool_presses(level, inclined):
    for result in (level, inclined):
        n = result.experiment.contact.surface.normal_W
        panels = draw(result, "position").get_axes()
        text = "desired, along the surface"
        wanted = np.stack([labelled(ax, text).get_ydata() for ax in panels], axis=1)
        # At the tool's height, at the distance of the position error, above the given path.
        off = result.series["p_WE"] - wanted
        np.testing.assert_allclose(off @ n, 0.0, atol=1e-12)
        np.testing.assert_allclose(np.linalg.norm(off, axis=1), result.position_error, atol=1e-12)
        sunk = np.cross(wanted - result.series["p_WE_desired"], n)
        np.testing.assert_allclose(sunk, 0.0, atol=1e-12)
        (line,) = [line for line in panel(result, "path_3d").lines if line.get_label() == text]
        drawn = np.stack(line.get_data_3d(), axis=1)
        np.testing.assert_array_equal(drawn, wanted[: len(drawn)])


def test_in_the_air_the_desired_path_is_drawn_as_it_is(free):
    drawn = [labelled(ax, "desired").get_ydata() for ax in draw(free, "position").get_axes()]
    np.testing.assert_array_equal(np.stack(drawn, axis=1), free.series["p_WE_desired"])


def test_a_circle_on_an_inclined_plate_is_one_from_above(inclined):
    ax = panel(inclined, "path_on_surface")
    assert ax.get_xlabel() == "x along the surface [mm]"
    desired = np.stack(labelled(ax, "desired").get_data(), axis=1)
    np.testing.assert_allclose(np.hypot(desired[:, 0] + 30.0, desired[:, 1]), 30.0, atol=1e-6)
    # Projected onto the x-y plane, it would be an ellipse.
    flat = 1e3 * (inclined.series["p_WE_desired"] - inclined.series["p_WE_desired"][0])
    assert np.ptp(flat[:, 0]) < 0.9 * np.ptp(desired[:, 0])


def test_a_curve_that_stands_still_is_a_point(level):
    still = np.tile(level.series["p_WE_desired"][0], (level.time.size, 1))
    ax = panel(with_series(level, p_WE=still, p_WE_desired=still), "path_on_surface")
    assert np.ptp(ax.get_xlim()) >= 1.0
    assert np.ptp(ax.get_ylim()) >= 1.0


# Errors along the surface.


def test_errors_are_those_along_the_surface(level, inclined):
    for result in (level, inclined):
        assert (
            panel(result, "position_error").get_ylabel() == "position error\nalong the surface [m]"
        )
        ax = panel(result, "position_error_axes")
        scale = {"mm": 1e3, "µm": 1e6}[ax.get_ylabel()[-3:-1]]
        norm, *axes = (line.get_ydata() for line in ax.lines)
        np.testing.assert_allclose(norm, scale * result.position_error, atol=1e-9)
        assert len(axes) == 2
        np.testing.assert_allclose(np.hypot(*axes), norm)
        slip = panel(result, "velocity_error")
        assert slip.get_ylabel().startswith("velocity error\nalong the surface [")
        assert len([line for line in slip.lines if not is_dashed(line)]) == 2


def test_how_deep_the_tool_has_sunk_in_is_no_error(level):
    # 0.1 N at 100 N/m is a millimetre.
    sunk = level.series["p_WE_desired"] - level.series["p_WE"]
    assert sunk[-1, 2] == pytest.approx(1e-3, rel=0.05)
    ax = panel(level, "position_error_axes")
    assert ax.get_ylabel().endswith("[µm]")
    assert max(np.abs(line.get_ydata()).max() for line in ax.lines) < 500.0
    np.testing.assert_allclose(surface_coordinates(level, level.series["p_WE_desired"])[0], 0.0)


def test_errors_before_the_window_do_not_flatten_those_in_it(level):
    error = np.where(level.time < 0.1, 1e-2, 1e-4)
    ax = panel(with_series(level, orientation_error=error), "orientation_error")
    assert ax.get_ylabel() == "orientation error [mrad]"
    np.testing.assert_allclose(ax.lines[0].get_ydata(), 1e3 * error)
    assert 0.1 < ax.get_ylim()[1] < 0.2
    (note,) = ax.texts
    assert note.get_text() == "10 mrad at 0 s"
    # Everything is shown if the window stays readable.
    ax = panel(with_series(level, orientation_error=error.clip(max=3e-4)), "orientation_error")
    assert ax.get_ylim()[1] > 0.3
    assert not ax.texts


def test_bounds_far_from_the_velocities_are_named(level):
    v = level.series["velocity"] / np.abs(level.series["velocity"]).max()
    for peak, share in ((0.05, 0.8), (0.24, 0.8), (0.3, 0.5)):
        moving = with_series(level, velocity=peak * v, network_velocity=peak * v)
        ax = panel(moving, "joint_velocities")
        is_near = peak > 0.5 / 2
        assert any(map(is_dashed, ax.lines)) == is_near
        assert any("bounds ±0.5 rad/s" in text.get_text() for text in ax.texts) != is_near
        # The curves fill at least this share of the panel.
        assert peak > share * ax.get_ylim()[1]


# The overview, and runs that are not finite.


def test_overview(level, inclined, learned):
    def labels(result):
        drawn = draw(result, "overview").get_axes()
        return {ax.get_ylabel().split(" [")[0] for ax in drawn}

    common = {
        "y along the surface",
        "normal force",
        "position error\nalong the surface",
        "orientation error",
    }
    common.add("limit")
    assert labels(level) == {*common, "joint velocity", "force error"}
    assert labels(inclined) == {*common, "joint velocity, law", "force error"}
    assert labels(learned) == {*common, "joint velocity, law", r"error of $\hat J$"}
    texts = {text.get_text() for part in draw(level, "overview").subfigs for text in part.texts}
    assert {
        words_of("force_error_rms_N"),
        words_of("lateral_error_max_m"),
        words_of("orientation_error_max_rad"),
        words_of("contact_lost_fraction"),
        words_of("joint_velocity_max_rad_s"),
    } <= texts


@pytest.mark.long
def test_values_that_are_not_finite(level, tmp_path):
    series = {name: values.astype(float) for name, values in level.series.items()}
    for name in series.keys() - {"p_WE_desired", "v_WE_desired", "normal_force_desired"}:
        series[name][:] = np.nan
    write_figures(replace(level, series=series), tmp_path, sorted(OWN & {*drawable(level)}))


@pytest.mark.long
def test_values_that_are_no_longer_finite(level, learned, tmp_path):
    for result in (level, learned):
        series = {name: values.astype(float) for name, values in result.series.items()}
        for values in series.values():
            values[-2:] = np.nan
        write_figures(replace(result, series=series), tmp_path, sorted(OWN & {*drawable(result)}))


def test_runs_are_compared_by_what_they_learned(learned, monkeypatch, tmp_path):
    drawn = []
    monkeypatch.setattr("drake_rnn.figures.campaign.save", lambda figure, _: drawn.append(figure))
    difference = learned.series["J"] - learned.series["J_hat"]
    error = np.linalg.norm(difference, axis=(1, 2))
    rows = [
        Row((1e-6,), {}, learning=(learned.time, error)),
        Row((1e-4,), {}, learning=(learned.time, 10 * error)),
        Row((1.0,), {}, failure="lost"),
    ]
    units = {"law.rho": "rad^2/s"}
    assert learning_figure(["law.rho"], rows, tmp_path / "learning.png", units) is not None
    (ax,) = drawn[0].get_axes()
    assert ax.get_yscale() == "log"
    (told,) = drawn[0].legends
    assert told.get_title().get_text() == "rho [rad²/s]"
    assert [text.get_text() for text in told.get_texts()] == ["1e-06", "0.0001"]
    np.testing.assert_array_equal(ax.lines[1].get_ydata(), 10 * error)
    assert_no_text_is_cut_off(drawn[0])
    assert learning_figure(["law.rho"], rows[2:], tmp_path / "learning.png") is None

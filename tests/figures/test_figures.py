from dataclasses import replace
from itertools import product

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex
from PIL import Image

from drake_rnn.errors import InvalidInputError
from drake_rnn.experiment import load_experiment
from drake_rnn.figures import drawable, write_figures
from drake_rnn.figures.style import SERIES, save
from drake_rnn.measures import format_quantity
from drake_rnn.runs.simulation import simulate
from figure_helpers import assert_no_text_is_cut_off, changed, curves, dashed_levels, draw, panel

KNOWN = [
    "overview",
    "path_3d",
    "path_plane",
    "joint_angles",
    "joint_velocities",
    "joint_accelerations",
    "acceleration_norm",
    "position",
    "position_error",
    "position_error_axes",
    "velocity_error",
    "joint_drift",
    "motion",
]
LEARNED = [*KNOWN, "jacobian", "jacobian_error"]


@pytest.fixture(scope="module")
def known():
    return simulate(load_experiment("slc_nephroid_known", {"duration": 0.5, "window": None}))


@pytest.fixture(scope="module")
def learned():
    changes = {"duration": 0.2, "window": [0.1, 0.2]}
    return simulate(load_experiment("slc_nephroid", changes))


@pytest.mark.long
def test_every_figure_is_written_as_a_small_png(learned, tmp_path):
    files = write_figures(learned, tmp_path / "new" / "figures")
    assert [file.stem for file in files] == drawable(learned)
    assert {file.name for file in (tmp_path / "new" / "figures").iterdir()} == {
        f"{name}.png" for name in LEARNED
    }
    for file in files:
        assert 3_000 < file.stat().st_size < 400_000
        with Image.open(file) as image:
            assert image.format == "PNG"
            # The width of a column or a page at 200 dots per inch.
            assert image.width in (700, 1420)
            assert 400 <= image.height <= 2000
            assert image.info["dpi"] == pytest.approx((200, 200), abs=0.5)
            darkness = 255 - np.asarray(image.convert("L"))
            assert darkness.max() > 200, "nothing is drawn"


def test_a_figure_without_its_series_is_not_drawn(known):
    assert sorted(drawable(known)) == sorted(KNOWN)
    fewer = {k: v for k, v in known.series.items() if "acceleration" not in k and k != "J"}
    names = drawable(replace(known, series=fewer))
    assert sorted({*KNOWN} - {*names}) == ["acceleration_norm", "joint_accelerations"]
    for name in names:
        draw(replace(known, series=fewer), name)


def test_a_single_sample_is_no_figure(known, tmp_path):
    one = replace(known, time=known.time[:1], series={k: v[:1] for k, v in known.series.items()})
    assert write_figures(one, tmp_path) == []


@pytest.mark.parametrize("name", LEARNED)
def test_every_panel_has_labels_with_units(learned, name):
    figure = draw(learned, name)
    panels = figure.get_axes()
    assert panels
    for ax in panels:
        assert ax.get_ylabel().endswith("]"), name
        below = [other for other in panels if other.get_shared_x_axes().joined(ax, other)]
        labels = {other.get_xlabel() for other in [ax, *below]} - {""}
        if name != "joint_angles":  # its columns share a time axis that matplotlib does not know of
            assert labels, name
        assert all(label.endswith("]") for label in labels)


@pytest.mark.parametrize("name", [name for name in LEARNED if name != "overview"])
def test_no_text_is_cut_off(learned, name):
    assert_no_text_is_cut_off(draw(learned, name))


def test_units_are_those_of_the_series(known):
    assert panel(known, "joint_velocities").get_ylabel() == "joint velocity [rad/s]"
    label = panel(known, "joint_accelerations").get_ylabel()
    assert label == "joint acceleration [rad/s²]"
    assert {ax.get_ylabel() for ax in draw(known, "position").get_axes()} == {
        "x [m]",
        "y [m]",
        "z [m]",
    }


def test_curves_are_the_series(known):
    ax = panel(known, "joint_velocities")
    np.testing.assert_array_equal(curves(ax), known.series["velocity"])
    assert len({line.get_color() for line in ax.lines[:7]}) == 7
    error = panel(known, "position_error").lines[0].get_ydata()
    np.testing.assert_array_equal(error, known.position_error)
    for k, ax in enumerate(draw(known, "joint_angles").get_axes()[:7]):
        np.testing.assert_array_equal(ax.lines[0].get_ydata(), known.series["position"][:, k])


def test_bounds_are_drawn_with_both_signs(known):
    ax = panel(known, "joint_velocities")
    assert dashed_levels(ax) == [-0.5, 0.5]
    low, high = ax.get_ylim()
    assert low < -0.5 < 0.5 < high
    assert dashed_levels(panel(known, "joint_accelerations")) == [-1.0, 1.0]
    assert dashed_levels(panel(known, "acceleration_norm")) == [1.0]
    assert dashed_levels(panel(known, "position_error")) == [1e-3]


def test_a_bound_far_away_is_named_and_does_not_flatten_the_curves(known):
    far = changed(known, limits={"velocity": 50.0, "acceleration": 1.0})
    ax = panel(far, "joint_velocities")
    assert dashed_levels(ax) == []
    assert ax.get_ylim()[1] < 1.0
    assert [text.get_text() for text in ax.texts] == ["bounds ±50 rad/s"]


def test_a_position_bound_is_drawn_where_it_is_near(known):
    q = known.series["position"]
    upper = q[:, 1].max() + 0.5 * np.ptp(q[:, 1])
    limits = known.experiment.limits
    bounds = [*limits.position_upper]
    bounds[1] = float(upper)
    near = changed(known, limits={"velocity": 0.5, "acceleration": 1.0, "position_upper": bounds})
    panels = draw(near, "joint_angles").get_axes()
    assert dashed_levels(panels[1]) == [pytest.approx(upper)]
    assert all(dashed_levels(panels[k]) == [] for k in (0, 2, 3))
    assert panels[0].get_title(loc="right").startswith("bounds −2.9")


def test_bounds_per_joint(known):
    own = [1.2, 1.6, 1.4, 1.4, 1.5, 1.8, 1.0]
    each = changed(known, limits={"velocity": 0.5, "acceleration": own})
    levels = dashed_levels(panel(each, "joint_accelerations"))
    assert levels == sorted(sign * bound for sign, bound in product((1, -1), set(own)))
    assert dashed_levels(panel(each, "acceleration_norm")) == [1.0, 1.8]


def test_without_limits(known):
    law = {**known.experiment.document.law, "acceleration_bound": "none"}
    unlimited = changed(known, limits="none", law=law)
    assert unlimited.experiment.limits.acceleration is None
    assert sorted(drawable(unlimited)) == sorted(KNOWN)
    draw(unlimited, "overview")
    for name in ("joint_velocities", "joint_accelerations", "acceleration_norm"):
        assert dashed_levels(panel(unlimited, name)) == []
    # Without bounds, there is no panel for the range.
    assert len(draw(unlimited, "joint_angles").get_axes()) == 7


def test_some_infinite_bounds(known):
    lower = [-np.inf, *known.experiment.limits.position_lower[1:]]
    velocity = [0.5] * 6 + [np.inf]
    limits = {"velocity": velocity, "acceleration": 1.0, "position_lower": lower}
    some = changed(known, limits=limits)
    assert dashed_levels(panel(some, "joint_velocities")) == [-0.5, 0.5]
    panels = draw(some, "joint_angles").get_axes()
    assert panels[0].get_title(loc="right") == "bounds none, 2.9"
    assert list(panels[7].get_yticks()) == [2, 3, 4, 5, 6, 7]


def test_noisy_arm_and_law_are_shown_apart(learned):
    labels = [ax.get_ylabel() for ax in draw(learned, "joint_accelerations").get_axes()]
    assert labels == ["acceleration, law [rad/s²]", "acceleration, arm [rad/s²]"]
    ax = panel(learned, "acceleration_norm")
    assert ax.get_yscale() == "log"
    legend = [text.get_text() for text in ax.get_legend().get_texts()]
    assert legend == ["arm", "law", "bound"]
    assert ax.get_ylim()[1] > learned.series["acceleration_peak"].max()


def test_jacobian_and_its_estimate_have_the_same_range(learned):
    panels = draw(learned, "jacobian").get_axes()
    assert len(panels) == 6
    assert len({ax.get_ylim() for ax in panels}) == 1
    np.testing.assert_array_equal(curves(panels[1]), learned.series["J_hat"][:, 0])


def test_a_learned_jacobian_of_poses_has_a_panel_for_each_of_its_six_rows():
    run = simulate(load_experiment("adaptive_pose_learned", {"duration": 0.05, "window": None}))
    panels = draw(run, "jacobian").get_axes()
    labels = [ax.get_ylabel() for ax in panels[::2]]
    assert [label.split(" row")[0] for label in labels] == [
        *(rf"$\omega_{axis}$" for axis in "xyz"),
        *"xyz",
    ]
    assert [label[label.index("[") :] for label in labels] == 3 * ["[1]"] + 3 * ["[m]"]


def test_window_is_shaded(known, learned):
    def shades(result):
        return list(panel(result, "position_error").patches)

    assert shades(known) == []
    (shade,) = shades(learned)
    assert shade.get_extents().width > 0


def test_overview_shows_the_metrics_and_their_expected_values(known):
    page = draw(known, "overview")
    texts = [text.get_text() for part in page.subfigs for text in part.texts]
    assert "slc_nephroid_known" in texts
    assert "position error max" in texts
    assert "≤ 0.9 mm" in texts
    missed = [text for part in page.subfigs for text in part.texts if text.get_weight() == "bold"]
    # The arm has not reached its path after half a second.
    assert format_quantity(known.metrics["position_error_max_m"], "m") in [
        text.get_text() for text in missed
    ]
    # Six panels, and that of the limits.
    assert len(page.get_axes()) == 7


@pytest.mark.long
def test_an_overview_has_no_empty_lines_above(known):
    def header(**told):
        page = draw(changed(known, **told), "overview")
        page.canvas = FigureCanvasAgg(page)
        page.canvas.draw()
        part = page.subfigs[0]
        bottom = min(text.get_window_extent().y0 for text in part.texts)
        assert bottom >= part.bbox.y0
        # Less than a line [inch] is empty below the last one.
        assert (bottom - part.bbox.y0) / page.dpi < 0.15
        return part.bbox.height / page.dpi

    heights = [
        header(paper="", expect=""),
        header(paper="Fig. 3", expect=""),
        header(paper="Fig. 3", expect="it follows"),
        header(paper="Fig. 3", expect="it follows its path " * 10),
    ]
    np.testing.assert_allclose(np.diff(heights), 0.14, atol=0.01)


@pytest.mark.long
def test_an_error_of_zero_and_values_that_are_not_finite(known, tmp_path):
    series = {name: values.copy() for name, values in known.series.items()}
    series["p_WE"] = series["p_WE_desired"].copy()
    draw(replace(known, series=series), "position_error")
    draw(replace(known, series=series), "overview")
    for name in series:
        series[name][-2:] = np.nan
    series["position"][-1] = np.inf
    write_figures(replace(known, series=series), tmp_path)


def test_planar_task(known):
    """Two task rows, as a planar arm has, and so no path in space."""
    narrow = ("p_WE", "p_WE_desired", "v_WE", "v_WE_desired", "J")
    series = {k: v[:, :2] if k in narrow else v for k, v in known.series.items()}
    names = drawable(replace(known, series=series))
    assert sorted({*KNOWN} - {*names}) == ["path_3d"]
    for name in names:
        draw(replace(known, series=series), name)


@pytest.mark.long
def test_nothing_else_changes(learned, tmp_path):
    before = {name: values.copy() for name, values in learned.series.items()}
    metrics = dict(learned.metrics)
    with mpl.rc_context({"font.size": 23, "axes.grid": False, "text.usetex": True}):
        settings, figures = dict(mpl.rcParams), plt.get_fignums()
        write_figures(learned, tmp_path, ["overview", "motion", "jacobian"])
        assert dict(mpl.rcParams) == settings
        assert plt.get_fignums() == figures
    for name, values in learned.series.items():
        np.testing.assert_array_equal(values, before[name])
    assert learned.metrics == metrics


@pytest.mark.parametrize("name", ["joint_velocities", "jacobian"])
def test_no_colour_is_lost_in_the_file(learned, name, tmp_path):
    save(draw(learned, name), tmp_path / "figure.png")
    with Image.open(tmp_path / "figure.png") as image:
        counts = {rgb: count for count, rgb in image.getcolors(1 << 24)}
    assert {*SERIES} <= {to_hex(np.array(rgb) / 255).upper() for rgb in counts}
    assert max(counts, key=counts.get) == (255, 255, 255)


def test_a_users_settings_do_not_show(known, tmp_path):
    def picture(name):
        save(draw(known, "position_error"), tmp_path / name)
        return (tmp_path / name).read_bytes()

    plain = picture("plain.png")
    with mpl.rc_context({"font.size": 23, "lines.linewidth": 9, "figure.dpi": 40}):
        assert picture("set.png") == plain


def test_a_folder_that_cannot_be_made(known, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InvalidInputError, match="file: is a file, not a folder"):
        write_figures(known, tmp_path / "file")

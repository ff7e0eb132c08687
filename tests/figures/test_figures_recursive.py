"""Figures of runs with bounds up to the fifth derivative, and the comparison of laws."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from drake_rnn import JointLimits
from drake_rnn.experiment import load_experiment
from drake_rnn.figures import drawable
from drake_rnn.figures.comparison import (
    comparison_figure,
    shares_of_bounds,
)
from drake_rnn.figures.style import save
from drake_rnn.runs.limit_use import derivatives_of_motion, share_of_range
from drake_rnn.runs.simulation import simulate
from figure_helpers import assert_no_text_is_cut_off, changed, curves, dashed_levels, draw

OF_DERIVATIVES = ["derivatives", "displayed_signals"]
UNITS = ["rad", "rad/s", "rad/s²", "rad/s³", "rad/s⁴", "rad/s⁵"]
NAMES = ["angle", "velocity", "acceleration", "jerk", "snap", "crackle"]
RATIOS = [f"limit_ratio_{order}_max" for order in range(1, 6)]
BOUNDS = [0.2, 0.1, 0.1, 0.2, 0.2]


def run(name, **changes):
    return simulate(load_experiment(name, {"duration": 0.5, "accept": None, **changes}))


@pytest.fixture(scope="module")
def filters():
    return run("recursive_circle")


@pytest.fixture(scope="module")
def printed():
    return run("recursive_circle_printed", duration=3.0)


@pytest.fixture(scope="module")
def smooth():
    return run("stretched_circle", duration=6.5)


def panels(result, name="derivatives"):
    return draw(result, name).get_axes()


def test_which_figures_there_are(filters, printed, smooth):
    assert {*OF_DERIVATIVES} < {*drawable(filters)}
    # The levels of the chain are derivatives, which the other figure shows already.
    for result in (printed, smooth):
        assert [name for name in OF_DERIVATIVES if name in drawable(result)] == ["derivatives"]
    one = run("rnn_circle")
    assert [name for name in OF_DERIVATIVES if name in drawable(one)] == ["derivatives"]


def test_they_are_drawn_only_where_jerk_is_bounded(filters, smooth):
    plain = run("pinv_circle", limits={"acceleration": 1.0}, duration=0.2)
    assert not {*OF_DERIVATIVES} & {*drawable(plain)}
    for few in (2, 5):
        series = {name: values[:few] for name, values in filters.series.items()}
        assert not {*OF_DERIVATIVES} & {
            *drawable(replace(filters, time=filters.time[:few], series=series))
        }


@pytest.mark.parametrize("name", OF_DERIVATIVES)
@pytest.mark.long
def test_six_panels_with_units_and_no_text_is_cut_off(filters, name):
    figure = draw(filters, name)
    assert_no_text_is_cut_off(figure, ("]", "bound"))
    labels = [ax.get_ylabel() for ax in figure.get_axes()]
    assert [label.split("[")[1] for label in labels] == [f"{unit}]" for unit in UNITS]
    assert figure.get_axes()[-1].get_xlabel() == "time [s]"


def test_derivatives_are_the_arms_and_as_large_as_the_metrics_say(filters, printed, smooth):
    """Except the acceleration: the metric is of single steps, the figure of 10 ms."""
    for result in (filters, printed, smooth):
        axes = panels(result)
        assert [ax.get_ylabel().split(" [")[0] for ax in axes] == NAMES
        np.testing.assert_array_equal(curves(axes[0]), result.series["position"])
        np.testing.assert_array_equal(curves(axes[1]), result.series["velocity"])
        for order in (1, 3, 4, 5):
            largest = np.abs(curves(axes[order])).max() / BOUNDS[order - 1]
            assert largest == pytest.approx(result.metrics[RATIOS[order - 1]], rel=1e-6)
        notes = [ax.get_title(loc="right") for ax in axes[1:]]
        ratios = [result.metrics[name] for name in RATIOS]
        told = [f"{'✗ ' * (ratio > 1)}up to {ratio:.3g} × bound" for ratio in ratios]
        assert notes == told


def test_differences_belong_to_the_middle_of_their_interval():
    """If the fourth derivative is 1, the third equals the time at which it is drawn."""
    result = run("pinv_circle", duration=0.1)
    velocity = np.tile(result.time[:, np.newaxis] ** 3 / 6, 7)
    made = replace(result, series={**result.series, "velocity": velocity})
    found = derivatives_of_motion(made)
    for order, expected in ((3, lambda t: t), (4, np.ones_like)):
        time, values = found[order]
        np.testing.assert_allclose(values[:, 0], expected(time), rtol=1e-8)
        assert time.size == result.time.size - order + 1


def test_differences_are_by_their_own_time_where_samples_are_uneven():
    """With steps of 4 ms and samples for each 10 ms, these are 8 or 12 ms apart."""
    result = run("pinv_circle", duration=0.4, period=4e-3)
    assert np.ptp(np.diff(result.time)) > 3e-3
    velocity = np.tile(result.time[:, np.newaxis] ** 2 / 2, 7)
    made = replace(result, series={**result.series, "velocity": velocity})
    found = derivatives_of_motion(made)
    np.testing.assert_allclose(found[2][1][:, 0], found[2][0], rtol=1e-9)
    np.testing.assert_allclose(found[3][1], 1.0, rtol=1e-9)


@pytest.mark.parametrize("log_period", [1e-3, 2e-3, 0.05])
@pytest.mark.long
def test_differences_are_over_10_ms_however_often_samples_are_stored(log_period, smooth):
    """Or over the distance of the samples, if that is larger: 2 % less at 50 ms."""
    other = run("stretched_circle", duration=6.5, log_period=log_period)
    for order in (2, 3):
        largest = [np.abs(derivatives_of_motion(r)[order][1]).max() for r in (smooth, other)]
        assert largest[1] == pytest.approx(largest[0], rel=1e-9 if log_period < 0.01 else 0.02)


def test_bounds_are_in_view_however_far_the_curves_go(filters, printed, smooth):
    for result in (filters, printed, smooth):
        for ax, bound in zip(panels(result)[1:], BOUNDS, strict=True):
            assert dashed_levels(ax) == [-bound, bound]
            low, high = ax.get_ylim()
            peak = np.abs(curves(ax)).max()
            assert low == -high
            assert high > max(bound, peak)
            # At least a twentieth of the panel is between the bounds.
            box = ax.transData.transform([(0, -bound), (0, bound), (0, low), (0, high)])[:, 1]
            assert box[1] - box[0] > 0.05 * (box[3] - box[2])
    assert panels(filters)[5].get_yscale() == "symlog"
    assert panels(smooth)[5].get_yscale() == "linear"
    assert dashed_levels(panels(filters)[0]) == [-2.0, 2.0]


def test_a_bound_that_would_flatten_the_curves_is_only_written(smooth):
    far = changed(smooth, limits={"velocity": 0.2, "acceleration": 0.1, "jerk": 1e3})
    ax = panels(far)[3]
    assert dashed_levels(ax) == []
    assert ax.get_ylim()[1] < 0.1
    assert ax.get_title(loc="right").endswith(" × bound")


def test_displayed_signals_are_those_of_the_filters_and_within_the_bounds(filters):
    axes = panels(filters, "displayed_signals")
    np.testing.assert_array_equal(curves(axes[1]), filters.series["velocity"])
    for order, ax in enumerate(axes[2:], start=2):
        shown = curves(ax)
        np.testing.assert_array_equal(shown, filters.series["levels"][:, order - 2])
        assert ax.get_ylabel().startswith(f"signal {order} [")
        assert np.abs(shown).max() <= BOUNDS[order - 1]
        assert ax.get_yscale() == "linear"
        ratio = np.abs(shown).max() / BOUNDS[order - 1]
        assert ax.get_title(loc="right") == f"up to {ratio:.3g} × bound"


def test_fewer_levels_are_fewer_panels():
    changes = {"law.gains": [100.0, 1e4, 2e4], "law.time_constants": [1e-4, 0.9, 0.8]}
    result = run("recursive_circle", **changes)
    assert len(panels(result, "displayed_signals")) == 4
    assert len(panels(result)) == 6


def test_bounds_of_some_orders_and_of_each_joint(smooth):
    own = [0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.06]
    some = changed(smooth, limits={"velocity": 0.2, "acceleration": None, "jerk": own})
    axes = panels(some)
    assert dashed_levels(axes[2]) == dashed_levels(axes[4]) == []
    assert axes[4].get_title(loc="right") == ""
    assert dashed_levels(axes[3]) == sorted(sign * bound for sign in (1, -1) for bound in {*own})


def draw_derivatives(result, folder):
    for name in OF_DERIVATIVES:
        save(draw(result, name), folder / f"{name}.png")


@pytest.mark.long
def test_values_that_are_not_finite(filters, tmp_path):
    series = {name: values.copy() for name, values in filters.series.items()}
    for values in series.values():
        values[-2:] = np.nan
    series["velocity"][10] = np.inf
    draw_derivatives(replace(filters, series=series), tmp_path)
    for name in ("position", "velocity", "levels"):
        series[name][:] = np.nan
    broken = replace(filters, series=series, metrics={})
    draw_derivatives(broken, tmp_path)
    comparison_figure({"circle": {"none": broken, "some": filters}}, tmp_path / "compared.png")


# The comparison of laws.


def test_shares_are_the_ratios_of_the_worst_joint(smooth):
    shares = shares_of_bounds(smooth)
    assert shares[0][1].max() == pytest.approx(np.abs(smooth.series["position"]).max() / 2)
    for order in (1, 3, 4, 5):
        largest = shares[order][1].max()
        assert largest == pytest.approx(smooth.metrics[RATIOS[order - 1]], rel=1e-6)


def test_the_comparison(filters, printed, smooth, tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(
        "drake_rnn.figures.comparison.save", lambda figure, file: drawn.append(figure)
    )
    groups = {
        "left": {"printed": printed, "stretched": smooth},
        "right": {"printed": filters, "stretched": smooth},
    }
    assert comparison_figure(groups, tmp_path / "x.png") == tmp_path / "x.png"
    axes = np.reshape(drawn[0].get_axes(), (7, 2))
    assert [ax.get_title() for ax in axes[0]] == ["left", "right"]
    assert axes[0, 0].get_ylabel() == "position error [m]"
    assert [ax.get_ylabel() for ax in axes[1:, 0]] == [f"{name} / bound [-]" for name in NAMES]
    np.testing.assert_array_equal(axes[0, 0].lines[1].get_ydata(), smooth.position_error)
    for ax in axes[1:].ravel():
        assert dashed_levels(ax) == [1.0]
        low, high = ax.get_ylim()
        assert low < 1.0 < high
    legend = [text.get_text() for text in drawn[0].legends[0].get_texts()]
    assert legend == ["printed", "stretched"]


def test_what_no_run_bounds_has_no_panel(smooth, tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(
        "drake_rnn.figures.comparison.save", lambda figure, file: drawn.append(figure)
    )
    arm = smooth.experiment.arm
    free = arm.with_limits(arm.limits.replace(snap=None, crackle=None))
    some = replace(smooth, experiment=replace(smooth.experiment, arm=free))
    for runs, panels in (({"a": some, "b": some}, 5), ({"a": some, "b": smooth}, 7)):
        comparison_figure({"": runs}, tmp_path / "x.png")
        assert len(drawn.pop().get_axes()) == panels


def test_the_comparison_is_a_page_wide(printed, smooth, tmp_path):
    file = comparison_figure({"circle": {"a": printed, "b": smooth}}, tmp_path / "compared.png")
    with Image.open(file) as image:
        assert image.width == 1420
        assert image.height < 2000


def test_joints_without_limits_have_no_share_of_their_range():
    """Without a warning, and the others have theirs; with none at all there is no curve."""
    q = np.array([[0.5, 3.0], [-0.5, 3.0]])
    half = JointLimits(position_lower=[-1, -np.inf], position_upper=[1, np.inf], velocity=[1, 1])
    np.testing.assert_allclose(share_of_range(q, half), [0.5, 0.5])
    none = JointLimits(position_lower=[-1] * 2, position_upper=[np.inf] * 2, velocity=[1, 1])
    assert np.isnan(share_of_range(q, none)).all()

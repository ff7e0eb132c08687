"""Broken bounds are marked on the overview, and what a transient hides is told."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import same_color

from drake_rnn.experiment import load_experiment
from drake_rnn.figures.style import BROKEN
from drake_rnn.measures import PREFIXES, format_quantity
from drake_rnn.robot.limits import LIMIT_UNITS
from drake_rnn.runs.limit_use import counted_limits, uses
from drake_rnn.runs.simulation import simulate
from figure_helpers import assert_no_text_is_cut_off, changed, draw, panel


def run(name, **changes):
    return simulate(load_experiment(name, changes))


@pytest.fixture(scope="module")
def keeps():
    return run("adaptive_jerk", duration=3.0, window=[2.2, 3.0])


@pytest.fixture(scope="module")
def breaks():
    """A path that is followed at once, with bounds up to the crackle that nothing keeps."""
    return run("recursive_circle_printed", duration=3.0)


def words(page):
    return [text.get_text() for part in page.subfigs for text in part.texts]


def limits_of(result):
    return draw(result, "overview").get_axes()[-1]


@pytest.mark.long
def test_a_run_that_keeps_its_bounds_has_no_mark(keeps):
    ax = limits_of(keeps)
    assert [label.get_text() for label in ax.get_yticklabels()] == list(LIMIT_UNITS)[:4]
    assert all(text.get_text().startswith("✓") for text in ax.texts)
    assert not any(same_color(bar.get_facecolor(), BROKEN) for bar in ax.patches)
    assert not any(text.startswith("✗") for text in words(draw(keeps, "overview")))
    np.testing.assert_allclose(
        [bar.get_width() for bar in ax.patches][1:],
        [keeps.metrics[f"limit_ratio_{order}_max"] for order in (1, 2, 3)],
    )


@pytest.mark.long
def test_broken_bounds_up_to_the_crackle_are_marked(breaks):
    ax = limits_of(breaks)
    names = [label.get_text() for label in ax.get_yticklabels()]
    assert names == [*LIMIT_UNITS][:-1]
    # The crackle is at its bound, but for the rounding of velocities.
    ratios = [breaks.metrics.get(f"limit_ratio_{order}_max", 0.0) for order in range(6)]
    broken = [ratio > 1.0 + 1e-5 for ratio in ratios]
    assert [text.get_text().startswith("✗") for text in ax.texts] == broken
    assert [same_color(bar.get_facecolor(), BROKEN) for bar in ax.patches] == broken
    assert broken[3:] == [True, True, False]
    # The bound is drawn, and bars and their numbers are within the panel.
    assert ax.lines[0].get_xdata()[0] == 1.0
    assert ax.get_xlim()[1] > max(bar.get_width() for bar in ax.patches)
    assert_no_text_is_cut_off(draw(breaks, "overview"), "]")


def test_the_table_says_no_as_the_terminal_does(keeps):
    missed = changed(keeps, accept={"position_error_max_m": {"at_most": 1e-9}})
    page = draw(missed, "overview")
    assert words(page).count("✗ no") == 1
    marked = [
        text.get_text()
        for part in page.subfigs
        for text in part.texts
        if text.get_weight() == "bold"
    ]
    assert marked == [
        format_quantity(keeps.metrics["position_error_max_m"], "m"),
        "✗ no",
        "≤ 1 nm",
    ]
    # Limits that the law keeps are in the table too, up to the jerk.
    assert "jerk / bound max" in words(page)


def test_what_was_not_reached_is_told(keeps):
    metrics = {name: value for name, value in keeps.metrics.items() if name != "settling_time_s"}
    page = draw(replace(keeps, metrics=metrics), "overview")
    assert "not reached" in words(page)


def test_limits_count_if_they_are_kept_or_asked_for(keeps, breaks):
    assert counted_limits(keeps.experiment) == ["position", "velocity", "acceleration", "jerk"]
    assert counted_limits(breaks.experiment) == [*LIMIT_UNITS][:-1]  # no envelope is given
    free = changed(breaks, limits="none", law={"kind": "pseudoinverse"}, accept={})
    assert counted_limits(free.experiment) == []
    free = replace(free, metrics={})
    assert uses(free) == []
    draw(free, "overview")


def test_a_position_beyond_its_limit_is_broken(keeps):
    beyond = replace(keeps, metrics=keeps.metrics | {"joint_limit_margin_min_rad": -0.01})
    assert [use.name for use in uses(beyond) if use.broken] == ["position"]


@pytest.mark.parametrize(
    ("name", "unit"), [("position_error_axes", "m"), ("velocity_error", "m/s")]
)
def test_a_transient_does_not_flatten_the_rest_and_its_peak_is_told(keeps, name, unit):
    ax = panel(keeps, name)
    inner = ax.get_ylim()
    outer = [line.get_ydata() for line in ax.lines]
    largest = max(np.nanmax(np.abs(values)) for values in outer)
    assert max(map(abs, inner)) < largest / 4.0
    notes = [text.get_text() for text in ax.texts]
    # The note has a unit of its own, in which the number has few digits.
    shown = ax.get_ylabel().rpartition("[")[2].removesuffix(f"{unit}]")
    peak = format_quantity(largest / dict(PREFIXES)[shown], unit, 3)
    assert any(note.startswith((f"{peak} at ", f"−{peak} at ")) for note in notes)
    # An arrow stands at the edge of the view for each.
    edges = [mark.get_offsets()[0][1] for mark in ax.collections]
    assert len(edges) == len(notes)
    assert {*edges} <= {*inner}


def test_a_position_limit_that_is_exceeded_is_shown_though_nothing_keeps_it(breaks):
    metrics = breaks.metrics | {
        "joint_limit_margin_min_rad": -0.01,
        "position_violation_max_rad": 0.01,
    }
    free = changed(breaks, limits={"velocity": 0.1}, law={"kind": "pseudoinverse"}, accept={})
    assert [use.name for use in uses(free)] == ["velocity"]
    found = uses(replace(free, metrics=metrics))
    assert next((use.name, use.broken) for use in found) == ("position", True)

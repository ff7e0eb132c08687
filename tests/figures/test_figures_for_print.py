"""Figures for print: their size on the page, their fonts, and one figure of several runs."""

import re
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from drake_rnn.errors import InvalidInputError
from drake_rnn.experiment import load_experiment
from drake_rnn.figures import (
    FIGURES,
    Paper,
    drawable,
    drawn_for,
    fitting,
    parse_width,
    write_figures,
)
from drake_rnn.figures import figure as figure_of
from drake_rnn.figures.comparison import (
    PANELS,
    compared_figure,
)
from drake_rnn.figures.style import (
    DESIRED,
    SERIES,
    filled_page,
    save,
)
from drake_rnn.runs.simulation import simulate
from figure_helpers import assert_no_text_is_cut_off

COLUMN = parse_width("88mm")
SHORT = {"duration": 0.3, "window": None, "accept": None}


@pytest.fixture(scope="module")
def runs():
    names = ("slc_nephroid_known", "adaptive_nephroid_known")
    return {name: simulate(load_experiment(name, SHORT)) for name in names}


@pytest.fixture(scope="module")
def result(runs):
    return runs["slc_nephroid_known"]


@pytest.mark.parametrize(
    ("text", "millimetres"), [("88mm", 88), ("8.8cm", 88), ("3.5 in", 88.9), (".16 cm", 0)]
)
def test_widths(text, millimetres):
    if millimetres:
        assert 25.4 * parse_width(text) == pytest.approx(millimetres)
        return
    with pytest.raises(InvalidInputError, match="from 40 to 1000 mm"):
        parse_width(text)


@pytest.mark.parametrize("text", ["88", "mm", "88pt", "-88mm", "nan mm", "1e2mm"])
def test_what_is_no_width_is_refused(text):
    with pytest.raises(InvalidInputError, match="such as 88mm"):
        parse_width(text)


@pytest.mark.long
def test_a_pdf_is_as_wide_as_asked_and_has_its_fonts_in_it(result, tmp_path):
    paper = Paper("pdf", COLUMN, "journal")
    (file,) = write_figures(result, tmp_path, ["position_error"], paper)
    contents = file.read_bytes()
    (box,) = re.findall(rb"/MediaBox \[ 0 0 ([\d.]+) ([\d.]+) \]", contents)
    assert float(box[0]) / 72 * 25.4 == pytest.approx(88.0, abs=0.01)
    # Type 42: whole TrueType fonts, which publishers ask for, and none of type 3.
    assert b"/CIDFontType2" in contents
    assert b"/FontFile2" in contents
    assert b"/Type3" not in contents
    assert b"STIX" in contents
    again = write_figures(result, tmp_path / "again", ["position_error"], paper)
    assert again[0].read_bytes() == contents


def test_an_svg_needs_no_fonts(result, tmp_path):
    (file,) = write_figures(result, tmp_path, ["joint_velocities"], Paper("svg", COLUMN))
    text = file.read_text()
    assert "<text" not in text
    assert re.search(r'width="249\.4\d+pt"', text)
    assert SERIES[0].lower() in text


def test_a_picture_for_a_journal_has_dots_enough(result, tmp_path):
    (file,) = write_figures(result, tmp_path, ["position_error"], Paper("png", COLUMN, "journal"))
    with Image.open(file) as image:
        assert image.width == int(88 / 25.4 * 600)
        assert round(image.info["dpi"][0]) == 600


@pytest.mark.parametrize("look", ["screen", "journal"])
@pytest.mark.long
def test_no_label_of_any_figure_is_cut_off_in_a_column(result, look):
    paper = Paper("pdf", COLUMN, look)
    names = fitting(drawable(result), paper)
    assert len(names) > 5
    for name in names:
        drawn = figure_of(result, name, paper)
        assert drawn.get_figwidth() == pytest.approx(COLUMN)
        with drawn_for(paper):
            assert_no_text_is_cut_off(drawn)


def test_what_cannot_be_read_in_a_column_is_left_out_and_refused(result, tmp_path):
    paper = Paper("pdf", COLUMN)
    assert "overview" not in fitting(drawable(result), paper)
    assert "overview" in fitting(drawable(result), Paper("pdf", parse_width("180mm")))
    with pytest.raises(InvalidInputError, match="overview needs a width of 165 mm or more"):
        write_figures(result, tmp_path, ["overview"], paper)
    assert {FIGURES[name].least for name in fitting(drawable(result), paper)} == {0.0}


def test_a_paper_is_left_with_its_block():
    with drawn_for(Paper(width=COLUMN)):
        assert filled_page(4)[0].get_figwidth() == COLUMN
    assert filled_page(4)[0].get_figwidth() == 7.1


def test_an_unknown_look_is_refused():
    with pytest.raises(InvalidInputError, match="look: no 'newspaper'"):
        Paper(look="newspaper")


# Several runs.


def curves_of(ax, count):
    return [line.get_ydata() for line in ax.lines[:count]]


def test_a_figure_of_several_runs_has_their_curves(runs):
    drawn = compared_figure(runs, ["path", "error", "velocity", "speed"], Paper("pdf", COLUMN))
    path, error, velocity, speed = drawn.get_axes()
    first, second = runs.values()
    np.testing.assert_array_equal(path.lines[1].get_xydata(), second.series["p_WE"][:, [1, 2]])
    for one, run in zip(curves_of(error, 2), runs.values(), strict=True):
        np.testing.assert_array_equal(one, run.position_error)
    limits = first.experiment.limits
    share = np.abs(first.series["velocity"]) / limits.velocity
    np.testing.assert_array_equal(velocity.lines[0].get_ydata(), share.max(axis=1))
    assert speed.get_ylabel().startswith("end-effector speed [")
    named = [text.get_text() for text in drawn.legends[0].get_texts()]
    assert named == [*runs, "desired"]
    assert len({line.get_color() for line in drawn.legends[0].get_lines()}) == 3
    assert_no_text_is_cut_off(drawn)


def test_runs_with_paths_of_their_own_are_drawn_beside_these(runs):
    changes = {**SHORT, "path.size": 0.02, "path.period": 6.0}
    other = simulate(load_experiment("slc_nephroid_known", changes))
    given = {**runs, "small": other}
    path, _ = compared_figure(given, ["path", "error"], Paper("pdf", COLUMN)).get_axes()
    traced, desired = path.lines[:3], path.lines[3:6]
    for one, run, its in zip(traced, given.values(), desired, strict=True):
        np.testing.assert_array_equal(its.get_xydata(), run.series["p_WE_desired"][:, [1, 2]])
        assert its.get_color() == one.get_color()
        assert its.get_alpha() < 1.0
    drawn = compared_figure(given, ["path"], Paper("pdf", COLUMN))
    assert [text.get_text() for text in drawn.legends[0].get_texts()][-1] == "desired of each"
    assert_no_text_is_cut_off(drawn)


def test_a_path_that_another_run_passes_at_other_times_is_one(runs):
    changes = {**SHORT, "path.period": 4.0, "duration": 0.2}
    faster = simulate(load_experiment("slc_nephroid_known", changes))
    path, _ = compared_figure({**runs, "faster": faster}, ["path", "error"], Paper()).get_axes()
    # Those of the legend have no points.
    drawn = [line for line in path.lines if line.get_xydata().size]
    assert [line.get_color() == DESIRED["color"] for line in drawn] == [False] * 3 + [True]


@pytest.mark.long
def test_panels_are_beside_one_another_on_a_page_and_below_in_a_column(runs):
    for width, beside in ((COLUMN, False), (parse_width("180mm"), True)):
        drawn = compared_figure(runs, ["error", "velocity"], Paper("pdf", width))
        drawn.draw_without_rendering()
        one, other = (ax.get_position() for ax in drawn.get_axes())
        assert bool(other.x0 > one.x1) is beside
        assert bool(other.y1 < one.y0) is not beside
        assert_no_text_is_cut_off(drawn)


@pytest.mark.parametrize(
    ("panels", "message"),
    [
        (["eror"], "panels: no 'eror'; nearest: error"),
        (["error", "error"], "error is given twice"),
        (["force"], "has no series normal_force, which force needs"),
        (["crackle"], "crackle is bounded in none of the runs"),
    ],
)
def test_panels_that_cannot_be_drawn_are_refused(runs, panels, message):
    with pytest.raises(InvalidInputError, match=message):
        compared_figure(runs, panels, Paper())


def test_runs_that_diverged_and_runs_of_other_lengths_are_drawn(runs, tmp_path):
    first, second = runs.values()
    series = {name: values.copy() for name, values in second.series.items()}
    series["velocity"][-3:] = np.nan
    short = replace(second, time=second.time[:20], series={k: v[:20] for k, v in series.items()})
    drawn = compared_figure({"a": first, "b": short}, ["error", "velocity", "drift"], Paper())
    save(drawn, tmp_path / "figure.png")
    assert drawn.get_axes()[0].get_xlim()[1] == first.time[-1]


def test_every_panel_says_its_unit(runs):
    for name in PANELS:
        if name not in ("force", "distance", "orientation", "jerk", "snap", "crackle"):
            drawn = compared_figure(runs, [name], Paper("pdf", COLUMN))
            assert drawn.get_axes()[0].get_ylabel().endswith("]")

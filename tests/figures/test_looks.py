"""What curves look like: meanings have their colours, and joints are told apart by anybody."""

from itertools import combinations

import pytest
from matplotlib.colors import same_color
from matplotlib.figure import Figure

from colour_vision import VISIONS, distance
from drake_rnn import colours
from drake_rnn.experiment import load_experiment
from drake_rnn.figures import drawable
from drake_rnn.figures.style import (
    BROKEN,
    INK,
    PAGE,
    SERIES,
    common_style,
    legend,
    nth,
)
from drake_rnn.runs.simulation import simulate
from figure_helpers import (
    assert_no_text_is_cut_off,
    changed,
    dashes,
    draw,
    is_dashed,
    panel,
)

MEANINGS = ("DESIRED", "TRACED", "TARGET", "FORCE", "BOUND")


def seen_apart(one, other, vision):
    return distance(colours.components(one), colours.components(other), vision)


@pytest.fixture(scope="module")
def tracking():
    return simulate(load_experiment("slc_nephroid_known", {"duration": 1.0, "window": None}))


@pytest.fixture(scope="module")
def pressing():
    return simulate(
        load_experiment(
            "motion_force_tricuspid", {"duration": 2.0, "window": [1, 2], "accept": None}
        )
    )


@pytest.fixture(scope="module")
def seeking():
    return simulate(load_experiment("modified_state_adjustment", {"duration": 0.5, "accept": None}))


def test_each_two_of_28_joints_differ_by_colour_or_dashes():
    assert len({(nth(k)["color"], nth(k)["linestyle"]) for k in range(28)}) == 28


@pytest.mark.parametrize("vision", VISIONS)
def test_joints_of_the_same_dashes_differ_in_colour(vision):
    """Far for two curves of 7, as joints 1 and 5; and the colours alone would do for areas."""
    for one, other in combinations(range(7), 2):
        least = 50.0 if nth(one)["linestyle"] == nth(other)["linestyle"] else 25.0
        apart = seen_apart(SERIES[one], SERIES[other], vision)
        assert apart > least, (one + 1, other + 1)


@pytest.mark.parametrize("vision", VISIONS)
def test_joints_errors_and_alarms_are_not_taken_for_what_has_a_meaning(vision):
    """For those who see all colours twice as far; 2.3 is just noticed side by side."""
    least = 25.0 if vision == "normal" else 15.0
    for number, colour in enumerate(SERIES, start=1):
        for meaning in MEANINGS:
            assert seen_apart(colour, getattr(colours, meaning), vision) > least, (number, meaning)
    for meaning in MEANINGS[:-1]:  # bounds are dashed, and errors are not
        assert seen_apart(INK, getattr(colours, meaning), vision) > 15.0, meaning
    assert seen_apart(BROKEN, INK, vision) > 15.0


@pytest.mark.parametrize("vision", VISIONS)
def test_curves_stand_out_from_paper(vision):
    for colour in (*SERIES, INK, BROKEN):
        assert seen_apart(colour, "#FFFFFF", vision) > 25.0


def labelled(ax, start):
    (line,) = [line for line in ax.lines if str(line.get_label()).startswith(start)]
    return line


@pytest.mark.long
def test_desired_and_traced_have_the_colours_of_the_playback(tracking, pressing):
    for result in (tracking, pressing):
        for name in {"path_3d", "path_plane", "position", "path_on_surface"} & {*drawable(result)}:
            ax = panel(result, name)
            desired = labelled(ax, "desired")
            assert same_color(desired.get_color(), colours.DESIRED)
            assert dashes(desired)
            if name != "path_on_surface":  # which is coloured by the force
                assert same_color(labelled(ax, "traced").get_color(), colours.TRACED)
                assert not dashes(labelled(ax, "traced"))
    assert same_color(labelled(panel(tracking, "motion"), "traced").get_color(), colours.TRACED)


def test_forces_targets_and_bounds_have_theirs(pressing, seeking, tracking):
    ax = panel(pressing, "normal_force")
    assert same_color(labelled(ax, "force").get_color(), colours.FORCE)
    assert same_color(labelled(ax, "desired").get_color(), colours.DESIRED)
    assert same_color(labelled(panel(seeking, "postures"), "target").get_color(), colours.TARGET)
    for ax in draw(seeking, "joint_angles").get_axes()[:7]:
        assert any(same_color(line.get_color(), colours.TARGET) for line in ax.lines)
    for ax in (panel(tracking, "joint_velocities"), panel(tracking, "position_error")):
        bounds = [line for line in ax.lines if is_dashed(line)]
        assert bounds
        assert all(same_color(line.get_color(), colours.BOUND) for line in bounds)


def test_what_has_no_meaning_wears_no_colour_of_one(tracking, pressing, seeking):
    free = {
        "position_error": tracking,
        "position_error_axes": pressing,
        "velocity_error": tracking,
        "joint_angles": tracking,
        "joint_drift": tracking,
        "end_effector": seeking,
        "orientation_error": pressing,
        "acceleration_norm": tracking,
    }
    meanings = [getattr(colours, meaning) for meaning in MEANINGS]
    for name, result in free.items():
        for ax in draw(result, name).get_axes():
            for line in ax.lines:
                worn = any(same_color(line.get_color(), meaning) for meaning in meanings)
                # But for bounds, and the zero that is desired.
                assert not worn or is_dashed(line), name


def test_bounds_of_single_joints_are_numbered(tracking):
    own = [1.2, 1.6, 1.4, 1.4, 1.5, 1.8, 1.0]
    ax = panel(
        changed(tracking, limits={"velocity": 0.5, "acceleration": own}), "joint_accelerations"
    )
    numbers = [text.get_text() for text in ax.texts if text.get_text()[0].isdigit()]
    # In the order of the bounds; those that nearly agree share a label.
    told = [int(number) for text in numbers for number in text.split(", ")]
    assert sorted(told) == [1, 2, 3, 4, 5, 6, 7]
    assert "7" in numbers[0]
    assert "6" in numbers[-1]


def test_no_joint_hides_the_others(tracking):
    """The curve that goes up and down most is drawn first, whatever its number."""
    lines = panel(tracking, "joint_velocities").lines[:7]
    ways = [abs(line.get_ydata()[1:] - line.get_ydata()[:-1]).sum() for line in lines]
    order = sorted(range(7), key=lambda k: lines[k].get_zorder())
    assert [ways[k] for k in order] == sorted(ways, reverse=True)


def test_a_long_legend_breaks_into_lines_and_is_not_cut_off():
    """The names of what happens to an arm that grips, above the right one of two panels."""
    grips = [f"moves its gripper: finger_joint1 to {to}" for to in (0.015, 0.04)]
    names = ["settling tolerance", "window", *grips, "attaches box", "releases box"]
    with common_style():
        figure = Figure(figsize=(PAGE, 3.0), layout="constrained")
        axes = figure.subplots(1, 2)
        for name in names:
            axes[1].plot([0.0, 1.0], label=name)
        legend(axes[1])
        assert_no_text_is_cut_off(figure, tuple(names))

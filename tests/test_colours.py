"""Colours that mean different things can be told apart, by people who see no green or red too."""

from __future__ import annotations

import re
from itertools import combinations

import numpy as np
import pytest
from pydrake.geometry import Rgba

from colour_vision import VISIONS, distance, seen
from drake_rnn import colours, load_arm
from drake_rnn.playback.arm_drawing import _pale

MEANINGS = {
    name: colours.components(getattr(colours, name))
    for name in ("DESIRED", "TRACED", "TARGET", "FORCE", "BOUND")
}
GROUNDS = {name: colours.components(getattr(colours, name)) for name in ("ARM", "SURFACE")} | {
    "white": (1.0, 1.0, 1.0)
}


@pytest.mark.parametrize("vision", VISIONS)
def test_meanings_are_told_apart(vision: str) -> None:
    """30 is as far as black from a dark grey of 28 %; 2.3 is just noticed side by side."""
    for one, other in combinations(MEANINGS, 2):
        assert distance(MEANINGS[one], MEANINGS[other], vision) > 30.0, (one, other)


@pytest.mark.parametrize("vision", VISIONS)
def test_meanings_stand_out_from_arm_surface_and_paper(vision: str) -> None:
    for meaning, colour in MEANINGS.items():
        for ground, behind in GROUNDS.items():
            assert distance(colour, behind, vision) > 30.0, (meaning, ground)


@pytest.mark.parametrize("vision", VISIONS)
def test_more_is_lighter_along_a_path_that_is_coloured_by_values(vision: str) -> None:
    """And none of the colours is that of the desired path, which lies round it."""
    scale = [colours.components(each) for each in colours.SCALE]
    assert min(np.diff([seen(each, vision)[0] for each in scale])) > 5.0
    assert min(distance(each, MEANINGS["DESIRED"], vision) for each in scale) > 20.0


def test_green_and_red_of_equal_lightness_look_alike_without_the_receptor_for_green() -> None:
    """The simulation does simulate: such a pair is far apart for others."""
    red, green = (0.75, 0.25, 0.2), (0.42, 0.46, 0.1)
    assert distance(red, green, "normal") > 60.0
    assert distance(red, green, "deuteranopia") < 20.0


@pytest.mark.parametrize("vision", VISIONS)
def test_paths_stand_out_from_the_pale_colours_of_arms(vision: str) -> None:
    """20, as dark greys and the force have for some; the orange of a maker would be a path's."""
    for arm in ("panda", "fr3", "iiwa14", "ur5", "gen3", "puma560"):
        model = load_arm(arm).model.read_text()
        found = {tuple(map(float, each.split())) for each in re.findall('rgba="([^"]*)"', model)}
        for maker in found:
            pale = _pale(Rgba(*maker))
            for meaning, colour in MEANINGS.items():
                seen = distance(colour, (pale.r(), pale.g(), pale.b()), vision)
                assert seen > 20.0, (arm, maker, meaning)
    assert distance(colours.components(colours.TRACED), (1.0, 0.424, 0.039), "protanopia") < 20.0

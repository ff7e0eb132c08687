"""What is written below the pictures."""

import numpy as np
import pytest
from PIL import Image

from drake_rnn import FilmSettings, load_experiment, simulate
from drake_rnn.colours import DESIRED, TRACED, components
from drake_rnn.film.encoding import (
    Caption,
    live_numbers,
)
from drake_rnn.measures import format_quantity

SHORT = {"duration": 0.2, "window": None, "accept": None}


@pytest.fixture(scope="module")
def run():
    return simulate(load_experiment("slc_nephroid", SHORT | {"name": "a_run"}))


@pytest.fixture(scope="module")
def named(run):
    changes = SHORT | {"name": "a_run_with_a_name_that_is_much_longer_than_a_film_is_wide"}
    return simulate(load_experiment("slc_nephroid", changes))


def strip(result, t=0.1, speed=1.0, **settings):
    """The strip below a grey picture, and that picture."""
    settings = FilmSettings(**settings)
    caption = Caption([result], settings, speed, (0.0, 0.2))
    width, height = settings.size
    above = Image.new("RGB", (width, height - caption.height), "#808080")
    whole = np.asarray(caption.below(above, t))
    assert whole.shape == (height, width, 3)
    return whole[height - caption.height :], whole[: height - caption.height]


@pytest.mark.parametrize("size", [(160, 160), (384, 270), (640, 400), (1280, 720)])
def test_the_picture_is_whole_and_nothing_is_written_over_an_edge(run, named, size):
    for result in (run, named):
        for theme in ("light", "dark"):
            written, above = strip(result, size=size, speed=2.5, theme=theme)
            assert (above == 128).all()
            ground = written[-1, 0]
            assert (written[4:, :8] == ground).all()
            assert (written[4:, -8:] == ground).all()
            assert (written[-1] == ground).all()


def test_the_legend_has_the_colours_of_what_it_names(run):
    written, _ = strip(run)
    for colour in (DESIRED, TRACED):
        sought = np.rint(255 * np.array(components(colour)))
        assert (np.abs(written - sought).max(axis=2) == 0).sum() > 30


def test_the_bar_tells_how_much_of_the_film_has_passed(run):
    for t in (0.0, 0.05, 0.1, 0.2):
        written, _ = strip(run, t)
        bar = (written[1] == written[1, 0]).all(axis=1)
        passed = 0 if t == 0.0 else int(bar.sum())
        assert passed == round(640 * t / 0.2)


def test_a_film_in_real_time_names_no_speed(run):
    plain, _ = strip(run)
    fast, _ = strip(run, speed=2.5)
    changed = np.flatnonzero((plain != fast).any(axis=(0, 2)))
    # The name and the legend stay where they are.
    assert changed.size
    assert changed.min() > 200


def test_the_numbers_are_those_of_the_run(run):
    numbers = live_numbers(run)
    for t in (0.0, 0.1, 0.2):
        sample = int(np.searchsorted(run.time, t + 1e-9)) - 1
        J, J_hat = run.series["J"][sample], run.series["J_hat"][sample]
        off = 100.0 * np.linalg.norm(J_hat - J) / np.linalg.norm(J)
        assert numbers.at(t) == [
            f"Jacobian off by {off:.0f} %",
            f"error {format_quantity(run.position_error[sample], 'm', 2)}",
        ]

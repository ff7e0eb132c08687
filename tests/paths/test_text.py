"""Letters: the points that they pass, corners, moves, and bounds of speed and acceleration."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from HersheyFonts import HersheyFonts
from path_helpers import assert_derivatives

from drake_rnn import InvalidInputError, Text

A = {"text": "A", "size": 0.1, "period": 4.0}


def strokes_of(text: str, size: float, font: str = "futural") -> list[np.ndarray]:
    """The font's own strokes of one line, relative to the first point."""
    fonts = HersheyFonts()
    fonts.load_default_font(font)
    strokes = [np.array(stroke, dtype=float) for stroke in fonts.strokes_for_text(text)]
    first = strokes[0][0]
    return [(stroke - first) * [size / 21.0, -size / 21.0] for stroke in strokes]


def at_times(path, count, order=0):
    times = np.linspace(0.0, path.duration, count)
    return np.array([path.evaluate(t)[order] for t in times.tolist()])


def test_an_a_rests_at_the_ends_of_its_three_strokes():
    path = Text(**A)
    ends = np.concatenate(strokes_of("A", 0.1))
    knots = path.knots(9.0)
    assert len(knots) == 6
    for t, (x, y) in zip(knots.tolist(), ends, strict=True):
        p, v, _ = path.evaluate(t)
        np.testing.assert_allclose(p, [x, y, 0.0], atol=1e-15)
        assert np.abs(v).max() < 1e-12


@pytest.mark.parametrize("font", ["futural", "scripts"])
def test_the_path_passes_the_points_of_its_letters(font):
    path = Text(text="Bg 8", size=0.1, period=30.0, font=font)
    drawn = path.sample(20_000)
    step = path.length / 20_000
    for x, y in np.concatenate(strokes_of("Bg 8", 0.1, font)):
        away = np.linalg.norm(drawn - [x, y, 0.0], axis=1).min()
        # Half a step, and what a tight bend adds to it.
        assert away < 0.6 * step


def test_straight_parts_of_letters_stay_straight():
    """A spline through the font's points alone would swing 3 % of the height out of these lines."""
    (stroke,) = strokes_of("U", 0.1)
    (left, top), right = stroke[0], stroke[-1][0]
    drawn = Text(text="U", size=0.1, period=3.0).sample(2000)
    upper = drawn[drawn[:, 1] > top - 0.06]
    off = np.minimum(np.abs(upper[:, 0] - left), np.abs(upper[:, 0] - right))
    assert off.max() < 1e-4


def test_the_length_is_that_of_strokes_and_moves():
    strokes = strokes_of("A", 0.1)
    points = np.concatenate(strokes)
    length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    assert Text(**A).length == pytest.approx(length, rel=1e-12)
    # Moves in the air are longer by their ways up and down, and shorter by their four roundings.
    lifted = Text(**A, lift=0.02).length
    assert length + 0.06 < lifted < length + 0.08
    bent = Text(text="O", size=0.1, period=4.0)
    (stroke,) = strokes_of("O", 0.1)
    chords = np.linalg.norm(np.diff(stroke, axis=0), axis=1).sum()
    assert chords < bent.length < 1.02 * chords


@pytest.mark.parametrize("timing", ["quintic", "ramps"])
@pytest.mark.parametrize("more", [{}, {"blend_radius": 0.01, "lift": -0.02, "plane": "yz"}])
def test_velocity_and_acceleration_are_the_derivatives(timing, more):
    assert_derivatives(Text(text="G", size=0.1, period=12.0, timing=timing, **more))


def test_a_corner_is_stopped_at_or_rounded():
    sharp = Text(text="L", size=0.1, period=4.0)
    assert len(sharp.knots(9.0)) == 3
    assert np.abs(sharp.evaluate(sharp.knots(9.0)[1])[1]).max() < 1e-12
    rounded = Text(text="L", size=0.1, period=4.0, blend_radius=0.02)
    assert len(rounded.knots(9.0)) == 2
    inner = at_times(rounded, 801, 1)[8:-8]
    assert np.linalg.norm(inner, axis=1).min() > 1e-5
    # Two legs at a right angle: the rounding passes their corner at 3 r sqrt(2) / 16.
    corner = np.array([0.0, -0.1, 0.0])
    away = np.linalg.norm(rounded.sample(20_000) - corner, axis=1).min()
    assert away == pytest.approx(3 * 0.02 * np.sqrt(2) / 16, rel=1e-4)


def test_the_acceleration_is_continuous_round_corners():
    """Its steps shrink with the time between two looks, with and without rounded corners."""
    for radius in (None, 0.01):
        path = Text(text="R", size=0.1, lift=0.03, period=5.0, blend_radius=radius)
        few, many = (np.diff(at_times(path, n, 2), axis=0) for n in (4001, 16001))
        ratio = np.abs(many).max() / np.abs(few).max()
        assert 0.2 < ratio < 0.35


@pytest.mark.parametrize(
    ("timing", "radius"),
    [("quintic", None), ("cycloid", 0.005), ("ramps", 0.005), ("sin2", None)],
)
def test_bounds_of_speed_and_acceleration_are_held_and_reached(timing, radius):
    given = {"text": "S4", "size": 0.1, "lift": 0.02, "timing": timing, "blend_radius": radius}
    for order, bound in ((1, {"speed": 0.1}), (2, {"acceleration": 0.5})):
        path = Text(**given, **bound)
        most = np.linalg.norm(at_times(path, 2903, order), axis=1).max()
        (value,) = bound.values()
        assert 0.98 * value <= most <= value * (1 + 1e-9)


def test_of_two_bounds_each_run_has_the_slower():
    runs = {}
    for key, bounds in (
        ("speed", {"speed": 0.1}),
        ("acceleration", {"acceleration": 0.2}),
        ("both", {"speed": 0.1, "acceleration": 0.2}),
    ):
        runs[key] = np.diff(Text(text="A7", size=0.1, **bounds).knots(99.0))
    np.testing.assert_allclose(
        runs["both"], np.maximum(runs["speed"], runs["acceleration"]), rtol=1e-12
    )
    assert np.ptp(np.sign(runs["speed"] - runs["acceleration"])) == 2


def test_with_a_period_all_runs_have_the_same_largest_acceleration():
    path = Text(text="A7", size=0.1, period=10.0)
    assert path.duration == path.traversal == 10.0
    largest = [
        max(np.linalg.norm(path.evaluate(t)[2]) for t in np.linspace(a, b, 2001)[:-1].tolist())
        for a, b in pairwise(path.knots(20.0))
    ]
    np.testing.assert_allclose(largest, largest[0], rtol=1e-5)


@pytest.mark.parametrize(
    ("plane", "normal"), [("xy", [0, 0, 1]), ("yz", [1, 0, 0]), ("xz", [0, -1, 0])]
)
@pytest.mark.parametrize("lift", [0.03, -0.03])
def test_moves_rise_along_the_normal_and_strokes_lie_in_the_plane(plane, normal, lift):
    path = Text(**A, plane=plane, lift=lift)
    height = path.sample(4001) @ np.array(normal, dtype=float)
    assert np.abs(height).max() == pytest.approx(0.03, abs=1e-9)
    assert np.all(height * np.sign(lift) > -1e-12)
    times = path.knots(9.0)
    for number, (begin, end) in enumerate(pairwise(times)):
        middle = path.evaluate((begin + end) / 2)[0] @ normal
        assert middle == pytest.approx(lift if number % 2 else 0.0, abs=1e-9)


def test_a_text_that_returns_closes():
    path = Text(**A, lift=0.02, returns=True)
    assert path.closed
    np.testing.assert_allclose(path.evaluate(9.0)[0], 0.0, atol=1e-12)
    assert not Text(**A).closed
    assert path.placed(np.zeros(3)).last_lap(4.0) == pytest.approx(0.0)


def test_the_centre_of_what_is_drawn_lies_where_it_is_said_to():
    centre = np.array([0.4, -0.1, 0.3])
    placed = Text(text="AE\nx", size=0.05, period=9.0, centre=centre).placed()
    drawn = placed.sample(5001)
    np.testing.assert_allclose((drawn.min(axis=0) + drawn.max(axis=0)) / 2, centre, atol=1e-4)
    # Two lines, the second 1.6 heights below the first.
    assert np.ptp(drawn[:, 1]) == pytest.approx(0.05 * 2.6, abs=1e-4)


def test_a_space_takes_room_and_draws_nothing():
    apart, together = Text(**{**A, "text": "I I"}), Text(**{**A, "text": "II"})
    assert len(apart.knots(9.0)) == len(together.knots(9.0))
    assert apart.evaluate(4.0)[0][0] > together.evaluate(4.0)[0][0] + 0.05


def test_the_points_at_which_it_rests_are_among_those_shown():
    path = Text(text="AZ", size=0.1, period=9.0, lift=0.02)
    shown = path.sample(200)
    for t in path.knots(9.0).tolist():
        assert np.linalg.norm(shown - path.evaluate(t)[0], axis=1).min() < 1e-12
    assert len(path.sample(3)) == 3


def test_a_time_that_is_none_is_refused():
    with pytest.raises(InvalidInputError, match="t: must be finite, not nan"):
        Text(**A).evaluate(np.nan)

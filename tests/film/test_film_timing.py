"""What a film shows when, and for how long."""

import numpy as np
import pytest

from drake_rnn import FilmSettings, InvalidInputError
from drake_rnn.film.encoding import (
    LAST,
    film_times,
)


def test_a_long_run_is_shown_faster_and_a_short_one_is_not_slowed():
    settings = FilmSettings(seconds=8.0, frames_per_second=10.0)
    long, short = film_times(20.0, settings), film_times(3.0, settings)
    assert (long.speed, short.speed) == (2.5, 1.0)
    assert (len(long.shown), len(short.shown)) == (81, 31)
    for times, duration in ((long, 20.0), (short, 3.0)):
        assert (times.shown[0], times.shown[-1]) == (0.0, duration)
        np.testing.assert_allclose(np.diff(times.shown), times.speed / 10.0)


def test_a_part_of_a_run_is_shown_from_its_beginning_to_its_end():
    times = film_times(20.0, FilmSettings(begin=5.0, end=9.0, seconds=1.0))
    assert (times.shown[0], times.shown[-1], times.speed) == (5.0, 9.0, 4.0)


@pytest.mark.parametrize("unit", [1e-3, 1e-2])
@pytest.mark.parametrize("rate", [7.0, 12.0, 30.0])
def test_each_picture_comes_at_its_time_whatever_a_format_counts_in(unit, rate):
    """Durations are rounded; their sum does not drift away."""
    times = film_times(20.0, FilmSettings(seconds=6.0, frames_per_second=rate))
    durations = unit * np.array(times.durations(unit))
    begins = np.concatenate(([0.0], np.cumsum(durations)))
    assert np.abs(begins[:-1] - times.shown / times.speed).max() <= 0.5001 * unit
    assert begins[-1] == pytest.approx(6.0 + LAST)


@pytest.mark.parametrize("step", [1, 2, 3, 4])
def test_with_pictures_left_out_the_film_is_as_long_and_ends_alike(step):
    times = film_times(20.0, FilmSettings(seconds=6.0, frames_per_second=7.0))
    some, kept = times.every(step)
    assert kept[0] == 0
    assert kept[-1] == len(times.shown) - 1
    np.testing.assert_array_equal(some.shown, times.shown[kept])
    assert set(np.diff(kept)[:-1]) <= {step}
    assert sum(some.durations(1e-3)) == sum(times.durations(1e-3))


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"begin": 3.0}, "begin: the run ends at 2 s, before 3 s"),
        ({"begin": 2.0}, "begin: must be before the end, 2 s, not 2 s"),
        ({"end": 3.0}, "end: the run ends at 2 s, before 3 s"),
        (
            {"size": (3840, 2160), "frames_per_second": 60.0, "seconds": 2.0},
            "film: 121 pictures of 3840x2160 take 3.0 GB of memory; give a smaller size",
        ),
    ],
)
def test_what_cannot_be_shown_is_refused(settings, said):
    with pytest.raises(InvalidInputError) as refused:
        film_times(2.0, FilmSettings(**settings))
    assert str(refused.value).startswith(said)

"""How metrics are gathered: the same from one part as from several, and for each robot of many."""

import numpy as np
import pytest

from drake_rnn.measures.metric import (
    Change,
    FirstTime,
    Largest,
    Last,
    Mean,
    Median,
    Settling,
    Share,
    Smallest,
)

RNG = np.random.default_rng(0)
TIME = np.arange(12.0)
TRUE = RNG.uniform(size=(12, 5)) < 0.4
NUMBERS = RNG.normal(size=(12, 5))


def gathered(gathering, values, cuts=()):
    """The parts come in one place of memory, as from a recorder: what is kept must be a copy."""
    state, place = gathering.start, values.copy()
    for part in np.split(np.arange(len(values)), cuts):
        place[: len(part)] = values[part]
        state = gathering.add(state, place[: len(part)], TIME[part])
    return gathering.value(state)


def top(vectors):
    return abs(vectors).max(axis=-1)


WAYS = [
    (Largest(), NUMBERS),
    (Smallest(), NUMBERS),
    (Last(), NUMBERS),
    (FirstTime(), TRUE),
    (Settling(), TRUE),
    (Median(), 10.0**NUMBERS),
]
NAMES = [type(gathering).__name__ for gathering, _ in WAYS]


@pytest.mark.parametrize(("gathering", "values"), WAYS, ids=NAMES)
def test_parts_and_company_do_not_matter(gathering, values):
    whole = gathered(gathering, values)
    for cuts in ([1], [4, 9], range(1, 12)):
        assert np.array_equal(gathered(gathering, values, cuts), whole, equal_nan=True)
    for robot in range(5):
        alone = gathered(gathering, values[:, robot : robot + 1])
        assert np.array_equal(alone, whole[robot : robot + 1], equal_nan=True)
        # A run by itself has no axis of robots; its median is exact.
        one = gathered(gathering, values[:, robot])
        assert one == pytest.approx(whole[robot], rel=0.006, nan_ok=True)


@pytest.mark.parametrize(
    ("gathering", "values"), [(Mean(), NUMBERS), (Share(), TRUE)], ids=["Mean", "Share"]
)
def test_a_mean_of_parts_is_that_of_all_but_for_rounding(gathering, values):
    assert gathered(gathering, values) == pytest.approx(values.mean(axis=0), rel=1e-12)
    assert gathered(gathering, values, [3, 7]) == pytest.approx(values.mean(axis=0), rel=1e-12)


def test_a_change_is_from_the_first_step_to_the_last_and_needs_two():
    vectors = RNG.normal(size=(12, 5, 3))
    moved = top(vectors[-1] - vectors[0])
    for cuts in ((), [1], [5, 11]):
        assert np.array_equal(gathered(Change(top), vectors, cuts), moved)
    assert np.isnan(gathered(Change(top), vectors[:1])).all()


@pytest.mark.parametrize("count", [501, 4])
def test_medians_of_many_are_within_six_thousandths(count):
    """Of four numbers over eight decades the middle two are far apart: it is their mean."""
    numbers = 10.0 ** RNG.uniform(-6, 2, (count, 3))
    state = Median().add((), numbers, np.arange(float(count)))
    assert Median().value(state) == pytest.approx(np.median(numbers, axis=0), rel=0.006)


def test_what_is_no_number_does_not_count_in_a_median():
    assert np.isnan(Median().value(()))
    values = np.array([[1.0, np.nan]])
    assert gathered(Median(), values) == pytest.approx([1.0, np.nan], rel=0.006, nan_ok=True)
    assert np.isnan(gathered(Median(), values[:, 1]))


def test_there_is_no_extreme_or_mean_of_no_numbers():
    for gathering in (Largest(), Smallest(), Mean()):
        assert not np.isfinite(gathering.value(gathering.start))


def test_an_error_settles_at_its_last_crossing():
    rows = ([0.5, 2.0, 0.5], [0.5, 0.5, 2.0], [0.5, 2.0, 2.0], [0.5, 0.5, 1.0])
    settled = np.array(rows) < 1.0
    assert gathered(Settling(), settled).tolist() == [0.0, 3.0, np.inf]

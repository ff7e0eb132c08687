"""What varied keys take their values from."""

import numpy as np
import pytest
from scipy import stats

from drake_rnn import InvalidInputError
from drake_rnn.jobs.plan import Axis, variation_of

LOW = {"kind": "uniform", "low": 1.0, "high": 3.0}


def draws(section, count=4000):
    one = variation_of(section, "vary.x")
    return [one.draw(np.random.default_rng([5, k])) for k in range(count)]


@pytest.mark.parametrize(
    ("section", "cdf"),
    [
        (LOW, stats.uniform(1, 2).cdf),
        ({"kind": "log_uniform", "low": 1e-3, "high": 1e2}, stats.loguniform(1e-3, 1e2).cdf),
        ({"kind": "normal", "mean": 2.0, "deviation": 0.5}, stats.norm(2, 0.5).cdf),
    ],
    ids=lambda value: value["kind"] if isinstance(value, dict) else "",
)
def test_numbers_have_their_distribution(section, cdf):
    """By the test of Kolmogorov and Smirnov; the seeds are fixed, so it does not fail by chance."""
    assert stats.kstest(draws(section), cdf).pvalue > 0.01


@pytest.mark.parametrize(
    ("section", "expected"),
    [
        ({"kind": "integers", "low": -1, "high": 2}, {-1: 0.25, 0: 0.25, 1: 0.25, 2: 0.25}),
        ({"kind": "choice", "values": ["a", None, 3]}, {"a": 1 / 3, None: 1 / 3, 3: 1 / 3}),
        (
            {"kind": "choice", "values": ["a", "b"], "weights": [1.0, 3.0]},
            {"a": 0.25, "b": 0.75},
        ),
    ],
)
def test_choices_come_as_often_as_they_should(section, expected):
    """Within four standard deviations, at most 0.008 each, of 4000 draws."""
    found = draws(section)
    for value, share in expected.items():
        assert found.count(value) / len(found) == pytest.approx(share, abs=0.032)
    assert set(found) == set(expected)


def test_each_entry_of_a_list_is_drawn():
    section = {"kind": "uniform", "low": [0.0, -1.0], "high": [1.0, 0.0]}
    values = np.array(draws(section, 500))
    assert values.shape == (500, 2)
    assert (values >= [0, -1]).all()
    assert (values <= [1, 0]).all()
    assert abs(np.corrcoef(values.T)[0, 1]) < 0.15


@pytest.mark.parametrize(
    ("section", "values"),
    [
        ([1, "none", None], [1, "none", None]),
        ({"kind": "range", "low": 0, "high": 6, "count": 4}, [0, 2, 4, 6]),
        ({"kind": "range", "low": 0, "high": 1, "count": 3}, [0.0, 0.5, 1.0]),
        ({"kind": "range", "low": 2, "high": 2, "count": 1}, [2]),
        (
            {"kind": "range", "low": 0.01, "high": 1.0, "count": 3, "spacing": "log"},
            pytest.approx([0.01, 0.1, 1.0]),
        ),
    ],
)
def test_axes_list_their_values(section, values):
    axis = variation_of(section, "vary.x")
    assert isinstance(axis, Axis)
    assert axis.values_in_order() == values


@pytest.mark.parametrize(
    ("section", "message"),
    [
        (3, "vary.x: must be a list of values, or a mapping with a kind, not 3"),
        ([], "vary.x.values: must not be empty"),
        ({"kind": "unifrom"}, "vary.x.kind: no such kind, 'unifrom'; nearest: uniform"),
        ({"low": 1}, "vary.x.kind: no such kind, None"),
        ({**LOW, "hihg": 3}, "vary.x.hihg: no such key; nearest: high"),
        ({**LOW, "high": 0.5}, "vary.x.high: must be at least low, 1.0, not 0.5"),
        (
            {**LOW, "high": [3, 4], "low": [1, 2, 3]},
            "vary.x.high: must have as many entries",
        ),
        ({"kind": "log_uniform", "low": 0.0, "high": 1.0}, "vary.x.low: must be greater than 0"),
        ({"kind": "normal", "mean": 0, "deviation": -1}, "vary.x.deviation: must be at least 0"),
        ({"kind": "integers", "low": 3, "high": 1}, "vary.x.high: must be at least low, 3, not 1"),
        ({"kind": "choice", "values": [1], "weights": [1.0, 2.0]}, "vary.x.weights: must have 1"),
        ({"kind": "choice", "values": [1], "weights": [0.0]}, "vary.x.weights"),
        ({"kind": "range", "low": 1, "high": 2, "count": 0}, "vary.x.count: must be greater"),
        ({"kind": "range", "low": 0, "high": 2, "count": 2, "spacing": "log"}, "vary.x.low"),
        ({"kind": "uniform", "low": float("nan"), "high": 1}, "vary.x.low"),
        ({"kind": "uniform", "low": -1e308, "high": 1e308}, "vary.x.high: is too far from low"),
    ],
)
def test_bad_sections_are_refused_by_name(section, message):
    with pytest.raises(InvalidInputError) as caught:
        variation_of(section, "vary.x")
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)


def test_grids_list_each_section_with_all_its_gains():
    section = {
        "kind": "grids",
        "of": [
            {"fixed": {"kind": "a", "list": [1, 2]}, "over": {"x": [1, 2], "y": [3, 4]}},
            {"fixed": {"kind": "b"}},
        ],
    }
    axis = variation_of(section, "vary.law")
    gains = [(1, 3), (1, 4), (2, 3), (2, 4)]
    listed = [{"kind": "a", "list": [1, 2], "x": x, "y": y} for x, y in gains]
    assert axis.values_in_order() == [*listed, {"kind": "b"}]
    assert axis.size == 5


@pytest.mark.parametrize(
    ("grids", "said"),
    [
        ([], "vary.law.of: must not be empty"),
        ([{"over": {"x": [1]}}], "vary.law.of.0.fixed: must be given"),
        ([{"fixed": {"x": 1}, "over": {"x": [1]}}], "over.x: is also in fixed"),
        ([{"fixed": {}, "over": {"x": []}}], "over.x: must have one value or more"),
    ],
)
def test_grids_that_mean_nothing_are_refused(grids, said):
    with pytest.raises(InvalidInputError, match=said.replace(".", r"\.")):
        variation_of({"kind": "grids", "of": grids}, "vary.law")

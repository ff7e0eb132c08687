"""What is stored of a run's series changes neither the run nor its metrics."""

from itertools import pairwise

import numpy as np
import pytest

from drake_rnn import InvalidInputError, Result, load_experiment, simulate, write_figures
from drake_rnn.runs import series as stored

NAME = "state_adjustment"
SHORT = {"accept": None, "duration": 1.0, "log_period": 1e-3}


@pytest.fixture(scope="module")
def full():
    return simulate(load_experiment(NAME, SHORT))


def test_thin_samples_are_some_of_the_full_ones(full, monkeypatch):
    """At most as many as are few, and the last; a peak is the largest of all that are left out.

    The last step is one that rounding sets apart from a full sample.
    """
    monkeypatch.setattr(stored, "_FEW", 30)
    thin = simulate(load_experiment(NAME, SHORT), series="thin")
    assert 20 < thin.time.size <= 32
    assert thin.metrics == full.metrics
    at = np.searchsorted(full.time, thin.time - 1e-9)
    assert full.time[at] == pytest.approx(thin.time, abs=1e-12)
    for name, values in thin.series.items():
        if not name.endswith("_peak"):
            np.testing.assert_array_equal(values[:-1], full.series[name][at][:-1], name)
    peaks = full.series["acceleration_peak"]
    expected = [peaks[a + 1 : b + 1].max() for a, b in pairwise(at)]
    np.testing.assert_array_equal(thin.series["acceleration_peak"][1:], expected)


def test_the_document_of_a_thin_result_says_how_thin_it_is(monkeypatch, tmp_path):
    monkeypatch.setattr(stored, "_FEW", 30)
    thin = simulate(load_experiment(NAME, SHORT), series="thin")
    assert thin.experiment.document.log_period == pytest.approx(0.034)
    thin.save(tmp_path)
    again = simulate(tmp_path / "experiment.yaml")
    np.testing.assert_array_equal(again.series["position"], thin.series["position"])


def test_a_short_run_has_all_its_samples_also_where_few_are_wanted(full):
    thin = simulate(load_experiment(NAME, SHORT), series="thin")
    np.testing.assert_array_equal(thin.time, full.time)
    assert thin.experiment.document.log_period == 1e-3


def test_of_no_series_the_last_step_is_left(full, tmp_path):
    none = simulate(load_experiment(NAME, SHORT), series="none")
    assert none.metrics == full.metrics
    assert none.time == pytest.approx([1.0], abs=1e-12)
    assert none.series.keys() == full.series.keys()
    end = full.series["position"][-1:]
    np.testing.assert_allclose(none.series["position"], end, rtol=0, atol=1e-12)
    assert none.series["acceleration_peak"] == full.metrics["joint_acceleration_max_rad_s2"]
    none.save(tmp_path)
    loaded = Result.load(tmp_path)
    assert loaded.record["until_s"] == none.time[0]
    assert loaded.metrics == full.metrics
    assert write_figures(loaded, tmp_path / "figures") == []


def test_what_is_stored_is_full_thin_or_none():
    with pytest.raises(InvalidInputError, match=r"^series: may be full, thin, none, not 'thick'$"):
        simulate(load_experiment(NAME, SHORT), series="thick")


def test_a_run_that_stores_too_much_may_store_less():
    many = {**SHORT, "duration": 0.01, "log_period": 1e-10}
    with pytest.raises(InvalidInputError, match="log_period: 1e-10 s stores 1e\\+08 samples"):
        simulate(load_experiment(NAME, many))
    assert simulate(load_experiment(NAME, many), series="none").time.size == 1


#: Steps of 1/64 s, which are exact.
STEP = 1 / 64


def kept(steps, period, parts=1, duration=None):
    """The times that are stored of a run to the last step, which is evaluated in parts."""
    time = np.asarray(steps) * STEP
    series = stored.StoredSeries(period * STEP, duration or time[-1])
    cuts = [*np.linspace(0, time.size - 1, parts + 1).astype(int)]
    for begin, end in pairwise(cuts):
        part = time[begin : end + 1]
        change = -np.arange(begin + 1, end + 1, dtype=float)[:, np.newaxis]
        series.add(part, {"t": part}, {"rate": change}, last=end == time.size - 1)
    taken = series.take()
    np.testing.assert_array_equal(taken["t"], taken["time"])
    # The magnitude of a change is the number of its step: the largest is that of the sample.
    at = np.searchsorted(time, taken["time"])
    np.testing.assert_array_equal(taken["rate_peak"], at)
    np.testing.assert_array_equal(taken["rate"][:, 0], -at)
    return (taken["time"] / STEP).tolist()


@pytest.mark.parametrize("parts", [1, 2, 3, 7])
def test_the_first_step_of_each_period_is_stored_and_the_last_of_the_run(parts):
    assert kept(range(22), 5, parts) == [0, 5, 10, 15, 20, 21]
    assert kept(range(21), 5, parts) == [0, 5, 10, 15, 20]
    assert kept([0, 1, 2, 3, 4, 6, 7, 8, 13], 5, parts) == [0, 6, 13]
    assert kept(range(22), np.inf, parts) == [21]


def test_a_last_step_that_rounding_sets_apart_is_not_stored_again():
    """It is 1e-9 of a step behind one that is; 1e-3 of a step behind it, it is another one."""
    assert kept([0, 1, 2, 3, 4, 4 + 1e-9], 2) == [0, 2, 4]
    assert kept([0, 1, 2, 3, 4, 4 + 1e-3], 2) == [0, 2, 4, 4 + 1e-3]


@pytest.mark.parametrize("parts", [1, 7])
def test_a_run_that_lasts_longer_than_was_expected_is_stored_whole(parts):
    assert kept(range(22), 1, parts, duration=3 * STEP) == list(range(22))

"""A run is evaluated in parts while it goes on: what it comes to does not depend on them.

Parts of some 50 steps against one part. Extremes, times and series are the same to the last bit.
Means are sums of the same numbers, rounded in another order: 1e-12 of them.
"""

import os
import signal
import tracemalloc

import numpy as np
import pytest

from drake_rnn import InvalidInputError, SimulationError, load_experiment, simulate
from drake_rnn.errors import InterruptedRunError
from drake_rnn.runs import evaluation, simulation

FEW = 50
FREE = {"accept": None, "window": None}
# Of each kind of run, one; and what about it needs the steps of another part.
CASES = {
    "kinematic": ("slc_nephroid_known", {"duration": 0.3}),
    "to a target": ("state_adjustment", {"duration": 0.3}),
    "laps and window": (
        "pinv_circle",
        {"duration": 1.1, "window": [0.2, 1.0], "path.period": 0.25, "limits": "none"},
    ),
    "contact": ("contact_circle", {"duration": 0.3}),
    "contact with a noisy sensor": ("contact_noisy", {"duration": 0.15}),
    "learned, in contact": ("motion_force_tricuspid_learned", {"duration": 0.05}),
    "learned with dither at 10 kHz": ("slc_nephroid", {"duration": 0.05}),
    "filter": ("slc_nephroid_chain", {"duration": 0.3}),
    "filter behind a law that learns of its own arm": (
        "slc_nephroid_chain",
        {"duration": 0.3, "feedback": "unfiltered", "filter.delay_desired": False},
    ),
    "error control": ("slc_nephroid_continuous", {"duration": 0.05}),
    "error control of joint drift": ("galjdf_clover", {"duration": 0.5}),
    "sensing": ("slc_nephroid_known", {"duration": 0.2, "sensing": {"resolution": 1e-4}}),
}
LONG = ("contact", "filter", "filter behind a law that learns of its own arm")
MEANS = {"rms", "mean", "fraction"}


@pytest.fixture
def in_parts(monkeypatch):
    """Run an experiment in parts of few steps; return its result and how often steps were taken."""
    monkeypatch.setattr(simulation, "PART", FEW)
    taken = []
    take = evaluation.Evaluation.take

    def counted(self, steps):
        taken.append(take(self, steps))
        return taken[-1]

    monkeypatch.setattr(evaluation.Evaluation, "take", counted)

    def run(experiment):
        result = simulate(experiment)
        assert sum(end > 0 for end in taken) >= 2
        return result

    return run


def in_one(experiment, monkeypatch):
    with monkeypatch.context() as patched:
        patched.setattr(simulation, "PART", 10**6)
        return simulate(experiment)


def same(parts, whole):
    assert parts.metrics.keys() == whole.metrics.keys()
    for name, value in whole.metrics.items():
        if MEANS & {*name.split("_")}:
            assert parts.metrics[name] == pytest.approx(value, rel=1e-12), name
        else:
            assert parts.metrics[name] == value, name
    np.testing.assert_array_equal(parts.time, whole.time)
    assert list(parts.series) == list(whole.series)
    for name, values in whole.series.items():
        np.testing.assert_array_equal(parts.series[name], values, name)
    assert parts.warnings == whole.warnings


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        pytest.param(*CASES[case], id=case, marks=pytest.mark.long if case in LONG else ())
        for case in CASES
    ],
)
def test_what_a_run_comes_to_does_not_depend_on_its_parts(name, changes, in_parts, monkeypatch):
    experiment = load_experiment(name, {**FREE, **changes})
    whole = in_one(experiment, monkeypatch)
    assert whole.metrics
    same(in_parts(experiment), whole)


def test_a_lap_that_began_in_an_earlier_part_has_its_drift(in_parts):
    name, changes = CASES["laps and window"]
    result = in_parts(load_experiment(name, {**FREE, **changes}))
    # A pseudoinverse drifts: what is compared is no zero.
    assert result.metrics["lap_drift_max_rad"] > 1e-6


def test_ticks_that_rarely_end_together_make_longer_parts(in_parts, monkeypatch):
    """Those of motors, 0.7 ms, and of the law, 10 ms: both end every 70 ms."""
    changes = {"duration": 0.3, "level": "dynamic", "plant.time_step": 7e-4, "period": 1e-2}
    experiment = load_experiment("slc_nephroid_known", {**FREE, **changes})
    same(in_parts(experiment), in_one(experiment, monkeypatch))


# A run that does not come to its end.


@pytest.fixture
def interrupted(interrupts):
    """Interrupt every run after 0.2 s."""
    interrupts(0.2)


@pytest.mark.usefixtures("interrupted")
def test_an_interrupted_run_keeps_all_that_it_had(in_parts, monkeypatch):
    experiment = load_experiment("slc_nephroid_known", FREE)
    found = []
    for run in (in_parts, lambda each: in_one(each, monkeypatch)):
        with pytest.raises(InterruptedRunError) as caught:
            run(experiment)
        found.append(caught.value.result)
    assert found[0].time[-1] == pytest.approx(0.201, abs=1e-9)
    same(*found)


def test_ctrl_c_while_a_part_is_evaluated_takes_its_steps_once(in_parts, monkeypatch):
    """It waits for the part's end, so that sums hold each step once and the run is kept whole."""
    experiment = load_experiment("slc_nephroid_known", {**FREE, "duration": 0.2})
    whole = in_one(experiment, monkeypatch)
    motion_of, parts = evaluation.motion_of, []

    def interrupted(*args, **options):
        parts.append(motion_of(*args, **options))
        if len(parts) == 2:
            os.kill(os.getpid(), signal.SIGINT)
        return parts[-1]

    monkeypatch.setattr(evaluation, "motion_of", interrupted)
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(InterruptedRunError) as caught:
        in_parts(experiment)
    assert signal.getsignal(signal.SIGINT) is before
    result = caught.value.result
    kept = whole.time <= result.time[-1]
    # But for the very last sample, which ends every run.
    np.testing.assert_array_equal(
        result.series["position"][:-1], whole.series["position"][kept][: result.time.size - 1]
    )
    assert 2 * FEW * 0.9e-3 < result.time[-1] < 3 * FEW * 1e-3


@pytest.mark.parametrize("moment", ["_add", "finish"])
def test_ctrl_c_after_the_last_step_waits_for_the_result(monkeypatch, moment):
    experiment = load_experiment("slc_nephroid_known", {**FREE, "duration": 0.05})
    whole = simulate(experiment)
    work = getattr(evaluation.Evaluation, moment)

    def told(self, *args, **options):
        os.kill(os.getpid(), signal.SIGINT)
        return work(self, *args, **options)

    monkeypatch.setattr(evaluation.Evaluation, moment, told)
    with pytest.raises(InterruptedRunError, match="after its last step") as caught:
        simulate(experiment)
    result = caught.value.result
    assert result.status == "complete"
    assert "control_step_us" in result.timings
    same(result, whole)


def test_ctrl_c_at_the_last_step_keeps_the_whole_run(interrupts):
    experiment = load_experiment("slc_nephroid_known", {**FREE, "duration": 0.05})
    whole = simulate(experiment)
    interrupts(0.0495)
    with pytest.raises(InterruptedRunError, match="after its last step") as caught:
        simulate(experiment)
    assert caught.value.result.status == "complete"
    same(caught.value.result, whole)


def test_of_a_law_whose_observables_fail_on_the_way_the_rest_is_kept(in_parts, monkeypatch):
    experiment = load_experiment("slc_nephroid_known", {**FREE, "duration": 0.2})
    whole = in_one(experiment, monkeypatch)
    observed = evaluation.observed_signals

    def failing(experiment, motion, *rest):
        if motion.time[-1] > 0.12:
            raise InvalidInputError("observables: failed")
        return observed(experiment, motion, *rest)

    monkeypatch.setattr(evaluation, "observed_signals", failing)
    with pytest.raises(SimulationError, match="observables: failed") as caught:
        in_parts(experiment)
    result = caught.value.result
    lost = whole.series.keys() - result.series.keys()
    assert lost == {*whole.experiment.law.sampled(1e-3).observables.parts}
    for name, values in result.series.items():
        np.testing.assert_array_equal(values, whole.series[name], name)
    assert "saturated_fraction" in whole.metrics
    assert "saturated_fraction" not in result.metrics
    assert result.metrics["position_error_max_m"] == whole.metrics["position_error_max_m"]


# Memory.


def grown(duration):
    """Return how much memory a run takes at most, all that Python and NumPy allocate [B]."""
    experiment = load_experiment("pinv_circle", {**FREE, "duration": duration, "path.period": 0.5})
    tracemalloc.start()
    simulate(experiment, series="none")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak


@pytest.mark.long
def test_memory_does_not_grow_with_the_duration(monkeypatch):
    """Four times as many steps; all of them would take 1 kB each, the 1200 that are more 1.2 MB."""
    monkeypatch.setattr(simulation, "PART", FEW)
    grown(0.1)
    assert grown(1.6) < grown(0.4) + 0.3e6

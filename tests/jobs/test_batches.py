"""Campaigns whose runs are carried out side by side: the same rows, whoever runs beside whom."""

import csv

import pytest

from drake_rnn import InvalidInputError, load_experiment, simulate
from drake_rnn.batch.run import robots_of
from drake_rnn.experiment import make_experiment
from drake_rnn.jobs import plan_campaign, read_campaign, run_campaign
from drake_rnn.jobs.campaign import run_each, simulate_each, surely_in_reach
from drake_rnn.jobs.pool import tasks_of
from drake_rnn.jobs.requests import RunRequest

HOME = load_experiment("slc_nephroid_known").start
NEAR = {"kind": "uniform", "low": (HOME - 0.05).tolist(), "high": (HOME + 0.05).tolist()}
KNOWN = {
    "name": "known",
    "experiment": "slc_nephroid_known",
    "changes": {
        "duration": 0.03,
        "window": None,
        "accept": {"position_error_max_m": {"at_most": 0.1}},
    },
    "vary": {"start": NEAR, "law.kappa": {"kind": "uniform", "low": 10.0, "high": 20.0}},
    "samples": 7,
}
#: Some are out of reach, and some have a law that fails on its way or at its start.
MIXED = {
    "experiment": "pinv_line",
    "changes": {"duration": 4.5, "period": 2e-2, "law.kind": "fatal_law:Fatal"},
    "vary": {
        "law.fate": ["live", "fail", "live", "fail", "live", "live"],
        "path.by": [
            [0.1, 0.2, 0.1],
            [0.1, 0.2, 0.0],
            [3.0, 0.0, 0.0],
            [0.1, 0.1, 0.1],
            [0.05, 0.1, 0.0],
            [0.0, 3.0, 0.0],
        ],
    },
    "together": [["law.fate", "path.by"]],
}


def rows(folder):
    with (folder / "table.csv").open(newline="") as stream:
        return list(csv.DictReader(stream))


@pytest.mark.long
def test_a_batch_gives_the_same_table_to_the_last_bit_however_it_is_cut(tmp_path):
    tables = []
    for batch in (None, 1, 3):
        folder = tmp_path / str(batch)
        result = run_campaign(KNOWN, folder, jobs=0, batch=batch)
        assert result.summary.methods == {"batch": 7}
        tables.append((folder / "table.csv").read_bytes())
    assert tables[0] == tables[1] == tables[2]


@pytest.mark.long
def test_a_row_of_a_batch_is_that_of_a_simulation_but_for_rounding(tmp_path):
    run_campaign(KNOWN, tmp_path / "batch", jobs=0)
    run_campaign({**KNOWN, "method": "simulate"}, tmp_path / "simulate", jobs=0)
    for many, one in zip(rows(tmp_path / "batch"), rows(tmp_path / "simulate"), strict=True):
        assert (many["method"], one["method"]) == ("batch", "simulate")
        for name in many.keys() - {"method"}:
            try:
                # Jerks are differences over a tick, which magnify rounding errors.
                assert float(many[name]) == pytest.approx(float(one[name]), rel=1e-4, abs=1e-9)
            except ValueError:
                assert many[name] == one[name]


@pytest.mark.long
def test_a_pair_of_arms_is_a_row_as_in_a_simulation_and_refused_if_one_is_out_of_reach():
    base = {"translation": [0.9, 0.0, 0.0], "rpy": [0.0, 0.0, 3.1]}
    line = {"kind": "line", "by": [0.0, 0.1, 0.0], "period": 2.0}
    pair = load_experiment("adaptive_two_arms").document.contents()
    pair |= {"duration": 0.02, "window": None, "path": line}
    pair |= {"second": {"base": base}, "accept": {}}
    far = {**pair, "second": {"base": base, "path": {**line, "offset": [0.0, 3.0, 0.0]}}}
    requests = [RunRequest(key, each, method="batch") for key, each in (("a", pair), ("b", far))]
    record, refused = run_each(requests)
    assert (record.method, record.status) == ("batch", "complete"), record.failure
    (alone,) = simulate_each(requests[:1])
    assert record.metrics == pytest.approx(alone.metrics, rel=1e-7, abs=1e-7)
    assert refused.status == "refused"
    assert refused.failure.startswith("path: out of reach")


def test_rows_of_one_method_are_not_taken_for_those_of_another(tmp_path):
    run_campaign({**KNOWN, "samples": 1, "method": "simulate"}, tmp_path, jobs=0)
    result = run_campaign({**KNOWN, "samples": 1}, tmp_path, jobs=0)
    assert (result.kept, result.summary.methods) == (0, {"batch": 1})
    # What a method has computed is kept under it, whether it was chosen or asked for.
    assert run_campaign({**KNOWN, "samples": 1, "method": "batch"}, tmp_path, jobs=0).kept == 1


@pytest.mark.long
@pytest.mark.parametrize("batch", [None, 2])
def test_what_is_refused_and_what_fails_is_a_row_as_in_a_simulation(tmp_path, batch):
    run_campaign(MIXED, tmp_path / "auto", jobs=0, batch=batch)
    run_campaign({**MIXED, "method": "simulate"}, tmp_path / "simulate", jobs=0)
    for many, one in zip(rows(tmp_path / "auto"), rows(tmp_path / "simulate"), strict=True):
        assert (many["status"], many["failure"]) == (one["status"], one["failure"])
        assert float(many["until_s"]) == pytest.approx(float(one["until_s"]), abs=1e-12)
    told = [row["status"] for row in rows(tmp_path / "auto")]
    assert told == ["complete", "failed", "refused", "failed", "complete", "refused"]


@pytest.mark.long
def test_an_interrupted_batch_loses_its_own_rows_and_goes_on(tmp_path):
    def interrupt(ended, runs, outcome):
        if ended == 3:
            raise KeyboardInterrupt

    first = run_campaign(KNOWN, tmp_path, jobs=0, batch=3, progress=interrupt)
    assert (first.ending, first.missing) == ("interrupted", 4)
    second = run_campaign(KNOWN, tmp_path, jobs=0)
    assert (second.ending, second.kept) == ("complete", 3)
    run_campaign(KNOWN, tmp_path / "undisturbed", jobs=0)
    assert rows(tmp_path) == rows(tmp_path / "undisturbed")


def test_a_batch_that_is_asked_for_and_cannot_be_is_refused_with_the_reason():
    dynamic = {"experiment": "pinv_line", "vary": {"level": ["kinematic", "dynamic"]}}
    with pytest.raises(InvalidInputError, match=r"^method: may not be batch here; level: .*row 1"):
        plan_campaign(read_campaign({**dynamic, "method": "batch"}))
    methods = [row.method for row in plan_campaign(read_campaign(dynamic)).rows]
    assert methods == ["batch", "simulate"]


def test_batches_are_sized_by_their_steps_and_simulations_are_alone():
    def request(number, method, duration=20.0):
        document = {"duration": duration, "period": 1e-3}
        return RunRequest(str(number), document, "", "", method=method)

    short = [request(k, "batch", 1.0) for k in range(10_000)]
    assert {len(task) for task in tasks_of(short, 2)} == {1000}
    long = [request(k, "batch", 1000.0) for k in range(1000)]
    assert {len(task) for task in tasks_of(long, 2)} == {100}
    mixed = [
        request(0, "simulate"),
        request(1, "batch"),
        request(2, "simulate"),
        request(3, "batch"),
    ]
    assert [len(task) for task in tasks_of(mixed, 2)] == [2, 1, 1]
    assert [len(task) for task in tasks_of(mixed, 2, batch=3)] == [3, 1]


@pytest.mark.long
def test_a_path_is_in_reach_beyond_doubt_only_if_a_simulation_would_begin():
    document = load_experiment("pinv_line").document.contents()
    far = [[0.1, 0.2, 0.1], [0.0, 0.0, 0.6], [0.2, 0.2, 0.2], [1.0, 0.0, 0.0]]
    lines = [{**document, "path": {**document["path"], "by": by}} for by in far]
    experiments = [make_experiment(line) for line in lines]
    sure = surely_in_reach(robots_of(experiments))
    assert sure.tolist() == [True, False, True, False]
    for experiment, known in zip(experiments, sure, strict=True):
        if known:
            assert simulate(experiment, series="none").status == "complete"
        assert surely_in_reach(robots_of([experiment]))[0] == known

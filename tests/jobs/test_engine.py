"""The engine alone, with workers and runs that are none: what is lost, what is tried again."""

import math
import sys
from concurrent.futures import BrokenExecutor, CancelledError, ThreadPoolExecutor
from threading import Lock

import pytest

from drake_rnn import DrakeRnnError, InvalidInputError
from drake_rnn.jobs.pool import (
    InOrder,
    Jobs,
    LostWorkersError,
    Processes,
    ThisProcess,
    Workers,
)
from drake_rnn.jobs.requests import (
    RecordStore,
    RunRecord,
    RunRequest,
)


class DeathError(Exception):
    """A worker that has died."""


class Threads(Workers):
    """Threads that are taken for workers."""

    deaths = (DeathError,)

    def __init__(self, count=3):
        self.pool = ThreadPoolExecutor(count)
        super().__init__(self.pool, count)

    def stop(self):
        self.pool.shutdown()


class Runs:
    """Runs that end at once.

    Args:
        deadly: Number of deaths that each request costs before it is carried out.
    """

    def __init__(self, deadly=()):
        self.deadly, self.lock = dict(deadly), Lock()
        self.at_once, self.most_beside_deadly, self.begun = 0, 0, []

    def __call__(self, requests):
        with self.lock:
            self.at_once += 1
            self.begun += [request.key for request in requests]
        try:
            for request in requests:
                if self.deadly.get(request.key, 0) > 0:
                    self.deadly[request.key] -= 1
                    raise DeathError("gone")
            return [RunRecord("complete", metrics={"number": float(o.key)}) for o in requests]
        finally:
            with self.lock:
                self.at_once -= 1


def requests(count):
    return [RunRequest(str(k), {}, "", "") for k in range(count)]


def records_of(runs, count=20, workers=None, batch=1):
    found = {}

    def take(request, record):
        assert request.key not in found
        found[request.key] = record

    assert Jobs(requests(count)).run(workers or Threads(), runs, take, batch)
    return found


@pytest.mark.parametrize("batch", [1, 3, 50])
@pytest.mark.parametrize("workers", [Threads, ThisProcess])
def test_every_order_is_carried_out_once_whatever_the_batches(batch, workers):
    runs = Runs()
    found = records_of(runs, workers=workers(), batch=batch)
    assert {key: record.metrics["number"] for key, record in found.items()} == {
        str(k): float(k) for k in range(20)
    }
    assert sorted(runs.begun, key=int) == [str(k) for k in range(20)]


@pytest.mark.parametrize("batch", [1, 4])
def test_an_order_that_always_kills_is_named_and_the_others_end(batch):
    runs = Runs({"7": 1000})
    found = records_of(runs, batch=batch)
    assert [key for key, each in found.items() if each.status == "killed its worker"] == ["7"]
    deaths = runs.begun.count("7")
    assert found["7"].failure.startswith(
        f"its worker died {deaths} times, the last time alone: DeathError"
    )
    assert len(found) == 20
    # A larger task is halved until its culprit is alone.
    assert deaths <= max(3, 1 + math.ceil(math.log2(batch)))


def test_who_was_beside_a_deadly_order_is_carried_out_by_halves_and_last():
    runs = Runs({"0": 1})
    found = records_of(runs, batch=4)
    assert all(record.status == "complete" for record in found.values())
    # The first task held 0 to 3; they come again after all others.
    assert runs.begun[-4:] == ["0", "1", "2", "3"]


def test_what_loses_its_worker_twice_is_still_carried_out():
    found = records_of(Runs({"3": 2, "4": 2}))
    assert all(record.status == "complete" for record in found.values())


@pytest.mark.parametrize("error", [BrokenExecutor("broken"), CancelledError()])
def test_a_lost_executor_ends_it_with_a_sentence_and_keeps_what_had_come(error):
    def perform(batch):
        if batch[0].key == "5":
            raise error
        return [RunRecord("complete") for _ in batch]

    found = []
    with pytest.raises(LostWorkersError, match="the workers are lost"):
        Jobs(requests(20)).run(
            Workers(ThreadPoolExecutor(1), 1), perform, lambda o, _: found.append(o)
        )
    assert [request.key for request in found] == ["0", "1", "2", "3", "4"]


def test_workers_that_are_silently_lost_are_noticed():
    class Silent(Workers):
        def submit(self, task, *arguments):
            class Never:
                def add_done_callback(self, fn):
                    pass

            return Never()

        def why_lost(self):
            return "the scheduler is lost"

    with pytest.raises(LostWorkersError, match="the scheduler is lost"):
        Jobs(requests(3)).run(Silent(None, 2), Runs(), lambda *_: None)


def test_a_task_that_cannot_be_done_at_all_is_a_sentence():
    def perform(batch):
        raise ModuleNotFoundError("No module named 'drake_rnn'")

    with pytest.raises(DrakeRnnError, match="a worker cannot do its task: ModuleNotFoundError"):
        Jobs(requests(3)).run(Threads(), perform, lambda *_: None)


def test_a_worker_that_refuses_is_quoted():
    def perform(batch):
        raise InvalidInputError("worker: has drake 1.0")

    with pytest.raises(InvalidInputError, match=r"^worker: has drake 1\.0$"):
        Jobs(requests(3)).run(Threads(), perform, lambda *_: None)


def test_an_interrupt_keeps_what_had_come():
    found = []

    def take(request, record):
        found.append(request)
        if len(found) == 4:
            raise KeyboardInterrupt

    assert not Jobs(requests(20)).run(ThisProcess(), Runs(), take)
    assert len(found) == 4


def test_a_record_of_an_interrupted_run_ends_all_and_is_not_stored(tmp_path):
    def perform(batch):
        return [RunRecord("interrupted" if batch[0].key == "2" else "complete")]

    store = RecordStore(tmp_path)
    jobs = Jobs(requests(5), store)
    assert not jobs.run(ThisProcess(), perform)
    assert [request.key for request in jobs.missing] == ["3", "4"]
    assert store.all_keys() == ["0", "1"]
    later = Jobs(requests(5), store)
    assert (later.kept, [request.key for request in later.missing]) == (2, ["2", "3", "4"])
    assert later.run(ThisProcess(), Runs())
    assert store.all_keys() == ["0", "1", "2", "3", "4"]


@pytest.mark.parametrize(
    ("ends", "told"), [("210", ["0", "1", "2"]), ("02", ["0", "2"]), ("21", ["1", "2"])]
)
def test_records_are_told_in_the_order_of_their_requests(ends, told):
    """Those that are left at the end although one before them is missing, too."""
    found, records = [], {}
    order = InOrder(requests(3), records, lambda request, _: found.append(request.key))
    for key in ends:
        records[key] = RunRecord("complete")
        order.take()
        assert found == [str(k) for k in range(len(found))]
    order.finish()
    assert found == told


def test_in_this_process_a_fault_of_the_function_is_raised_as_it_is():
    def perform(batch):
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        Jobs(requests(3)).run(ThisProcess(), perform, lambda *_: None)


def test_processes_that_end_as_they_start_are_lost_at_once(tmp_path, monkeypatch):
    """Each imports the script that started it, which here runs on without a guard."""
    script = tmp_path / "script.py"
    script.write_text("raise SystemExit(1)")
    monkeypatch.setattr(sys.modules["__main__"], "__file__", str(script), raising=False)
    monkeypatch.setattr(sys.modules["__main__"], "__spec__", None)
    taken = []
    with pytest.raises(LostWorkersError, match="__main__"):
        Jobs(requests(4)).run(Processes(1), len, lambda *record: taken.append(record), 4)
    assert not taken

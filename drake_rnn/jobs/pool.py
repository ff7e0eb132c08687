"""Workers: this process, processes of this machine, a Dask cluster or any executor.

Requests go in, in tasks that workers carry out, and records come out as runs end.
"""

from __future__ import annotations

import json
import logging
import os
import re
import signal
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Future, ProcessPoolExecutor, wait
from contextlib import suppress
from functools import partial
from math import ceil
from multiprocessing import active_children, get_context
from multiprocessing.connection import Connection
from queue import Empty, SimpleQueue
from time import monotonic
from typing import Any, Protocol

from ..errors import DrakeRnnError, InvalidInputError
from ..inputs.kinds import describe
from ..inputs.packages import import_extra
from ..inputs.processes import begin, deaf_children
from .requests import Perform, RecordStore, RunRecord, RunRequest, unique_requests


class Handle(Protocol):
    """The future result of a task, as `concurrent.futures` or Dask return it."""

    def result(self) -> Any:
        """Return the result of the task, or raise its error."""

    def add_done_callback(self, fn: Callable[[Any], object]) -> Any:
        """Register a function to call when the task is done, in any thread."""

    def cancel(self) -> Any:
        """Cancel the task if it has not begun."""


class Executor(Protocol):
    """An object to which tasks can be submitted."""

    def submit(self, fn: Callable[..., Any], /, *args: Any) -> Any:
        """Submit a task, and return a `Handle` of its result."""


class LostWorkersError(DrakeRnnError):
    """A cluster or an executor is lost, or cannot carry out tasks."""


class Workers:
    """An executor, and how it reports crashes and losses.

    Args:
        executor: Any executor whose futures have ``result`` and ``add_done_callback``.
        slots: Number of tasks that are handed over at a time.

    Attributes:
        deaths: Errors that a future raises if the worker of its task has crashed.
        losses: Errors that a future raises if the executor itself is lost.
        attempts: Number of crashes after which a run is said to kill its worker.
    """

    deaths: tuple[type[BaseException], ...] = ()
    losses: tuple[type[BaseException], ...] = (BrokenExecutor, CancelledError)
    attempts: int = 3

    def __init__(self, executor: Executor, slots: int | None = None) -> None:
        self._executor = executor
        self._slots = slots or 2 * (os.cpu_count() or 1)

    @property
    def slots(self) -> int:
        """Number of tasks that are handed over at a time."""
        return self._slots

    def submit(self, task: Callable[..., Any], *arguments: Any) -> Handle:
        """Submit a task, and return a handle of its result."""
        handle: Handle = self._executor.submit(task, *arguments)
        return handle

    def why_lost(self) -> str:
        """Return why no further results can arrive; empty while they can."""
        return ""

    def interrupt(self, running: Sequence[Any]) -> None:
        """Let running tasks end early, and wait for them, if they can end so with a record."""

    def stop(self) -> None:
        """Stop the running tasks, as far as the executor can."""


class ThisProcess(Workers):
    """This process itself: a task is done when it is submitted.

    All classes known here can be used, but a run that crashes ends the whole campaign. A fault in
    the function that carries out tasks is raised as it is.
    """

    def __init__(self) -> None:
        super().__init__(self, 1)

    def submit(self, task: Callable[..., Any], *arguments: Any) -> Handle:
        """Carry out a task, and return a handle of its result."""
        future: Future[Any] = Future()
        try:
            future.set_result(task(*arguments))
        except DrakeRnnError as error:
            future.set_exception(error)
        return future


class Processes(Workers):
    """Processes of this machine, each for one task at a time.

    If a process crashes, its task is known and another process takes its place. All of them end
    with this process, however it ends.

    Args:
        jobs: Number of processes.
        deaf: Whether they leave Ctrl-C, which in a terminal reaches all processes, to this one;
            otherwise it ends those whose task does not say better, a task that is interrupted ends
            with a record of what it had, and none is tried again.
    """

    deaths = (BrokenExecutor,)
    losses = ()

    def __init__(self, jobs: int, deaf: bool = True) -> None:
        super().__init__(self, jobs)
        self._deaf = deaf
        self.attempts = Workers.attempts if deaf else 1
        # Drake has started threads, which a forked process would not inherit.
        self._context = get_context("spawn")
        self._idle: list[ProcessPoolExecutor] = []
        self._pools: list[ProcessPoolExecutor] = []
        self._lifelines: list[Connection] = []
        try:
            self._any_began = self._context.Event()
        except OSError as error:
            raise InvalidInputError(
                f"processes: cannot be started: {error.strerror}, in /dev/shm"
            ) from None
        self._any_died, self._is_stopped = False, False

    def submit(self, task: Callable[..., Any], *arguments: Any) -> Handle:
        """Submit a task, and return a handle of its result."""
        while self._idle:
            process = self._idle.pop()
            try:
                return self._submit(process, task, *arguments)
            except BrokenExecutor:
                # The process ended while it was idle.
                continue
        return self._submit(self._start(), task, *arguments)

    def why_lost(self) -> str:
        """Return why no further results can arrive: processes end before they begin to work."""
        if self._any_began.is_set() or not self._any_died:
            return ""
        return (
            "its processes end as soon as they start; each imports the script that started them, "
            'so what the script runs must stand below `if __name__ == "__main__":`'
        )

    def interrupt(self, running: Sequence[Any]) -> None:
        """Interrupt processes that are not deaf, and wait until their tasks have ended."""
        while not self._deaf and wait(running, timeout=_INTERRUPT_AGAIN).not_done:
            for child in active_children():
                if child.pid is not None:
                    os.kill(child.pid, signal.SIGINT)

    def stop(self) -> None:
        """Stop all processes at once, also those with a task."""
        self._is_stopped = True
        for lifeline in self._lifelines:
            lifeline.close()
        # If this process ended while the thread of a pool does, Python would print a traceback.
        until = monotonic() + _FAREWELL
        for pool in self._pools:
            if (thread := vars(pool).get("_executor_manager_thread")) is not None:
                thread.join(max(until - monotonic(), 0.0))
        self._lifelines, self._idle, self._pools = [], [], []

    def _submit(
        self, process: ProcessPoolExecutor, task: Callable[..., Any], *arguments: Any
    ) -> Future[Any]:
        with deaf_children():
            future = process.submit(task, *arguments)
        future.add_done_callback(partial(self._back, process))
        return future

    def _back(self, process: ProcessPoolExecutor, future: Future[Any]) -> None:
        # A pool whose process died ends by itself. It must not be shut down here: Python 3.12 calls
        # this while it holds the lock that a shutdown waits for.
        if future.cancelled() or not isinstance(future.exception(), BrokenExecutor):
            self._idle.append(process)
        else:
            self._any_died = True

    def _start(self) -> ProcessPoolExecutor:
        end, lifeline = self._context.Pipe(duplex=False)
        self._lifelines.append(lifeline)
        # One process per pool: a larger pool loses all its tasks if one process crashes.
        pool = ProcessPoolExecutor(1, self._context, begin, (end, self._any_began, self._deaf))
        self._pools.append(pool)
        # A thread of the pool may still send to a process that was stopped, of which Python would
        # print a traceback. It offers no other way to leave that out.
        queue: Any = vars(pool).get("_call_queue")
        with suppress(AttributeError):
            tell = queue._on_queue_feeder_error
            queue._on_queue_feeder_error = partial(self._tell_unless_stopped, tell)
        return pool

    def _tell_unless_stopped(self, tell: Callable[..., None], *arguments: Any) -> None:
        if not self._is_stopped:
            tell(*arguments)


def processes_of(jobs: int) -> Workers:
    """Return a number of processes on this machine as workers; for 0, this process itself."""
    return Processes(jobs) if jobs > 0 else ThisProcess()


#: Time after which a process is interrupted again, in case it was not ready [s].
_INTERRUPT_AGAIN = 0.5
#: Longest time to wait for what is left of processes that were stopped [s].
_FAREWELL = 2.0
#: Longest time to wait for a scheduler [s].
_PATIENCE = 10.0
#: Tasks handed over for each thread of the cluster: one that runs, and the one to run next.
_AHEAD = 2
#: Time after which the threads of the cluster are counted again [s].
_COUNT_AGAIN = 2.0


def cluster_at(address: str) -> DaskWorkers:
    """Return the workers of the cluster whose scheduler listens at an address.

    Args:
        address: The address, e.g. ``tcp://10.0.0.1:8786``.

    Raises:
        InvalidInputError: If Dask is not installed, or no scheduler answers.
    """
    require_address(address)
    dask = _dask()
    # Dask logs at length what the message below says in one sentence.
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
    try:
        client = dask.Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, TimeoutError, ValueError, TypeError) as error:
        text = " ".join(str(error).split()) or type(error).__name__
        raise InvalidInputError(f"--scheduler: no scheduler answers at {address}: {text}") from None
    return DaskWorkers(client, is_own=True)


def require_address(address: str) -> None:
    """Raise an InvalidInputError unless a text is the address of a scheduler."""
    if not re.fullmatch(r"([a-z]+://)?\S+:\d+", str(address)):
        raise InvalidInputError(
            f"--scheduler: must be an address such as tcp://10.0.0.1:8786, not {address!r}"
        )


class DaskWorkers(Workers):
    """The workers of a Dask cluster.

    Args:
        client: A client of the cluster, ``dask.distributed.Client``.
        is_own: Whether to close the client when the campaign ends.
    """

    # The scheduler itself tries several workers before it gives up a task.
    attempts = 2

    def __init__(self, client: Any, is_own: bool = False) -> None:
        super().__init__(client)
        dask = _dask()
        self._client = client
        self._owned = is_own
        self._address = client.scheduler.address
        self._counted, self._threads = -_COUNT_AGAIN, 1
        self.deaths = (dask.KilledWorker,)
        self.losses = (CancelledError, dask.comm.CommClosedError)

    @property
    def slots(self) -> int:
        """Number of tasks that are handed over at a time; workers may come and go."""
        if monotonic() - self._counted > _COUNT_AGAIN and not self.why_lost():
            # If the scheduler is lost meanwhile, the running tasks report it.
            with suppress(OSError, TimeoutError):
                self._threads = sum(self._client.nthreads().values())
            self._counted = monotonic()
        return _AHEAD * max(self._threads, 1)

    def submit(self, task: Callable[..., Any], *arguments: Any) -> Handle:
        """Submit a task, and return a handle of its result."""
        # Not pure: Dask must carry out a retried request again.
        handle: Handle = self._client.submit(task, *arguments, pure=False)
        return handle

    def why_lost(self) -> str:
        """Return why no further results can arrive; empty while they can."""
        if self._client.status == "running":
            return ""
        return f"the scheduler at {self._address} is lost"

    def stop(self) -> None:
        """Close the client, if this object owns it."""
        if self._owned:
            self._client.close(timeout=_PATIENCE)


def workers_of(executor: Any) -> Workers:
    """Return an executor as `Workers`.

    Args:
        executor: `Workers`, a client of Dask, or anything with ``submit`` whose futures have
            ``result`` and ``add_done_callback``.

    Raises:
        InvalidInputError: If it has no ``submit``.
    """
    if isinstance(executor, Workers):
        return executor
    if type(executor).__module__.partition(".")[0] == "distributed":
        return DaskWorkers(executor)
    if not any("submit" in vars(cls) for cls in type(executor).__mro__):
        raise InvalidInputError(
            f"executor: must have a method submit; {type(executor).__name__} has none"
        )
    return Workers(executor)


def _dask() -> Any:
    """Return Dask's package ``distributed``, an optional dependency."""
    (dask,) = import_extra("--scheduler", "cluster", "distributed")
    return dask


#: Called with each request and its record, when the record arrives.
Take = Callable[[RunRequest, RunRecord], None]

# Time between two checks of whether the workers are still alive [s].
_LOOK = 0.5


class Jobs:
    """Requests, and the records that they have so far.

    Args:
        requests: The requests.
        store: Store of the records; None to keep them in memory alone.
        again: Whether to retry runs whose worker crashed.

    Attributes:
        requests: The requests, of those with the same key one.
        records: The records by key.
        kept: Number of records that the store held before.
    """

    def __init__(
        self, requests: Sequence[RunRequest], store: RecordStore | None = None, again: bool = False
    ) -> None:
        self.requests = unique_requests(requests)
        self._store = store
        self.records = {} if store is None else store.records(self.requests, again)
        self.kept = len(self.records)
        self._running: dict[Handle, Sequence[RunRequest]] = {}
        self._done: SimpleQueue[Handle] = SimpleQueue()
        self._suspects: deque[Sequence[RunRequest]] = deque()
        self._deaths: dict[str, int] = {}

    @property
    def missing(self) -> list[RunRequest]:
        """The requests without a record."""
        return [request for request in self.requests if request.key not in self.records]

    def run(
        self,
        workers: Workers,
        perform: Perform,
        take: Take = lambda request, record: None,
        batch: int | None = None,
    ) -> bool:
        """Carry out what is missing; return whether all was, False if it was interrupted.

        A task whose worker crashes is halved. The halves are retried when all other tasks have
        ended, one at a time, so that they cannot crash the worker of another run. After a few
        crashes, the last of them alone in its worker, the record of a request is that it killed its
        worker.

        Args:
            workers: Workers that carry out the tasks. They are stopped at the end.
            perform: Function that carries out a task, and that can be sent to the workers.
            take: Called with each request and its record, after it was stored, in the order in
                which records arrive.
            batch: Number of requests in every task; by default it follows from the requests.

        Raises:
            LostWorkersError: If the workers are lost. Records that have arrived are taken first.
            DrakeRnnError: If a worker refuses to work.
        """
        waiting = deque(tasks_of(self.missing, workers.slots, batch))
        try:
            while waiting or self._running or self._suspects:
                while waiting and len(self._running) < workers.slots:
                    self._submit(waiting.popleft(), workers, perform)
                if not self._running:
                    self._submit(self._suspects.popleft(), workers, perform)
                self._wait(workers, take)
        except KeyboardInterrupt:
            self._cancel(workers, take)
            return False
        finally:
            self._running.clear()
            workers.stop()
        return True

    def _submit(self, task: Sequence[RunRequest], workers: Workers, perform: Perform) -> None:
        try:
            handle = workers.submit(perform, list(task))
        except workers.losses as error:
            raise LostWorkersError(f"the workers are lost: {describe(error)}") from error
        self._running[handle] = task
        handle.add_done_callback(self._done.put)

    def _wait(self, workers: Workers, take: Take) -> None:
        """Wait for the next records, and take them."""
        try:
            handle = self._done.get(timeout=_LOOK)
        except Empty:
            if reason := workers.why_lost():
                raise LostWorkersError(reason) from None
            return
        task = self._running.pop(handle)
        try:
            records = _records_of(handle, workers)
        except workers.deaths as error:
            records = self._count_crash(task, error, workers)
            task = task[: len(records)]
        self._take(task, records, take)
        if any(record.status == "interrupted" for record in records):
            raise KeyboardInterrupt

    def _take(self, task: Sequence[RunRequest], records: Sequence[RunRecord], take: Take) -> None:
        for request, record in zip(task, records, strict=True):
            if self._store is not None and record.status != "interrupted":
                self._store.put(request, record)
            self.records[request.key] = record
            take(request, record)

    def _count_crash(
        self, task: Sequence[RunRequest], error: BaseException, workers: Workers
    ) -> list[RunRecord]:
        """Count a crash of a task's worker; return its record if it is not to be retried."""
        if reason := workers.why_lost():
            raise LostWorkersError(reason) from error
        for request in task:
            self._deaths[request.key] = self._deaths.get(request.key, 0) + 1
        if len(task) > 1:
            middle = len(task) // 2
            self._suspects.extend((task[:middle], task[middle:]))
            return []
        if (deaths := self._deaths[task[0].key]) < workers.attempts:
            self._suspects.append(task)
            return []
        failure = f"its worker died {deaths} times, the last time alone: {describe(error)}"
        return [RunRecord("killed its worker", failure)]

    def _cancel(self, workers: Workers, take: Take) -> None:
        """Cancel the tasks that have not begun, and take what those that can be interrupted had."""
        for handle in self._running:
            handle.cancel()
        workers.interrupt(list(self._running))
        for handle, task in self._running.items():
            # A process that had not begun has ended at once, and has no record.
            if isinstance(handle, Future) and handle.done() and not _has_failed(handle):
                self._take(task, handle.result(), take)


def _records_of(handle: Handle, workers: Workers) -> Sequence[RunRecord]:
    errors: tuple[type[BaseException], ...] = (*workers.deaths, DrakeRnnError)
    try:
        records: Sequence[RunRecord] = handle.result()
    except errors:
        raise
    except workers.losses as error:
        reason = workers.why_lost() or f"the workers are lost: {describe(error)}"
        raise LostWorkersError(reason) from error
    # Errors of runs are records, so this task could not be sent or read.
    except Exception as error:
        raise LostWorkersError(f"a worker cannot do its task: {describe(error)}") from error
    return records


def _has_failed(future: Future[Any]) -> bool:
    return future.cancelled() or future.exception() is not None


class InOrder:
    """Tells of records in the order of their requests, whichever end first.

    Args:
        requests: The requests.
        records: The records by key, those of `Jobs`, to which others are added.
        tell: Called with each request and its record.
    """

    def __init__(
        self, requests: Sequence[RunRequest], records: Mapping[str, RunRecord], tell: Take
    ) -> None:
        self._untold, self._records, self._tell = deque(requests), records, tell
        self.take()

    def take(self, *newest: Any) -> None:
        """Tell of all records whose turn it is, after the newest was added."""
        while self._untold and self._untold[0].key in self._records:
            request = self._untold.popleft()
            self._tell(request, self._records[request.key])

    def finish(self) -> None:
        """Tell of the records that are left, although records before them are missing."""
        self._untold = deque(each for each in self._untold if each.key in self._records)
        self.take()


# Rows of a batch: larger batches are no cheaper per row, and smaller ones save nothing.
_MOST, _FEWEST = 1000, 100
# Robot-steps of a batch, so that rows are kept and progress is shown about every half minute.
_STEPS = 2e7


def tasks_of(
    requests: Sequence[RunRequest], slots: int, batch: int | None = None
) -> list[list[RunRequest]]:
    """Return requests as tasks: one task for each simulated one, and batches of the others.

    Args:
        requests: The requests.
        slots: Number of tasks that are carried out at a time.
        batch: Number of requests in every task; by default it follows from the requests.
    """
    if batch is not None:
        return _cut(list(requests), batch)
    # Only robots of one kind run side by side, so batches are made of requests of one kind.
    together = sorted((each for each in requests if each.method == "batch"), key=kind_of)
    size = 1
    if together:
        count = min(_STEPS / max(each.effort for each in together), len(together) / slots)
        size = min(max(ceil(count), _FEWEST), _MOST)
    alone = [[each] for each in requests if each.method != "batch"]
    return [*_cut(together, size), *alone]


def _cut(requests: list[RunRequest], size: int) -> list[list[RunRequest]]:
    return [requests[k : k + size] for k in range(0, len(requests), size)]


#: Keys that tell whether robots may run side by side, but for their numbers; those before others
#: that always keep robots apart, for the tasks are cut from requests that are sorted by them.
_TELLING = (
    *("law", "period", "duration", "task", "filter", "feedback"),
    *("sensing", "dither", "disturbance", "arm"),
)


def kind_of(request: RunRequest) -> str:
    """Return a text that is equal for requests whose robots may run side by side."""
    sections = {key: request.document.get(key) for key in _TELLING}
    kinds = [
        _without_numbers(sections[key]) if key != "period" else sections[key] for key in _TELLING
    ]
    return json.dumps(kinds, sort_keys=True)


def _without_numbers(value: Any) -> Any:
    """Return plain data with 0.0 for each number that is not whole."""
    if isinstance(value, Mapping):
        return {str(key): _without_numbers(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [_without_numbers(entry) for entry in value]
    return 0.0 if isinstance(value, float) else value if isinstance(value, (str, int)) else None

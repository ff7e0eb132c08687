"""Workers that carry out tasks: this process, processes of this machine, or any executor."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, CancelledError, Future, ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any, Protocol

from ..errors import DrakeRnnError
from ..inputs.lifeline import begin, deaf_children


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

    def lost(self) -> str:
        """Return why no further results can arrive; empty while they can."""
        return ""

    def stop(self) -> None:
        """Stop the running tasks, as far as the executor can."""


class ThisProcess(Workers):
    """This process itself: a task is done when it is submitted.

    All classes known here can be used, but a run that crashes ends the whole campaign.
    """

    def __init__(self) -> None:
        super().__init__(self, 1)

    def submit(self, task: Callable[..., Any], *arguments: Any) -> Handle:
        """Carry out a task, and return a handle of its result."""
        future: Future[Any] = Future()
        try:
            future.set_result(task(*arguments))
        except Exception as error:
            future.set_exception(error)
        return future


class Processes(Workers):
    """Processes of this machine, each for one task at a time.

    If a process crashes, its task is known and another process takes its place. All of them end
    with this process, however it ends.

    Args:
        jobs: Number of processes.
        deaf: Whether they leave Ctrl-C, which in a terminal reaches all processes, to this one;
            otherwise it ends those whose task does not say better.
    """

    deaths = (BrokenExecutor,)
    losses = ()

    def __init__(self, jobs: int, deaf: bool = True) -> None:
        super().__init__(self, jobs)
        self._deaf = deaf
        # Drake has started threads, which a forked process would not inherit.
        self._context = get_context("spawn")
        self._idle: list[ProcessPoolExecutor] = []
        self._lifelines: list[Connection] = []
        self._any_began = self._context.Event()
        self._any_died = False

    def submit(self, task: Callable[..., Any], *arguments: Any) -> Handle:
        """Submit a task, and return a handle of its result."""
        while self._idle:
            process = self._idle.pop()
            try:
                return self._handed(process, task, *arguments)
            except BrokenExecutor:
                # The process ended while it was idle.
                continue
        return self._handed(self._started(), task, *arguments)

    def lost(self) -> str:
        """Return why no further results can arrive: processes end before they begin to work."""
        if self._any_began.is_set() or not self._any_died:
            return ""
        return (
            "its processes end as soon as they start; each imports the script that started them, "
            'so what the script runs must stand below `if __name__ == "__main__":`'
        )

    def stop(self) -> None:
        """Stop all processes at once, also those with a task."""
        for lifeline in self._lifelines:
            lifeline.close()
        self._lifelines, self._idle = [], []

    def _handed(
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

    def _started(self) -> ProcessPoolExecutor:
        end, lifeline = self._context.Pipe(duplex=False)
        self._lifelines.append(lifeline)
        # One process per pool: a larger pool loses all its tasks if one process crashes.
        return ProcessPoolExecutor(1, self._context, begin, (end, self._any_began, self._deaf))

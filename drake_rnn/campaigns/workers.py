"""Where tasks are carried out: this process, processes of this machine, or any executor."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, CancelledError, Future, ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from multiprocessing.connection import Connection
from threading import Thread
from typing import Any, Protocol

from ..errors import DrakeRnnError


class Handle(Protocol):
    """What comes of a task, as a future of `concurrent.futures`, of Dask or of others."""

    def result(self) -> Any:
        """Return what the task has returned, or raise what it has raised."""

    def add_done_callback(self, fn: Callable[[Any], object]) -> Any:
        """Let a function be called when the task is done, in whatever thread."""

    def cancel(self) -> Any:
        """Take the task back if it has not begun."""


class Executor(Protocol):
    """What tasks can be submitted to."""

    def submit(self, fn: Callable[..., Any], /, *args: Any) -> Any:
        """Return a `Handle` of what comes of a task."""


class LostWorkersError(DrakeRnnError):
    """A cluster or an executor that is there no more, or that cannot carry out tasks."""


class Workers:
    """An executor, with what must be known of it beyond ``submit``.

    Args:
        executor: Any executor whose futures have ``result`` and ``add_done_callback``.
        slots: Number of tasks that are handed over at a time.

    Attributes:
        deaths: What the future of a task raises whose worker has died.
        losses: What a future raises when the executor itself is lost.
        attempts: Times that a run may lose its worker before it is named as what kills it.
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
        """Return a handle of what comes of a task."""
        handle: Handle = self._executor.submit(task, *arguments)
        return handle

    def lost(self) -> str:
        """Return why no more can come of tasks; empty as long as it can."""
        return ""

    def stop(self) -> None:
        """Stop what is being carried out, as far as that can be done."""


class ThisProcess(Workers):
    """This process itself: a task is done when it is submitted.

    It knows all classes that are known here, but what kills it kills all.
    """

    def __init__(self) -> None:
        super().__init__(self, 1)

    def submit(self, task: Callable[..., Any], *arguments: Any) -> Handle:
        """Return a handle of what has come of a task."""
        future: Future[Any] = Future()
        try:
            future.set_result(task(*arguments))
        except Exception as error:
            future.set_exception(error)
        return future


class Processes(Workers):
    """Processes of this machine, each for one task at a time.

    If one dies, the task that it had is known, and another one takes its place. They end with this
    process, however it ends.

    Args:
        jobs: Number of processes.
    """

    deaths = (BrokenExecutor,)
    losses = ()

    def __init__(self, jobs: int) -> None:
        super().__init__(self, jobs)
        self._idle: list[ProcessPoolExecutor] = []
        self._lifelines: list[Connection] = []

    def submit(self, task: Callable[..., Any], *arguments: Any) -> Handle:
        """Return a handle of what comes of a task."""
        while self._idle:
            process = self._idle.pop()
            try:
                return self._handed(process, task, *arguments)
            except BrokenExecutor:
                # It died while it had nothing to do.
                continue
        return self._handed(self._started(), task, *arguments)

    def stop(self) -> None:
        """Stop all processes at once, whatever they are at."""
        for lifeline in self._lifelines:
            lifeline.close()
        self._lifelines, self._idle = [], []

    def _handed(
        self, process: ProcessPoolExecutor, task: Callable[..., Any], *arguments: Any
    ) -> Future[Any]:
        future = process.submit(task, *arguments)
        future.add_done_callback(partial(self._back, process))
        return future

    def _back(self, process: ProcessPoolExecutor, future: Future[Any]) -> None:
        # A pool whose process died ends by itself. It must not be shut down here: Python 3.12 calls
        # this while it holds the lock that a shutdown waits for.
        if future.cancelled() or not isinstance(future.exception(), BrokenExecutor):
            self._idle.append(process)

    def _started(self) -> ProcessPoolExecutor:
        # Drake has started threads, which a forked process would not inherit.
        context = get_context("spawn")
        end, lifeline = context.Pipe(duplex=False)
        self._lifelines.append(lifeline)
        # Pools of one: of a larger one, all tasks are lost with any of its processes.
        return ProcessPoolExecutor(1, context, _begin, (end,))


def _begin(lifeline: Connection) -> None:
    # Ctrl-C in a terminal reaches all processes; the first one decides what it means.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_end_with, args=(lifeline,), daemon=True).start()


def _end_with(lifeline: Connection) -> None:
    """End this process when the other end of a pipe is closed, or its process has ended."""
    try:
        lifeline.recv()
    except (EOFError, OSError):
        os._exit(1)

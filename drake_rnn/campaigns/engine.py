"""The engine of sweeps and campaigns: orders go in, and outcomes come out as runs end."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from queue import Empty, SimpleQueue

from ..errors import DrakeRnnError
from ..inputs.own_code import described
from .outcome import Order, Outcome
from .perform import Perform
from .workers import Handle, LostWorkersError, Workers

#: Called with each order and its outcome, when the outcome arrives.
Take = Callable[[Order, Outcome], None]

# Time between two checks of whether the workers are still alive [s].
_LOOK = 0.5


def carry_out(
    tasks: Sequence[Sequence[Order]], perform: Perform, workers: Workers, take: Take
) -> bool:
    """Carry out orders; return whether all were carried out, False if the user interrupted.

    A task whose worker crashes is halved. The halves are retried when all other tasks have ended,
    one at a time, so that they cannot crash the worker of another run. After a few crashes, the
    last of them alone in its worker, an order's outcome is that it killed its worker.

    Args:
        tasks: The orders, each once, in lists that are handed over as a whole.
        perform: Function that carries out a task, and that can be sent to the workers.
        workers: Workers that carry out the tasks.
        take: Called with each order and its outcome, in the order in which outcomes arrive.

    Raises:
        LostWorkersError: If the workers are lost. Outcomes that have arrived are taken first.
        DrakeRnnError: If a worker refuses to work.
    """
    engine = _Engine(perform, workers, take)
    try:
        engine.run(tasks)
    except KeyboardInterrupt:
        engine.cancel()
        return False
    finally:
        workers.stop()
    return True


class _Engine:
    """The tasks of one campaign on their way."""

    def __init__(self, perform: Perform, workers: Workers, take: Take) -> None:
        self._perform = perform
        self._workers = workers
        self._take = take
        self._running: dict[Handle, Sequence[Order]] = {}
        self._done: SimpleQueue[Handle] = SimpleQueue()
        self._suspects: deque[Sequence[Order]] = deque()
        self._deaths: dict[str, int] = {}

    def run(self, tasks: Sequence[Sequence[Order]]) -> None:
        """Carry out tasks, and then the orders whose worker crashed."""
        waiting = deque(tasks)
        while waiting or self._running or self._suspects:
            while waiting and len(self._running) < self._workers.slots:
                self._submit(waiting.popleft())
            if not self._running:
                self._submit(self._suspects.popleft())
            self._wait()

    def cancel(self) -> None:
        """Cancel the tasks that have not begun, as far as the executor can."""
        for handle in self._running:
            handle.cancel()

    def _submit(self, task: Sequence[Order]) -> None:
        try:
            handle = self._workers.submit(self._perform, list(task))
        except self._workers.losses as error:
            raise LostWorkersError(f"the workers are lost: {described(error)}") from error
        self._running[handle] = task
        handle.add_done_callback(self._done.put)

    def _wait(self) -> None:
        """Wait for the next outcomes, and take them."""
        try:
            handle = self._done.get(timeout=_LOOK)
        except Empty:
            if reason := self._workers.lost():
                raise LostWorkersError(reason) from None
            return
        task = self._running.pop(handle)
        try:
            outcomes = handle.result()
        except self._workers.deaths as error:
            self._count_crash(task, error)
            return
        except self._workers.losses as error:
            reason = self._workers.lost() or f"the workers are lost: {described(error)}"
            raise LostWorkersError(reason) from error
        except DrakeRnnError:
            raise
        # Errors of runs are outcomes, so this task could not be sent or read.
        except Exception as error:
            raise LostWorkersError(f"a worker cannot do its task: {described(error)}") from error
        for order, outcome in zip(task, outcomes, strict=True):
            self._take(order, outcome)

    def _count_crash(self, task: Sequence[Order], error: BaseException) -> None:
        """Count a crash of a task's worker, and decide whether to retry its orders."""
        if reason := self._workers.lost():
            raise LostWorkersError(reason) from error
        for order in task:
            self._deaths[order.key] = self._deaths.get(order.key, 0) + 1
        if len(task) > 1:
            middle = len(task) // 2
            self._suspects.extend((task[:middle], task[middle:]))
            return
        (order,) = task
        if (deaths := self._deaths[order.key]) < self._workers.attempts:
            self._suspects.append(task)
            return
        failure = f"its worker died {deaths} times, the last time alone: {described(error)}"
        self._take(order, Outcome("killed its worker", failure))

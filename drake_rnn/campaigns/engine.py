"""The engine of sweeps and campaigns: orders in, outcomes out as they come, whatever happens."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from queue import Empty, SimpleQueue

from ..errors import DrakeRnnError
from ..inputs.own_code import described
from .outcome import Order, Outcome
from .perform import Perform
from .workers import Handle, LostWorkersError, Workers

#: What is done with an outcome when it is there.
Take = Callable[[Order, Outcome], None]

# Time after which it is looked whether the workers are still there [s].
_LOOK = 0.5


def carry_out(
    tasks: Sequence[Sequence[Order]], perform: Perform, workers: Workers, take: Take
) -> bool:
    """Carry out orders; return whether all were, or False if the user has interrupted it.

    A task whose worker dies is halved, and its parts are tried again when all others are done, one
    at a time with nothing beside them, so that they cost no other run its worker. After a few
    deaths, the last one of them alone, an order's outcome is that it killed its worker.

    Args:
        tasks: The orders, each once, in lists that are handed over as a whole.
        perform: What carries out a task, a function that can be sent to the workers.
        workers: Where it is carried out.
        take: Called with each order and its outcome, in the order in which they come.

    Raises:
        LostWorkersError: If the workers are there no more. What has come is taken.
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
        """Carry out tasks, and then what has lost its worker."""
        waiting = deque(tasks)
        while waiting or self._running or self._suspects:
            while waiting and len(self._running) < self._workers.slots:
                self._submit(waiting.popleft())
            if not self._running:
                self._submit(self._suspects.popleft())
            self._wait()

    def cancel(self) -> None:
        """Take back what has not begun, as far as that can be done."""
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
        """Take what has come, once there is something."""
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
            self._mourn(task, error)
            return
        except self._workers.losses as error:
            reason = self._workers.lost() or f"the workers are lost: {described(error)}"
            raise LostWorkersError(reason) from error
        except DrakeRnnError:
            raise
        # What runs raise are outcomes: a task cannot be sent, or not be read where it arrives.
        except Exception as error:
            raise LostWorkersError(f"a worker cannot do its task: {described(error)}") from error
        for order, outcome in zip(task, outcomes, strict=True):
            self._take(order, outcome)

    def _mourn(self, task: Sequence[Order], error: BaseException) -> None:
        """Note that a task has lost its worker."""
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

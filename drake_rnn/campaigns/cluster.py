"""Workers of a Dask cluster, on this machine or on many."""

from __future__ import annotations

import logging
import re
from collections.abc import Callable
from concurrent.futures import CancelledError
from contextlib import suppress
from time import monotonic
from typing import Any

from ..errors import InvalidInputError
from ..inputs.extras import needed
from .workers import Handle, Workers

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
    distributed = _dask()
    # Dask logs at length what the message below says in one sentence.
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
    try:
        client = distributed.Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, TimeoutError, ValueError, TypeError) as error:
        told = " ".join(str(error).split()) or type(error).__name__
        raise InvalidInputError(f"--scheduler: no scheduler answers at {address}: {told}") from None
    return DaskWorkers(client, owned=True)


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
        owned: Whether to close the client when the campaign ends.
    """

    # The scheduler itself tries several workers before it gives up a task.
    attempts = 2

    def __init__(self, client: Any, owned: bool = False) -> None:
        super().__init__(client)
        distributed = _dask()
        self._client = client
        self._owned = owned
        self._address = client.scheduler.address
        self._counted, self._threads = -_COUNT_AGAIN, 1
        self.deaths = (distributed.KilledWorker,)
        self.losses = (CancelledError, distributed.comm.CommClosedError)

    @property
    def slots(self) -> int:
        """Number of tasks that are handed over at a time; workers may come and go."""
        if monotonic() - self._counted > _COUNT_AGAIN and not self.lost():
            # If the scheduler is lost meanwhile, the running tasks report it.
            with suppress(OSError, TimeoutError):
                self._threads = sum(self._client.nthreads().values())
            self._counted = monotonic()
        return _AHEAD * max(self._threads, 1)

    def submit(self, task: Callable[..., Any], *arguments: Any) -> Handle:
        """Submit a task, and return a handle of its result."""
        # Not pure: Dask must carry out a retried order again.
        handle: Handle = self._client.submit(task, *arguments, pure=False)
        return handle

    def lost(self) -> str:
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
    (distributed,) = needed("--scheduler", "cluster", "distributed")
    return distributed

"""How orders are cut into tasks, each of which a worker is handed as a whole."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil

from .outcome import Order

# Rows of a batch: beyond these it gets no cheaper, and below it is not worth being one.
_MOST, _FEWEST = 1000, 100
# Robot-steps of a batch, so that rows are kept, and progress seen, every half a minute or so.
_STEPS = 2e7


def tasks_of(orders: Sequence[Order], slots: int, batch: int | None = None) -> list[list[Order]]:
    """Return orders as tasks: each alone that is simulated, and batches of the others.

    Args:
        orders: The orders.
        slots: Number of tasks that are carried out at a time.
        batch: Number of orders in a task, whatever they are; by default as is best.
    """
    if batch is not None:
        return _cut(list(orders), batch)
    together = [order for order in orders if order.method == "batch"]
    size = 1
    if together:
        wanted = min(_STEPS / max(map(_steps, together)), len(together) / slots)
        size = min(max(ceil(wanted), _FEWEST), _MOST)
    alone = [[order] for order in orders if order.method != "batch"]
    return [*_cut(together, size), *alone]


def _cut(orders: list[Order], size: int) -> list[list[Order]]:
    return [orders[k : k + size] for k in range(0, len(orders), size)]


def _steps(order: Order) -> float:
    document = order.document
    dither = document.get("dither") or {}
    step = min(document["period"], dither.get("hold", document["period"]))
    return max(1.0, float(document["duration"] / step))

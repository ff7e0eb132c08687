"""How orders are divided into tasks; a worker receives a task as a whole."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from math import ceil
from typing import Any

from .outcome import Order

# Rows of a batch: larger batches are no cheaper per row, and smaller ones save nothing.
_MOST, _FEWEST = 1000, 100
# Robot-steps of a batch, so that rows are kept and progress is shown about every half minute.
_STEPS = 2e7


def tasks_of(orders: Sequence[Order], slots: int, batch: int | None = None) -> list[list[Order]]:
    """Return orders as tasks: one task for each simulated order, and batches of the others.

    Args:
        orders: The orders.
        slots: Number of tasks that are carried out at a time.
        batch: Number of orders in every task; by default it follows from the orders.
    """
    if batch is not None:
        return _cut(list(orders), batch)
    # Only robots of one kind run side by side, so batches are made of orders of one kind.
    together = sorted((order for order in orders if order.method == "batch"), key=_kind)
    size = 1
    if together:
        wanted = min(_STEPS / max(map(_steps, together)), len(together) / slots)
        size = min(max(ceil(wanted), _FEWEST), _MOST)
    alone = [[order] for order in orders if order.method != "batch"]
    return [*_cut(together, size), *alone]


def _cut(orders: list[Order], size: int) -> list[list[Order]]:
    return [orders[k : k + size] for k in range(0, len(orders), size)]


#: Keys that tell whether robots may run side by side, but for their numbers; those before others
#: that always keep robots apart, for the tasks are cut from orders that are sorted by them.
_TELLING = (
    *("law", "period", "duration", "task", "filter", "feedback"),
    *("sensing", "dither", "disturbance", "arm"),
)


def _kind(order: Order) -> str:
    """Return a text that is equal for orders whose robots may run side by side."""
    known = {key: order.document.get(key) for key in _TELLING}
    kinds = [_without_numbers(known[key]) if key != "period" else known[key] for key in _TELLING]
    return json.dumps(kinds, sort_keys=True)


def _without_numbers(value: Any) -> Any:
    """Return plain data with 0.0 for each number that is not whole."""
    if isinstance(value, Mapping):
        return {str(key): _without_numbers(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [_without_numbers(entry) for entry in value]
    return 0.0 if isinstance(value, float) else value if isinstance(value, (str, int)) else None


def _steps(order: Order) -> float:
    document = order.document
    noise = document.get("dither") or document.get("disturbance") or {}
    step = min(document["period"], noise.get("hold", document["period"]))
    return max(1.0, float(document["duration"] / step))

"""Steps within a period whose number may differ between robots and may be unknown to a compiler."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from importlib import import_module
from math import ceil
from typing import Any

import numpy as np

from .algebra import functions_of
from .namespace import AnyArray

#: Parts of a state that change from step to step.
Parts = tuple[AnyArray, ...]

_most: ContextVar[int | None] = ContextVar("most", default=None)


def rounded_up(count: Any) -> Any:
    """Return a number of steps >= 1: an int, or an array of shape (..., 1) for an array."""
    # A rounding error above a whole number does not count.
    if isinstance(count, float):
        return max(1, ceil(count - 1e-9))
    xp = functions_of(count)
    return xp.maximum(1.0, xp.ceil(count - 1e-9))


def in_steps(
    advance: Callable[[Parts, Any, Any], Parts], parts: Parts, period: float, count: Any
) -> Parts:
    """Return parts of a state after a number of equal steps that fill a period.

    Args:
        advance: Returns the parts one step later, given the parts, the number of the step, from 0,
            and its length [s]. A step of length zero must change nothing.
        parts: The parts at the beginning.
        period: The period [s].
        count: Number of steps, an int, or one for each robot, shape (..., 1). A robot that has
            made its steps continues with steps of length zero until all robots have made theirs.
    """
    h = period / count
    if isinstance(count, int):
        for k in range(count):
            parts = advance(parts, k, h)
        return parts
    xp = functions_of(count)
    if xp is not np:
        return _compiled(xp, advance, parts, h, count)
    most, fewest = int(count.max()), int(count.min())
    for k in range(most):
        parts = advance(parts, k, h if k < fewest else np.where(k < count, h, 0.0))
    return parts


def repeated(advance: Callable[[Parts], Parts], parts: Parts, count: int) -> Parts:
    """Return parts after a number of steps that is known to a compiler.

    Args:
        advance: Returns the parts after a step, of the same shapes.
        parts: The parts at the beginning. The last one tells which robots are done.
        count: Number of steps.
    """
    if not all(isinstance(part, np.ndarray) for part in parts):
        lax = import_module("jax.lax")
        return lax.fori_loop(0, count, lambda _, parts: advance(parts), parts)
    for _ in range(count):
        parts = advance(parts)
        if parts[-1].all():
            break
    return parts


@contextmanager
def reversible(most: int) -> Iterator[None]:
    """Give functions that JAX traces in this block derivatives in reverse mode (``jax.grad``).

    The compiler must then know the number of steps: each period has ``most`` of them, some of
    length zero. A robot that needs more steps gets NaN. Derivatives in forward mode (``jax.jvp``,
    ``jax.jacfwd``) do not need this block. Functions that are already compiled do not change.

    Args:
        most: Largest number of steps that a network makes in a period.
    """
    token = _most.set(most)
    try:
        yield
    finally:
        _most.reset(token)


def _compiled(
    xp: Any,
    advance: Callable[[Parts, Any, Any], Parts],
    parts: Parts,
    h: AnyArray,
    count: AnyArray,
) -> Parts:
    lax = import_module("jax.lax")

    def body(k: AnyArray, parts: Parts) -> Parts:
        return advance(parts, k, xp.where(k < count, h, 0.0))

    most = _most.get()
    # Parts of the state take the leading axes of the signals that drive them.
    shapes = [part.shape for part in import_module("jax").eval_shape(lambda: body(0, parts))]
    parts = tuple(xp.broadcast_to(part, shape) for part, shape in zip(parts, shapes, strict=True))
    if most is None:
        return lax.fori_loop(0, count.max().astype(int), body, parts)
    too_many = xp.where(count > most, np.nan, 0.0)
    return tuple(part + too_many for part in lax.fori_loop(0, most, body, parts))

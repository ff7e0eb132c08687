"""Steps within a period whose number may differ between robots and may be unknown to a compiler.

Block principal pivoting: which entries of a program change sides from round to round.

An entry is at its lower bound, -1, at its upper one, 1, or free, 0. All that are wrong change sides
at once as long as fewer are wrong each time, or once more; then only the last one that is wrong
does, as Murty's rule has it, which ends.

JAX, an optional dependency.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from importlib import import_module
from math import ceil
from typing import Any

import numpy as np

from ..inputs.packages import import_extra
from .algebra import AnyArray, functions_of

#: Parts of a state that change from step to step.
Parts = tuple[AnyArray, ...]

_mapped: ContextVar[bool] = ContextVar("mapped", default=False)
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
        return _loop(xp, advance, parts, h, count)
    most, fewest = int(count.max()), int(count.min())
    for k in range(most):
        parts = advance(parts, k, h if k < fewest else np.where(k < count, h, 0.0))
    return parts


def repeat(advance: Callable[[Parts], Parts], parts: Parts, count: int) -> Parts:
    """Return parts after a number of steps that is known to a compiler.

    Args:
        advance: Returns the parts after a step, of the same shapes.
        parts: The parts at the beginning. The last one tells which robots are done: a further step
            would not change what is used of theirs.
        count: Number of steps.
    """
    if not all(isinstance(part, np.ndarray) for part in parts):
        return _repeat_by_jax(advance, parts, count)
    for _ in range(count):
        parts = advance(parts)
        if parts[-1].all():
            break
    return parts


def _repeat_by_jax(advance: Callable[[Parts], Parts], parts: Parts, count: int) -> Parts:
    lax = import_module("jax.lax")
    if _most.get() is not None:
        return lax.fori_loop(0, count, lambda _, parts: advance(parts), parts)

    def goes_on(carry: Any) -> AnyArray:
        return (carry[0] < count) & ~carry[1][-1].all()

    return lax.while_loop(goes_on, lambda carry: (carry[0] + 1, advance(carry[1])), (0, parts))[1]


def either(flag: Any, yes: Callable[..., Any], no: Callable[..., Any], *operands: Any) -> Any:
    """Return what one of two functions returns; the other one is not called, if that can be.

    Args:
        flag: Whether it is the first: a truth value of NumPy, or one that JAX has yet to know.
        yes: The first function.
        no: The other one. With JAX both return arrays of the same shapes.
        operands: Their arguments.
    """
    if isinstance(flag, (bool, np.bool_)):
        return yes(*operands) if flag else no(*operands)
    return import_module("jax.lax").cond(flag, yes, no, *operands)


def knows_branches(flag: Any) -> bool:
    """Return whether JAX traces a flag whose `either` calls one side alone."""
    return not (isinstance(flag, (bool, np.bool_, np.ndarray)) or _mapped.get())


def per_robot(
    function: Callable[..., Parts], operands: Sequence[AnyArray], axes: Sequence[int]
) -> Parts:
    """Return what a function of one robot returns for one or for many, its arrays.

    NumPy calls it robot by robot, JAX maps it. A single robot in a trace keeps its branches, which
    compiled C needs: mapped over many, both sides of `either` are computed.

    Args:
        function: Returns arrays, given those of one robot.
        operands: Its arguments, of which any may have a leading axis of robots.
        axes: How many axes each of these has without.
    """
    have = [np.ndim(each) > own for each, own in zip(operands, axes, strict=True)]
    if not any(have):
        return function(*operands)
    pairs = list(zip(operands, have, strict=True))
    count = max(len(each) for each, many in pairs if many)
    # One that all robots share may have an axis of its own.
    pairs = [
        (each[0], False) if many and len(each) < count else (each, many) for each, many in pairs
    ]
    if all(isinstance(each, (np.ndarray, np.generic, float)) for each in operands):
        rows = [
            function(*(each[k] if many else each for each, many in pairs)) for k in range(count)
        ]
        return tuple(np.stack(parts) for parts in zip(*rows, strict=True))
    if count == 1:
        parts = function(*(each[0] if many else each for each, many in pairs))
        return tuple(part[None] for part in parts)
    places = tuple(0 if many else None for _, many in pairs)
    token = _mapped.set(True)
    try:
        return import_module("jax").vmap(function, in_axes=places)(*(each for each, _ in pairs))
    finally:
        _mapped.reset(token)


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


def _loop(
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


#: Further rounds in which all entries may change sides though not fewer are wrong. With 3, five
#: times as many programs that allow nothing like their task need more than 60 rounds.
PATIENCE = 1.0


def first(sides: AnyArray) -> tuple[AnyArray, AnyArray]:
    """Return the fewest that were wrong and the patience before the first round, (..., 1) each."""
    each = 0.0 * sides[..., :1]
    return each + sides.shape[-1] + 1.0, each + PATIENCE


def update_sides(
    sides: AnyArray, ought: AnyArray, fewest: Any, patience: Any
) -> tuple[AnyArray, ...]:
    """Return sides, fewest and patience of the next round, and who is done, shape (..., 1).

    Args:
        sides: Sides of this round, shape (..., n).
        ought: Sides that its solution is on, likewise.
        fewest: The fewest that were wrong so far, shape (..., 1).
        patience: Rounds that all may still change sides in, likewise.
    """
    xp, order = functions_of(sides, ought), np.arange(sides.shape[-1])
    wrong = ought != sides
    count = 1.0 * wrong.sum(axis=-1, keepdims=True)
    fewer = count < fewest
    last = wrong & (xp.where(wrong, order, -1).max(axis=-1, keepdims=True) == order)
    sides = xp.where(fewer | (patience > 0.0) | last, ought, sides)
    patience = xp.where(fewer, PATIENCE, patience - 1.0)
    return sides, xp.minimum(fewest, count), patience, count == 0.0


def require_jax() -> Any:
    """Return the module ``jax`` with 64-bit numbers, which are switched on for the whole process.

    Arrays that JAX made before have 32 bits; functions that need 64 refuse them.

    Raises:
        InvalidInputError: If JAX is not installed.
    """
    (jax,) = import_extra("compilation", "jax", "jax")
    jax.config.update("jax_enable_x64", True)
    return jax

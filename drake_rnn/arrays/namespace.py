"""The module of an array's functions, NumPy's or JAX's, and the layout of robots in memory."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import InvalidInputError
from ..inputs.complaints import short

#: An array of NumPy or JAX, or a tracer of JAX.
AnyArray = Any


def namespace(name: str, array: AnyArray) -> Any:
    """Return the module whose functions take this array: ``numpy`` or ``jax.numpy``.

    Args:
        name: Name of the array in the message.
        array: The array.

    Raises:
        InvalidInputError: If it is not such an array, or not of 64 bits; JAX makes arrays of 32
            bits until `drake_rnn.arrays.jax_module.require_jax` is called.
    """
    # NumPy 1 has no __array_namespace__.
    if isinstance(array, np.ndarray):
        xp: Any = np
    else:
        try:
            xp = array.__array_namespace__()
        except AttributeError:
            raise InvalidInputError(
                f"{name}: must be an array of NumPy or JAX, not {short(array)}"
            ) from None
    if array.dtype != np.float64:
        raise InvalidInputError(
            f"{name}: must be of float64, not {array.dtype}; in JAX, call require_jax() first"
        )
    return xp


def is_foreign(value: AnyArray) -> bool:
    """Return whether a value is an array, but not NumPy's; JAX may not know its entries yet."""
    try:
        return value.__array_namespace__() is not np and not isinstance(value, np.ndarray)
    except AttributeError:
        return False


def robots_last(array: AnyArray, axes: int) -> AnyArray:
    """Return an array with the last ``axes`` of its axes in front, and robots side by side.

    The same entry of all robots, e.g. the position of the third joint, is then contiguous in
    memory, which suits elementwise operations. Their results keep this layout, so that no later
    call copies them.
    """
    moved = in_front(array, axes)
    return np.ascontiguousarray(moved) if isinstance(moved, np.ndarray) else moved


def in_front(array: AnyArray, axes: int) -> AnyArray:
    """Return a view of an array with the last ``axes`` of its axes in front."""
    lead = array.ndim - axes
    return array.transpose(*range(lead, array.ndim), *range(lead))


def robots_first(array: AnyArray, axes: int) -> AnyArray:
    """Return a view of an array with the first ``axes`` of its axes last; undoes `in_front`."""
    return array.transpose(*range(axes, array.ndim), *range(axes))

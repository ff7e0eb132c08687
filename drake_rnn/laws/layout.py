"""Named parts of flat vectors: the state of a law, and the signals that it sees."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..arrays.algebra import functions_of
from ..errors import InvalidInputError
from ..inputs.complaints import short
from ..inputs.fields import Array

Signals = Mapping[str, Array]


class Layout:
    """The named parts of a flat vector, in order.

    Args:
        parts: Shape of each part by name, e.g. ``v=(7,), J_hat=(3, 7)``.

    Raises:
        InvalidInputError: If a shape is not one or more positive whole numbers.
    """

    def __init__(self, **parts: tuple[int, ...]) -> None:
        for name, shape in parts.items():
            _check_shape(name, shape)
        sizes = [int(np.prod(shape)) for shape in parts.values()]
        ends = np.cumsum([0, *sizes])
        self.size = int(ends[-1])
        self.parts = {
            name: (slice(int(end) - size, int(end)), shape)
            for (name, shape), size, end in zip(parts.items(), sizes, ends[1:], strict=True)
        }
        self._places = tuple(self.parts.values())

    def __contains__(self, name: str) -> bool:
        return name in self.parts

    def split(self, x: Array) -> list[Array]:
        """Return views of the parts of ``x``, shape (..., size), in order."""
        if x.ndim == 1:
            # Called at every sample: reshaping only the parts that need it saves time.
            return [x[at] if len(s) == 1 else x[at].reshape(s) for at, s in self._places]
        lead = x.shape[:-1]
        return [x[..., at].reshape(lead + shape) for at, shape in self._places]

    def part(self, x: Array, name: str) -> Array:
        """Return a view of one part of ``x``, shape (..., size)."""
        at, shape = self.parts[name]
        return x[..., at].reshape(x.shape[:-1] + shape)

    def named(self, x: Array) -> dict[str, Array]:
        """Return views of the parts of ``x``, shape (..., size), by name."""
        return dict(zip(self.parts, self.split(x), strict=True))

    def joined(self, values: Signals) -> Array:
        """Return the flat vector of parts by name, shape (..., size); see `join`."""
        return self.join(*(values[name] for name in self.parts))

    def replaced(self, x: Array, **values: Array) -> Array:
        """Return a copy of ``x``, shape (..., size), with other values of some parts."""
        places = [(self.parts[name][0], name) for name in values]
        if not isinstance(x, np.ndarray):
            for at, name in places:
                x = x.at[..., at].set(values[name].reshape((*x.shape[:-1], -1)))
            return x
        # In the order of memory of what is copied.
        x = x.copy(order="K")
        for at, name in places:
            x[..., at] = values[name].reshape((*x.shape[:-1], -1))
        return x

    def join(self, *values: Array) -> Array:
        """Return the flat vector of the given parts, shape (..., size).

        Their leading axes are broadcast against each other.
        """
        if values[0].ndim == len(self._places[0][1]) and isinstance(values[0], np.ndarray):
            return np.concatenate([value.ravel() for value in values])
        xp = functions_of(*values)
        shapes = [shape for _, shape in self._places]
        leads = [v.shape[: v.ndim - len(s)] for v, s in zip(values, shapes, strict=True)]
        lead = np.broadcast_shapes(*leads)
        whole = (
            xp.broadcast_to(v, lead + s).reshape((*lead, -1))
            for v, s in zip(values, shapes, strict=True)
        )
        return xp.concatenate(list(whole), axis=-1)


def _check_shape(name: str, shape: object) -> None:
    sizes = shape if isinstance(shape, tuple) else ()
    if not sizes or not all(isinstance(size, (int, np.integer)) and size > 0 for size in sizes):
        raise InvalidInputError(
            f"Layout: the shape of {name!r} must be positive whole numbers, e.g. (3,) or (3, 7), "
            f"not {short(shape)}"
        )

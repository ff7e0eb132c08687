"""The last values of something, newest first."""

from __future__ import annotations

from ...arrays.algebra import functions_of
from ...inputs.fields import Array


def pushed(rows: Array, newest: Array, axis: int) -> Array:
    """Return the last values with one more, of which the oldest is dropped.

    Args:
        rows: The values along an axis, newest first, shape (..., k, ...).
        newest: The one more, without that axis.
        axis: The axis, counted from the end: -2 for vectors, -3 for matrices.
    """
    if rows.shape[axis] == 1:
        return newest[..., None, :] if axis == -2 else newest[..., None, :, :]
    kept = rows[..., :-1, :] if axis == -2 else rows[..., :-1, :, :]
    xp = functions_of(newest)
    return xp.concatenate((xp.expand_dims(newest, axis), kept), axis=axis)

"""Algebra of series: the first axis is steps, an optional second one robots, then vectors.

For one robot, each function is NumPy's plain one. For many robots, sums are added term by term, so
that a robot's result has the same bits in any batch.
"""

from __future__ import annotations

import numpy as np

from .algebra import functions_of, root
from .namespace import AnyArray


def lengths(vectors: AnyArray) -> AnyArray:
    """Return the norms of vectors, shape (k, ...), of shape (k, ..., m)."""
    return root(summed(vectors * vectors))


def sizes(matrices: AnyArray) -> AnyArray:
    """Return the Frobenius norms of matrices, shape (k, ...), of shape (k, ..., m, n)."""
    entries = matrices.reshape(*matrices.shape[:-2], -1)
    if _of_one(entries):
        return np.linalg.norm(entries, axis=-1)
    return lengths(entries)


def along(vectors: AnyArray, direction: AnyArray) -> AnyArray:
    """Return the parts of vectors, shape (k, ..., m), along directions, shape (..., m)."""
    if _of_one(vectors):
        return np.outer(vectors @ direction, direction)
    return summed(vectors * direction)[..., None] * direction


def transformed(matrices: AnyArray, vectors: AnyArray) -> AnyArray:
    """Return products of matrices, shape (k, ..., m, n), and vectors, shape (k, ..., n)."""
    if _of_one(vectors):
        return np.einsum("kmn,kn->km", matrices, vectors)
    total = matrices[..., 0] * vectors[..., :1]
    for k in range(1, vectors.shape[-1]):
        total = total + matrices[..., k] * vectors[..., k, None]
    return total


def summed(vectors: AnyArray) -> AnyArray:
    """Return the sums of the entries of vectors, one after the other, shape (k, ...).

    NumPy's own sum may add in another order for one robot than for several.
    """
    total = vectors[..., 0]
    for k in range(1, vectors.shape[-1]):
        total = total + vectors[..., k]
    return total


def added_up(total: AnyArray, values: AnyArray) -> AnyArray:
    """Return a sum, shape (...), with the values of further steps, shape (k, ...), added.

    For many robots the steps are added one after the other: the sum does not depend on how a run is
    divided into parts.
    """
    if values.ndim == 1:
        return total + values.sum()
    for row in values:
        total = total + row
    return total


def least_singular_squares(matrices: AnyArray) -> AnyArray:
    """Return the squares of the least singular values, shape (k, ...).

    They are the least eigenvalues of A A^T. For many robots and three rows, they are computed in
    elementwise operations as roots of a cubic (O. K. Smith, "Eigenvalues of a symmetric 3 x 3
    matrix", 1961).

    Args:
        matrices: Matrices A, shape (k, ..., m, n), with no more rows than columns.
    """
    m = matrices.shape[-2]
    if matrices.ndim == 3:
        gram = matrices @ np.swapaxes(matrices, 1, 2)
        return np.linalg.eigvalsh(gram)[:, 0].astype(float, copy=False)
    rows = [matrices[..., i, :] for i in range(m)]
    xp = functions_of(matrices)
    gram = {(i, k): summed(rows[i] * rows[k]) for i in range(m) for k in range(i, m)}
    if m == 2:
        half = 0.5 * (gram[0, 0] - gram[1, 1])
        mean = 0.5 * (gram[0, 0] + gram[1, 1])
        return mean - xp.sqrt(half * half + gram[0, 1] * gram[0, 1])
    if m != 3:
        entries = [gram[min(i, k), max(i, k)] for i in range(m) for k in range(m)]
        square = xp.stack(entries, axis=-1)
        return xp.linalg.eigvalsh(square.reshape(*square.shape[:-1], m, m))[..., 0].astype(float)
    mean = (gram[0, 0] + gram[1, 1] + gram[2, 2]) / 3.0
    a, b, c = gram[0, 0] - mean, gram[1, 1] - mean, gram[2, 2] - mean
    d, e, f = gram[0, 1], gram[0, 2], gram[1, 2]
    p = xp.sqrt((a * a + b * b + c * c + 2.0 * (d * d + e * e + f * f)) / 6.0)
    determinant = a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e)
    cube = xp.where(p > 0.0, p * p * p, 1.0)
    angle = xp.arccos(xp.clip(0.5 * determinant / cube, -1.0, 1.0)) / 3.0
    return mean + 2.0 * p * xp.cos(angle + 2.0 * np.pi / 3.0)


def _of_one(vectors: AnyArray) -> bool:
    """Return whether a series of vectors is NumPy's and of one robot."""
    return vectors.ndim == 2 and functions_of(vectors) is np

"""Products of vectors and matrices that have leading axes of robots, in NumPy or in JAX arrays.

One robot in NumPy takes the plain, fastest function, and no other. For many, sums of products are
taken term by term: a matrix product may add up in an order that depends on how many robots there
are and on how they lie in memory. A robot's result then has the same bits among any others.

Where a robot's numbers differ from those of the next, as a gain may, they have shape (..., 1).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from .namespace import AnyArray

#: A function of a vector, which multiplies it by a matrix.
Product = Callable[[AnyArray], AnyArray]

# Bound here: looking them up at every sample takes time.
_ndarray, _minimum, _maximum, _concatenate = np.ndarray, np.minimum, np.maximum, np.concatenate
_solve = np.linalg.solve

# Share of its trace that is more than what rounding takes from a matrix.
_ROUNDING = 1e-15


def is_one(vector: AnyArray) -> bool:
    """Return whether a vector, shape (..., n), is that of one robot and NumPy's.

    Then, and only then, its numbers may decide which way the program goes.
    """
    return type(vector) is _ndarray and vector.ndim == 1


def functions_of(*arrays: AnyArray) -> Any:
    """Return the module whose functions take these: ``jax.numpy`` if any is JAX's, else ``numpy``.

    Python's numbers may be among them.
    """
    for array in arrays:
        if not isinstance(array, (_ndarray, np.generic, float, int)):
            return array.__array_namespace__()
    return np


def matvec(A: AnyArray, v: AnyArray) -> AnyArray:
    """Return A v, shape (..., m), of a matrix, shape (..., m, n), and a vector, shape (..., n)."""
    if type(v) is _ndarray:
        if v.ndim == 1:
            return A.dot(v)
        return _summed(lambda k: A[..., :, k] * v[..., k, None], v.shape[-1])
    return (A * v[..., None, :]).sum(axis=-1)


def vecmat(y: AnyArray, A: AnyArray) -> AnyArray:
    """Return A^T y, shape (..., n), of a matrix of shape (..., m, n) and a vector, (..., m)."""
    if type(y) is _ndarray:
        if y.ndim == 1:
            return y.dot(A)
        return _summed(lambda k: y[..., k, None] * A[..., k, :], y.shape[-1])
    return (y[..., :, None] * A).sum(axis=-2)


def products(A: AnyArray) -> tuple[Product, Product]:
    """Return the functions v -> A v and y -> A^T y of a matrix, shape (..., m, n).

    In a loop they are faster than `matvec` and `vecmat`, and have the same bits.
    """
    if type(A) is _ndarray and A.ndim == 2:
        return A.dot, A.T.dot
    return (lambda v: matvec(A, v)), (lambda y: vecmat(y, A))


def matmul(A: AnyArray, B: AnyArray) -> AnyArray:
    """Return A B, shape (..., m, n), of matrices, shapes (..., m, k) and (..., k, n)."""
    if type(B) is not _ndarray:
        return A @ B
    if B.ndim == 2:
        return A.dot(B)
    return _summed(lambda k: A[..., :, k, None] * B[..., k, None, :], B.shape[-2])


def dot(a: AnyArray, b: AnyArray) -> Any:
    """Return the scalar product of vectors, shape (..., n): of one robot a float, else (..., 1)."""
    if type(b) is _ndarray:
        if b.ndim == 1:
            return float(a.dot(b))
        return _summed(lambda k: a[..., k, None] * b[..., k, None], b.shape[-1])
    return (a * b).sum(axis=-1, keepdims=True)


def square_sum(A: AnyArray) -> AnyArray:
    """Return the sum of the squares of a matrix, shape (..., m, n), of shape (..., 1)."""
    entries = flat(A)
    return dot(entries, entries)


def solved(A: AnyArray, B: AnyArray) -> AnyArray:
    """Return X with A X = B, of matrices, shapes (..., m, m) and (..., m, n).

    Each robot's system is solved by itself, in the same order.
    """
    if type(A) is _ndarray:
        return _solve(A, B)
    return functions_of(A).linalg.solve(A, B)


def solved_for(A: AnyArray, b: AnyArray) -> AnyArray:
    """Return x with A x = b, of a matrix, shape (..., m, m), and a vector, shape (..., m)."""
    return solved(A, b) if is_one(b) else solved(A, b[..., None])[..., 0]


def solved_regular(A: AnyArray, b: AnyArray) -> AnyArray:
    """Return x with A x = b, as `solved_for` does, of a symmetric and positive definite matrix.

    One that rounding has made singular, in NumPy, is solved with a trace of it more.
    """
    if type(b) is not _ndarray:
        return solved_for(A, b)
    if b.shape != (3,) or A.ndim != 2:
        try:
            return solved_for(A, b)
        except np.linalg.LinAlgError:
            # Robot by robot: others of a batch keep their bits.
            rows = zip(A.reshape(-1, *A.shape[-2:]), b.reshape(-1, b.shape[-1]), strict=True)
            return np.reshape([_solved_singular(each, of) for each, of in rows], b.shape)
    # Plain floats: LAPACK's answer for three rows would come four times as late.
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = A.tolist()
    bx, by, bz = b.tolist()
    least = _ROUNDING * (xx + yy + zz)
    f, g = xy / xx, xz / xx
    yy, yz, zz, by, bz = yy - f * xy, yz - f * xz, zz - g * xz, by - f * bx, bz - g * bx
    yy = max(yy, least)
    f = yz / yy
    z = (bz - f * by) / max(zz - f * yz, least)
    y = (by - yz * z) / yy
    return np.array(((bx - xy * y - xz * z) / xx, y, z))


def _solved_singular(A: AnyArray, b: AnyArray) -> AnyArray:
    try:
        return _solve(A, b)
    except np.linalg.LinAlgError:
        return _solve(A + _ROUNDING * np.trace(A) * np.eye(b.size), b)


def outer(a: AnyArray, b: AnyArray) -> AnyArray:
    """Return a b^T, shape (..., m, n), of vectors, shapes (..., m) and (..., n)."""
    return a[..., :, None] * b[..., None, :]


def transposed(A: AnyArray) -> AnyArray:
    """Return a view of the transposed matrix, shape (..., n, m), of one of shape (..., m, n)."""
    return A.T if A.ndim == 2 else A.swapaxes(-1, -2)


def scaled(gain: Any, A: AnyArray) -> AnyArray:
    """Return a matrix, shape (..., m, n), times a number, or one for each robot, shape (..., 1)."""
    return gain * A if isinstance(gain, float) else gain[..., None] * A


def clipped(value: AnyArray, lower: AnyArray, upper: AnyArray) -> AnyArray:
    """Return a value within its bounds, all of the shape (..., n)."""
    # np.clip costs three times as much for arrays of one robot's size.
    if type(value) is _ndarray:
        return _minimum(_maximum(value, lower), upper)
    xp = functions_of(value)
    return xp.minimum(xp.maximum(value, lower), upper)


def larger(least: float, value: Any) -> Any:
    """Return the larger of a number and a value, a number or an array."""
    if isinstance(value, float):
        return max(least, value)
    return functions_of(value).maximum(least, value)


def root(square: AnyArray) -> AnyArray:
    """Return the square root of what is not negative; in JAX, with the derivative 0 at 0."""
    if isinstance(square, (_ndarray, np.generic)):
        return np.sqrt(square)
    xp = functions_of(square)
    return xp.where(square > 0.0, xp.sqrt(xp.where(square > 0.0, square, 1.0)), 0.0)


def differentiable(way: AnyArray) -> AnyArray:
    """Return a way that may be infinite, with 0 in its place then if JAX takes derivatives.

    Its derivatives of what is not finite spoil those of what is chosen instead.
    """
    if isinstance(way, _ndarray):
        return way
    xp = functions_of(way)
    return xp.where(xp.isfinite(way), way, 0.0)


def joined(parts: Any) -> AnyArray:
    """Return vectors, shape (..., n_i), one after the other, shape (..., sum of n_i).

    Their leading axes are the same.
    """
    if type(parts[0]) is _ndarray and parts[0].ndim == 1:
        return _concatenate(parts)
    return functions_of(*parts).concatenate(parts, axis=-1)


def flat(A: AnyArray) -> AnyArray:
    """Return a matrix row by row, shape (..., m n), of one of shape (..., m, n)."""
    return A.ravel() if A.ndim == 2 else A.reshape((*A.shape[:-2], A.shape[-2] * A.shape[-1]))


def acts(gain: Any) -> bool:
    """Return whether a gain is not zero for all robots, so that its term cannot be left out."""
    return not isinstance(gain, float) or gain != 0.0


def chosen(
    condition: Any, then: Callable[[], AnyArray], otherwise: Callable[[], AnyArray]
) -> AnyArray:
    """Return one of two arrays, shape (..., n), and compute both only if robots may differ.

    Args:
        condition: Python's true or false, or an array of these, shape (..., 1).
        then: Returns what holds where the condition does.
        otherwise: Returns what holds elsewhere.
    """
    if isinstance(condition, (bool, np.bool_)):
        return then() if condition else otherwise()
    return functions_of(condition).where(condition, then(), otherwise())


def _summed(term: Callable[[int], AnyArray], count: int) -> AnyArray:
    """Return the sum of terms, one added after the other."""
    total = term(0)
    for k in range(1, count):
        total = total + term(k)
    return total

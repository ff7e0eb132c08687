"""Products of vectors and matrices that have leading axes of robots, in NumPy or in JAX arrays.

For one robot in NumPy, each function is NumPy's plain one, which is the fastest. For many robots,
products are added up term by term, because the order in which a matrix product adds depends on the
number of robots and on their layout in memory. A robot's result has the same bits in any batch.

Numbers that differ between robots, such as a gain, have shape (..., 1). In order:

- the module of an array's functions, NumPy's or JAX's, and the layout of robots in memory;
- products, solutions of equations, and functions of entries;
- series, whose first axis is steps, an optional second one robots, then vectors;
- steps within a period whose number may differ between robots and may be unknown to a compiler;
- block principal pivoting: which entries of a program change sides from round to round. An entry
  is at its lower bound, -1, at its upper one, 1, or free, 0. All that are wrong change sides at
  once as long as fewer are wrong each time, or once more; then only the last one that is wrong
  does, as Murty's rule has it, which ends;
- JAX, an optional dependency.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from importlib import import_module
from math import ceil
from typing import Any

import numpy as np

from ..errors import InvalidInputError
from ..inputs.messages import short
from ..inputs.packages import import_extra

#: An array of NumPy or JAX, or a tracer of JAX.
AnyArray = Any


def namespace(name: str, array: AnyArray) -> Any:
    """Return the module whose functions take this array: ``numpy`` or ``jax.numpy``.

    Args:
        name: Name of the array in the message.
        array: The array.

    Raises:
        InvalidInputError: If it is not such an array, or not of 64 bits; JAX makes arrays of 32
            bits until `drake_rnn.arrays.algebra.require_jax` is called.
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


def entries(array: AnyArray, places: AnyArray | slice) -> AnyArray:
    """Return the entries along the first axis of an array, at places that JAX may not know yet."""
    return functions_of(places).asarray(array)[places] if is_foreign(places) else array[places]


def robots_last(array: AnyArray, axes: int) -> AnyArray:
    """Return an array with the last ``axes`` of its axes in front, and robots side by side.

    The same entry of all robots, e.g. the position of the third joint, is then contiguous in
    memory, which suits elementwise operations. Their results keep this layout, so that no later
    call copies them.
    """
    view = in_front(array, axes)
    return np.ascontiguousarray(view) if isinstance(view, np.ndarray) else view


def in_front(array: AnyArray, axes: int) -> AnyArray:
    """Return a view of an array with the last ``axes`` of its axes in front."""
    lead = array.ndim - axes
    return array.transpose(*range(lead, array.ndim), *range(lead))


def robots_first(array: AnyArray, axes: int) -> AnyArray:
    """Return a view of an array with the first ``axes`` of its axes last; undoes `in_front`."""
    return array.transpose(*range(axes, array.ndim), *range(axes))


#: A function of a vector, which multiplies it by a matrix.
Product = Callable[[AnyArray], AnyArray]

# Bound here: looking them up at every sample takes time.
_ndarray, _minimum, _maximum, _concatenate = np.ndarray, np.minimum, np.maximum, np.concatenate
_solve = np.linalg.solve

# Share of the trace of a matrix that is larger than its rounding errors.
_ROUNDING = 1e-15


def is_one(vector: AnyArray) -> bool:
    """Return whether a vector, shape (..., n), is a NumPy vector of one robot.

    Only then may the program branch on its entries.
    """
    return type(vector) is _ndarray and vector.ndim == 1


def functions_of(*arrays: AnyArray) -> Any:
    """Return ``jax.numpy`` if any of the arrays is JAX's, else ``numpy``; numbers are allowed.

    A law that calls ``xp = functions_of(u["J"])`` and then functions of ``xp`` alone serves a run,
    runs side by side and JAX, which compiles it for tuning.

    Raises:
        InvalidInputError: If one of them is neither.
    """
    for array in arrays:
        if not isinstance(array, (_ndarray, np.generic, float, int)):
            try:
                return array.__array_namespace__()
            except AttributeError:
                raise InvalidInputError(
                    f"functions_of: takes arrays of NumPy or JAX and numbers, not {short(array)}"
                ) from None
    return np


def matvec(A: AnyArray, v: AnyArray) -> AnyArray:
    """Return A v, shape (..., m), of a matrix, shape (..., m, n), and a vector, shape (..., n)."""
    if type(v) is _ndarray:
        if v.ndim == 1:
            return A.dot(v)
        return _sum_of(lambda k: A[..., :, k] * v[..., k, None], v.shape[-1])
    return (A * v[..., None, :]).sum(axis=-1)


def vecmat(y: AnyArray, A: AnyArray) -> AnyArray:
    """Return A^T y, shape (..., n), of a matrix of shape (..., m, n) and a vector, (..., m)."""
    if type(y) is _ndarray:
        if y.ndim == 1:
            return y.dot(A)
        return _sum_of(lambda k: y[..., k, None] * A[..., k, :], y.shape[-1])
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
    return _sum_of(lambda k: A[..., :, k, None] * B[..., k, None, :], B.shape[-2])


def dot(a: AnyArray, b: AnyArray) -> Any:
    """Return the scalar product of vectors, shape (..., n): of one robot a float, else (..., 1)."""
    if type(b) is _ndarray:
        if b.ndim == 1:
            return float(a.dot(b))
        return _sum_of(lambda k: a[..., k, None] * b[..., k, None], b.shape[-1])
    return (a * b).sum(axis=-1, keepdims=True)


def square_sum(A: AnyArray) -> AnyArray:
    """Return the sum of the squares of a matrix, shape (..., m, n), of shape (..., 1)."""
    entries = flat(A)
    return dot(entries, entries)


def solve(A: AnyArray, B: AnyArray) -> AnyArray:
    """Return X with A X = B, of matrices, shapes (..., m, m) and (..., m, n).

    Each robot's system is solved by itself, in the same order.
    """
    if type(A) is _ndarray and type(B) is _ndarray:
        return _solve(A, B)
    return functions_of(A, B).linalg.solve(A, B)


def solved_for(A: AnyArray, b: AnyArray) -> AnyArray:
    """Return x with A x = b, of a matrix, shape (..., m, m), and a vector, shape (..., m)."""
    return solve(A, b) if is_one(b) else solve(A, b[..., None])[..., 0]


def solved_regular(A: AnyArray, b: AnyArray) -> AnyArray:
    """Return x with A x = b, as `solved_for` does, of a symmetric and positive definite matrix.

    A matrix that rounding has made singular is solved all the same: with pivots of at least 1e-15
    of its trace or, in NumPy but for a single one of three rows, with that added to the diagonal.
    """
    if b.shape[-1] == 0:
        return b
    if type(b) is not _ndarray:
        return _eliminate(A, b)
    if b.shape != (3,) or A.ndim != 2:
        try:
            return solved_for(A, b)
        except np.linalg.LinAlgError:
            # Robot by robot: others of a batch keep their bits.
            rows = zip(A.reshape(-1, *A.shape[-2:]), b.reshape(-1, b.shape[-1]), strict=True)
            return np.reshape([_solved_singular(each, of) for each, of in rows], b.shape)
    # Plain floats: for three rows LAPACK takes four times as long.
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


def _eliminate(A: AnyArray, b: AnyArray) -> AnyArray:
    """Return what `solved_regular` does in JAX: as for three rows in NumPy, in the same order."""
    xp, rows = functions_of(b), range(b.shape[-1])
    U = [[A[..., i, j] for j in rows] for i in rows]
    x = [b[..., i] for i in rows]
    least = _ROUNDING * sum(U[i][i] for i in rows)
    for k in rows:
        if k > 0:
            U[k][k] = xp.maximum(U[k][k], least)
        for i in rows[k + 1 :]:
            factor = U[k][i] / U[k][k]
            U[i][i:] = [U[i][j] - factor * U[k][j] for j in rows[i:]]
            x[i] = x[i] - factor * x[k]
    for k in reversed(rows):
        for j in rows[k + 1 :]:
            x[k] = x[k] - U[k][j] * x[j]
        x[k] = x[k] / U[k][k]
    return xp.stack(x, axis=-1)


def _solved_singular(A: AnyArray, b: AnyArray) -> AnyArray:
    try:
        return _solve(A, b)
    except np.linalg.LinAlgError:
        return _solve(A + _ROUNDING * np.trace(A) * np.eye(b.size), b)


def outer(a: AnyArray, b: AnyArray) -> AnyArray:
    """Return a b^T, shape (..., m, n), of vectors, shapes (..., m) and (..., n)."""
    return a[..., :, None] * b[..., None, :]


def transpose(A: AnyArray) -> AnyArray:
    """Return a view of the transposed matrix, shape (..., n, m), of one of shape (..., m, n)."""
    return A.T if A.ndim == 2 else A.swapaxes(-1, -2)


def scale(gain: Any, A: AnyArray) -> AnyArray:
    """Return a matrix, shape (..., m, n), times a gain: a number, or an array, shape (..., 1)."""
    return gain * A if isinstance(gain, float) else gain[..., None] * A


def clip(value: AnyArray, lower: AnyArray, upper: AnyArray) -> AnyArray:
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
    """Return the square root of a number >= 0; where it has a derivative, that at 0 is 0."""
    if type(square) is _ndarray or isinstance(square, np.generic):
        return np.sqrt(square)
    xp = functions_of(square)
    return xp.where(square > 0.0, xp.sqrt(xp.where(square > 0.0, square, 1.0)), 0.0)


def differentiable(way: AnyArray) -> AnyArray:
    """Return a distance; in JAX, an infinite one is replaced by 0.

    JAX differentiates both branches of a choice. An infinite value in the branch that is not chosen
    would turn the derivative of the other one into NaN.
    """
    if isinstance(way, _ndarray):
        return way
    xp = functions_of(way)
    return xp.where(xp.isfinite(way), way, 0.0)


def join(parts: Any) -> AnyArray:
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
    """Return whether the term of a gain counts: False if the gain is zero for all robots."""
    return not isinstance(gain, float) or gain != 0.0


def select(
    condition: Any, then: Callable[[], AnyArray], otherwise: Callable[[], AnyArray]
) -> AnyArray:
    """Return one of two arrays, shape (..., n); compute both only if robots may differ.

    Args:
        condition: A truth value, or one for each robot, shape (..., 1).
        then: Returns the array for robots whose condition is true.
        otherwise: Returns the array for the others.
    """
    if isinstance(condition, (bool, np.bool_)):
        return then() if condition else otherwise()
    return functions_of(condition).where(condition, then(), otherwise())


def _sum_of(term: Callable[[int], AnyArray], count: int) -> AnyArray:
    """Return the sum of terms, one added after the other."""
    total = term(0)
    for k in range(1, count):
        total = total + term(k)
    return total


def lengths(vectors: AnyArray) -> AnyArray:
    """Return the norms of vectors, shape (k, ...), of shape (k, ..., m)."""
    return root(sum_entries(vectors * vectors))


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
    return sum_entries(vectors * direction)[..., None] * direction


def transform(matrices: AnyArray, vectors: AnyArray) -> AnyArray:
    """Return products of matrices, shape (k, ..., m, n), and vectors, shape (k, ..., n)."""
    if _of_one(vectors):
        return np.einsum("kmn,kn->km", matrices, vectors)
    total = matrices[..., 0] * vectors[..., :1]
    for k in range(1, vectors.shape[-1]):
        total = total + matrices[..., k] * vectors[..., k, None]
    return total


def sum_entries(vectors: AnyArray) -> AnyArray:
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
    gram = {(i, k): sum_entries(rows[i] * rows[k]) for i in range(m) for k in range(i, m)}
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

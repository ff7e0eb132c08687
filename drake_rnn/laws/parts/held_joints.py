"""The joint velocity within bounds that gives a task velocity, found by holding joints one by one.

The joint that would exceed its bound the most is held at it, and the others compensate, until all
keep theirs. Where too few joints are left, the whole motion is slowed down.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...arrays.algebra import (
    clipped,
    functions_of,
    is_one,
    matmul,
    matvec,
    scaled,
    solved_for,
    transposed,
)
from ...arrays.substeps import Parts, repeated
from ...inputs.fields import Array


def velocity_within(
    J: Array, task_velocity: Array, pull: Array, bounds: tuple[Array, Array], damping: Any
) -> Array:
    """Return the velocities within bounds, nearest to ``pull``, that give ``task_velocity``.

    Args:
        J: Jacobian, shape (..., m, n).
        task_velocity: Desired velocity of the end effector, shape (..., m).
        pull: Joint velocities to come close to, shape (..., n) [rad/s].
        bounds: Lower and upper velocities, shape (..., n) [rad/s].
        damping: Damping mu of the pseudoinverse [m].
    """
    m, n = J.shape[-2:]
    damping_matrix = scaled(damping**2, np.eye(m))
    lower, upper = bounds

    def tried(free: Array, held: Array) -> tuple[Array, Array]:
        """Return the velocities with some joints held, and by how much free ones are too fast."""
        J_free = J * free[..., np.newaxis, :]
        gram = matmul(J_free, transposed(J_free)) + damping_matrix
        v = held + free * pull
        missing = task_velocity - matvec(J, v)
        v = v + matvec(transposed(J_free), solved_for(gram, missing))
        return v, functions_of(v).maximum(lower - v, v - upper) * free

    def advance(parts: Parts) -> Parts:
        before, free, held, keeps, ends = parts
        v, excess = tried(free, held)
        xp = functions_of(v)
        v = xp.where(ends, before, v)
        too_fast = excess.max(axis=-1, keepdims=True)
        keeps = keeps | ~ends & (too_fast <= 0.0)
        few = free.sum(axis=-1, keepdims=True) <= m
        ends = ends | keeps | few | ~xp.isfinite(v).all(axis=-1, keepdims=True)
        worst = ~ends & (np.arange(n) == excess.argmax(axis=-1)[..., np.newaxis])
        held = xp.where(worst, clipped(v, lower, upper), held)
        return v, xp.where(worst, 0.0, free), held, keeps, ends

    if is_one(pull):
        v, keeps = _of_one(tried, m, n, lower, upper)
        return v if keeps else _slowed(v, lower, upper)
    xp = functions_of(J, task_velocity, pull)
    shape = np.broadcast_shapes(J.shape[:-2], pull.shape[:-1], lower.shape[:-1])
    zeros, no = xp.zeros((*shape, n)), xp.zeros((*shape, 1), bool)
    parts = repeated(advance, (zeros, zeros + 1.0, zeros, no, no), n)
    return xp.where(parts[3], parts[0], _slowed(parts[0], lower, upper))


def _of_one(tried: Any, m: int, n: int, lower: Array, upper: Array) -> tuple[Array, bool]:
    """Return the velocities of one robot, and whether they are within their bounds."""
    free, held = np.ones(n), np.zeros(n)
    for _ in range(n):
        v, excess = tried(free, held)
        worst = int(np.argmax(excess))
        if excess[worst] <= 0.0:
            return v, True
        if free.sum() <= m or not np.isfinite(v).all():
            break
        free[worst] = 0.0
        held[worst] = min(max(v[worst], lower[worst]), upper[worst])
    return v, False


def _slowed(v: Array, lower: Array, upper: Array) -> Array:
    """Return the velocities, as far towards ``v`` from those nearest to rest as bounds permit."""
    xp = functions_of(v, lower)
    rest = clipped(xp.zeros(v.shape), lower, upper)
    change = v - rest
    room = xp.where(change > 0, upper - rest, rest - lower)
    far = xp.abs(change) > room
    share = xp.where(far, room / xp.where(far, xp.abs(change), 1.0), 1.0)
    return rest + share.min(axis=-1, keepdims=True) * change

"""The distances of `Clearance` in JAX, whose derivatives barriers of a user's own need."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from drake_rnn import InvalidInputError
from drake_rnn.robot.clearance import Clearance
from drake_rnn.robot.clearance.capsules import Solids

# Below this length nothing has a direction [m]; its square root keeps derivatives finite.
_TINY = 1e-12


class Things(NamedTuple):
    """Obstacles as an argument, so that other ones of the same number compile nothing.

    Attributes:
        ends, radii: Those of balls and capsules, shapes (r, 2, 3) and (r,) [m].
        centers, R_WO, half: Those of boxes, shapes (b, 3) [m], (b, 3, 3) and (b, 3) [m].
    """

    ends: ArrayLike
    radii: ArrayLike
    centers: ArrayLike
    R_WO: ArrayLike
    half: ArrayLike

    @classmethod
    def of(cls, solids: Solids) -> Things:
        """Return the round obstacles and the boxes."""
        return cls(solids.ends, solids.radii, solids.centers, solids.R_WO, solids.half)


def gaps_of(clearance: Clearance) -> Callable[[jax.Array, Things], jax.Array]:
    """Return a function of the joint positions, shape (n,), to the distances, shape (p,) [m].

    Args:
        clearance: Its obstacles are round ones and boxes, its joints revolute.

    Raises:
        InvalidInputError: If it has others.
    """
    arm, solids = clearance.arm, clearance.solids
    others = solids.levels.size or solids.cylinders.radii.size
    if others or any(arm.poses.slides):
        raise InvalidInputError(
            "jax_distances: knows no half-spaces, no cylinders and no joints that slide"
        )
    moved = np.flatnonzero(arm.carried_by_joint.any(axis=1))
    (a, b), radii = clearance.own.T, arm.radii[moved]

    def gaps(q: jax.Array, things: Things) -> jax.Array:
        R, p = _link_motions(q, jnp.asarray(arm.poses.axes), jnp.asarray(arm.poses.points))
        links = jnp.asarray(arm.links)
        ends = jnp.einsum("cij,cej->cei", R[links], jnp.asarray(arm.ends)) + p[links][:, None]
        found = [between_segments(ends[a], ends[b]) - arm.radii[a] - arm.radii[b]]
        outer = ends[moved]
        if solids.radii.size:
            apart = between_segments(outer, jnp.asarray(things.ends)[:, None])
            found.append((apart - radii - jnp.asarray(things.radii)[:, None]).ravel())
        if solids.half.size:
            p = outer - jnp.asarray(things.centers)[:, None, None]
            local = jnp.einsum("bcei,bij->bcej", p, jnp.asarray(things.R_WO))
            half = jnp.broadcast_to(jnp.asarray(things.half)[:, None], (*local.shape[:2], 3))
            found.append((to_boxes(local, half) - radii).ravel())
        return jnp.concatenate(found)

    return gaps


def _link_motions(q: jax.Array, axes: jax.Array, points: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return rotations and translations of all links from zero, as `LinkPoses.at`."""
    R, p = [jnp.eye(3)], [jnp.zeros(3)]
    for angle, axis, point in zip(q, axes, points, strict=True):
        K = jnp.cross(jnp.eye(3), axis).T @ -jnp.eye(3)
        turn = jnp.eye(3) + jnp.sin(angle) * K + (1.0 - jnp.cos(angle)) * K @ K
        R.append(R[-1] @ turn)
        p.append(R[-2] @ (point - turn @ point) + p[-1])
    return jnp.stack(R), jnp.stack(p)


def between_segments(A: jax.Array, B: jax.Array) -> jax.Array:
    """Return the distances of segments, as `drake_rnn.robot.clearance.capsules` has them."""
    p, q = A[..., 0, :], B[..., 0, :]
    d, e, r = A[..., 1, :] - p, B[..., 1, :] - q, p - q
    a, f, b = (_dot(x, y) for x, y in ((d, d), (e, e), (d, e)))
    c, g = _dot(d, r), _dot(e, r)
    det = a * f - b * b
    s = jnp.where(det > 1e-14 * a * f, (b * g - c * f) / jnp.where(det > 0.0, det, 1.0), 0.0)
    s = jnp.clip(s, 0.0, 1.0)
    t = jnp.clip((b * s + g) / jnp.maximum(f, _TINY), 0.0, 1.0)
    s = jnp.clip((b * t - c) / jnp.maximum(a, _TINY), 0.0, 1.0)
    return _norm(r + s[..., None] * d - t[..., None] * e)


def to_boxes(A: jax.Array, half: jax.Array) -> jax.Array:
    """Return the distances of segments and boxes, in the frames of the boxes, likewise."""
    p, d = A[..., 0, :], A[..., 1, :] - A[..., 0, :]
    moves = jnp.abs(d) > _TINY
    along = jnp.where(moves, d, 1.0)
    crossed = [jnp.where(moves, (side * half - p) / along, 0.0) for side in (-1.0, 1.0)]
    limits = jnp.broadcast_to(jnp.array([0.0, 1.0]), (*p.shape[:-1], 2))
    s = jnp.sort(jnp.clip(jnp.concatenate((*crossed, limits), axis=-1), 0.0, 1.0), axis=-1)
    x = p[..., None, :] + s[..., None] * d[..., None, :]
    sides = half[..., None, :]
    slope = _dot(x - jnp.clip(x, -sides, sides), d[..., None, :])
    low = jnp.clip((slope <= 0.0).sum(axis=-1) - 1, 0, s.shape[-1] - 2)[..., None]
    s0, s1, g0, g1 = (
        jnp.take_along_axis(values, low + k, axis=-1)[..., 0]
        for values in (s, slope)
        for k in (0, 1)
    )
    rise = g1 - g0
    share = jnp.where(rise > 0.0, jnp.clip(-g0 / jnp.where(rise > 0.0, rise, 1.0), 0.0, 1.0), 0.0)
    best = jnp.where(slope[..., 0] > 0.0, 0.0, s0 + share * (s1 - s0))
    nearest = p + best[..., None] * d
    return _norm(nearest - jnp.clip(nearest, -half, half))


def _dot(x: jax.Array, y: jax.Array) -> jax.Array:
    return (x * y).sum(axis=-1)


def _norm(x: jax.Array) -> jax.Array:
    return jnp.sqrt(_dot(x, x) + _TINY**2)

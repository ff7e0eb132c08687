"""Postures of an arm: random ones, and one to start from."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..inputs.arguments import checked, instance, whole
from ..inputs.fields import Array
from .arm import Arm
from .kinematics import ArmKinematics

# A joint is drawn from at most one turn about the middle of its range, which holds every posture of
# a joint that turns [rad], or from so much of its way if it slides [m]; the middle of an unlimited
# joint is 0.
_HALF_TURN, _HALF_WAY = np.pi, 1.0
# Random postures that compete to be the home posture, those that are improved, and their trials.
_CANDIDATES, _FINALISTS, _TRIALS = 2000, 6, 600
# Standard deviation of the first and the last trials' steps [rad].
_FIRST_STEP, _LAST_STEP = 0.3, 0.01
# A joint this share of half its range away from its limits is far enough; so is a frame E that is
# this share of the arm's reach above the base.
_ENOUGH_ROOM, _ENOUGH_HEIGHT = 0.25, 0.25
# Bodies at half of the largest distance that they can have are far enough from each other; those
# that are always close, relative to the reach, do not count.
_APART, _ALWAYS_CLOSE = 0.5, 0.02
# A body is out over the work if it is farther from the base's axis than this share of the reach; it
# may be below E by that share.
_OUT, _BELOW = 0.2, 0.05
# Digits of the proposed posture.
_DIGITS = 2


def random_postures(arm: Arm, count: int, seed: int = 0) -> Array:
    """Return postures within the position limits, uniformly distributed, shape (count, n).

    A joint whose range exceeds one turn, or 2 m if it slides, is drawn from so much of it about the
    middle; units are those of ``arm.units``.

    Args:
        arm: The arm.
        count: Number of postures.
        seed: Seed of the random numbers.
    """
    lower, upper = _range(arm)
    return np.random.default_rng(seed).uniform(lower, upper, (count, arm.n))


@checked(arm=instance(Arm), seed=whole())
def proposed_home(arm: Arm, seed: int = 0) -> Array:
    """Return a posture to start from, away from limits and singularities.

    It is the best of 2000 random postures, improved by a random search. A posture is judged by the
    product of

    - the smallest distance of a joint from its limits as a share of half its range; 0.25 is
      enough;
    - the reciprocal condition number of the Jacobian, of the pose for six joints or more, otherwise
      of the position, in its structural rank; lengths are taken relative to the arm's reach;
    - how much E's z axis points down, along gravity, and how far E is ahead, along the base's x
      axis: (1 + cosine) / 2 both, the first squared;
    - the smallest distance of two bodies of the chain as a share of the largest that they can have;
      0.5 is enough;
    - the distance of E from the base's xy plane as a share of the arm's reach; 0.25 is enough. No
      body may be behind that plane, and of those that are out over the work none below E.

    Where no posture fulfils the last of these, as for an arm that hangs, only the joints' limits,
    the Jacobian and the distances of bodies count.

    Args:
        arm: The arm; a home posture that it has does not matter.
        seed: Seed of the random search.

    Returns:
        The posture with two decimals, shape (n,) [rad].

    Raises:
        InvalidInputError: If ``arm`` is not an `Arm`.
    """
    candidates = random_postures(arm, _CANDIDATES, seed)
    merit = _merit(arm, candidates)
    worth = np.array([merit(q) for q in candidates])
    if not worth.any():
        merit = _merit(arm, candidates, stands=False)
        worth = np.array([merit(q) for q in candidates])
    rng = np.random.default_rng(seed)
    found = [
        _improved(arm, merit, candidates[k], float(worth[k]), rng)
        for k in np.argsort(-worth, kind="stable")[:_FINALISTS]
    ]
    best = max(found, key=lambda pair: pair[1])[0]
    rounded = np.round(best, _DIGITS) + 0.0
    return rounded if not arm.limits.violation(rounded).any() else best


def conditioning(kinematics: ArmKinematics, q: Array, reach: float) -> Array:
    """Return the singular values of the Jacobian at ``q``, relative to the largest, descending.

    Args:
        kinematics: Kinematics of the arm.
        q: Posture, shape (n,) [rad].
        reach: Length to which those of the Jacobian are related [m].
    """
    J = kinematics.J(q) / reach
    if q.size >= 6:
        J = np.vstack((J, kinematics.J_omega(q)))
    values = np.linalg.svd(J, compute_uv=False)
    return np.asarray(values / values[0])


def structural_rank(kinematics: ArmKinematics, postures: Array, reach: float) -> int:
    """Return the largest rank of the Jacobian over postures, shape (k, n), see `conditioning`."""
    return max(int((conditioning(kinematics, q, reach) > 1e-6).sum()) for q in postures)


def _range(arm: Arm) -> tuple[Array, Array]:
    lower, upper = arm.limits.position_lower, arm.limits.position_upper
    limited = np.isfinite(lower) & np.isfinite(upper)
    middle = np.zeros(arm.n)
    middle[limited] = (lower[limited] + upper[limited]) / 2.0
    # A joint with one limit is drawn from the turn next to it.
    half = np.array([_HALF_TURN if unit == "rad" else _HALF_WAY for unit in arm.units])
    above, below = np.isfinite(lower) & ~limited, np.isfinite(upper) & ~limited
    middle[above] = (lower + half)[above]
    middle[below] = (upper - half)[below]
    return np.maximum(lower, middle - half), np.minimum(upper, middle + half)


def _improved(
    arm: Arm,
    merit: Callable[[Array], float],
    q: Array,
    worth: float,
    rng: np.random.Generator,
) -> tuple[Array, float]:
    """Return a posture near ``q`` that is worth more, and its worth."""
    for step in np.geomspace(_FIRST_STEP, _LAST_STEP, _TRIALS):
        tried = q + step * rng.standard_normal(q.size)
        if arm.limits.violation(tried).any():
            continue
        if (gained := merit(tried)) > worth:
            q, worth = tried, gained
    return q, worth


def _merit(arm: Arm, candidates: Array, stands: bool = True) -> Callable[[Array], float]:
    """Return the function that judges a posture, from 0 to 1.

    Args:
        arm: The arm.
        candidates: Postures to compare with, shape (k, n).
        stands: Whether it matters where E points, and what is ahead of the base or below E.
    """
    kinematics, limits = arm.kinematics(), arm.limits
    weight = float(np.linalg.norm(arm.gravity))
    down = arm.gravity / weight if weight > 0.0 else np.array([0.0, 0.0, -1.0])
    chains = np.array([kinematics.skeleton(q) for q in candidates])
    reach = float(np.linalg.norm(chains[:, -1], axis=1).max())
    is_planar = bool(np.ptp(chains[:, -1, 2]) < 1e-9)
    farthest = np.max([_distances(chain) for chain in chains], axis=0)
    counts = farthest > _ALWAYS_CLOSE * reach
    half = (limits.position_upper - limits.position_lower) / 2.0
    rank = structural_rank(kinematics, candidates[:50], reach)

    def merit(q: Array) -> float:
        chain = kinematics.skeleton(q)
        place = placed(q, chain[1:]) if stands else 1.0
        if place == 0.0:
            return 0.0
        room = np.minimum(q - limits.position_lower, limits.position_upper - q)
        shares = np.divide(room, half, out=np.ones(arm.n), where=np.isfinite(half))
        apart = float((_distances(chain)[counts] / farthest[counts]).min())
        worth = min(float(shares.min()) / _ENOUGH_ROOM, 1.0) * min(apart / _APART, 1.0)
        return place * worth * float(conditioning(kinematics, q, reach)[rank - 1])

    def placed(q: Array, bodies: Array) -> float:
        p_WE, heights = bodies[-1], -bodies @ down
        out = np.linalg.norm(bodies[:, :2], axis=1) > _OUT * reach
        if bodies[:, 2].min() < 0.0 or (heights[out] < heights[-1] - _BELOW * reach).any():
            return 0.0
        ahead = (1.0 + p_WE[0] / max(float(np.linalg.norm(p_WE)), 1e-9)) / 2.0
        pointing = (1.0 + float(kinematics.R_WE(q)[:, 2] @ down)) / 2.0
        high = 1.0 if is_planar else min(float(p_WE[2]) / (_ENOUGH_HEIGHT * reach), 1.0)
        return ahead * pointing**2 * high

    return merit


def _distances(points: Array) -> Array:
    """Return the distances between points, shape (k, 3), pair by pair."""
    first, second = np.triu_indices(len(points), 1)
    return np.asarray(np.linalg.norm(points[first] - points[second], axis=1))

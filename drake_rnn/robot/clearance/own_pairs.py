"""Which pairs of an arm's own capsules are to stay apart."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import combinations, product

import numpy as np

from ...inputs.fields import Array
from ..arm import Arm
from .arm_shapes import Part
from .capsules import ArmCapsules, numbered
from .clearance import Clearance
from .least_distance import least_distance, search_bounds
from .pairs import Flags, Indices
from .solids import Solids

#: Bodies of an arm that are nearer than this at home count as touching by construction [m].
TOUCHING = 0.01
# Bodies whose shapes a search finds no nearer than this cannot touch [m]; it is made for so many
# joints between them, of which it sees all postures on a grid.
_APART, _FEW = 0.005, 2
# Postures of the one joint between two bodies; what changes their distance by less is none [m].
_POSTURES, _SAME = 721, 1e-6


def own_pairs(
    arm: Arm,
    capsules: ArmCapsules,
    left_out: Collection[Collection[str]],
    home: Array,
    parts: Sequence[Part],
    stated: Collection[str],
) -> tuple[Indices, list[tuple[str, str]]]:
    """Return the pairs of an arm's capsules that are to stay apart, shape (s, 2).

    Bodies that a joint connects are no pairs, nor those that move together. Other bodies of which
    one joint alone moves one beside the other are a pair only if that joint brings their capsules
    to each other.

    Args:
        arm: The arm.
        capsules: Its capsules.
        left_out: Pairs of bodies, or of their `numbered` capsules, that are not looked at.
        home: A posture in which the arm does not touch itself, shape (n,) [rad].
        parts: The shapes of its bodies.
        stated: Names of bodies whose capsules are stated. The capsules of others are fitted, and
            are no pairs with those that they touch at home.

    Returns:
        The pairs, and the names of those that are left out although they may touch.
    """
    out = {frozenset(pair) for pair in left_out} | _joined(arm, capsules)
    links, names = capsules.links, capsules.bodies
    both = list(zip(names, numbered(names), strict=True))
    found = [
        (a, b)
        for a, b in combinations(range(len(links)), 2)
        if links[a] != links[b] and out.isdisjoint(map(frozenset, product(both[a], both[b])))
    ]
    own = np.array(found, dtype=np.intp).reshape(-1, 2)
    near = Clearance(capsules, own, Solids.of([])).gaps(home) < TOUCHING
    beside = np.abs(links[own[:, 0]] - links[own[:, 1]]) == 1
    kept = ~beside | (_approach(arm, capsules, own, beside, home) & ~near)
    fitted = np.array([name not in stated for name in names])[own].any(axis=1)
    kept &= ~(near & fitted)
    joints = {(names[a], names[b]): abs(int(links[a] - links[b])) for a, b in own[near & ~kept]}
    return own[kept], [
        pair for pair, count in joints.items() if count > _FEW or _can_touch(arm, pair, parts, home)
    ]


def _joined(arm: Arm, capsules: ArmCapsules) -> set[frozenset[str]]:
    """Return the pairs of bodies that a controlled joint connects.

    Where one of them has no capsule, all that move with it stand for it.
    """
    plant, found = arm.plant(), set[frozenset[str]]()
    for number, name in enumerate(arm.joints):
        joint = plant.GetJointByName(name)
        sides = [
            {body.name()} & set(capsules.bodies)
            or {b for b, link in zip(capsules.bodies, capsules.links, strict=True) if link == moved}
            for body, moved in ((joint.parent_body(), number), (joint.child_body(), number + 1))
        ]
        found |= {frozenset((a, b)) for a in sides[0] for b in sides[1]}
    return found


def _approach(arm: Arm, capsules: ArmCapsules, own: Indices, beside: Flags, home: Array) -> Flags:
    """Return of which pairs the one joint between them brings the capsules to each other."""
    found, between = np.zeros(len(own), dtype=bool), capsules.links[own].min(axis=1)
    lower, upper = search_bounds(arm)
    for joint in np.unique(between[beside]):
        pairs = np.nonzero(beside & (between == joint))[0]
        q = np.tile(home, (_POSTURES, 1))
        q[:, joint] = np.linspace(lower[joint], upper[joint], _POSTURES)
        gaps = Clearance(capsules, own[pairs], Solids.of([])).gaps(q)
        found[pairs] = (gaps.min(axis=0) < TOUCHING) & (np.ptp(gaps, axis=0) > _SAME)
    return found


def _can_touch(arm: Arm, pair: tuple[str, str], parts: Sequence[Part], home: Array) -> bool:
    """Return whether the shapes of two bodies can touch, as far as they are known."""
    if not {*pair} <= {part.body for part in parts}:
        return True
    return least_distance(arm, pair, parts, enough=_APART, first=home).distance <= _APART

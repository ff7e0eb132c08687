"""What an arm is to stay clear of: which of its own bodies, and which obstacles."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from ...errors import InvalidInputError
from ...inputs.complaints import nearest
from ...inputs.fields import Array
from ..arm import Arm
from ..tool import bodies_at_tip
from .arm_capsules import capsules_of, place_capsules
from .clearance import Clearance
from .obstacles import Obstacle
from .solids import Solids

#: Bodies of an arm that are nearer than this at home count as touching by construction [m].
TOUCHING = 0.01


def arm_clearance(
    arm: Arm,
    obstacles: Sequence[Obstacle],
    posture: Array,
    pressed: Sequence[Obstacle] = (),
) -> tuple[Clearance, tuple[str, ...]]:
    """Return what an arm is to stay clear of, and warnings.

    Bodies that a joint connects are not looked at, nor those that the file of the arm's capsules
    leaves out. Of an arm without such a file, capsules are fitted to its geometry, and bodies whose
    capsules touch in a posture where they do not are left out, with a warning.

    Args:
        arm: The arm.
        obstacles: The obstacles.
        posture: The arm's home or another posture in which it does not touch itself, shape (n,)
            [rad].
        pressed: What its tool presses on, which only its other bodies are to stay clear of.

    Raises:
        InvalidInputError: If the arm has no geometry, its file of capsules does not fit it, or an
            obstacle has the name of what is pressed on.
    """
    described = arm.description.capsules
    capsules, left_out = capsules_of(arm)
    if not capsules:
        raise InvalidInputError(
            f"obstacles: {arm.model.name} has no geometry to keep clear of them; name a file of "
            "capsules in arm.capsules"
        )
    placed = place_capsules(arm, capsules)
    names = [capsule.body for capsule in capsules]
    for name in (name for pair in left_out for name in pair):
        if name not in names:
            raise InvalidInputError(
                f"{described}: left_out: no capsule of {name!r}; {nearest(name, names)}"
            )
    apart = [
        pair
        for pair in combinations(range(len(capsules)), 2)
        if abs(placed.links[pair[0]] - placed.links[pair[1]]) > 1
        and {names[pair[0]], names[pair[1]]} not in [set(out) for out in left_out]
    ]
    own = np.array(apart, dtype=np.intp).reshape(-1, 2)
    solids = Solids.of([*obstacles, *pressed])
    touching = _touching(arm, names, solids, {obstacle.name for obstacle in pressed})
    if described is not None:
        return Clearance(placed, own, solids, touching=touching), ()
    near = Clearance(placed, own, Solids.of([])).gaps(posture) < TOUCHING
    doubts = [
        f"obstacles: {names[a]} and {names[b]}, whose capsules touch where the arm is at home, may "
        "collide unseen; give a file of capsules in arm.capsules"
        for a, b in own[near]
    ]
    return Clearance(placed, own[~near], solids, touching=touching), tuple(doubts)


def _touching(
    arm: Arm, bodies: Sequence[str], solids: Solids, pressed: set[str]
) -> frozenset[tuple[int, int]]:
    """Return the pairs of a capsule of the tool and a solid that it presses on."""
    if not pressed:
        return frozenset()
    found = [k for k, name in enumerate(solids.names) if name in pressed]
    if len(found) > len(pressed):
        name = next(solids.names[k] for k in found if solids.names.count(solids.names[k]) > 1)
        raise InvalidInputError(
            f"obstacles: {name!r} is the name of what the tool presses on; give another name"
        )
    at_tip = bodies_at_tip(arm)
    return frozenset((a, k) for a, body in enumerate(bodies) if body in at_tip for k in found)

"""What an arm is to stay clear of: which of its own bodies, and which obstacles."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np

from ...errors import InvalidInputError
from ...inputs.arguments import checked, each, instance, vector
from ...inputs.fields import Array
from ..arm import Arm
from ..tool import bodies_at_tip
from .arm_capsules import capsules_of, place_capsules, stated_bodies
from .arm_shapes import HARDLY, ArmShapes, arm_shapes
from .capsules import ArmCapsules, Capsule
from .clearance import Clearance
from .obstacles import Obstacle
from .own_pairs import own_pairs
from .solids import Solids


@checked(arm=instance(Arm), obstacles=each(Obstacle), posture=vector, pressed=each(Obstacle))
def arm_clearance(
    arm: Arm,
    obstacles: Sequence[Obstacle],
    posture: Array,
    pressed: Sequence[Obstacle] = (),
) -> tuple[Clearance, tuple[str, ...]]:
    """Return what an arm is to stay clear of, and warnings.

    See `drake_rnn.robot.clearance.own_pairs` for the pairs of its own bodies. Bodies of which the
    arm's file has no capsule get one that is fitted to their shapes. Where that touches another one
    in a posture where the bodies do not touch, the pair is left out; a warning names those that may
    touch.

    Args:
        arm: The arm.
        obstacles: The obstacles.
        posture: The arm's home or another posture in which it does not touch itself, shape (n,)
            [rad].
        pressed: What its tool presses on, which only its other bodies are to stay clear of.

    Raises:
        InvalidInputError: If no body that the arm moves has a shape, the only mesh of a body cannot
            be read, a shape has no bounds, its file of capsules does not fit it, or an obstacle has
            the name of what is pressed on.
    """
    shapes = arm_shapes(arm)
    capsules, left_out = capsules_of(arm, shapes)
    placed = place_capsules(arm, capsules)
    stated = stated_bodies(arm)
    _require_shapes(arm, shapes, placed)
    own, unseen = own_pairs(arm, placed, left_out, posture, shapes.parts, stated)
    solids = Solids.of([*obstacles, *pressed])
    touching = _touching(arm, placed.bodies, solids, {obstacle.name for obstacle in pressed})
    doubts = [
        *(f"obstacles: {doubt}" for doubt in _doubts(arm, shapes, placed, stated)),
        *(f"obstacles: {doubt}" for doubt in _too_small(arm, shapes, capsules, stated)),
        *(f"obstacles: {doubt}" for doubt in _unseen(unseen)),
    ]
    return Clearance(placed, own, solids, touching=touching), tuple(doubts)


def _require_shapes(arm: Arm, shapes: ArmShapes, capsules: ArmCapsules) -> None:
    """Raise an InvalidInputError if it is not known where an arm is."""
    for lost in shapes.lost:
        if lost.link not in capsules.bodies:
            raise InvalidInputError(
                f"obstacles: {lost.link!r} has no shape to keep clear: its mesh {lost.mesh} "
                f"{lost.fault}; mend the model, or give the body a capsule in a file: arm.capsules"
            )
    tool = None if arm.tool is None else arm.tool.name
    moved = zip(capsules.bodies, capsules.links, strict=True)
    if not any(link > 0 and body != tool for body, link in moved):
        raise InvalidInputError(
            f"obstacles: {arm.model.name} has no geometry to keep clear of them; name a file of "
            "capsules in arm.capsules"
        )


def _doubts(
    arm: Arm, shapes: ArmShapes, capsules: ArmCapsules, stated: Collection[str]
) -> list[str]:
    """Return what of an arm is not kept clear, or differently from what its model says."""
    bare = ", ".join(body for body in shapes.bare if body not in capsules.bodies)
    told = shapes.doubts(stated)
    if bare:
        told.insert(
            0,
            f"nothing keeps these bodies of {arm.model.name} clear, which have no shape: {bare}; "
            "give them capsules in a file, arm.capsules",
        )
    return told


def _too_small(
    arm: Arm, shapes: ArmShapes, capsules: Sequence[Capsule], stated: Collection[str]
) -> list[str]:
    """Return a warning about stated capsules that hold less than the model's shapes."""
    found = dict[str, float]()
    for part in (part for part in shapes.parts if part.body in stated):
        own = [capsule.outside(part.points) for capsule in capsules if capsule.body == part.body]
        if (far := float(np.min(own, axis=0).max())) > HARDLY:
            found[part.body] = max(far, found.get(part.body, 0.0))
    if not found:
        return []
    named = ", ".join(f"{body} by {1e3 * far:.0f} mm" for body, far in found.items())
    file = Path(arm.description.capsules or "").name
    return [f"capsules of {file} hold less than the model's shapes: {named}"]


def _unseen(pairs: Sequence[tuple[str, str]]) -> list[str]:
    """Return a warning about pairs of bodies that may touch and are left out."""
    if not pairs:
        return []
    named = ", ".join(f"{a} and {b}" for a, b in pairs)
    return [
        f"{named} are not kept apart from each other, although they may touch: their capsules do "
        "where the arm is at home; give capsules that do not in a file, arm.capsules"
    ]


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

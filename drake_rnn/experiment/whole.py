"""Checks of an experiment as a whole: contact and target posture.

- The contact of an experiment's tool with a surface, checked together with its path.
- Check of whether a target posture can be reached while the end effector stays.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..errors import InvalidInputError
from ..inputs.fields import Array
from ..laws import Law, PostureLaw
from ..robot.arm import Arm
from ..robot.kinematics import TASKS
from ..robot.postures import SelfMotion
from .document import ExperimentDocument
from .sections import Sections

# Largest displacement [m] and rotation [rad] of the end effector in a target posture, and largest
# distance of a joint from where the self-motion towards the target ends [rad]. With a larger miss
# the law would trade one error for the other.
_MISS, _TURN, _SHORT = 1e-4, 1e-3, 0.01


def with_reachable_target(parts: Sections) -> tuple[Law, list[str]]:
    """Return the law with a target posture that can be reached, if it has one, and warnings.

    Args:
        parts: What the sections of the experiment's document describe.

    Raises:
        InvalidInputError: If no self-motion leads to it and ``on_unreachable`` is ``refuse``.
    """
    if not isinstance(parts.law, PostureLaw):
        return parts.law, []
    target, changes = _reachable(parts.document, parts.arm, parts.start, parts.law.target)
    return replace(parts.law, target=target), changes


def _reachable(
    document: ExperimentDocument, arm: Arm, start: Array, target: Array
) -> tuple[Array, list[str]]:
    """Return the target posture to seek, shape (n,) [rad], and warnings about it."""
    motion = SelfMotion(arm, start, document.task)
    if motion.free_dimensions == 0:
        raise InvalidInputError(
            f"task: {document.task} leaves {arm.name} no self-motion at its start: with its "
            f"{arm.n} joints, 0 free dimensions remain"
        )
    closest = motion.towards(target)
    _require_plane(document.task, arm, start, closest)
    short = np.abs(closest - target)
    distance, angle = motion.distance(target), motion.angle(target)
    if distance <= _MISS and angle <= _TURN and short.max() <= _SHORT:
        return target, _detours(arm, start, target)
    faults = []
    if distance > _MISS:
        faults.append(f"moves the end effector {distance:.3g} m from where it starts")
    if angle > _TURN:
        faults.append(f"turns it by {angle:.3g} rad")
    if not faults:
        faults.append("is not reached by the self-motion from the start, which gets stuck")
    worst = int(np.argmax(short))
    lower, upper = arm.limits.position_lower, arm.limits.position_upper
    what = (
        f"law.target: {' and '.join(faults)}; the nearest posture that can be reached is "
        f"[{', '.join(map(_typed, closest, lower, upper))}], {short[worst]:.3g} rad off in "
        f"{arm.joints[worst]}"
    )
    if arm.limits.violation(closest).any():
        raise InvalidInputError(f"{what}, which is outside its limits; start nearer to them")
    if document.on_unreachable == "refuse":
        raise InvalidInputError(f"{what}; give that, or on_unreachable: project")
    return closest, [f"{what}; that one is used instead", *_detours(arm, start, closest)]


def _require_plane(task: str, arm: Arm, start: Array, target: Array) -> None:
    """Raise an InvalidInputError if the end effector leaves the plane of a planar task."""
    kinematics = arm.kinematics()
    moved = np.abs(kinematics.p_WE(target) - kinematics.p_WE(start))
    moved[list(TASKS[task].axes)] = 0.0
    if moved.max() > _MISS:
        raise InvalidInputError(
            f"task: {task} leaves the end effector free along {'xyz'[int(np.argmax(moved))]}, by "
            f"{moved.max():.3g} m on the way to law.target; hold it with task: xyz"
        )


def _typed(q: float, lower: float, upper: float) -> str:
    """Return a joint position to six decimals, or exactly if rounding would break its limits."""
    text = f"{q:.6f}"
    return text if lower <= float(text) <= upper else repr(float(q))


def _detours(arm: Arm, start: Array, target: Array) -> list[str]:
    """Return warnings for joints that turn by more than pi although a shorter way exists."""
    other = target - 2 * np.pi * np.round((target - start) / (2 * np.pi))
    lower, upper = arm.limits.position_lower, arm.limits.position_upper
    detour = (np.abs(target - start) > np.pi) & (lower <= other) & (other <= upper)
    return [
        f"law.target: {name} has to turn by {abs(to - begin):.3g} rad; at {near:.6g} rad the "
        "posture is the same, and nearer"
        for name, begin, to, near, so in zip(arm.joints, start, target, other, detour, strict=True)
        if so
    ]

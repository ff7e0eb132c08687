"""What joints that lock do to the rest of an experiment."""

from __future__ import annotations

import numpy as np

from ..laws import PostureLaw
from ..robot.task import named_task
from .sections import Sections


def lock_doubts(parts: Sections) -> list[str]:
    """Return warnings about the joints that lock.

    Args:
        parts: What the sections of the experiment's document describe.
    """
    locks, document, arm = parts.locks, parts.document, parts.arm
    if locks is None:
        return []
    names = [arm.joints[joint] for joint in locks.joints]
    found, left = [], arm.n - len(names)
    if left < (size := named_task(document.task).size):
        found.append(
            f"faults: with {', '.join(names)} locked, {left} joints remain for the {size} "
            "dimensions of the task"
        )
    tellable = parts.law.sees_jacobian or parts.law.learns_jacobian
    if np.isfinite(locks.told).any() and not tellable:
        found.append(
            f"faults: {type(parts.law).__name__} sees and learns no Jacobian, so that it cannot be "
            "told; it goes on as if the joints moved"
        )
    if isinstance(parts.law, PostureLaw):
        found.append(
            f"faults: {', '.join(names)} will not reach the target posture, unless they lock there"
        )
    return found

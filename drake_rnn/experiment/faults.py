"""What joints that lock do to the rest of an experiment."""

from __future__ import annotations

import numpy as np

from ..diagrams import check_locks
from ..errors import InvalidInputError
from ..laws import PostureLaw
from ..laws.checks import sampled_reading
from ..laws.told_of_locks import tellable
from ..robot.task import named_task
from .guarantees import command_guarantee
from .sections import Sections


def lock_doubts(parts: Sections) -> list[str]:
    """Return warnings about the joints that lock.

    Args:
        parts: What the sections of the experiment's document describe.

    Raises:
        InvalidInputError: If joints cannot lock in such a loop.
    """
    locks, document, arm = parts.locks, parts.document, parts.arm
    if locks is None:
        return []
    check_locks(locks, document.period, parts.feedback, document.dither)
    if document.second is not None:
        raise InvalidInputError("second: must be left out with faults")
    if command_guarantee(parts.law, parts.safety).distance is not None:
        raise InvalidInputError(
            "obstacles: must not be avoided with faults; what is certified to stay clear of them "
            "is a stop of all joints at once, and a brake stops one of them alone"
        )
    names = [arm.joints[joint] for joint in locks.joints]
    found, left = [], arm.n - len(names)
    if left < (size := named_task(document.task).size):
        found.append(
            f"faults: with {', '.join(names)} locked, {left} joints remain for the {size} "
            "dimensions of the task"
        )
    if np.isfinite(locks.told).any() and not _tellable(parts):
        found.append(
            f"faults: {type(parts.law).__name__} sees and learns no Jacobian, so that it cannot be "
            "told; it goes on as if the joints moved"
        )
    if isinstance(parts.law, PostureLaw):
        found.append(
            f"faults: {', '.join(names)} will not reach the target posture, unless they lock there"
        )
    return found


def _tellable(parts: Sections) -> bool:
    period = parts.document.period
    return period is not None and tellable(sampled_reading(parts.law, period))

"""What there is to doubt of a posture that joints are pulled towards while they do their task."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...inputs.fields import Array
from ...robot.limits import JointLimits

# A posture this close to a limit [rad], or with so small a singular value, is doubted.
_NEAR_LIMIT, _SINGULAR = 0.1, 0.05


def posture_doubts(
    key: str, target: Array, limits: JointLimits, task_J: Callable[[Array], Array] | None
) -> list[str]:
    """Return sentences on what may go wrong, with remedies.

    Args:
        key: What gives the posture, for messages.
        target: The posture, shape (n,) [rad].
        limits: Limits of the joints.
        task_J: Jacobian of the task, shape (m, n), of joint positions; None if it is not known.
    """
    gap = np.minimum(target - limits.position_lower, limits.position_upper - target)
    found = []
    if gap.min() < _NEAR_LIMIT:
        found.append(
            f"{key}: joint {int(gap.argmin()) + 1} is pulled to {max(gap.min(), 0.0):.2g} rad "
            "from its limit, and may be held there; consider another law.secondary.target, or "
            "law.secondary.posture: 0"
        )
    if task_J is not None:
        least = float(np.linalg.svd(task_J(target), compute_uv=False)[-1])
        if least < _SINGULAR:
            found.append(
                f"{key}: the arm is pulled towards a posture that is singular for its task "
                f"(smallest singular value {least:.2g}), where it loses the task; consider "
                "law.secondary.target with the joints some 0.1 rad away, or "
                "law.secondary.posture: 0"
            )
    return found

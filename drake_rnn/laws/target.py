"""What laws that seek a target posture have in common."""

from __future__ import annotations

import numpy as np

from ..fields import Array
from ..limits import JointLimits


def check_target(target: Array, limits: JointLimits) -> None:
    """Raise a ValueError if ``target``, shape (n,) [rad], is no posture within ``limits``."""
    if target.size != limits.size:
        raise ValueError(f"target: must have {limits.size} entries, one a joint, not {target.size}")
    outside = limits.violation(target)
    if outside.any():
        joint = int(np.argmax(outside))
        lower, upper = limits.position_lower[joint], limits.position_upper[joint]
        raise ValueError(
            f"target: joint {joint + 1} is at {target[joint]:.6g} rad; "
            f"it may be {lower:.6g} to {upper:.6g}"
        )

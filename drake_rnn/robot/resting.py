"""Where joints may rest: within their position limits, and within the envelope of the velocity."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import InvalidInputError
from ..inputs.fields import Array
from .limits import JointLimits

# A posture this far outside is there but for rounding [rad].
_ROUNDING = 1e-9


def require_resting(
    limits: JointLimits,
    q: Array,
    key: str,
    names: Sequence[str] | None = None,
    units: Sequence[str] | None = None,
) -> None:
    """Raise an InvalidInputError if a joint is too close to a limit to rest under its envelope.

    Without an envelope nothing is checked.

    Args:
        limits: Limits of the joints.
        q: Their positions, shape (n,) [rad].
        key: Begins the message.
        names: Names of the joints; by default their numbers.
        units: Units of their positions; by default rad.
    """
    if limits.envelope is None:
        return
    lower, upper = limits.resting
    beyond = np.maximum(lower - q, q - upper)
    worst = int(np.argmax(beyond))
    if not beyond[worst] > _ROUNDING:
        return
    name = f"joint {worst + 1}" if names is None else names[worst]
    unit = "rad" if units is None else units[worst]
    raise InvalidInputError(
        f"{key}: {name} is at {q[worst]:.6g} {unit}; under the envelope of its velocity it may "
        f"rest at {lower[worst]:.6g} to {upper[worst]:.6g} {unit}"
    )

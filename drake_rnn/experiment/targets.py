"""The joint targets that an experiment's document describes."""

from __future__ import annotations

import numpy as np

from ..errors import InvalidInputError
from ..laws import Law
from ..paths import JointTargets
from ..robot.arm import Arm
from .document import ExperimentDocument


def followed_targets(
    document: ExperimentDocument, kind: type[Law], arm: Arm
) -> tuple[JointTargets | None, list[str]]:
    """Return the joint targets that a law follows, and warnings; None for a law of another kind.

    Args:
        document: Document of the experiment.
        kind: Class of its law.
        arm: The arm, with the limits of the experiment.

    Raises:
        InvalidInputError: If targets are not those of the arm, or none comes during the run.
    """
    if not kind.follows_joint_targets or document.targets is None:
        return None, []
    targets = document.targets.of_arm(arm.joints)
    if not (targets.followed.time < document.duration).any():
        raise InvalidInputError(
            f"targets: none that is followed comes within the duration, {document.duration:g} s"
        )
    return targets, [*_late(targets, document.duration), *_beyond_limits(targets, arm)]


def _late(targets: JointTargets, duration: float) -> list[str]:
    """Return a warning about targets that come after the run."""
    if targets.time[-1] <= duration:
        return []
    return [f"targets: end at {targets.time[-1]:g} s, and the run at {duration:g} s"]


def _beyond_limits(targets: JointTargets, arm: Arm) -> list[str]:
    """Return a warning about targets beyond the position limits."""
    followed = targets.followed
    beyond = arm.limits.violation(followed.position)
    count = int((beyond > 0.0).any(axis=1).sum())
    if not count:
        return []
    k, joint = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
    return [
        f"targets: {count} of {len(beyond)} are beyond the position limits, {arm.joints[joint]} by "
        f"{beyond[k, joint]:.3g} {arm.units[joint]} at t = {followed.time[k]:.4g} s; the arm goes "
        "to its limits"
    ]

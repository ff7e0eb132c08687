"""The joints of a document that lock during the run."""

from __future__ import annotations

from ..errors import InvalidInputError
from ..robot.arm import Arm
from ..robot.joint_locks import JointLocks
from .document import ExperimentDocument


def joint_locks(document: ExperimentDocument, arm: Arm) -> JointLocks | None:
    """Return when the joints of an arm lock; None if none does.

    Raises:
        InvalidInputError: If there is no such joint, one locks twice, or none does in this run.
    """
    if not document.faults:
        return None
    for number, lock in enumerate(document.faults):
        if lock.time >= document.duration:
            raise InvalidInputError(
                f"faults.{number}.time: must be before the end of the run, "
                f"{document.duration:g} s, not {lock.time:g}"
            )
        if lock.time + lock.told_after >= document.duration:
            raise InvalidInputError(
                f"faults.{number}.told_after: must end before the run does, at "
                f"{document.duration:g} s, not be {lock.told_after:g}; for never, give told: false"
            )
        try:
            JointLocks.of(arm.joints, document.faults[: number + 1])
        except InvalidInputError as error:
            raise InvalidInputError(f"faults.{number}.{error}") from None
    return JointLocks.of(arm.joints, document.faults)

"""Which limits and distances hold by construction, and of what: of the command or of the arm.

They are computed once, when the experiment is made: from what its law declares, and from what
stands between the law and the arm. Verdicts, figures and pages read them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from ..features.filter import averaged_limits
from ..features.locks import JointLocks
from ..laws import Law, Safety
from ..robot.limits import JointLimits
from ..systems import BODIES, Feedback
from .document import ExperimentDocument

#: Limits of what is commanded that the stop of a joint keeps if the command before it did.
_STOPS_WITHIN = ("acceleration", "jerk")
#: Limits that hold of the arm only if its positions are those that the law counts with; a stop
#: keeps them only if the command left it room.
_OF_POSITIONS = ("position", "envelope")


class Guarantee(NamedTuple):
    """What holds by construction, whatever the inputs of the law are.

    Attributes:
        limits: Names of limits, of `drake_rnn.robot.limits.LIMIT_UNITS`.
        distance: Least distance from the arm itself and from obstacles that stand still [m]; None
            if none holds.
    """

    limits: tuple[str, ...] = ()
    distance: float | None = None


@dataclass(frozen=True)
class Guarantees:
    """What an experiment's command and its arm keep by construction.

    Attributes:
        command: What the command keeps: that of the law, or what `Safety` makes of it.
        arm: What the arm keeps. It keeps nothing if it does not move as commanded, because of its
            motors, of an actuated dither or of a disturbance.
    """

    command: Guarantee
    arm: Guarantee

    @property
    def command_only(self) -> tuple[str, ...]:
        """Names of the limits that the command keeps, but nothing keeps of the arm."""
        return tuple(name for name in self.command.limits if name not in self.arm.limits)


def command_guarantee(law: Law, safety: Safety | None) -> Guarantee:
    """Return what the command of a law keeps, or what safety makes of it.

    Args:
        law: The law, which declares what it keeps.
        safety: What bounds the law's command; None if it is taken as it is.
    """
    if safety is None:
        return Guarantee(law.keeps, law.keeps_distance)
    # What safety changes keeps no higher limit that the law's own command kept.
    distances = (law.keeps_distance, safety.keeps_distance)
    return Guarantee(safety.keeps, max((d for d in distances if d is not None), default=None))


def guarantees_of(
    document: ExperimentDocument,
    command: Guarantee,
    *,
    limits: JointLimits,
    feedback: Feedback,
    locks: JointLocks | None,
) -> Guarantees:
    """Return what command and arm of an experiment keep.

    Behind a filter the arm's positions are means of those of an unfiltered arm that the law sees,
    if neither a bound on the velocity nor a precompensation changes the command before. A law that
    sees positions with errors of measurement can keep no limit of the true ones, and no distance.
    A joint that locks stops within the limits that the command kept, but not within higher ones.

    Args:
        document: The experiment's document.
        command: What its command keeps.
        limits: Limits of the joints.
        feedback: Arm that the law sees.
        locks: When joints lock; None if none does.
    """
    noise = document.joint_noise
    if BODIES[document.level].has_motors or (noise is not None and noise.moves_arm):
        return Guarantees(command, Guarantee())
    if document.filter is not None:
        means = feedback == "unfiltered" and not document.filter.precompensate
        arm = _behind_filter(command, limits, means)
    elif document.sensing is not None:
        arm = Guarantee(tuple(name for name in command.limits if name not in _OF_POSITIONS))
    else:
        arm = command
    return Guarantees(command, arm if locks is None else _with_locks(arm, locks, limits))


def _behind_filter(command: Guarantee, limits: JointLimits, means: bool) -> Guarantee:
    """Return what a filter keeps, whose positions are ``means`` of those commanded or are not."""
    kept = averaged_limits(limits)
    within = means and {"position", "velocity"} <= {*command.limits}
    return Guarantee(("position", *kept) if within else kept)


def _with_locks(arm: Guarantee, locks: JointLocks, limits: JointLimits) -> Guarantee:
    """Return what is left of what an arm keeps where joints lock: a stop is of all joints."""
    able = ("velocity", *_STOPS_WITHIN) if not locks.at_once.any() else ("velocity",)
    # A command within fewer bounds than its stop may need more way than it has.
    room = _bounded(_STOPS_WITHIN, limits) <= set(arm.limits)
    return Guarantee(
        tuple(name for name in arm.limits if name in able or (room and name in _OF_POSITIONS))
    )


def _bounded(names: Sequence[str], limits: JointLimits) -> set[str]:
    return {name for name in names if limits.bounds[name] is not None}

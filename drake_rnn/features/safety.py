"""What is kept of the command of any law, as a document says."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from ..inputs.fields import Array, validated
from ..inputs.keys import Meaning, Only
from ..laws import Avoidance, Law, Safety
from ..laws.checks import sampled_reading
from ..robot.clearance import Clearance
from ..robot.limits import JointLimits
from .feature import Feature, Guarantee


@validated
class SafetySettings:
    """What is kept of the command, whatever the law is."""

    bounds: Annotated[
        bool,
        Meaning(
            "Whether the limits of the joints are kept: of position and velocity, and those of "
            "acceleration and jerk that are given.",
        ),
    ] = True
    collisions: Annotated[
        bool,
        Meaning("Whether the arm is kept clear of itself and of ``obstacles``."),
    ] = False
    avoidance: Annotated[
        Avoidance,
        Meaning("How near it may come.", only=(Only("collisions"),)),
    ] = Field(default_factory=Avoidance)

    def __post_init__(self) -> None:
        if not self.bounds:
            raise ValueError(
                "bounds: must be true; a stop that is certified keeps them. Leave safety out to "
                "keep nothing"
            )


def make_safety(
    settings: SafetySettings | None,
    law: Law,
    limits: JointLimits,
    period: float | None,
    start: Array,
    clearance: Clearance | None,
) -> Safety | None:
    """Return what is kept of a law's command; None if the law's own is taken as it is.

    Args:
        settings: What the document says.
        law: The law.
        limits: Limits of the joints in the experiment.
        period: Sampling period [s]; None for a law that an integrator runs.
        start: Start posture, shape (n,) [rad].
        clearance: What the arm is to stay clear of, if that is looked at.

    Raises:
        InvalidInputError: If nothing can be kept of such a command, or the arm starts too near to
            something.
    """
    if settings is None or period is None:
        return None
    safety = Safety(limits, clearance if settings.collisions else None, settings.avoidance)
    safety.check_start(start)
    safety.around(sampled_reading(law, period), period)
    return safety


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


class SafetyFeature(Feature):
    """The section ``safety``; what it guarantees is what the command keeps."""

    key = "safety"

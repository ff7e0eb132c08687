"""Robots that can be driven, and what of their own limits a drive uses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import InvalidInputError
from ..experiment import Described, Experiment, make_experiment, read_document
from ..inputs.fields import Array
from ..robot.limits import JointLimits
from ..robot.load_arm import load_arm


@dataclass(frozen=True)
class Robot:
    """A robot behind messages.

    Attributes:
        name: Its name on the command line.
        arm: Its shipped arm.
        period: Time of a cycle [s].
        inside: How far commands stay inside its position limits [rad].
        clipped: How far inside its position limits its own driver clips commands [rad].
        share: Share of its limits of velocity and acceleration that commands use.
    """

    name: str
    arm: str
    period: float
    inside: float
    clipped: float
    share: float

    @property
    def limits(self) -> JointLimits:
        """The robot's own limits."""
        return load_arm(self.arm).limits

    @property
    def commanded(self) -> JointLimits:
        """Limits that every command keeps, the robot's own reduced by the margins."""
        own = self.limits
        return own.replace(
            position_lower=own.position_lower + self.inside,
            position_upper=own.position_upper - self.inside,
            velocity=self.share * own.velocity,
            acceleration=self.share * own.require("acceleration", "the robot's bounds"),
        )

    @property
    def measured(self) -> JointLimits:
        """Limits at which a measured joint stops the robot, where its driver clips."""
        own = self.limits
        return own.replace(
            position_lower=own.position_lower + self.clipped,
            position_upper=own.position_upper - self.clipped,
        )


#: The KUKA LBR iiwa behind drake-iiwa-driver, which clips commands 1 degree inside.
IIWA = Robot("iiwa", "iiwa14", 5e-3, inside=0.05, clipped=np.deg2rad(1.0).item(), share=0.9)

#: Robots by name.
ROBOTS = {robot.name: robot for robot in (IIWA,)}


def driven_experiment(
    experiment: Described, robot: Robot, changes: Mapping[str, Any] | None = None
) -> Experiment:
    """Return an experiment as a robot is to carry it out.

    It is at ``level: robot``, with the robot's arm in place of the document's, and with the
    stricter of its own limits and the robot's, reduced by the margins.

    Args:
        experiment: What `drake_rnn.load_experiment` takes.
        robot: The robot.
        changes: Changes of the document by dotted key.

    Raises:
        InvalidInputError: If the document is wrong; if it has a start posture of another arm; or
            if the start is outside the limits.
    """
    document = read_document(experiment, changes) | {"level": "robot"}
    given = document.get("arm")
    model = given.get("model") if isinstance(given, dict) else given
    if model != robot.arm:
        if document.get("start") is not None:
            raise InvalidInputError(
                f"start: is a posture of {model}; {robot.name} is an {robot.arm}: give arm: "
                f"{robot.arm} and a start of its own, or leave start out"
            )
        document["arm"] = robot.arm
    wanted = make_experiment(document).limits
    document["limits"] = _stricter(wanted, robot.commanded)
    found = make_experiment(document)
    if found.limits.violation(found.start).any():
        why = found.limits.complaint(found.start, 0.0, found.arm.joints, found.arm.units)
        raise InvalidInputError(f"start: {why}")
    if found.second is not None:
        raise InvalidInputError("second: must be left out; one robot is driven at a time")
    return found


def _stricter(wanted: JointLimits, own: JointLimits) -> dict[str, list[float]]:
    """Return the stricter of two limits, by name, as a document has them."""
    found: dict[str, list[float]] = {}
    for name, bound in wanted.bounds.items():
        known: list[Array] = [each for each in (bound, own.bounds[name]) if each is not None]
        if known:
            strictest = np.max if name == "position_lower" else np.min
            found[name] = strictest(known, axis=0).tolist()
    return found

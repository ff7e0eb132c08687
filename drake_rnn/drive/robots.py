"""Robots that can be driven, and what of their own limits a drive uses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..errors import InvalidInputError
from ..experiment import Described, Experiment, make_experiment, read_document
from ..features.pairs import refuse
from ..inputs.arguments import checked, flag, instance, number, optional
from ..inputs.complaints import require_type
from ..inputs.fields import Array
from ..robot.limits import JointLimits
from ..robot.load_arm import load_arm


@checked(
    name=instance(str),
    arm=instance(str),
    inside=number(0.0),
    clipped=number(0.0),
    share=number(above=0.0),
    slower=number(0.0),
    paced=flag,
    without_jerk=optional(number(above=0.0)),
    url=instance(str),
)
@dataclass(frozen=True)
class Robot:
    """A robot behind messages.

    Attributes:
        name: Its name on the command line.
        arm: Its shipped arm.
        inside: How far commands stay inside its position limits [rad].
        clipped: How far inside its position limits its own driver clips commands [rad].
        share: Share of its limits of velocity and acceleration that commands use.
        slower: Margin of the velocity, also of its envelope near position limits [rad/s].
        paced: Whether it waits for nobody, so that its connection is paced, see `Connection`.
        without_jerk: Largest acceleration of a law that does not bound the jerk [rad/s^2]; None if
            the robot does not check the jerk.
        url: Address by default; empty if there is none.
    """

    name: str
    arm: str
    inside: float
    clipped: float
    share: float = 1.0
    slower: float = 0.0
    paced: bool = False
    without_jerk: float | None = None
    url: str = ""

    @cached_property
    def period(self) -> float:
        """Time of a cycle, between two of its messages [s]."""
        period = load_arm(self.arm).description.message_period
        assert period is not None
        return period

    @cached_property
    def joints(self) -> tuple[str, ...]:
        """Names of its joints."""
        return load_arm(self.arm).joints

    @cached_property
    def limits(self) -> JointLimits:
        """The robot's own limits."""
        return load_arm(self.arm).limits

    @property
    def commanded(self) -> JointLimits:
        """Limits that every command keeps, the robot's own reduced by the margins."""
        own = self.limits
        offset = own.envelope_offset
        return own.replace(
            position_lower=own.position_lower + self.inside,
            position_upper=own.position_upper - self.inside,
            velocity=self.share * own.velocity - self.slower,
            acceleration=self.share * own.require("acceleration", "the robot's bounds"),
            envelope_offset=None if offset is None else offset + self.slower,
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
IIWA = Robot(
    "iiwa",
    "iiwa14",
    inside=0.05,
    clipped=np.deg2rad(1.0).item(),
    share=0.9,
    url="udpm://239.255.76.67:7699?ttl=0",
)
#: The Franka FR3, which judges each command, also by what it measures meanwhile.
FR3 = Robot("fr3", "fr3", inside=0.05, clipped=0.0, slower=0.3, paced=True, without_jerk=2.4)

#: Robots by name.
ROBOTS = {robot.name: robot for robot in (IIWA, FR3)}


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
    require_type("robot", robot, Robot)
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
    wanted = make_experiment(document)
    if robot.paced:
        _require_paced(wanted, robot)
    document["limits"] = _stricter(wanted.limits, robot.commanded)
    if robot.without_jerk is not None and "jerk" not in wanted.guarantees.command.limits:
        # Without a bound of the jerk, the stop has none either.
        slow = np.minimum(document["limits"]["acceleration"], robot.without_jerk)
        document["limits"] |= {"acceleration": slow.tolist(), "jerk": None}
    found = make_experiment(document)
    if found.limits.violation(found.start).any():
        why = found.limits.complaint(found.start, 0.0, found.arm.joints, found.arm.units)
        raise InvalidInputError(f"start: {why}")
    refuse(replace(found.combination, host="drive", robot=robot.name))
    return found


def _require_paced(experiment: Experiment, robot: Robot) -> None:
    """Raise an InvalidInputError for what does not go on from where a paced connection is."""
    document = experiment.document
    if document.period is None or abs(document.period - robot.period) > 1e-9:
        raise InvalidInputError(
            f"period: must be {robot.period:g} s, the cycle of the {robot.name}, not "
            f"{document.period}"
        )
    refuse(replace(experiment.combination, host="paced drive", robot=robot.name))


def _stricter(wanted: JointLimits, own: JointLimits) -> dict[str, list[float]]:
    """Return the stricter of two limits, by name, as a document has them."""
    found: dict[str, list[float]] = {}
    for name, bound in wanted.bounds.items():
        known: list[Array] = [each for each in (bound, own.bounds[name]) if each is not None]
        if known:
            strictest = np.max if name in ("position_lower", "envelope_offset") else np.min
            found[name] = strictest(known, axis=0).tolist()
    return found

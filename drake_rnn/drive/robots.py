"""Robots that can be driven, and what of their own limits a drive uses.

- What a robot tells and is told, whatever its messages are.
- When a robot is stopped, and how it is brought to the start.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import isfinite, nan
from typing import Annotated, Any, NamedTuple, Protocol

import numpy as np

from ..errors import InvalidInputError, OldName
from ..experiment import Experiment, ExperimentSource, make_experiment, read_document
from ..features.pairs import refuse
from ..inputs.fields import (
    Array,
    NonNegative,
    Positive,
    Time,
    between,
    checked,
    flag,
    instance,
    number,
    optional,
    validated,
)
from ..inputs.messages import require_type
from ..laws.law import Signals
from ..robot.limits import JointLimits
from ..robot.load_arm import load_arm
from .law_in_c import LawInC


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
    def command_limits(self) -> JointLimits:
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
    def measurement_limits(self) -> JointLimits:
        """Limits at which a measured joint stops the robot, where its driver clips."""
        own = self.limits
        return own.replace(
            position_lower=own.position_lower + self.clipped,
            position_upper=own.position_upper - self.clipped,
        )

    commanded = OldName("command_limits")
    measured = OldName("measurement_limits")


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
    experiment: ExperimentSource, robot: Robot, changes: Mapping[str, Any] | None = None
) -> Experiment:
    """Return an experiment as a robot is to carry it out.

    It is at ``level: robot``, with the robot's arm in place of the document's, and with the
    stricter of its own limits and the robot's, reduced by the margins.

    Args:
        experiment: What `drake_rnn.load_experiment` takes.
        robot: The robot.
        changes: Changes of the document by dotted key.

    Raises:
        InvalidInputError: If the document is wrong; if it has a start posture of another arm, or
            other joints or another order of these; or if the start is outside the limits.
    """
    require_type("robot", robot, Robot)
    document = read_document(experiment, changes) | {"level": "robot"}
    section = document.get("arm")
    model = section.get("model") if isinstance(section, dict) else section
    if model != robot.arm:
        if document.get("start") is not None:
            raise InvalidInputError(
                f"start: is a posture of {model}; {robot.name} is an {robot.arm}: give arm: "
                f"{robot.arm} and a start of its own, or leave start out"
            )
        document["arm"] = robot.arm
    slow_experiment = make_experiment(document)
    if slow_experiment.arm.joints != robot.joints:
        refuse(replace(slow_experiment.combination, host="drive", robot=robot.name))
        raise InvalidInputError(
            f"arm.joints: must be those of the {robot.name}, in its order: "
            f"{', '.join(robot.joints)}; not {', '.join(slow_experiment.arm.joints)}"
        )
    if robot.paced:
        _require_paced(slow_experiment, robot)
    document["limits"] = _stricter(slow_experiment.limits, robot.command_limits)
    if robot.without_jerk is not None and "jerk" not in slow_experiment.guarantees.command.limits:
        # Without a bound of the jerk, the stop has none either.
        slow = np.minimum(document["limits"]["acceleration"], robot.without_jerk)
        document["limits"] |= {"acceleration": slow.tolist(), "jerk": None}
    robot_experiment = make_experiment(document)
    if robot_experiment.limits.violation(robot_experiment.start).any():
        why = robot_experiment.limits.complaint(
            robot_experiment.start, 0.0, robot_experiment.arm.joints, robot_experiment.arm.units
        )
        raise InvalidInputError(f"start: {why}")
    refuse(replace(robot_experiment.combination, host="drive", robot=robot.name))
    return robot_experiment


def _require_paced(experiment: Experiment, robot: Robot) -> None:
    """Raise an InvalidInputError for what does not go on from where a paced connection is."""
    document = experiment.document
    if document.period is None or abs(document.period - robot.period) > 1e-9:
        raise InvalidInputError(
            f"period: must be {robot.period:g} s, the cycle of the {robot.name}, not "
            f"{document.period}"
        )
    refuse(replace(experiment.combination, host="paced drive", robot=robot.name))


def _stricter(limits: JointLimits, own: JointLimits) -> dict[str, list[float]]:
    """Return the stricter of two limits, by name, as a document has them.

    Raises:
        InvalidInputError: If bounds of the two directions differ.
    """
    limits.require_one_bound("a drive")
    entries: dict[str, list[float]] = {}
    for name, bound in limits.bounds.items():
        finite: list[Array] = [each for each in (bound, own.bounds[name]) if each is not None]
        if finite:
            strictest = np.max if name in ("position_lower", "envelope_offset") else np.min
            entries[name] = strictest(finite, axis=0).tolist()
    return entries


class Motion(NamedTuple):
    """A commanded motion at the end of a cycle.

    Attributes:
        position: Joint positions, shape (n,) [rad].
        velocity: Velocities that have led there, shape (n,) [rad/s].
        acceleration: Accelerations that have led to these, shape (n,) [rad/s^2].
    """

    position: Array
    velocity: Array
    acceleration: Array

    @property
    def rests(self) -> bool:
        """Whether nothing moves."""
        return not (self.velocity.any() or self.acceleration.any())

    def equals(self, other: Motion) -> bool:
        """Return whether all numbers are the same."""
        return all(map(np.array_equal, self, other))


@dataclass(frozen=True, eq=False)
class Command:
    """What a robot is told in a cycle.

    Attributes:
        time: Time of the robot's clock that it is for [s].
        motion: The motion; what the robot is told are the positions.
        limits: Limits of acceleration and jerk within which the joints are to come to rest if
            nobody commands any more; for a connection that sees to it.
        then: The motions of the cycles after it, as far as they are known; likewise.
    """

    time: float
    motion: Motion
    limits: JointLimits
    then: Sequence[Motion] = ()


@dataclass(frozen=True, eq=False)
class RobotStatus:
    """What a robot tells in a cycle.

    Attributes:
        time: Its own clock [s].
        position: Measured joint positions, shape (n,) [rad].
        velocity: Estimated joint velocities, shape (n,) [rad/s].
        commanded: Positions that it holds as its command, shape (n,) [rad].
        motion: What a paced connection has commanded in this cycle; None of any other.
        earlier: Older statuses that have come together with it, the oldest first.
        fault: Why the message cannot be read; the numbers mean nothing then.
    """

    time: float
    position: Array
    velocity: Array
    commanded: Array
    motion: Motion | None = None
    earlier: Sequence[RobotStatus] = ()
    fault: str = ""

    def complaint(self, joints: int) -> str:
        """Return why it is no status of a robot with so many joints; empty if it is one."""
        if self.fault:
            return self.fault
        if not isfinite(self.time):
            return f"a status has the time {self.time} s"
        for values in (self.position, self.velocity, self.commanded):
            if values.shape != (joints,):
                return f"a status has {values.size} joints; the arm has {joints}"
        return ""


class LawCourse(NamedTuple):
    """How far a law has come that a connection runs.

    Attributes:
        origin: Robot's clock at its first sample [s]; NaN before it.
        is_over: Whether the cycle has been answered that follows its last sample.
        why: Why it commands nothing any more, behind the watch that says so; empty if it does.
    """

    origin: float = nan
    is_over: bool = False
    why: str = ""


class LawSample(NamedTuple):
    """A sample of a law that a connection runs.

    Attributes:
        time: Its time [s].
        position, velocity: Measured then, shape (n,) each [rad, rad/s].
        before: The motion that it goes on from.
        state: The law's state after it, shape (state.size,).
    """

    time: float
    position: Array
    velocity: Array
    before: Motion
    state: Array


class Connection(Protocol):
    """A connection to a robot that takes a command of joint positions in each cycle.

    A robot of this kind may wait for a command, as an iiwa does. One that does not, as an FR3, has
    a *paced* connection: it answers the robot itself in each cycle, by the command that was sent
    for it or, where there is none, by a step of the fastest stop. Its statuses tell what it has
    commanded, and the next command goes on from there.
    """

    #: Whether it answers the robot itself.
    paced: bool = False

    @property
    def period(self) -> float:
        """Time of a cycle [s]."""

    def now(self) -> float:
        """Return the time of this side's clock, which never jumps [s]."""

    def next(self, timeout: float) -> RobotStatus | None:
        """Return the newest status, with all that have not been returned yet; None if none comes.

        Args:
            timeout: Time to wait for it [s].
        """

    def send(self, command: Command) -> None:
        """Send a command."""

    def others(self) -> int:
        """Return how many commands of other programs have been seen since it was made."""
        return 0

    def listen(self) -> None:
        """Begin to listen to the robot: what takes time has been done."""
        return None

    def begin(self) -> None:
        """Take the robot over, which has been listened to.

        Raises:
            RobotError: If it does not let itself be taken over.
        """
        return None

    def take_law(
        self, law: LawInC, limits: JointLimits, commanded: JointLimits, late: float
    ) -> bool:
        """Take over a law that is compiled to C, to be run by `run`; return whether it does so.

        Args:
            law: The law.
            limits: Limits of the law, which its stop keeps.
            commanded: Limits of every command.
            late: Time without a call of `next` after which the robot is brought to rest [s].
        """
        return False

    def run(self) -> None:
        """Begin to run the law that was taken over, from the next cycle on."""
        return None

    @property
    def course(self) -> LawCourse:
        """How far the law has come that was taken over."""
        return LawCourse()

    @property
    def late(self) -> int:
        """Cycles in which the law was due that was taken over, and has not commanded the robot.

        Those to which the robot has lost others are not among them.
        """
        return 0

    @property
    def lost(self) -> int | None:
        """Cycles that the robot has gone by without an answer while it was moved.

        None where statuses are counted instead.
        """
        return None

    def samples(self) -> list[LawSample]:
        """Return all samples that the law has made which was taken over."""
        return []

    def commanded(self) -> Signals | None:
        """Return what a robot that does not wait was commanded in each of its cycles.

        ``time`` on its clock, shape (k,) [s], and ``position`` then, shape (k, n) [rad]: in cycles
        that it has lost, where it has gone on to. None of another robot.
        """
        return None

    def rest(self) -> None:
        """Have a paced connection bring the robot to rest, whatever is sent from now on."""
        return None

    def end(self) -> None:
        """Hand the robot back, which rests."""
        return None

    @property
    def failure(self) -> str:
        """Why the robot takes no more commands; empty while it does."""
        return ""


Share = Annotated[Positive, between(0.01, 1.0)]


@validated
class DriveSettings:
    """What a drive waits for, tolerates and moves to its start with.

    Args:
        contact: Time to wait for a first status [s].
        listen: Time for which the robot is listened to before a first command, and must stand
            still [s]; drake-iiwa-driver gives up if commanded within a quarter of a second.
        still: Speed below which a joint stands still [rad/s].
        silence: Time without a status after which the robot is stopped [s].
        late: Time that the robot's clock may pass between two cycles, on either side's account,
            before the robot is stopped [s].
        lag: Distance of a joint from its command at which the robot is stopped [rad].
        jump: Distance that a measured joint may jump beyond what its largest speed explains [rad].
        hold: Time without a command after which the robot has stopped by itself, so that it is
            told to stay where it was commanded to be last [s].
        approach_velocity: Largest speed of a joint on the way to the start [rad/s].
        approach_acceleration: Largest acceleration on that way [rad/s^2].
        approach_jerk: Largest jerk on that way [rad/s^3].
        approach_time: Time that the way to the start may take [s].
    """

    contact: Time = 5.0
    listen: Annotated[Time, between(0.3, 60.0)] = 0.5
    still: Positive = 0.02
    silence: Time = 0.1
    late: Time = 0.1
    lag: Positive = 0.1
    jump: NonNegative = 0.02
    hold: Time = 0.1
    approach_velocity: Positive = 0.3
    approach_acceleration: Positive = 0.5
    approach_jerk: Positive = 5.0
    approach_time: Time = 120.0

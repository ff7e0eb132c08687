"""Why a robot is to be stopped: each watch looks at one thing, and says what is wrong with it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..inputs.fields import Array
from ..robot.limits import JointLimits
from .connection import Motion, RobotStatus

# Share by which rounding may take a command beyond a speed.
_ROUNDING = 1e-6


class StopError(Exception):
    """A reason to stop the robot.

    Attributes:
        watch: Name of the watch that found it.
        reason: What it found.
    """

    def __init__(self, watch: str, reason: str) -> None:
        super().__init__(f"{watch}: {reason}")
        self.watch, self.reason = watch, reason


class Watches:
    """The watches on one robot.

    Args:
        names: Names of the joints.
        measured: Limits of what is measured.
        commanded: Limits of what is commanded.
        lag: Largest distance of a joint from its command [rad].
        jump: Largest jump of a measured joint beyond what its largest speed explains [rad].
    """

    def __init__(
        self,
        names: Sequence[str],
        measured: JointLimits,
        commanded: JointLimits,
        lag: float,
        jump: float,
    ) -> None:
        self._names = names
        self._measured, self._commanded = measured, commanded
        self._lag, self._jump = lag, jump

    def sound(self, status: RobotStatus) -> None:
        """Raise a StopError for what is no status, or a measurement that is not a number."""
        if complaint := status.complaint(len(self._names)):
            raise StopError("status", complaint)
        for what, values, unit in (
            ("position", status.position, "rad"),
            ("velocity", status.velocity, "rad/s"),
        ):
            if not np.isfinite(values).all():
                joint = int(np.argmin(np.isfinite(values)))
                raise StopError(
                    "status", f"{what} of {self._names[joint]} is {values[joint]} {unit}"
                )

    def within(self, status: RobotStatus) -> None:
        """Raise a StopError for a joint beyond the limits of what is measured."""
        if self._measured.violation(status.position).any():
            raise StopError("limits", self._measured.complaint(status.position, 0.0, self._names))
        joint = int(np.argmax(np.abs(status.velocity) / self._measured.velocity))
        speed, most = abs(status.velocity[joint]), self._measured.velocity[joint]
        if speed > most:
            raise StopError(
                "limits", f"{self._names[joint]} moves at {speed:.4g} rad/s; it may {most:.4g}"
            )

    def follows(self, status: RobotStatus, commanded: Array) -> None:
        """Raise a StopError for a joint far from its command, shape (n,) [rad]."""
        joint, off = _largest(status.position - commanded)
        if off > self._lag:
            raise StopError(
                "lag", f"{self._names[joint]} is {off:.4g} rad from its command; {self._lag:g} may"
            )

    def continues(self, status: RobotStatus, before: RobotStatus) -> None:
        """Raise a StopError for a joint that has jumped since another status."""
        time = abs(status.time - before.time)
        moved = np.abs(status.position - before.position)
        joint, off = _largest(np.maximum(moved - time * self._measured.velocity, 0.0))
        if off > self._jump:
            raise StopError(
                "jump",
                f"{self._names[joint]} has moved by {moved[joint]:.4g} rad in {time:.4g} s",
            )

    def may_be_sent(
        self, position: Array, before: Array, time: float, motion: Motion | None = None
    ) -> None:
        """Raise a StopError for a command beyond the limits, which is then not sent.

        A robot that has lost cycles has held its acceleration in them, and may have become faster
        than its limits: it is slowed down then, which is no reason to stop.

        Args:
            position: The command, shape (n,) [rad].
            before: The command before, shape (n,) [rad].
            time: Time from that to this one [s].
            motion: What a robot that loses cycles has been commanded until then; None for another.
        """
        if not np.isfinite(position).all():
            raise StopError("command", f"the law commands {position.tolist()} rad")
        limits = self._commanded
        if (limits.violation(position) > _ROUNDING).any():
            raise StopError("command", limits.complaint(position, 0.0, self._names))
        fastest = limits.velocity
        if motion is not None:
            # As it goes on, and as it would with its acceleration held once more.
            speeds = np.abs([motion.velocity, motion.velocity + time * motion.acceleration])
            fastest = np.maximum(fastest, speeds.max(axis=0))
        joint = int(np.argmax(np.abs(position - before) / fastest))
        step, most = abs(position[joint] - before[joint]), time * fastest[joint]
        if step > most * (1.0 + _ROUNDING) + 1e-9:
            raise StopError(
                "command",
                f"{self._names[joint]} is to move by {step:.4g} rad in {time:.4g} s; it may by "
                f"{most:.4g} rad",
            )

    def may_be_stopped(self, motion: Motion) -> None:
        """Raise a StopError for a commanded motion that no stop can begin with."""
        for what, values, unit in (
            ("velocity", motion.velocity, "rad/s"),
            ("acceleration", motion.acceleration, "rad/s^2"),
        ):
            if not np.isfinite(values).all():
                joint = int(np.argmin(np.isfinite(values)))
                raise StopError(
                    "command",
                    f"the law commands {self._names[joint]} a {what} of {values[joint]} {unit}",
                )


def _largest(values: Array) -> tuple[int, float]:
    """Return the joint with the largest magnitude, and that."""
    joint = int(np.argmax(np.abs(values)))
    return joint, float(abs(values[joint]))

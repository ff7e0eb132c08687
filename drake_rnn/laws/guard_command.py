"""A command of a guard, and the certified stop that follows it."""

from __future__ import annotations

from math import floor
from typing import NamedTuple

import numpy as np

from ..inputs.fields import Array
from ..robot.joint_stop import stop_after

#: Times that differ by less are one, as a share of the period.
SAME = 1e-6


class GuardCommand(NamedTuple):
    """A command of a guard or a shield, and the certified stop that follows it.

    A command holds for a period from its time on. Whoever gets no further one until then goes on
    along the stop, a sample each period, which is within all bounds: `at` and `position_at` say
    where that is. With ``late="hold"`` the robot is to stand at ``position`` instead.

    Attributes:
        number: How many there have been, with this one.
        time: When it begins to hold, on the clock of the calls [s].
        position: Positions to be reached a period later, shape (n,) [rad].
        velocity: Velocities on the way there, shape (n,) [rad/s].
        target_age: Time since a target came, or the guard began [s]; if it is longer than the
            law's ``timeout``, the arm comes to rest or rests. Of a shield: time since a target that
            is followed, infinite before one.
        period: Time for which it holds [s].
        acceleration: Accelerations that have led to the velocities, shape (n,) [rad/s^2].
        most: Largest accelerations of the stop, shape (n,) [rad/s^2]; may be infinite.
        jerk: Largest jerks of the stop, shape (n,) [rad/s^3]; None if the jerk is not bounded.
        after: Number of the command that it goes on from, or from the stop that follows that one.
        sample: Which sample of the stop it is; 0 for a command itself.
    """

    number: int
    time: float
    position: Array
    velocity: Array
    target_age: float
    period: float
    acceleration: Array
    most: Array
    jerk: Array | None
    after: int = 0
    sample: int = 0

    def stop(self, samples: int) -> GuardCommand:
        """Return a sample of the stop that follows, as a command.

        Args:
            samples: Which one; 0 for the command itself.
        """
        joints = zip(
            self.velocity.tolist(),
            self.acceleration.tolist(),
            self.most.tolist(),
            [None] * self.most.size if self.jerk is None else self.jerk.tolist(),
            strict=True,
        )
        rows = [stop_after(*joint, self.period, float(samples)) for joint in joints]
        way, v, a = np.array(rows).T
        elapsed = samples * self.period
        return self._replace(
            time=self.time + elapsed,
            position=self.position + way,
            velocity=v,
            target_age=self.target_age + elapsed,
            acceleration=a,
            sample=self.sample + samples,
        )

    def at(self, t: float) -> GuardCommand:
        """Return what is commanded at a time if no further command has come: itself, or its stop.

        Args:
            t: The time [s].
        """
        samples = floor((t - self.time) / self.period + SAME)
        return self if samples <= 0 else self.stop(samples)

    def share_at(self, t: float) -> float:
        """Return which share of the period has passed at a time [s] in which it holds."""
        return min(max((t - self.time) / self.period, 0.0), 1.0)

    def reached(self, share: float) -> Array:
        """Return where the joints are after a share of the period, shape (n,) [rad]."""
        return self.position - (1.0 - share) * self.period * self.velocity

    def position_at(self, t: float) -> Array:
        """Return where the joints are to be at a time, shape (n,) [rad]; velocities are held.

        Positions of times that are a period apart, or any other time, keep the bounds of the
        acceleration and the jerk: ask for times of a regular clock, not for when a loop happens to
        run.

        Args:
            t: The time [s]; before the command begins to hold, the arm is where that begins.
        """
        now = self.at(t)
        return now.reached(now.share_at(t))

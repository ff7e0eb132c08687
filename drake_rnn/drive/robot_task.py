"""What a robot is to do: a diagram with a `RobotArm`, advanced by the robot's clock."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydrake.systems.analysis import Simulator

from ..errors import InvalidInputError
from ..inputs.arguments import checked, instance, number
from ..inputs.fields import Array
from ..robot.clearance import Clearance
from ..robot.limits import JointLimits
from ..systems import RobotArm
from .connection import Motion

# Times that differ by less are one [s].
_SAME = 1e-9


class RobotTask:
    """A diagram that moves a robot.

    Args:
        simulator: Simulator of the diagram, at time zero; it is initialized here.
        arm: The arm in it. Its limits are those that the robot is brought to its start and to
            rest within.
        duration: Time after which the robot is brought to rest [s].
        period: Time for which the diagram holds a commanded velocity [s].
        clearance: What the arm is to stay clear of on its way to the start; by default itself.

    Raises:
        InvalidInputError: If the arm's limits have no acceleration, or an argument is of another
            class.
    """

    @checked(
        simulator=instance(Simulator),
        arm=instance(RobotArm),
        duration=number(above=0.0),
        period=number(above=0.0),
        clearance=instance(Clearance, None),
    )
    def __init__(
        self,
        simulator: Simulator,
        arm: RobotArm,
        duration: float,
        period: float,
        clearance: Clearance | None = None,
    ) -> None:
        if not (duration > 0.0 and period > 0.0):
            raise InvalidInputError(
                f"duration, period: must be positive times [s], not {duration} and {period}"
            )
        arm.arm.limits.require("acceleration", "coming to rest")
        self._simulator, self._body = simulator, arm
        self.duration, self.period, self.clearance = duration, period, clearance
        at_rest = np.zeros(arm.arm.n)
        self._motion = Motion(arm.start, at_rest, at_rest)
        self._advanced = 0.0
        simulator.Initialize()

    @property
    def body(self) -> RobotArm:
        """The arm."""
        return self._body

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints."""
        return self._body.arm.joints

    @property
    def limits(self) -> JointLimits:
        """Limits of the arm."""
        return self._body.arm.limits

    @property
    def start(self) -> Array:
        """Posture in which it begins, shape (n,) [rad]."""
        return self._body.start

    @property
    def time(self) -> float:
        """Time of the diagram [s]."""
        return float(self._simulator.get_context().get_time())

    def advance(self, until: float, position: Array, velocity: Array) -> Array:
        """Return the positions to command at a time of the diagram, shape (n,) [rad].

        Args:
            until: The time [s].
            position: Joint positions measured last, shape (n,) [rad].
            velocity: Joint velocities measured last, shape (n,) [rad/s].

        Raises:
            SimulationError: If a law in the diagram fails.
        """
        # A time that ends a sample does so exactly, or Drake would begin the next one.
        samples = round(until / self.period)
        if abs(until - samples * self.period) < _SAME:
            until = samples * self.period
        root = self._simulator.get_mutable_context()
        self._body.measure(root, position, velocity)
        self._simulator.AdvanceTo(until)
        command, speed = self._body.command(root)
        if (since := until - self._advanced) > 0.0:
            acceleration = self._accelerated(speed, since)
            self._motion, self._advanced = Motion(command, speed, acceleration), until
        return command

    @property
    def held(self) -> float:
        """Time for which the velocity is still held [s]."""
        samples = self._advanced / self.period
        return float((np.ceil(samples - 1e-9) - samples) * self.period)

    def motion(self) -> Motion:
        """Return what `advance` has led to."""
        return self._motion

    def then(self) -> Sequence[Motion]:
        """Return the motions after that, of which none is known."""
        return ()

    #: Whether it goes on from what was commanded without it.
    resumes = False

    def resume(self, time: float, motion: Motion) -> None:
        """Go on from what was commanded without it, at a time of the diagram.

        Args:
            time: The time [s], a whole number of periods, not before that of the diagram.
            motion: The motion.
        """
        raise NotImplementedError("this diagram goes on from its own commands alone")

    def _accelerated(self, velocity: Array, since: float) -> Array:
        """Return the acceleration that has led to a velocity: the mean over a time [s]."""
        return np.asarray((velocity - self._motion[1]) / since)

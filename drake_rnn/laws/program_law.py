"""The base class of laws whose network follows the optimum of a scheme's program."""

# No postponed annotations: older pydantic resolves inherited ones in the subclass's module.
from collections.abc import Mapping
from functools import cached_property
from typing import Annotated, Literal

import numpy as np

from ..inputs.fields import Gain, GainOrZero, Positive, Vector, between, validated
from ..inputs.keys import Meaning, Only
from ..robot.limits import JointLimits
from .law import Law
from .program.bounds import VelocityBox
from .program.costs import Cost, KineticEnergy, LargestVelocity, ReturningVelocity
from .program.rows import EndEffectorVelocity
from .program.scheme import QPScheme


@validated
class ProgramLaw(Law):
    """A law with a scheme: a cost along a path, within bounds if they are asked for."""

    limits: Annotated[
        JointLimits,
        Meaning("Limits of the joints; with ``bounds: velocity`` those of position and velocity."),
    ]
    home: Annotated[
        Vector,
        Meaning("Posture at the start, which the joints return to, shape (n,).", unit="rad"),
    ]
    task_size: Annotated[
        Literal[2, 3, 6],
        Meaning("Number of rows of J; of 6 rows the first three are rotation."),
    ] = 3
    cost: Annotated[
        Literal["velocity", "kinetic_energy", "largest_velocity"],
        Meaning(
            "What is minimised: ``velocity``, ``kinetic_energy`` or ``largest_velocity``, see "
            "`drake_rnn.laws.program.costs`.",
        ),
    ] = "velocity"
    return_gain: Annotated[
        GainOrZero,
        Meaning(
            "Gain k of the way back to that posture; 0 for the least velocity alone.",
            unit="1/s",
        ),
    ] = 1.0
    manipulability: Annotated[
        GainOrZero,
        Meaning(
            "Gain of the gradient of the manipulability [rad/s], with ``cost: velocity``.",
            unit="rad/s",
        ),
    ] = 0.0
    blend: Annotated[
        Positive,
        between(1e-3, 0.99),
        Meaning(
            "Weight of the velocity's square beside the largest velocity; nearly 1 has the "
            "square alone.",
            unit="1",
            only=(Only("cost", "largest_velocity"),),
        ),
    ] = 0.1
    feedback: Annotated[
        GainOrZero,
        Meaning("Gain K of the feedback of position and orientation.", unit="1/s"),
    ] = 10.0
    bounds: Annotated[
        Literal["none", "velocity"],
        Meaning(
            "``velocity`` has the limits of position and velocity as inequalities of the "
            "program, which the network fulfils as well as it follows its optimum; ``none`` has "
            "none.",
        ),
    ] = "none"
    limit_stiffness: Annotated[
        Gain,
        Meaning(
            "Velocity allowed per radian left to a position limit [1/s], where the program has "
            "bounds.",
            unit="1/s",
        ),
    ] = 10.0

    def __post_init__(self) -> None:
        self.limits.require_size("home", self.home)
        unbounded = ~np.isfinite(self.limits.velocity)
        if self._bounded and unbounded.any():
            raise ValueError(
                f"{self._bounding} needs a velocity limit for every joint, but joint "
                f"{int(np.argmax(unbounded)) + 1} has none; give limits.velocity"
            )

        if self.manipulability and (self.cost != "velocity" or self.task_size == 2):
            raise ValueError(
                "manipulability: needs cost: velocity and task: xyz or pose; leave it out"
            )

    @property
    def _bounding(self) -> str:
        """What has bounds in the program, as a document says it; empty without bounds."""
        return "" if self.bounds == "none" else f"bounds: {self.bounds}"

    @property
    def _bounded(self) -> bool:
        return bool(self._bounding)

    @property
    def _cost(self) -> Cost:
        if self.cost == "kinetic_energy":
            return KineticEnergy(self.home, self.return_gain)
        square = ReturningVelocity(self.home, self.return_gain, self.manipulability, self.task_size)
        return square if self.cost == "velocity" else LargestVelocity(square, self.blend)

    @cached_property
    def scheme(self) -> QPScheme:
        """The program that the network follows the optimum of."""
        return QPScheme(
            self._cost,
            EndEffectorVelocity(self.limits.size, self.task_size, self.feedback),
            VelocityBox(self.limits, self.limit_stiffness) if self._bounded else None,
        )

    @property
    def loop_gains(self) -> Mapping[str, float]:
        return {"feedback": self.feedback}

    @property
    def sampled_gains(self) -> Mapping[str, float]:
        stiffness = {"limit_stiffness": self.limit_stiffness} if self._bounded else {}
        return {"feedback": self.feedback, "return_gain": self.return_gain, **stiffness}

    @property
    def limits_remedy(self) -> str:
        return "safety: {bounds: true} does"

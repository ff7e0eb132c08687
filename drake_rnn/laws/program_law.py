"""The base class of laws whose network follows the optimum of a scheme's program."""

# No postponed annotations: older pydantic resolves inherited ones in the subclass's module.
from collections.abc import Mapping
from functools import cached_property
from typing import Literal

import numpy as np

from ..inputs.fields import Gain, GainOrZero, Vector, validated
from ..robot.limits import JointLimits
from .law import Law
from .program.bounds import VelocityBox
from .program.costs import ReturningVelocity
from .program.rows import EndEffectorVelocity
from .program.scheme import QPScheme


@validated
class ProgramLaw(Law):
    """A law with a scheme: repetitive motion along a path, within bounds if they are asked for.

    Args:
        limits: Limits of the joints; with ``bounds: velocity`` those of position and velocity.
        home: Posture at the start, which the joints return to, shape (n,) [rad].
        task_size: Number of rows of J; of 6 rows the first three are rotation.
        return_gain: Gain k of the way back to that posture [1/s]; 0 for the least velocity alone.
        feedback: Gain K of the feedback of position and orientation [1/s].
        bounds: ``velocity`` has the limits of position and velocity as inequalities of the
            program, which the network fulfils as well as it follows its optimum; ``none`` has none.
        limit_stiffness: Velocity allowed per radian left to a position limit [1/s].
    """

    limits: JointLimits
    home: Vector
    task_size: Literal[2, 3, 6] = 3
    return_gain: GainOrZero = 1.0
    feedback: GainOrZero = 10.0
    bounds: Literal["none", "velocity"] = "none"
    limit_stiffness: Gain = 10.0

    def __post_init__(self) -> None:
        self.limits.require_size("home", self.home)
        unbounded = ~np.isfinite(self.limits.velocity)
        if self.bounds == "velocity" and unbounded.any():
            raise ValueError(
                "bounds: velocity needs a velocity limit for every joint, but joint "
                f"{int(np.argmax(unbounded)) + 1} has none; give limits.velocity"
            )

    @cached_property
    def scheme(self) -> QPScheme:
        """The program that the network follows the optimum of."""
        return QPScheme(
            ReturningVelocity(self.home, self.return_gain),
            EndEffectorVelocity(self.limits.size, self.task_size, self.feedback),
            VelocityBox(self.limits, self.limit_stiffness) if self.bounds == "velocity" else None,
        )

    @property
    def loop_gains(self) -> Mapping[str, float]:
        return {"feedback": self.feedback}

    @property
    def sampled_gains(self) -> Mapping[str, float]:
        stiffness = {"limit_stiffness": self.limit_stiffness} if self.bounds == "velocity" else {}
        return {"feedback": self.feedback, "return_gain": self.return_gain, **stiffness}

    @property
    def limits_remedy(self) -> str:
        return "safety: {bounds: true} does"

"""The base class of laws that move to a target posture while the end effector stays in place."""

# No postponed annotations: older pydantic resolves inherited ones in the subclass's module.
from collections.abc import Mapping
from typing import Literal

from ..inputs.fields import Gain, Vector, validated
from ..robot.limits import JointLimits
from .law import SampledLaw


@validated
class PostureLaw(SampledLaw):
    """A law with a target posture.

    Args:
        target: Target posture, shape (n,) [rad].
        limits: Position and velocity limits of the joints.
        rate: Rate of convergence to the target [1/s].
        limit_stiffness: Velocity allowed per radian left to a position limit [1/s].
        task_size: Number of rows of J, all of them held; of 6 rows the first three are rotation.
    """

    target: Vector
    limits: JointLimits
    rate: Gain = 4.0
    limit_stiffness: Gain = 20.0
    task_size: Literal[2, 3, 6] = 3

    def __post_init__(self) -> None:
        self.limits.require_size("target", self.target)
        if self.limits.violation(self.target).any():
            raise ValueError(f"target: {self.limits.complaint(self.target)}")

    @property
    def sampled_gains(self) -> Mapping[str, float]:
        return {"rate": self.rate, "limit_stiffness": self.limit_stiffness}

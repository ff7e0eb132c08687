"""The base class of laws that move to a target posture while the end effector stays in place."""

# No postponed annotations: older pydantic resolves inherited ones in the subclass's module.
from collections.abc import Mapping
from typing import Annotated, Literal

from ..inputs.fields import Gain, Vector, validated
from ..inputs.keys import Meaning
from ..robot.limits import JointLimits
from .law import SampledLaw


@validated
class PostureLaw(SampledLaw):
    """A law with a target posture."""

    target: Annotated[Vector, Meaning("Target posture, shape (n,).", unit="rad")]
    limits: Annotated[JointLimits, Meaning("Position and velocity limits of the joints.")]
    rate: Annotated[Gain, Meaning("Rate of convergence to the target.", unit="1/s")] = 4.0
    limit_stiffness: Annotated[
        Gain,
        Meaning("Velocity allowed per radian left to a position limit.", unit="1/s"),
    ] = 20.0
    task_size: Annotated[
        Literal[2, 3, 6],
        Meaning("Number of rows of J, all of them held; of 6 rows the first three are rotation."),
    ] = 3

    def __post_init__(self) -> None:
        self.limits.require_size("target", self.target)
        if self.limits.violation(self.target).any():
            raise ValueError(f"target: {self.limits.complaint(self.target)}")

    @property
    def sampled_gains(self) -> Mapping[str, float]:
        return {"rate": self.rate, "limit_stiffness": self.limit_stiffness}

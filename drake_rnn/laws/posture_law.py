"""What laws that seek a posture while the end effector stays have in common."""

# No postponed annotations: older pydantic looks for inherited ones in the subclass's module.
from typing import Literal

from ..inputs.fields import Positive, Vector, validated
from ..robot.limits import JointLimits
from .law import SampledLaw, SampledReading
from .parts.sampling_rate import check_sampling_rate


@validated
class PostureLaw(SampledLaw):
    """A law with a target posture.

    Args:
        target: Posture to reach, shape (n,) [rad].
        limits: Position and velocity limits of the joints.
        rate: Speed of convergence to the target [1/s].
        limit_stiffness: Velocity allowed per radian left to a position limit [1/s].
        task_size: Rows of J, all of which are held; of 6 the first three are rotation.
    """

    target: Vector
    limits: JointLimits
    rate: Positive = 4.0
    limit_stiffness: Positive = 20.0
    task_size: Literal[2, 3, 6] = 3

    def __post_init__(self) -> None:
        if self.target.size != self.limits.size:
            raise ValueError(
                f"target: must have {self.limits.size} entries, one a joint, not {self.target.size}"
            )
        if self.limits.violation(self.target).any():
            raise ValueError(f"target: {self.limits.complaint(self.target)}")

    @property
    def rates(self) -> dict[str, float]:
        """What a period must be shorter than the inverse of, by key [1/s]."""
        return {"rate": self.rate, "limit_stiffness": self.limit_stiffness}

    def sampled(self, period: float) -> SampledReading:
        """Return the law itself.

        Raises:
            InvalidInputError: If it would overshoot at this period [s].
        """
        check_sampling_rate(period, self.rates)
        return super().sampled(period)

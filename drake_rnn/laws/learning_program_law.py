"""The base class of laws of programs whose Jacobian may be learned."""

# No postponed annotations: older pydantic resolves inherited ones in the subclass's module.
from abc import abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Literal, Self

from pydantic import Field

from ..inputs.fields import Weight, validated
from ..inputs.keys import Meaning, Only
from .layout import Layout
from .parts.learned_jacobian import LearnedJacobian
from .parts.measurement import EXACT, Measurement, suited
from .program_law import ProgramLaw
from .program_reading import FollowingNetwork, ProgramReading

_UNMOVED = (
    "law.J_hat_initial: zero moves no joint, so nothing is learned unless a noise moves the arm; "
    "consider uniform"
)


@validated
class LearningProgramLaw(ProgramLaw):
    """A law of a program whose Jacobian is known, or learned from positions."""

    jacobian: Annotated[
        Literal["known", "learned"],
        Meaning("``known`` reads J; ``learned`` learns it from ``position`` and ``p_WE``."),
    ] = "known"
    J_hat_initial: Annotated[
        Literal["uniform", "zero", "exact"],
        Meaning(
            "Initial J_hat: ``uniform`` in [0, 1], ``zero``, or ``exact``, the arm's own.",
            only=(Only("jacobian", "learned"),),
        ),
    ] = "uniform"
    variance: Annotated[
        Weight | None,
        Meaning(
            "Variance R of the measured velocity; by default as suits the measurement.",
            only=(Only("jacobian", "learned"),),
        ),
    ] = None
    wander: Annotated[
        Weight | None,
        Meaning(
            "Growth q_n of the variance of J_hat's entries; likewise.",
            unit="1/s",
            only=(Only("jacobian", "learned"),),
        ),
    ] = None
    measurement: Annotated[
        Measurement,
        Meaning("Quality of what the law sees, if it learns."),
    ] = Field(default_factory=Measurement)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.manipulability and self.learns_jacobian:
            raise ValueError("manipulability: needs jacobian: known; leave it out")

    @property
    @abstractmethod
    def dynamics(self) -> FollowingNetwork:
        """The network that the law runs."""

    @property
    def learns_jacobian(self) -> bool:
        """See `Law.learns_jacobian`."""
        return self.jacobian == "learned"

    def _suited(self, period: float) -> tuple[Self, int, float]:
        """Return the law with the numbers that suit its measurement, samples and least speed."""
        suits = suited(self.measurement, period) if self.learns_jacobian else EXACT
        law = replace(
            self,
            variance=suits.variance if self.variance is None else self.variance,
            wander=suits.wander if self.wander is None else self.wander,
        )
        return law, suits.samples, suits.still

    @property
    def _learning_doubts(self) -> list[str]:
        return [_UNMOVED] if self.learns_jacobian and self.J_hat_initial == "zero" else []

    @property
    def inputs(self) -> Layout:
        shapes = self.scheme.inputs
        if self.learns_jacobian:
            del shapes["J"]
            shapes |= {"position": (self.limits.size,)}
        return Layout(**shapes)

    @property
    def state(self) -> Layout:
        n, m = self.limits.size, self.task_size
        learned = {"J_hat": (m, n)} if self.learns_jacobian else {}
        return Layout(v=(n,), **self.dynamics.shapes, **learned)


@dataclass(frozen=True, eq=False)
class LearningReading(ProgramReading):
    """The sampled reading of a `LearningProgramLaw`.

    Attributes:
        law: The law, with the numbers that suit its measurement.
        samples: Number of samples over which velocities are difference quotients.
        still: Joint speed below which nothing is learned [rad/s].
    """

    law: LearningProgramLaw
    samples: int
    still: float

    @cached_property
    def learned(self) -> LearnedJacobian | None:
        """See `ProgramReading.learned`."""
        law = self.law
        if law.jacobian == "known":
            return None
        m, n = law.task_size, law.limits.size
        trust = (law.wander, law.variance, self.still)
        return LearnedJacobian(m, n, self.samples, *trust, law.J_hat_initial, turns=m == 6)

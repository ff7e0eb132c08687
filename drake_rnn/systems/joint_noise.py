"""What is added to joint velocities, held for a time: the base class of dither and disturbance."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, Protocol

from ..inputs.fields import Array


class Samples(Protocol):
    """Values that depend on the number of the sample alone, of size 1."""

    def sample(self, number: int) -> Array:
        """Return the values of one sample, shape (size,)."""

    def block(self, number: int) -> Array:
        """Return the values of as many samples as `WhiteNoise.block` does, one a row."""


class JointNoise(ABC):
    """Settings of what is added to the joint velocities.

    Attributes:
        section: Name of its section of a document.
        model: Where it acts, see `DitherSettings`.
        hold: Time for which each value is held [s].
    """

    section: ClassVar[str]
    model: str
    hold: float

    @property
    def moves_arm(self) -> bool:
        """Whether the arm moves with it."""
        return self.model == "actuated"

    @property
    @abstractmethod
    def course(self) -> str:
        """How its samples vary in time; those of equal courses are the same."""

    @property
    @abstractmethod
    def scale(self) -> float:
        """The factor of its samples [rad/s]."""

    @abstractmethod
    def samples(self, size: int, seed: int) -> Samples:
        """Return its samples.

        Args:
            size: Number of joints.
            seed: Seed of the experiment.
        """

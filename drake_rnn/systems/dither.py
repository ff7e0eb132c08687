"""Excitation of the joints, which lets a learning law see all directions of motion."""

from __future__ import annotations

from typing import Annotated, Literal

from pydrake.systems.framework import Context, DiscreteValues

from ..inputs.arguments import checked, whole
from ..inputs.fields import Array, Positive, between, validated
from ..inputs.keys import Meaning
from .block import Block
from .joint_noise import JointNoise, Samples
from .white_noise import WhiteNoise


@validated
class DitherSettings(JointNoise):
    """Seeded white noise on the joint velocities, and where it acts."""

    model: Annotated[
        Literal["actuated", "virtual", "printed"],
        Meaning(
            "``actuated``: the noise moves the arm, and measurements show it. ``virtual``: the "
            "noise does not move the arm, but the law sees ``velocity`` and ``v_WE`` as if it "
            "did, which only a simulation can do. ``printed``: the law sees ``velocity`` with "
            "the noise and ``v_WE`` without it, as in the paper of `SimultaneousLearning`.",
        ),
    ] = "actuated"
    sigma: Annotated[
        Annotated[Positive, between(0.0, 100.0)],
        Meaning(
            "Standard deviation of each joint's noise; it is clipped at three sigma.",
            unit="rad/s",
        ),
    ]
    hold: Annotated[Positive, Meaning("Time for which each value is held.", unit="s")]

    section = "dither"

    @property
    def course(self) -> str:
        """See `JointNoise.course`."""
        return "white"

    @property
    def scale(self) -> float:
        """See `JointNoise.scale`."""
        return self.sigma

    def samples(self, size: int, seed: int) -> Samples:
        """See `JointNoise.samples`."""
        return WhiteNoise(size, seed, stream=1, clip=3.0)


class HeldNoise(Block):
    """What is added to the joint velocities, with a new value every ``hold``.

    The output, shape (n,) [rad/s], is named after the settings' section. It depends on seed and
    sample number alone: every run and every process gets the same values.

    Args:
        size: Number of joints.
        settings: Settings of the noise.
        seed: Seed of the random generator.
    """

    def __init__(self, size: int, settings: JointNoise, seed: int = 0) -> None:
        super().__init__()
        self._sigma = settings.scale
        self._hold = settings.hold
        self._noise = settings.samples(size, seed)
        state = self.DeclareDiscreteState(size)
        self.DeclareStateOutputPort(settings.section, state)
        self.DeclarePeriodicDiscreteUpdateEvent(self._hold, 0.0, self._update)

    def sample(self, number: int) -> Array:
        """Return the value of one sample, shape (n,) [rad/s]."""
        return self._sigma * self._noise.sample(number)

    def _update(self, context: Context, state: DiscreteValues) -> None:
        state.set_value(self.sample(round(context.get_time() / self._hold)))


class Dither(HeldNoise):
    """Normal white noise, clipped at three sigma, with a new value every ``hold``.

    The output is ``dither``, shape (n,) [rad/s].

    Args:
        size: Number of joints.
        sigma: Standard deviation [rad/s].
        hold: Time for which each value is held [s].
        seed: Seed of the random generator.
    """

    @checked(size=whole(1, 10**6))
    def __init__(self, size: int, sigma: float, hold: float, seed: int = 0) -> None:
        super().__init__(size, DitherSettings(sigma=sigma, hold=hold), seed)

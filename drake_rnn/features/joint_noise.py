"""What is added to the joint velocities, held for a time: dither and disturbance.

Dither excites the joints, which lets a learning law see all directions of motion. A disturbance is
a velocity that the arm makes besides the one that is commanded.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, Protocol

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues
from pydrake.systems.primitives import Adder

from ..inputs.fields import (
    Array,
    Positive,
    between,
    checked,
    validated,
    whole,
)
from ..inputs.keys import Meaning
from ..systems.block import Block
from .feature import Feature, Guarantee, JointVelocity, LoopBuild, LoopPart
from .sensing import BLOCK, Stream, WhiteNoise


class Samples(Protocol):
    """Values that depend on the number of the sample alone, of size 1."""

    def sample(self, number: int) -> Array:
        """Return the values of one sample, shape (size,)."""

    def block(self, number: int) -> Array:
        """Return the values of as many samples as `WhiteNoise.block` does, one a row."""


class JointNoise(ABC, LoopPart):
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

    def traits(self) -> Mapping[str, Any]:
        return {self.section: self}

    def change_command(self, loop: LoopBuild) -> None:
        """Add the noise to the velocities where its model says."""
        command, n = loop.velocity.moved, loop.velocity.moved.size()
        noise = loop.wiring.add(self.section, HeldNoise(n, self, loop.seed))
        adder = loop.wiring.add("dithered_velocity", Adder(2, n))
        loop.wiring.connect(command, adder.get_input_port(0))
        loop.wiring.connect(noise.get_output_port(), adder.get_input_port(1))
        output = adder.get_output_port()
        loop.velocity = {
            "actuated": JointVelocity(output, output, output),
            "virtual": JointVelocity(command, output, output),
            "printed": JointVelocity(command, command, output),
        }[self.model]


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
        Positive,
        between(0.0, 100.0),
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
        return WhiteNoise(size, seed, Stream.DITHER, clip=3.0)


@validated
class DisturbanceSettings(JointNoise):
    """Velocities that the arm makes besides those that the law commands, whatever the law is."""

    kind: Annotated[
        Literal["constant", "ramp", "sine", "random"],
        Meaning(
            "``constant``, the same in every joint, as a drive's offset is; ``ramp``, likewise, "
            "which grows in proportion to time; ``sine``, with one turn a second; or ``random``, "
            "normal white noise of each joint, clipped at three standard deviations.",
        ),
    ]
    size: Annotated[
        Positive,
        between(0.0, 100.0),
        Meaning(
            "Its size: of a ramp that after a second, of a sine the amplitude, of a random one "
            "the standard deviation.",
            unit="rad/s",
        ),
    ]
    hold: Annotated[Positive, Meaning("Time for which each value is held.", unit="s")] = 1e-3

    section = "disturbance"
    model = "actuated"

    @property
    def course(self) -> str:
        """See `JointNoise.course`."""
        return self.kind

    @property
    def scale(self) -> float:
        """See `JointNoise.scale`."""
        return self.size

    def samples(self, size: int, seed: int) -> Samples:
        """See `JointNoise.samples`."""
        if self.kind == "random":
            return WhiteNoise(size, seed, Stream.DISTURBANCE, clip=3.0)
        return _Course(self.kind, self.hold, size)


class _Course:
    """The same function of time in every joint.

    Args:
        kind: A kind of `DisturbanceSettings` that is not random.
        hold: Time for which each value is held [s].
        size: Number of joints.
    """

    def __init__(self, kind: str, hold: float, size: int) -> None:
        self._kind, self._hold, self._size = kind, hold, size

    def sample(self, number: int) -> Array:
        return self._at(np.array([float(number)]))[0]

    def block(self, number: int) -> Array:
        return self._at(number * BLOCK + np.arange(float(BLOCK)))

    def _at(self, numbers: Array) -> Array:
        t = numbers * self._hold
        course = {"constant": np.ones_like(t), "ramp": t, "sine": np.sin(2.0 * np.pi * t)}
        return np.repeat(course[self._kind][:, np.newaxis], self._size, axis=1)


class HeldNoise(Block):
    """What is added to the joint velocities, with a new value every ``hold``.

    The output, shape (n,) [rad/s], is named after the settings' section. It depends on seed and
    sample number alone: every run and every process gets the same values.

    Args:
        size: Number of joints.
        settings: Settings of the noise.
        seed: Seed of the random generator.
    """

    role = "noise"

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


class DitherFeature(Feature):
    """The section ``dither``."""

    key = "dither"

    def loop_arguments(self, experiment: Any) -> Mapping[str, Any]:
        return {"dither": experiment.document.joint_noise}

    def guarantee(self, arm: Guarantee, experiment: Any) -> Guarantee:
        """Return nothing if the arm does not move as commanded."""
        noise: JointNoise | None = experiment.document.joint_noise
        return Guarantee() if noise is not None and noise.moves_arm else arm


class DisturbanceFeature(DitherFeature):
    """The section ``disturbance``."""

    key = "disturbance"

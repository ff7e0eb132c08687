"""A disturbance of the joints: velocities that the arm makes besides those commanded."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np

from ..inputs.fields import Array, Positive, between, validated
from ..inputs.keys import Meaning
from .joint_noise import JointNoise, Samples
from .white_noise import BLOCK, WhiteNoise


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
        Annotated[Positive, between(0.0, 100.0)],
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
            return WhiteNoise(size, seed, stream=5, clip=3.0)
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

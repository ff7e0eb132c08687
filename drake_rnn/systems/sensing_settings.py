"""Imperfections of the measurements that a law sees of its arm."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from ..errors import InvalidInputError
from ..inputs.fields import (
    Array,
    Delay,
    NonNegative,
    NonNegativeEach,
    PositiveEach,
    between,
    validated,
)
from ..inputs.keys import Meaning
from ..robot.arm import Arm

# Largest error of a measured position or orientation [rad, or m].
_COARSEST = 1.0
_Noise = Annotated[NonNegative, between(0.0, _COARSEST)]


@validated
class SensingSettings:
    """Imperfections of the measurements that a law sees of its arm.

    Joints are always measured. The pose of the end effector follows from them by forward
    kinematics; or it is measured from outside, as by a camera, if a noise of the pose is given,
    which may be 0.
    """

    position_noise: Annotated[
        NonNegativeEach,
        Meaning(
            "Standard deviation of the normal noise on each measured position, one number for "
            "all joints or shape (n,) [rad, or m for a joint that slides].",
        ),
    ] = 0.0
    resolution: Annotated[
        PositiveEach | None,
        Meaning("Step of each measured position, likewise; None for no steps."),
    ] = None
    encoder_bits: Annotated[
        Annotated[int, Field(strict=True, ge=1, le=40)] | None,
        Meaning(
            "Bits of an encoder over one turn, in place of ``resolution``, which is then 2 pi / "
            "2^bits; only for joints that turn.",
        ),
    ] = None
    delay: Annotated[
        Delay,
        Meaning(
            "Delay of each measurement; a multiple of the period, at most 5 s because all "
            "delayed measurements are stored.",
            unit="s",
        ),
    ] = 0.0
    secant_samples: Annotated[
        int,
        Field(strict=True, ge=0, le=1000),
        Meaning(
            "Number of samples over which the measured velocity is the difference quotient of "
            "the measured positions; 0 for the robot's own velocity, without noise. ``v_WE`` of "
            "an end effector that is measured from outside always is such a quotient.",
        ),
    ] = 0
    p_WE_noise: Annotated[
        _Noise | None,
        Meaning(
            "Standard deviation of the normal noise on each coordinate of the end effector's "
            "position, measured from outside; None for a position without noise if "
            "``R_WE_noise`` is given, otherwise for one that follows from the joints.",
            unit="m",
        ),
    ] = None
    R_WE_noise: Annotated[
        _Noise | None,
        Meaning(
            "Standard deviation of the normal noise on each coordinate of a rotation vector by "
            "which its measured orientation is off; None likewise.",
            unit="rad",
        ),
    ] = None

    def __post_init__(self) -> None:
        errors = {"position_noise": self.position_noise, "resolution": self.resolution}
        for name, given in errors.items():
            if given is not None and np.max(given) > _COARSEST:
                raise ValueError(f"{name}: may be at most {_COARSEST:g} rad, not {np.max(given):g}")
        if self.resolution is not None and self.encoder_bits is not None:
            raise ValueError(
                "resolution: cannot be combined with encoder_bits, which sets it; give one of them"
            )

    @property
    def from_outside(self) -> bool:
        """Whether the end effector is measured from outside, not computed from the joints."""
        return self.p_WE_noise is not None or self.R_WE_noise is not None

    @property
    def of_position_alone(self) -> bool:
        """Whether nothing but the position of the end effector is measured with errors."""
        steps = self.resolution is not None or self.encoder_bits is not None
        others = np.max(self.position_noise), self.delay, self.secant_samples, self.R_WE_noise
        return self.p_WE_noise is not None and not steps and not any(others)

    def step_of(self, arm: Arm) -> Array | None:
        """Return the step of each joint's measured position, shape (n,); None without steps.

        Raises:
            InvalidInputError: If an encoder counts turns of a joint that slides, or there are not
                as many numbers as joints.
        """
        if self.encoder_bits is None:
            given = self.resolution
            return None if given is None else arm.each("sensing.resolution", given)
        for name, unit in zip(arm.joints, arm.units, strict=True):
            if unit != "rad":
                raise InvalidInputError(
                    f"sensing.encoder_bits: is for joints that turn, and {name} slides; give "
                    "sensing.resolution, one number for each joint"
                )
        return np.full(arm.n, 2.0 * math.pi / 2.0**self.encoder_bits)

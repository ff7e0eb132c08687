"""Settings of an arm with full dynamics: its simulation and its motors."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np

from ..errors import InvalidInputError
from ..inputs.fields import (
    NonNegative,
    NonNegativeEach,
    Positive,
    PositiveEach,
    between,
    validated,
)

_Bandwidth = Annotated[Positive, between(1e-2, 1e5)]
# Least and largest gain of a motor: [Nm/rad] or [Nm s/rad].
_SOFTEST, _STIFFEST = 1e-3, 1e9


@validated
class PlantSettings:
    """Simulation and motor settings of an arm with full dynamics.

    Gains of the motors that are not given follow from the arm's inertia, see
    `drake_rnn.systems.motor_gains`.

    Args:
        time_step: Time step of Drake's discrete plant [s].
        contact_approximation: Drake's approximation of discrete contact; ``sap`` pushes sliding
            bodies apart because of its default relaxation time.
        bandwidth: Rate at which the motors correct a deviation from their command [rad/s].
        stiffness: Gain of each motor's position loop, one number for all or shape (n,) [Nm/rad];
            by default ``bandwidth`` squared times the joint's largest inertia.
        damping: Gain of each motor's velocity loop, one number for all or shape (n,) [Nm s/rad];
            by default critical for ``stiffness`` and the joint's largest inertia.
        reflected_inertia: Inertia of each motor's rotor as seen from the joint [kg m^2].
    """

    time_step: Positive = 1e-3
    contact_approximation: Literal["lagged", "similar", "sap"] = "lagged"
    bandwidth: _Bandwidth | None = None
    stiffness: PositiveEach | None = None
    damping: NonNegativeEach | None = None
    reflected_inertia: Annotated[NonNegative, between(0.0, 1e3)] = 0.0

    def __post_init__(self) -> None:
        for name, given in (("stiffness", self.stiffness), ("damping", self.damping)):
            if given is not None and np.max(given) > _STIFFEST:
                raise ValueError(f"{name}: may be at most {_STIFFEST:g}, not {np.max(given):g}")
        if self.stiffness is not None and np.min(self.stiffness) < _SOFTEST:
            raise ValueError(
                f"stiffness: may be {_SOFTEST:g} or more, not {np.min(self.stiffness):g}"
            )
        if self.bandwidth is not None and self.stiffness is not None:
            raise ValueError(
                "bandwidth: cannot be combined with stiffness, which sets it; give one of them"
            )

    def check_period(self, period: float | None) -> None:
        """Raise an InvalidInputError if the time step is longer than the controller's period.

        Args:
            period: Sampling period of the controller [s]; None if Drake integrates it.
        """
        if period is not None and self.time_step > period:
            raise InvalidInputError(
                f"plant.time_step: may be at most the controller's period, {period:g} s, "
                f"not {self.time_step:g}"
            )

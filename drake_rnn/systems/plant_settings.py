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
from ..inputs.keys import Meaning

_Bandwidth = Annotated[Positive, between(1e-2, 1e5)]
# Least and largest gain of a motor: [Nm/rad] or [Nm s/rad].
_SOFTEST, _STIFFEST = 1e-3, 1e9


@validated
class PlantSettings:
    """Simulation and motor settings of an arm with full dynamics.

    Gains of the motors that are not given follow from the arm's inertia, see
    `drake_rnn.systems.motor_gains`.
    """

    time_step: Annotated[Positive, Meaning("Time step of Drake's discrete plant.", unit="s")] = 1e-3
    contact_approximation: Annotated[
        Literal["lagged", "similar", "sap"],
        Meaning(
            "Drake's approximation of discrete contact; ``sap`` pushes sliding bodies apart "
            "because of its default relaxation time.",
        ),
    ] = "lagged"
    bandwidth: Annotated[
        _Bandwidth | None,
        Meaning("Rate at which the motors correct a deviation from their command.", unit="rad/s"),
    ] = None
    stiffness: Annotated[
        PositiveEach | None,
        Meaning(
            "Gain of each motor's position loop, one number for all or shape (n,); by default "
            "``bandwidth`` squared times the joint's largest inertia.",
            unit="Nm/rad",
        ),
    ] = None
    damping: Annotated[
        NonNegativeEach | None,
        Meaning(
            "Gain of each motor's velocity loop, one number for all or shape (n,); by default "
            "critical for ``stiffness`` and the joint's largest inertia.",
            unit="Nm s/rad",
        ),
    ] = None
    reflected_inertia: Annotated[
        NonNegative,
        between(0.0, 1e3),
        Meaning("Inertia of each motor's rotor as seen from the joint.", unit="kg m^2"),
    ] = 0.0

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

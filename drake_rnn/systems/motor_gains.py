r"""Gains of motors, computed from the inertia that the motors move.

With the diagonal matrix R of the joints' largest inertias (`largest_inertia`) they are

.. math:: K = \omega^2 R, \qquad D = 2 \omega R.

The deviation e from a command at constant velocity then obeys M e'' + D e' + K e = 0. Where R - M
is positive semidefinite, as at all postures that R was taken from (at others but for a few per
cent), every mode of it has an M of mu <= 1 times its R, thus the decay rates
omega (1 +- sqrt(1 - mu)) / mu: none oscillates, and none is slower than omega / 2. Motors of equal
gains, in contrast, are too weak for the joints at the base of a large arm: slower than the feedback
of a law that measures the arm, they make the loop unstable.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..inputs.fields import Array
from ..robot.arm import Arm
from ..robot.inertia import largest_inertia
from .plant_settings import PlantSettings

#: Default of `PlantSettings.bandwidth` [rad/s].
BANDWIDTH = 100.0


class MotorGains(NamedTuple):
    """Gains of the n motors of an arm.

    Attributes:
        stiffness: Gains of the position loops, shape (n,) [Nm/rad].
        damping: Gains of the velocity loops, shape (n,) [Nm s/rad].
    """

    stiffness: Array
    damping: Array


def motor_gains(arm: Arm, settings: PlantSettings) -> MotorGains:
    """Return the gains of an arm's motors; those not given follow from its inertia.

    Args:
        arm: The arm.
        settings: Settings, with a number for all motors, one for each or None.

    Raises:
        InvalidInputError: If a gain is given for another number of joints.
    """
    stiffness, damping = (
        None if given is None else arm.each(f"plant.{name}", given)
        for name, given in (("stiffness", settings.stiffness), ("damping", settings.damping))
    )
    if stiffness is not None and damping is not None:
        return MotorGains(stiffness, damping)
    inertia = largest_inertia(arm) + settings.reflected_inertia
    if stiffness is None:
        bandwidth = BANDWIDTH if settings.bandwidth is None else settings.bandwidth
        stiffness = bandwidth**2 * inertia
    if damping is None:
        damping = 2.0 * np.sqrt(stiffness * inertia)
    return MotorGains(stiffness, damping)

r"""A rotation whose axis goes round: every axis of the end effector traces a cone.

With the cone's axis n and an axis u(0) at a right angle to it,

.. math::
    C(\varphi) = \exp(\theta [u(\varphi)]_\times), \quad u(\varphi) = \exp(\varphi [n]_\times) u(0),

turns about u, which itself turns about n. A path gives its rotation from the first orientation,
which is C(phi) C(0)^T. The angular velocity is phi' (n - C n).
"""

from __future__ import annotations

from math import cos, sin

import numpy as np
from pydrake.common.eigen_geometry import AngleAxis

from ..inputs.fields import Array
from .path import Motion


def coned(
    axes: tuple[Array, Array, Array], angle: float, phase: tuple[float, float, float]
) -> Motion:
    """Return the rotation from the first orientation, and its angular velocity and acceleration.

    Args:
        axes: Unit vectors u(0), n x u(0) and n, each of shape (3,).
        angle: Half angle theta of the cone [rad].
        phase: Phase phi [rad], its rate and its second derivative.

    Returns:
        The rotation, shape (3, 3); angular velocity [rad/s] and acceleration [rad/s^2], each of
        shape (3,).
    """
    first, second, normal = axes
    phi, rate, gain = phase
    C = AngleAxis(angle, cos(phi) * first + sin(phi) * second).rotation()
    slanted = C @ normal
    w = rate * (normal - slanted)
    alpha = gain * (normal - slanted) - rate * np.cross(w, slanted)
    return C @ AngleAxis(angle, first).rotation().T, w, alpha

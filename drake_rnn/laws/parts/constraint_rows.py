"""Rows by which motion-force control constrains the tip of a tool."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...arrays.algebra import functions_of, outer, scaled
from ...inputs.fields import Array


def surface_split(normal_WE: Array, stiffness: Any) -> Array:
    """Return the rows that split a tip velocity into pressing and sliding, shape (..., 6, 3).

    Args:
        normal_WE: Outward normal of the surface, of length 1, shape (..., 3).
        stiffness: Scale of the pressing rows [N/m].
    """
    n = normal_WE
    P_n = outer(n, n)
    return functions_of(n).concatenate((scaled(stiffness, P_n), np.eye(3) - P_n), axis=-2)


def printed_orientation_rows(J_omega: Array, R_WE: Array) -> Array:
    """Return the Jacobian of the paper's w = [b2, b3, c2, c3], shape (..., 4, n).

    Args:
        J_omega: Jacobian of the tool's angular velocity, shape (..., 3, n).
        R_WE: Orientation of the tool with the axes a, b, c as columns, shape (..., 3, 3).
    """
    # The columns b and c of R rotate with the angular velocity: b' = omega x b.
    xp = functions_of(J_omega, R_WE)
    turned = [
        xp.cross(J_omega, R_WE[..., :, axis, np.newaxis], axis=-2)[..., 1:, :] for axis in (1, 2)
    ]
    return xp.concatenate(turned, axis=-2)

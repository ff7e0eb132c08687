"""Quintic splines with equally spaced knots; six coefficients determine each piece."""

from __future__ import annotations

import numpy as np

from ...inputs.fields import Array

#: Degree of the splines, and the order of their highest derivative.
ORDER = 5
#: Weights of the coefficients in a spline's value at a knot.
KNOT = np.array([1.0, 26.0, 66.0, 26.0, 1.0]) / 120.0


def _quintic() -> Array:
    """Return the matrix from c_0 .. c_5 to the coefficients of s^0 .. s^5, shape (6, 6).

    s runs from 0 to 1 on the interval.
    """
    # Cox-de Boor recursion: each piece of order p follows from two of order p - 1.
    pieces = np.ones((1, 1))
    for p in range(1, ORDER + 1):
        up = np.zeros((p + 1, p + 1))
        for j in range(p):
            rising = np.concatenate(([0.0], pieces[:, j])) + (p - 1 - j) * np.append(
                pieces[:, j], 0.0
            )
            full = p * np.append(pieces[:, j], 0.0)
            up[:, j + 1] += rising / p
            up[:, j] += (full - rising) / p
        pieces = up
    return pieces


#: Matrix from c_0 .. c_5 to the coefficients of s^0 .. s^5 on an interval, s in [0, 1].
PIECE = _quintic()
#: The i-th derivative of s^k is FACTORS[i, k] s^EXPONENTS[i, k].
EXPONENTS = np.maximum(np.arange(ORDER + 1) - np.arange(ORDER + 1)[:, np.newaxis], 0)
#: See EXPONENTS.
FACTORS = np.array(
    [
        [float(np.prod(np.arange(k - i + 1, k + 1))) if k >= i else 0.0 for k in range(ORDER + 1)]
        for i in range(ORDER + 1)
    ]
)

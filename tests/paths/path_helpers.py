"""What the tests of paths share."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from drake_rnn.inputs.fields import Array
from drake_rnn.paths import RelativePath

SHARES = np.array([0.0317, 0.137, 0.381, 0.493, 0.618, 0.873, 0.971])


def times_inside(path: RelativePath) -> list[float]:
    """Several irregular times between successive knots."""
    knots = path.knots(1e3)
    return [float(a + (b - a) * s) for a, b in pairwise(knots) for s in SHARES]


def spin(R: Array) -> Array:
    """The vector of an antisymmetric matrix."""
    return np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2.0


def assert_derivatives(path: RelativePath, h: float = 1e-5) -> None:
    """Velocity and acceleration, also of the orientation, are those of central differences."""
    for t in times_inside(path):
        before, now, after = (path.evaluate(t + d) for d in (-h, 0.0, h))
        for order in (0, 1):
            secant = (after[order] - before[order]) / (2 * h)
            np.testing.assert_allclose(now[order + 1], secant, atol=1e-6)
        before, now, after = (path.evaluate_rotation(t + d) for d in (-h, 0.0, h))
        np.testing.assert_allclose(now[0] @ now[0].T, np.eye(3), atol=1e-12)
        np.testing.assert_allclose(
            now[1], spin((after[0] - before[0]) / (2 * h) @ now[0].T), atol=1e-6
        )
        np.testing.assert_allclose(now[2], (after[1] - before[1]) / (2 * h), atol=1e-5)

"""Functions of time that rise from 0 to 1 and stay there."""

from __future__ import annotations

import numpy as np

from ...inputs.fields import Array


def sine_rise(t: float | Array, duration: float) -> float | Array:
    """Return a rise along a quarter period of a sine; its slope jumps at the start."""
    share: float | Array = np.sin(np.pi / 2 * np.clip(t / duration, 0.0, 1.0))
    return share


def smooth_rise(t: float | Array, duration: float) -> float | Array:
    """Return a rise along a quintic with zero first and second derivatives at both ends."""
    u = np.clip(t / duration, 0.0, 1.0)
    share: float | Array = u * u * u * (10.0 - 15.0 * u + 6.0 * u * u)
    return share

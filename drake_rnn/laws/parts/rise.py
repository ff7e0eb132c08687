"""Functions of time that rise from 0 to 1 and stay there.

Times and durations are numbers, or arrays that are broadcast against each other.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...arrays.algebra import functions_of
from ...inputs.fields import Array


def column(t: float | Array) -> float | Array:
    """Return times that multiply vectors: a number, or shape (..., 1) of times of shape (...)."""
    return t[..., np.newaxis] if isinstance(t, np.ndarray) and t.ndim else t


def sine_rise(t: float | Array, duration: Any) -> Any:
    """Return a rise along a quarter period of a sine; its slope jumps at the start."""
    xp = functions_of(t, duration)
    return xp.sin(np.pi / 2 * xp.clip(t / duration, 0.0, 1.0))


def smooth_rise(t: float | Array, duration: Any) -> Any:
    """Return a rise along a quintic with zero first and second derivatives at both ends."""
    u = functions_of(t, duration).clip(t / duration, 0.0, 1.0)
    return u * u * u * (10.0 - 15.0 * u + 6.0 * u * u)

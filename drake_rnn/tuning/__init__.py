"""Gains of a law tuned by descent along derivatives through the closed loop."""

from .choosing import Trial
from .tuned import Tuned, Tuning, tune

__all__ = ["Trial", "Tuned", "Tuning", "tune"]

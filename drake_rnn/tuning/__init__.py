"""Gains of a law tuned by descent along derivatives through the closed loop."""

from .tune import Trial, Tuned, tune

__all__ = ["Trial", "Tuned", "tune"]

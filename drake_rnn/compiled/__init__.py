"""Runs, their derivatives and single steps, compiled by JAX from the source that NumPy runs."""

from .runs import CompiledRuns
from .slopes import Slopes, value_and_gradient

__all__ = ["CompiledRuns", "Slopes", "value_and_gradient"]

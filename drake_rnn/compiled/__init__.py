"""Runs, their derivatives and single steps, compiled by JAX from the source that NumPy runs."""

from .runs import CompiledRuns
from .slopes import Slopes, value_and_gradient
from .steps import CompiledStep, SteppedRobot

__all__ = ["CompiledRuns", "CompiledStep", "Slopes", "SteppedRobot", "value_and_gradient"]

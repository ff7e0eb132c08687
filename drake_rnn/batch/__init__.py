"""Kinematic runs side by side, without Drake: in NumPy, or compiled by JAX with derivatives."""

from .compiled_runs import CompiledRuns
from .compiled_step import CompiledStep, SteppedRobot
from .run import Many, run_many
from .slopes import Slopes, value_and_gradient
from .why_not import why_not

__all__ = [
    "CompiledRuns",
    "CompiledStep",
    "Many",
    "Slopes",
    "SteppedRobot",
    "run_many",
    "value_and_gradient",
    "why_not",
]

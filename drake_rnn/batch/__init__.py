"""Kinematic runs side by side, without Drake: in NumPy, or compiled by JAX with derivatives."""

from .compiled_runs import CompiledRuns as CompiledRuns
from .compiled_runs import (
    CompiledStep as CompiledStep,
    SteppedRobot as SteppedRobot,
)
from .run import Many as Many, run_many as run_many
from .compiled_runs import (
    Slopes as Slopes,
    value_and_gradient as value_and_gradient,
)
from .grouping import why_not as why_not

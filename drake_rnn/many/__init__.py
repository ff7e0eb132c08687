"""Many runs at once: kinematic ones, without Drake, robots side by side."""

from .run import Many, run_many
from .why_not import why_not

__all__ = ["Many", "run_many", "why_not"]

"""The wiring of a controller and an arm, and the experiments that come with this package."""

from pathlib import Path

from .loop import AddLoop, Loop, check_filter

#: Folder of the shipped experiments: a folder a scheme, a YAML file an experiment.
EXPERIMENTS = Path(__file__).parent / "experiments"

__all__ = ["EXPERIMENTS", "AddLoop", "Loop", "check_filter"]

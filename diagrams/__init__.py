"""Closed loops of a controller and an arm as diagrams, and the shipped experiments."""

from pathlib import Path

from .checks import check_filter, check_sensing
from .drawing import wiring_graph
from .loop import AddLoop, Loop

#: Folder of the shipped campaigns, one YAML file each.
CAMPAIGNS = Path(__file__).parent / "campaigns"
#: Folder of the shipped experiments: one folder per kind of law, one YAML file per experiment.
EXPERIMENTS = Path(__file__).parent / "experiments"

__all__ = [
    "CAMPAIGNS",
    "EXPERIMENTS",
    "AddLoop",
    "Loop",
    "check_filter",
    "check_sensing",
    "wiring_graph",
]

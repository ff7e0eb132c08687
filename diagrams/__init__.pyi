"""Names of this room, and the modules that they are lent from when they are first used."""

from pathlib import Path

from .drawing import wiring_graph as wiring_graph
from .loop import AddLoop as AddLoop, Loop as Loop

CAMPAIGNS: Path
EXPERIMENTS: Path
SCHEMAS: Path

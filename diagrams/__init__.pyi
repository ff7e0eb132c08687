"""Names of this room, and the modules that they are lent from when they are first used."""

from pathlib import Path

from .checks import (
    check_camera as check_camera,
    check_filter as check_filter,
    check_locks as check_locks,
    check_sensing as check_sensing,
)
from .drawing import wiring_graph as wiring_graph
from .loop import AddLoop as AddLoop, Loop as Loop

CAMPAIGNS: Path
EXPERIMENTS: Path
SCHEMAS: Path

"""The connection to each robot."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

from ..errors import RobotError
from ..inputs.extras import not_installed
from .connection import Connection
from .iiwa_lcm import IiwaLcm, connected
from .paced import Paced
from .robots import FR3, IIWA, Robot


def connect(robot: Robot, url: str | None = None, record: Path | None = None) -> Connection:
    """Return a connection to a robot.

    Args:
        robot: The robot.
        url: Its address; by default the robot's own, if it has one.
        record: File that a paced connection leaves if this process is killed.

    Raises:
        RobotError: If the address is missing or wrong, nothing answers there, or a package is
            missing.
    """
    if not (address := url or robot.url):
        raise RobotError(f"--url: must be given, the name or IP address of the {robot.name}")
    return _CONNECTED[robot.name](address, record)


def _iiwa(url: str, record: Path | None) -> Connection:
    return IiwaLcm(connected(url))


def _fr3(url: str, record: Path | None) -> Connection:
    if find_spec("pylibfranka") is None:
        raise RobotError(not_installed("--robot fr3", "franka", "pylibfranka"))
    return Paced(url, record=record)


_CONNECTED: dict[str, Callable[[str, Path | None], Connection]] = {
    IIWA.name: _iiwa,
    FR3.name: _fr3,
}

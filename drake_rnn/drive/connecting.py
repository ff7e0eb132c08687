"""The address of each robot, and the connection to it."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from ..errors import RobotError
from ..inputs.extras import not_installed
from .connection import Connection
from .iiwa_lcm import WITHIN, IiwaLcm, address_fault, connected
from .paced import Paced
from .robots import FR3, IIWA, Robot

# Name or IP address of a machine, without a port.
_HOST = re.compile(r"[A-Za-z0-9]([A-Za-z0-9._-]*[A-Za-z0-9])?")


def address_of(robot: Robot, url: str | None) -> str:
    """Return the address of a robot.

    Args:
        robot: The robot.
        url: What was given as its address; None for the robot's own, if it has one.

    Raises:
        RobotError: If the address is missing, or no address of this robot.
    """
    address = robot.url if url is None else url
    if not address.strip():
        like = (
            f"such as {robot.url}" if robot.url else f"the name or IP address of the {robot.name}"
        )
        raise RobotError(f"--url: must be given, {like}")
    if fault := _LINKS[robot.name].fault(address):
        raise RobotError(fault)
    return address


def connect(robot: Robot, url: str | None = None, record: Path | None = None) -> Connection:
    """Return a connection to a robot.

    Args:
        robot: The robot.
        url: Its address; by default the robot's own, if it has one.
        record: File that a paced connection leaves if this process is killed.

    Raises:
        RobotError: As `address_of`; if nothing answers there, or a package is missing.
    """
    return _LINKS[robot.name].connected(address_of(robot, url), record)


@dataclass(frozen=True)
class _Link:
    """How a robot is reached.

    Attributes:
        fault: Why a text is no address of it; empty if it is one.
        connected: The connection at an address, with a file that it leaves if it is paced.
    """

    fault: Callable[[str], str]
    connected: Callable[[str, Path | None], Connection]


def _network_fault(url: str) -> str:
    if url.startswith(WITHIN):
        return f"--url: {url!r} keeps messages within one process; it may be such as {IIWA.url}"
    return address_fault(url)


def _iiwa(url: str, record: Path | None) -> Connection:
    return IiwaLcm(connected(url))


def _host_fault(url: str) -> str:
    if _HOST.fullmatch(url):
        return ""
    return (
        f"--url: must be the name or IP address of the fr3 alone, such as 172.16.0.2, not {url!r}"
    )


def _fr3(url: str, record: Path | None) -> Connection:
    if find_spec("pylibfranka") is None:
        raise RobotError(not_installed("--robot fr3", "franka", "pylibfranka"))
    return Paced(url, record=record)


_LINKS = {IIWA.name: _Link(_network_fault, _iiwa), FR3.name: _Link(_host_fault, _fr3)}

"""Listening to a robot before anything is sent: it must be the right one, and stand still."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import RobotError
from .connection import Connection, RobotStatus
from .cycles import Cycle
from .log import Log
from .settings import DriveSettings

# Share of a cycle by which the cycles that were heard may differ from it.
_UNEVEN = 0.2


def listened(
    connection: Connection, names: Sequence[str], settings: DriveSettings, log: Log
) -> RobotStatus:
    """Return the last status of a robot that has stood still for a while.

    Args:
        connection: Connection to the robot.
        names: Names of its joints.
        settings: How long that is, and what standing still means.
        log: What was heard is added to it.

    Raises:
        RobotError: If nothing is heard; if the robot has other joints or another cycle, or moves;
            or if another program commands it.
    """
    began = connection.now()
    heard = [_awaited(connection, len(names), settings.contact)]
    while heard[-1].time - heard[0].time < settings.listen:
        status = _awaited(connection, len(names), settings.contact)
        passed = status.time - heard[-1].time
        if not np.isfinite(status.position).all() or not np.isfinite(status.velocity).all():
            raise RobotError("robot: a status is not a number")
        if abs(passed) > settings.late:
            # As messages do that have waited since the connection was made.
            if connection.now() - began > settings.contact:
                raise RobotError(f"robot: its clock went by {passed:.4g} s between two messages")
            heard = [status]
        elif passed > 0.0:
            log.add("listen", Cycle(status.time, passed, status), None, connection.now())
            heard.append(status)
    # Of messages that come together only the newest is heard.
    typical = np.min if connection.paced else np.median
    cycle = float(typical(np.diff([status.time for status in heard])))
    if not abs(cycle - connection.period) <= _UNEVEN * connection.period:
        raise RobotError(
            f"robot: its messages are {cycle * 1e3:.3g} ms apart; they should be "
            f"{connection.period * 1e3:g} ms"
        )
    if count := connection.others():
        raise RobotError(
            f"robot: another program commands it, {count} times in {settings.listen:g} s; end that "
            "one first"
        )
    _require_still(heard, names, settings)
    return heard[-1]


def _awaited(connection: Connection, joints: int, timeout: float) -> RobotStatus:
    status = connection.next(timeout)
    if status is None:
        raise RobotError(f"robot: no status within {timeout:g} s; is it on, at this address?")
    if status.position.shape != (joints,):
        raise RobotError(f"robot: has {status.position.size} joints; the arm has {joints}")
    return status


def _require_still(
    heard: Sequence[RobotStatus], names: Sequence[str], settings: DriveSettings
) -> None:
    """Raise a RobotError if a joint moves, by its speed or by where it is."""
    positions = np.array([status.position for status in heard])
    speeds = np.array([status.velocity for status in heard])
    drift = np.abs(positions[-1] - positions[0]) / settings.listen
    fastest = np.maximum(np.abs(np.mean(speeds, axis=0)), drift)
    joint = int(np.argmax(fastest))
    if fastest[joint] > settings.still:
        raise RobotError(
            f"robot: {names[joint]} moves at {fastest[joint]:.3g} rad/s; it must stand still "
            "before it is driven"
        )

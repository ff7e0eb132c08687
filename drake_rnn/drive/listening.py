"""Listening to a robot before anything is sent: it must be the right one, and stand still."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..errors import RobotError
from .connection import Connection, RobotStatus
from .cycles import Cycle
from .log import Log
from .settings import DriveSettings
from .watches import StopError

# Share of a cycle by which the cycles that were heard may differ from it.
_UNEVEN = 0.2
# Share of the cycles that are heard one by one at least, also where this side comes late.
_TYPICAL = 0.2
# Time for which nobody is asked whether the drive is to end [s].
_DEAF = 0.1
# Times of listening by this side's clock, after which the robot's clock is too slow.
_PATIENCE = 10.0


def listened(
    connection: Connection,
    names: Sequence[str],
    settings: DriveSettings,
    log: Log,
    is_told_to_stop: Callable[[], bool],
) -> RobotStatus:
    """Return the last status of a robot that has stood still for a while.

    Args:
        connection: Connection to the robot.
        names: Names of its joints.
        settings: How long that is, and what standing still means.
        log: What was heard is added to it.
        is_told_to_stop: Whether somebody wants the drive to end.

    Raises:
        RobotError: If nothing is heard; if the robot has other joints or another cycle, or moves;
            if what it tells cannot be read; or if another program commands it.
        StopError: If the drive is to end.
    """

    def awaited() -> RobotStatus:
        return _awaited(connection, len(names), settings.contact, is_told_to_stop)

    began = connection.now()
    heard = [awaited()]
    while heard[-1].time - heard[0].time < settings.listen:
        status = awaited()
        passed, since = status.time - heard[-1].time, connection.now() - began
        _require_clock(passed, since, settings)
        if abs(passed) > settings.late:
            # As messages do that have waited since the connection was made.
            heard = [status]
        elif passed > 0.0:
            log.add("listen", Cycle(status.time, passed, status), None, connection.now())
            heard.append(status)
    # Of messages that come together only one is heard.
    typical = 0.0 if connection.paced else _TYPICAL
    cycle = float(np.quantile(np.diff([status.time for status in heard]), typical))
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


def _awaited(
    connection: Connection, joints: int, timeout: float, is_told_to_stop: Callable[[], bool]
) -> RobotStatus:
    until, status = connection.now() + timeout, None
    while status is None:
        if is_told_to_stop():
            raise StopError("interrupted", "told to stop before anything was sent")
        if failure := connection.failure:
            raise RobotError(f"robot: {failure}")
        if (left := until - connection.now()) <= 0.0:
            raise RobotError(f"robot: no status within {timeout:g} s; is it on, at this address?")
        status = connection.next(min(left, _DEAF))
    for told in (*status.earlier, status):
        if complaint := told.complaint(joints):
            raise RobotError(f"robot: {complaint}")
        if not (np.isfinite(told.position).all() and np.isfinite(told.velocity).all()):
            raise RobotError("robot: a status is not a number")
    return status


def _require_clock(passed: float, since: float, settings: DriveSettings) -> None:
    """Raise a RobotError for a clock that jumps, or hardly goes, after a time of listening [s]."""
    if abs(passed) > settings.late and since > settings.contact:
        raise RobotError(
            f"robot: its clock went by {passed:.4g} s between two messages; do two robots tell "
            "statuses at this address?"
        )
    if since > settings.contact + _PATIENCE * settings.listen:
        raise RobotError(
            f"robot: its clock does not go by {settings.listen:g} s in {since:.4g} s of listening"
        )


def _require_still(
    heard: Sequence[RobotStatus], names: Sequence[str], settings: DriveSettings
) -> None:
    """Raise a RobotError if a joint moves, by its speed or by where it is."""
    positions = np.array([status.position for status in heard])
    speeds = np.array([status.velocity for status in heard])
    drift = np.ptp(positions, axis=0) / settings.listen
    fastest = np.maximum(np.abs(np.mean(speeds, axis=0)), drift)
    joint = int(np.argmax(fastest))
    if fastest[joint] > settings.still:
        raise RobotError(
            f"robot: {names[joint]} moves at {fastest[joint]:.3g} rad/s; it must stand still "
            "before it is driven"
        )

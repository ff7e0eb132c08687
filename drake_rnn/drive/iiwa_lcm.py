"""The iiwa behind drake-iiwa-driver: Drake's LCM messages, in position mode."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from math import ceil

import numpy as np
from drake import lcmt_iiwa_command, lcmt_iiwa_status
from pydrake.lcm import DrakeLcm

from ..errors import RobotError
from ..inputs.fields import Array
from .connection import Command, Connection, RobotStatus
from .robots import IIWA

STATUS, COMMAND = "IIWA_STATUS", "IIWA_COMMAND"
_KINDS = ("udpm://", "memq://")
_TEST = "DRAKE_RNN_TEST"
# Time that a message to oneself may take [s].
_TEST_TIME = 1.0
# Messages that may wait at most; of more, the oldest are of no use.
_MOST = 256


def decoded_status(data: bytes) -> RobotStatus:
    """Return what a message of the robot says."""
    message = lcmt_iiwa_status.decode(data)
    return RobotStatus(
        message.utime * 1e-6,
        np.array(message.joint_position_measured),
        np.array(message.joint_velocity_estimated),
        np.array(message.joint_position_commanded),
    )


def encoded_command(position: Array, time: float) -> bytes:
    """Return the message that commands positions, shape (7,) [rad], at a time [s]."""
    message = lcmt_iiwa_command()
    message.utime = round(time * 1e6)
    message.num_joints = position.size
    message.joint_position = position.tolist()
    return bytes(message.encode())


class IiwaLcm(Connection):
    """A connection to an iiwa.

    Args:
        lcm: The messages.
        wait: Waits for messages for up to a time [s], and has them handled; by default of ``lcm``.
        now: Clock of this side [s].
    """

    def __init__(
        self,
        lcm: DrakeLcm,
        wait: Callable[[float], object] | None = None,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._clock = now
        self._lcm = lcm
        self._wait = self._handle if wait is None else wait
        self._came: deque[bytes] = deque(maxlen=_MOST)
        self._commands = self._own = 0
        lcm.Subscribe(STATUS, self._came.append)
        lcm.Subscribe(COMMAND, self._count)

    @property
    def period(self) -> float:
        """See `Connection.period`."""
        return IIWA.period

    def now(self) -> float:
        """See `Connection.now`."""
        return self._clock()

    def next(self, timeout: float) -> RobotStatus | None:
        """See `Connection.next`."""
        end = self.now() + timeout
        while not self._came:
            if (left := end - self.now()) <= 0.0:
                return None
            self._wait(left)
        *earlier, newest = sorted(map(decoded_status, self._came), key=lambda status: status.time)
        self._came.clear()
        return replace(newest, earlier=earlier) if earlier else newest

    def send(self, command: Command) -> None:
        """See `Connection.send`."""
        self._own += 1
        self._lcm.Publish(COMMAND, encoded_command(command.motion.position, command.time))

    def others(self) -> int:
        """See `Connection.others`; own messages come back, too."""
        return max(self._commands - self._own, 0)

    def _count(self, data: bytes) -> None:
        self._commands += 1

    def _handle(self, timeout: float) -> None:
        self._lcm.HandleSubscriptions(max(ceil(timeout * 1e3), 1))


def connected(url: str) -> DrakeLcm:
    """Return messages at an address, through which a message to oneself has come.

    Args:
        url: Address of LCM, e.g. ``udpm://239.255.76.67:7699?ttl=0``.

    Raises:
        RobotError: If the address is none, or nothing comes back.
    """
    if not url.startswith(_KINDS):
        raise RobotError(f"--url: must begin with {' or '.join(_KINDS)}, not be {url!r}")
    lcm = DrakeLcm(url)
    came: list[bytes] = []
    lcm.Subscribe(_TEST, came.append)
    end = time.monotonic() + _TEST_TIME
    try:
        while not came and time.monotonic() < end:
            lcm.Publish(_TEST, b"test")
            lcm.HandleSubscriptions(50)
    except RuntimeError as error:
        raise RobotError(f"--url: {url!r} carries no messages: {error}") from None
    if not came:
        raise RobotError(
            f"--url: no message to oneself comes back at {url!r}; multicast needs a route: on one "
            "machine `ip link set lo multicast on; ip route add 224.0.0.0/4 dev lo`"
        )
    return lcm

"""The iiwa behind drake-iiwa-driver: Drake's LCM messages, in position mode."""

from __future__ import annotations

import struct
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from io import BytesIO
from ipaddress import IPv4Address
from math import ceil
from typing import Any
from urllib.parse import parse_qsl

import numpy as np
from drake import lcmt_iiwa_command, lcmt_iiwa_status
from pydrake.lcm import DrakeLcm

from ..errors import RobotError
from ..inputs.fields import (
    Array,
    checked,
    function,
    offering,
    optional,
)
from .robots import (
    IIWA,
    Command,
    Connection,
    RobotStatus,
)
from .shared_cycles import (
    LAW_BESIDE,
    Schedule,
    prioritize,
    raise_priority,
    restore,
)

STATUS, COMMAND = "IIWA_STATUS", "IIWA_COMMAND"
_SCHEME = "udpm://"
#: Address of messages within one process.
WITHIN = "memq://"
_TEST = "DRAKE_RNN_TEST"
# Time that a message to oneself may take [s].
_TEST_TIME = 1.0
# Messages that may wait at most; of more, the oldest are of no use.
_MOST = 256
# Own commands that may not have come back yet.
_UNDER_WAY = 64
# Cycles between two looks at the messages, after more than which the one that waits may be old.
_OLD = 1.5
# Options of an address, and what each may be.
_OPTIONS = {"ttl": (0, 255), "recv_buf_size": (2048, 2**31 - 1)}
_LAST_PORT = 65535
# Times that a message can hold [us].
_LONGEST = 2**63 - 1


def decode(kind: Any, data: bytes) -> Any:
    """Return a message of a class; None if the bytes are no such message, or more than one."""
    stream = BytesIO(data)
    try:
        message = kind.decode(stream)
    except (ValueError, struct.error, MemoryError, OverflowError):
        return None
    return None if stream.read(1) else message


def decoded_status(data: bytes) -> RobotStatus:
    """Return what a message of the robot says; one that cannot be read is a `fault`."""
    message = decode(lcmt_iiwa_status, data)
    if message is None:
        nothing = np.full(0, np.nan)
        fault = f"a message of {len(data)} bytes on {STATUS} is no lcmt_iiwa_status"
        return RobotStatus(np.nan, nothing, nothing, nothing, fault=fault)
    return RobotStatus(
        message.utime * 1e-6,
        np.array(message.joint_position_measured),
        np.array(message.joint_velocity_estimated),
        np.array(message.joint_position_commanded),
    )


def encoded_command(position: Array, time: float) -> bytes:
    """Return the message that commands positions, shape (7,) [rad], at a time [s]."""
    message = lcmt_iiwa_command()
    # A clock may tell anything.
    message.utime = min(max(round(time * 1e6), -_LONGEST), _LONGEST)
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

    @checked(lcm=offering("Publish", "Subscribe"), wait=optional(function()), now=function())
    def __init__(
        self,
        lcm: DrakeLcm,
        wait: Callable[[float], object] | None = None,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._clock = now
        self._lcm = lcm
        self._is_live = wait is None
        self._before: Schedule | None = None
        self._wait = self._handle if wait is None else wait
        self._came: deque[bytes] = deque(maxlen=_MOST)
        self._looked = self.now()
        self._own: deque[bytes] = deque(maxlen=_UNDER_WAY)
        self._others = 0
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
        """See `Connection.next`.

        Of the messages that come while nobody looks, DrakeLcm keeps the oldest. If this side comes
        late, it therefore waits for one more, up to a cycle.
        """
        began, enough = self.now(), 1
        if began - self._looked > _OLD * self.period:
            self._wait(0.0)
            enough, timeout = len(self._came) + 1, max(timeout, _OLD * self.period)
        while len(self._came) < enough:
            self._wait(max(began + timeout - self.now(), 0.0))
            if self.now() - began >= timeout:
                break
        self._looked = self.now()
        statuses = list(map(decoded_status, self._came))
        self._came.clear()
        read = sorted((each for each in statuses if not each.fault), key=lambda each: each.time)
        statuses_in_order = [each for each in statuses if each.fault] + read
        if not statuses_in_order:
            return None
        return (
            replace(statuses_in_order[-1], earlier=statuses_in_order[:-1])
            if statuses_in_order[1:]
            else statuses_in_order[0]
        )

    def send(self, command: Command) -> None:
        """See `Connection.send`."""
        data = encoded_command(command.motion.position, command.time)
        self._own.append(data)
        self._lcm.Publish(COMMAND, data)

    def listen(self) -> None:
        """See `Connection.listen`; from now on this thread comes before others, where it may."""
        if self._is_live:
            self._before = prioritize(LAW_BESIDE)

    def end(self) -> None:
        """See `Connection.end`."""
        restore(self._before)
        self._before = None

    def others(self) -> int:
        """See `Connection.others`; own messages come back, too."""
        return self._others

    def _count(self, data: bytes) -> None:
        try:
            self._own.remove(data)
        except ValueError:
            self._others += 1

    def _handle(self, timeout: float) -> None:
        self._lcm.HandleSubscriptions(max(ceil(timeout * 1e3), 1))


def open_lcm(url: str) -> DrakeLcm:
    """Return messages at an address, through which a message to oneself has come.

    Args:
        url: Address of LCM, e.g. ``udpm://239.255.76.67:7699?ttl=0``, or ``memq://`` for messages
            within this process.

    Raises:
        RobotError: If the address is none, or nothing comes back.
    """
    if url == WITHIN:
        return DrakeLcm(url)
    if not url.startswith(_SCHEME):
        raise RobotError(f"--url: must begin with {_SCHEME} or {WITHIN}, not be {url!r}")
    if fault := address_fault(url):
        raise RobotError(fault)
    try:
        # LCM receives in a thread, which keeps the priority.
        with raise_priority(LAW_BESIDE):
            lcm = DrakeLcm(url)
            if _carries(DrakeLcm(url), lcm):
                return lcm
    except RuntimeError as error:
        raise RobotError(f"--url: {url!r} carries no messages: {error}") from None
    raise RobotError(
        f"--url: no message to oneself comes back at {url!r}; multicast needs a route: on one "
        "machine `ip link set lo multicast on; ip route add 224.0.0.0/4 dev lo`"
    )


def _carries(sender: DrakeLcm, receiver: DrakeLcm) -> bool:
    """Return whether a message of one comes to another.

    It has to leave the first one: where LCM cannot reach the network, it passes messages to itself.
    """
    came: list[bytes] = []
    receiver.Subscribe(_TEST, came.append)
    end = time.monotonic() + _TEST_TIME
    while not came and time.monotonic() < end:
        sender.Publish(_TEST, b"test")
        receiver.HandleSubscriptions(50)
    return bool(came)


def address_fault(url: str) -> str:
    """Return why a text is no address of multicast messages; empty if it is one.

    LCM takes what it cannot read for something else, and tells nobody.
    """
    if not url.startswith(_SCHEME):
        return f"--url: must begin with {_SCHEME}, not be {url!r}; it may be such as {IIWA.url}"
    why = _group_fault(url) or _option_fault(url)
    return f"--url: {why}; it may be such as {IIWA.url}" if why else ""


def _group_fault(url: str) -> str:
    place = url.removeprefix(_SCHEME).partition("?")[0]
    group, _, port = place.rpartition(":") if ":" in place else (place, "", "")
    try:
        is_multicast = IPv4Address(group).is_multicast
    except ValueError:
        is_multicast = False
    if not is_multicast:
        return (
            "the address must be an IPv4 address of multicast, 224.0.0.0 to 239.255.255.255, not "
            f"{group!r}, in {url!r}"
        )
    if port.isascii() and port.isdigit() and 1 <= int(port[:6]) <= _LAST_PORT:
        return ""
    return f"the port must be a number from 1 to {_LAST_PORT}, not {port!r}, in {url!r}"


def _option_fault(url: str) -> str:
    _, question, query = url.partition("?")
    options = parse_qsl(query, keep_blank_values=True)
    for name, value in options:
        if name not in _OPTIONS:
            return f"the options may be {' and '.join(_OPTIONS)}, not {name!r}, in {url!r}"
        low, high = _OPTIONS[name]
        if not (value.isascii() and value.isdigit() and low <= int(value[:11]) <= high):
            return f"{name} must be a number from {low} to {high}, not {value!r}, in {url!r}"
    return "" if options or not question else f"{url!r} has no option behind its ?"

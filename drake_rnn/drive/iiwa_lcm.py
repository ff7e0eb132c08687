"""The iiwa behind drake-iiwa-driver: Drake's LCM messages, in position mode.

- An iiwa that is simulated behind the messages of the real one, by Drake's own systems.
- Faults of messages and of a robot, on request, so that what stops a drive can be tried.
- A robot that follows its commands exactly, in a time of its own: for a look at what is sent.
"""

from __future__ import annotations

import struct
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from io import BytesIO
from ipaddress import IPv4Address
from math import ceil
from typing import Annotated, Any
from urllib.parse import parse_qsl

import numpy as np
from drake import lcmt_iiwa_command, lcmt_iiwa_status
from pydantic import Field
from pydrake.lcm import DrakeLcm, DrakeLcmInterface
from pydrake.manipulation import BuildIiwaControl, IiwaDriver
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from ..errors import RobotError
from ..inputs.fields import (
    Array,
    Finite,
    NonNegative,
    checked,
    function,
    instance,
    number,
    offering,
    optional,
    validated,
    vector,
    whole,
)
from ..robot.load_arm import load_arm
from ..systems import start_posture
from ..systems.plant import motors_of
from .robots import (
    IIWA,
    Command,
    Connection,
    RobotStatus,
)
from .shared_cycles import (
    LAW_BESIDE,
    SIMULATED,
    Schedule,
    prioritize,
    raise_priority,
    restore,
    without_collection,
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


Share = Annotated[NonNegative, Field(le=1.0)]
# Time by which a message is delayed that others overtake [s].
_OVERTAKEN = 7.5e-3


@validated
class Faults:
    """What goes wrong between a robot and who drives it.

    Those that happen once begin ``at`` after the first command.

    Args:
        delay: Delay of every message, each way [s].
        loss: Share of the messages that are lost, each way.
        reorder: Share of the messages that later ones overtake, each way.
        noise: Standard deviation of measured positions [rad].
        at: When what follows begins [s].
        stall: Time for which the robot and its clock stand still [s].
        silence: Time for which nothing comes from the robot, which goes on [s].
        deaf: Time for which no command comes to the robot [s]; infinite for one that has stopped
            at a limit, and holds its posture.
        clock: Jump of the robot's clock [s].
        nan: Whether a position is told as NaN, in one message.
        beyond: Whether a joint is told beyond its limit, in one message.
    """

    delay: NonNegative = 0.0
    loss: Share = 0.0
    reorder: Share = 0.0
    noise: NonNegative = 0.0
    at: NonNegative = 1.0
    stall: NonNegative = 0.0
    silence: NonNegative = 0.0
    deaf: Annotated[float, Field(ge=0.0)] = 0.0
    clock: Annotated[Finite, Field(ge=-1e6, le=1e6)] = 0.0
    nan: bool = False
    beyond: bool = False


class Wire:
    """One way of messages, which delays, loses and reorders them.

    Args:
        faults: What it does.
        seed: Seed of which messages.
    """

    def __init__(self, faults: Faults, seed: tuple[int, ...]) -> None:
        self._faults = faults
        self._rng = np.random.default_rng(seed)
        self._under_way: list[tuple[float, int, bytes]] = []
        self._count = 0

    def put(self, now: float, data: bytes) -> None:
        """Send a message at a time [s]."""
        is_lost, overtaken = self._rng.random(2) < (self._faults.loss, self._faults.reorder)
        if is_lost:
            return
        due = now + self._faults.delay + (_OVERTAKEN if overtaken else 0.0)
        self._count += 1
        self._under_way.append((due, self._count, data))

    def take(self, now: float) -> list[bytes]:
        """Return the messages that have arrived by a time [s], in the order of their arrival."""
        # Times that are sums of steps are compared with some room.
        messages = sorted(each for each in self._under_way if each[0] <= now + 1e-9)
        self._under_way = [each for each in self._under_way if each[0] > now + 1e-9]
        return [data for _, _, data in messages]


#: Time step of the plant [s].
STEP = 1e-3
# Time by which the simulation may be behind; it does not catch up with more [s].
_BEHIND = 0.02
# Time for which another robot is listened for [s].
_LISTEN_TIME = 0.5


def _silent(text: str) -> None:
    """Say nothing."""


class SimulatedIiwa:
    """An iiwa that is told positions, and the faults of its messages.

    Drake's `BuildIiwaControl` controls a MultibodyPlant as the robot's own controller does:
    `IiwaCommandReceiver`, inverse dynamics with its default gains, `IiwaStatusSender`.

    Args:
        lcm: Messages to who drives it.
        start: Posture in which it stands, shape (7,) [rad]; by default the arm's home.
        faults: What goes wrong.
        seed: Seed of the faults.
        say: Told of commands that are none, the first time of each kind; they are ignored.

    Raises:
        InvalidInputError: If the posture is outside the limits.
    """

    @checked(
        lcm=instance(DrakeLcmInterface),
        start=optional(vector),
        faults=instance(Faults, None),
        seed=whole(),
        say=function(),
    )
    def __init__(
        self,
        lcm: DrakeLcm,
        start: Array | None = None,
        faults: Faults | None = None,
        seed: int = 0,
        say: Callable[[str], None] = _silent,
    ) -> None:
        self._say = say
        self._refused: set[str] = set()
        self._lcm, self._faults = lcm, Faults() if faults is None else faults
        self._to_robot, self._from_robot = (Wire(self._faults, (seed, way)) for way in (0, 1))
        self._rng = np.random.default_rng((seed, 2))
        self._time, self._stood, self._first = 0.0, 0.0, np.inf
        self._told_wrong = False
        self._clips, self._joints = IIWA.measurement_limits, len(IIWA.joints)
        lcm.Subscribe(COMMAND, self._command)
        self._inner = DrakeLcm("memq://")
        self._inner.Subscribe(STATUS, self._status)
        # The plant of the robot's own controller: its systems refer to it, and do not keep it.
        self._simulator, self._controlled = _simulator(self._inner, start)
        self._simulator.Initialize()

    @property
    def time(self) -> float:
        """Time since its start [s]."""
        return self._time

    def step(self) -> None:
        """Go on by a step of the plant, and send what is due."""
        self._time += STEP
        self._lcm.HandleSubscriptions(0)
        for data in self._to_robot.take(self._time):
            if not self._during(self._faults.deaf):
                self._inner.Publish(COMMAND, data)
        if self._during(self._faults.stall):
            self._stood += STEP
        else:
            # Here, and not by an LcmInterfaceSystem: Drake 1.58 calls what is subscribed in Python
            # without the interpreter's lock while it simulates.
            self._inner.HandleSubscriptions(0)
            self._simulator.AdvanceTo(self._time - self._stood)
        for data in self._from_robot.take(self._time):
            self._lcm.Publish(STATUS, data)

    def serve(self, is_told_to_stop: Callable[[], bool]) -> None:
        """Go on in real time until somebody wants it to end."""
        with without_collection(), raise_priority(SIMULATED):
            origin = time.monotonic() - self._time
            while not is_told_to_stop():
                ahead = origin + self._time - time.monotonic()
                if ahead > 0.0:
                    time.sleep(ahead)
                elif ahead < -_BEHIND:
                    origin -= ahead
                self.step()

    def _during(self, length: float) -> bool:
        """Return whether a fault of some length is present."""
        begin = self._first + self._faults.at
        return begin <= self._time < begin + length

    def _command(self, data: bytes) -> None:
        command = decode(lcmt_iiwa_command, data)
        if fault := _command_fault(command, self._joints):
            self._refuse(fault, f"a message of {len(data)} bytes {fault}")
            return
        self._first = min(self._first, self._time)
        q = np.array(command.joint_position)
        q_clipped = np.clip(q, self._clips.position_lower, self._clips.position_upper)
        if (q != q_clipped).any():
            joint = int(np.argmax(q != q_clipped))
            self._refuse("clipped", f"joint {joint + 1} at {q[joint]:.4g} rad is clipped")
            command.joint_position = q_clipped.tolist()
            data = command.encode()
        self._to_robot.put(self._time, data)

    def _refuse(self, kind: str, what: str) -> None:
        """Tell once of each kind of command that is not carried out as it is."""
        if kind not in self._refused:
            self._refused.add(kind)
            with suppress(Exception):
                self._say(f"{COMMAND}: {what}; more of this kind will not be told")

    def _status(self, data: bytes) -> None:
        faults, began = self._faults, self._time >= self._first + self._faults.at
        if self._during(faults.silence):
            return
        message = lcmt_iiwa_status.decode(data)
        q = np.array(message.joint_position_measured)
        if faults.noise > 0.0:
            q += faults.noise * self._rng.standard_normal(q.size)
        if began and not self._told_wrong:
            self._told_wrong = True
            if faults.nan:
                q[2] = np.nan
            if faults.beyond:
                q[3] = IIWA.limits.position_upper[3] + 0.01
        if began:
            message.utime += round(faults.clock * 1e6)
        message.joint_position_measured = q.tolist()
        self._from_robot.put(self._time, message.encode())


def _command_fault(command: lcmt_iiwa_command | None, joints: int) -> str:
    """Return why a message is no command; empty if it is one."""
    if command is None:
        return "is no lcmt_iiwa_command, and ignored"
    if command.num_joints != joints:
        return f"commands {command.num_joints} joints of {joints}, and is ignored"
    if not np.isfinite(command.joint_position).all():
        return "commands a position that is no number, and is ignored"
    return ""


def require_alone(lcm: DrakeLcm, url: str) -> None:
    """Raise a RobotError if another robot tells statuses at an address."""
    came: list[bytes] = []
    lcm.Subscribe(STATUS, came.append)
    end = time.monotonic() + _LISTEN_TIME
    while not came and (left := end - time.monotonic()) > 0.0:
        lcm.HandleSubscriptions(max(round(1e3 * left), 1))
    if came:
        raise RobotError(f"--url: another robot tells {STATUS} at {url!r} already")


def _simulator(lcm: DrakeLcm, start: Array | None) -> tuple[Simulator, MultibodyPlant]:
    """Return a simulator of a plant with the robot's own controller, and that one's plant."""
    arm = load_arm(IIWA.arm)
    posture = start_posture(arm, start)
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, MultibodyPlant(STEP))
    instance = arm.add_to(plant)
    motors = {motor.joint().name(): motor for motor in motors_of(plant, instance)}
    for name in arm.joints:
        if name not in motors:
            plant.AddJointActuator(f"{name}_motor", plant.GetJointByName(name, instance))
    plant.Finalize()
    plant.SetDefaultPositions(instance, arm.posture(arm.plant(), posture))
    plant_controlled = MultibodyPlant(0.0)
    arm.add_to(plant_controlled)
    plant_controlled.Finalize()
    BuildIiwaControl(
        builder=builder,
        lcm=lcm,
        plant=plant,
        iiwa_instance=instance,
        driver_config=IiwaDriver(control_mode="position_only"),
        controller_plant=plant_controlled,
    )
    return Simulator(builder.Build()), plant_controlled


@checked(robot=instance(SimulatedIiwa), lcm=instance(DrakeLcmInterface))
def lock_step(robot: SimulatedIiwa, lcm: DrakeLcm) -> Callable[[float], None]:
    """Return what waits for messages of a robot in this process, whose time then goes on.

    Args:
        robot: The robot, at ``lcm``.
        lcm: Messages within this process, ``memq://``.
    """

    def wait(timeout: float) -> None:
        robot.step()
        lcm.HandleSubscriptions(0)

    return wait


class FollowingRobot(Connection):
    """A connection to nothing.

    Args:
        position: Posture in which it stands, shape (n,) [rad].
        period: Time of a cycle [s].
    """

    @checked(position=vector, period=number(above=0.0))
    def __init__(self, position: Array, period: float = 5e-3) -> None:
        self._period = period
        self._cycle = 0
        self._position = np.array(position, dtype=float)
        self._velocity = np.zeros_like(self._position)

    @property
    def period(self) -> float:
        """See `Connection.period`."""
        return self._period

    def now(self) -> float:
        """Return its time [s]."""
        return self._cycle * self._period

    def next(self, timeout: float) -> RobotStatus | None:
        """Return the next status at once."""
        self._cycle += 1
        return RobotStatus(self.now(), self._position, self._velocity, self._position)

    def send(self, command: Command) -> None:
        """Be where it is told to be."""
        position = command.motion.position
        self._velocity = (position - self._position) / self._period
        self._position = position

"""An iiwa that is simulated behind the messages of the real one, by Drake's own systems.

- Faults of messages and of a robot, on request, so that what stops a drive can be tried.
- A robot that follows its commands exactly, in a time of its own: for a look at what is sent.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from typing import Annotated

import numpy as np
from drake import lcmt_iiwa_command, lcmt_iiwa_status
from pydantic import Field
from pydrake.lcm import DrakeLcm, DrakeLcmInterface
from pydrake.manipulation import BuildIiwaControl, IiwaDriver
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.lcm import LcmInterfaceSystem

from ..errors import RobotError
from ..inputs.fields import (
    Array,
    Finite,
    NonNegative,
    checked,
    function,
    instance,
    number,
    optional,
    validated,
    vector,
    whole,
)
from ..robot.load_arm import load_arm
from ..systems import start_posture
from ..systems.plant import motors_of
from .iiwa_lcm import COMMAND, STATUS, decode
from .robots import IIWA, Command, Connection, RobotStatus
from .shared_cycles import SIMULATED, raise_priority, without_collection

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
        self._simulator = _simulator(self._inner, start)
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


def _simulator(lcm: DrakeLcm, start: Array | None) -> Simulator:
    """Return a simulator of a plant with the robot's own controller behind its messages."""
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
    interface = builder.AddSystem(LcmInterfaceSystem(lcm))
    BuildIiwaControl(
        builder=builder,
        lcm=lcm,
        plant=plant,
        iiwa_instance=instance,
        driver_config=IiwaDriver(control_mode="position_only"),
        controller_plant=plant_controlled,
    )
    interface.set_name("messages")
    simulator = Simulator(builder.Build())
    return simulator


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

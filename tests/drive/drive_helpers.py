"""Robots that follow a script, in a time of their own."""

from dataclasses import replace
from functools import cache

import numpy as np
from drake import lcmt_iiwa_command, lcmt_iiwa_status
from pydrake.lcm import DrakeLcm

from drake_rnn.drive import (
    IIWA,
    Faults,
    FollowingRobot,
    IiwaLcm,
    SimulatedIiwa,
    driven_experiment,
    lock_step,
)
from drake_rnn.drive.iiwa_lcm import COMMAND, STATUS

PERIOD = IIWA.period
TORQUES = ("measured", "commanded", "external")


@cache
def known(duration=1.2, name="slc_nephroid_known"):
    return driven_experiment(name, IIWA, {"duration": duration})


class Scripted(FollowingRobot):
    """A robot whose statuses a script changes or withholds.

    Args:
        position: Where it stands.
        script: Called with the time since the first command and the status; returns the status
            to tell, or None.
    """

    def __init__(self, position, script=lambda t, status: status):
        super().__init__(position, PERIOD)
        self.script, self.first, self.sent, self.waited = script, None, [], 0.0

    def now(self):
        return super().now() + self.waited

    def next(self, timeout):
        status = super().next(timeout)
        since = -np.inf if self.first is None else self.now() - self.first
        return self.script(since, replace(status, time=self.now()))

    def send(self, command):
        self.first = self.now() if self.first is None else self.first
        self.sent.append(command.motion.position)
        super().send(command)


class Channels:
    """What `IiwaLcm` asks of LCM, and behind it a robot that follows at once, in a time of its own.

    Args:
        position: Where it stands.
        script: Called with the time since the first command and the message; returns the messages
            that come in its place, as bytes.
        pace: Cycles of this side in each of the robot's.
    """

    def __init__(self, position, script=lambda t, data: [data], pace=1):
        self.position, self.velocity, self.script = position, 0.0 * position, script
        self.time, self.last, self.cycles, self.pace = 0.0, 0.0, 0, pace
        self.first, self.sent, self.hear, self.kept = None, [], {}, []

    def Subscribe(self, channel, handler):
        self.hear[channel] = handler

    def Publish(self, channel, data):
        assert channel == COMMAND
        self.first = self.time if self.first is None else self.first
        position = np.array(lcmt_iiwa_command.decode(data).joint_position)
        passed = max(self.time - self.last, PERIOD)
        self.velocity, self.position = (position - self.position) / passed, position
        self.last = self.time
        self.sent.append(position)
        self.hear[COMMAND](data)

    def busy(self, length):
        """Time passes in which nobody reads: of what comes, LCM keeps the oldest."""
        self.kept = [status_bytes((self.cycles + 1) * PERIOD, self.position, self.velocity)]
        self.cycles += round(length / PERIOD)
        self.time = self.cycles * PERIOD

    def wait(self, timeout):
        """Some time passes, until the next message at most."""
        if self.kept:
            self.hear[STATUS](self.kept.pop())
            return
        due = (self.cycles + 1) * self.pace * PERIOD
        if timeout < due - self.time - 1e-9:
            self.time += timeout
            return
        self.time, self.cycles = due, self.cycles + 1
        since = -np.inf if self.first is None else self.time - self.first
        data = status_bytes(self.cycles * PERIOD, self.position, self.velocity)
        for each in self.script(since, data):
            self.hear[STATUS](each)

    def connection(self):
        return IiwaLcm(self, self.wait, lambda: self.time)


def status_bytes(time, position, velocity, **changes):
    """A message of the robot, with other fields where they are given."""
    message = lcmt_iiwa_status()
    message.utime, message.num_joints = round(time * 1e6), len(position)
    message.joint_position_measured = message.joint_position_commanded = list(position)
    message.joint_velocity_estimated = list(velocity)
    for name in ("joint_position_ipo", *(f"joint_torque_{of}" for of in TORQUES)):
        setattr(message, name, [0.0] * len(position))
    for name, value in changes.items():
        setattr(message, name, value)
    return message.encode()


def stopped_within(sent, acceleration=1.0):
    """Whether commands, one in each cycle, come to rest within a bound of the acceleration."""
    velocity = np.diff(sent, axis=0) / PERIOD
    hardest = np.abs(np.diff(velocity, axis=0)).max() / PERIOD
    return hardest <= acceleration + 1e-4 and not velocity[-1].any()


def simulated(experiment, off=0.0, faults=None, seed=0):
    """A connection to a simulated iiwa in lock step, and the robot."""
    lcm = DrakeLcm("memq://")
    robot = SimulatedIiwa(lcm, experiment.start + off, faults or Faults(), seed)
    return IiwaLcm(lcm, lock_step(robot, lcm), lambda: robot.time), robot


def derivatives(log, *phases):
    """Largest speed and acceleration of what was sent, by the times that it was sent for."""
    arrays = log.arrays()
    chosen = np.isin(arrays["phase"], phases or ("approach", "run", "stop"))
    chosen &= np.isfinite(arrays["position_sent"]).all(axis=1)
    t, q = arrays["time"][chosen], arrays["position_sent"][chosen]
    v = np.diff(q, axis=0) / np.diff(t)[:, None]
    middle = (t[1:] + t[:-1]) / 2
    a = np.diff(v, axis=0) / np.diff(middle)[:, None]
    return np.abs(v).max(), np.abs(a).max()

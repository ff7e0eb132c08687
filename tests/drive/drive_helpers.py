"""Robots that follow a script, in a time of their own."""

from dataclasses import replace
from functools import cache

import numpy as np
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

PERIOD = IIWA.period


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

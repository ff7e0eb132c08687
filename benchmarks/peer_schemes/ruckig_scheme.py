"""Ruckig: the fastest motion to a wanted state within bounds to the jerk."""

from __future__ import annotations

import numpy as np
from ruckig import (
    ControlInterface,
    InputParameter,
    OutputParameter,
    Result,
    Ruckig,
    Synchronization,
)

from drake_rnn import Array
from peer_schemes.behind import JERK, Shaper, behind
from peer_schemes.placo_scheme import PlacoWithoutAcceleration
from peer_schemes.scheme import NoSolutionError, in_the_middle
from peer_schemes.tasks import Task

# Share of the acceleration's bound that the frame may have: what is left is Ruckig's.
_MOST = 0.99


class RuckigVelocity(Shaper):
    """The first sample of the fastest motion to rest, in a frame that moves as is wanted.

    Ruckig takes a wanted velocity and acceleration for a state to be reached some time, not for
    one that moves on in the meantime.
    """

    name = "Ruckig"
    setting = "velocity interface in the frame that moves as wanted"

    def __init__(self, task: Task) -> None:
        super().__init__(task)
        n = task.arm.n
        self._generator = Ruckig(n, task.period)
        self._from, self._to = InputParameter(n), OutputParameter(n)
        self._from.control_interface = ControlInterface.Velocity
        self._from.synchronization = Synchronization.No
        self._from.max_jerk = [JERK] * n
        self._from.current_position = [0.0] * n
        self._from.target_velocity = self._from.target_acceleration = [0.0] * n

    def moved(self, q: Array, v: Array, a: Array) -> Array:
        h, bound = self.task.period, self.task.limits.acceleration
        a = np.clip(a, -_MOST * bound, _MOST * bound)
        frame_v = v - h * a
        self._from.current_velocity = (self.v - frame_v).tolist()
        self._from.current_acceleration = (self.a - a).tolist()
        self._from.max_acceleration = (bound - a).tolist()
        self._from.min_acceleration = (-bound - a).tolist()
        if self._generator.update(self._from, self._to) not in (Result.Working, Result.Finished):
            raise NoSolutionError
        self.v = v + np.array(self._to.new_velocity)
        self.a = a + np.array(self._to.new_acceleration)
        return q + h * frame_v + 0.5 * h * h * a + np.array(self._to.new_position)


SCHEMES = (behind(RuckigVelocity, in_the_middle(PlacoWithoutAcceleration)),)

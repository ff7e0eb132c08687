"""klimits: the accelerations from which joints stay within all bounds to the jerk."""

from __future__ import annotations

import numpy as np
from klimits import PosVelJerkLimitation, calculate_end_position, calculate_end_velocity

from drake_rnn import Array
from peer_schemes.behind import JERK, Shaper, behind
from peer_schemes.placo_scheme import PlacoWithoutAcceleration
from peer_schemes.scheme import in_the_middle
from peer_schemes.tasks import Task


class Klimits(Shaper):
    """The acceleration nearest to the one wanted of those that klimits allows."""

    name = "klimits"
    setting = "PosVelJerkLimitation"

    def __init__(self, task: Task) -> None:
        super().__init__(task)
        limits, ones = task.limits, np.ones(task.arm.n)
        self._room = PosVelJerkLimitation(
            time_step=task.period,
            pos_limits=np.stack((limits.position_lower, limits.position_upper), axis=1).tolist(),
            vel_limits=np.stack((-limits.velocity, limits.velocity), axis=1).tolist(),
            acc_limits=np.stack((-limits.acceleration, limits.acceleration), axis=1).tolist(),
            jerk_limits=np.stack((-JERK * ones, JERK * ones), axis=1).tolist(),
            acceleration_after_max_vel_limit_factor=0.0001,
            normalize_acc_range=False,
            num_threads=1,
        )

    def moved(self, q: Array, v: Array, a: Array) -> Array:
        h = self.task.period
        allowed, _ = self._room.calculate_valid_acceleration_range(q, self.v, self.a)
        # What the velocity lacks if the acceleration were the one wanted, and the way to it that
        # the jerk allows, of which nothing is left over.
        lack = v - self.v - 0.5 * h * (self.a + a)
        step = 0.5 * h * JERK
        way = np.sqrt(step * step + 2.0 * JERK * np.abs(lack)) - step
        change = np.sign(lack) * np.minimum(way, np.abs(lack) / h)
        next_a = np.clip(a + change, allowed[:, 0], allowed[:, 1])
        q_next = calculate_end_position(self.a, next_a, self.v, q, h)
        self.v = np.asarray(calculate_end_velocity(self.a, next_a, self.v, h))
        self.a = next_a
        return np.asarray(q_next)


SCHEMES = (behind(Klimits, in_the_middle(PlacoWithoutAcceleration)),)

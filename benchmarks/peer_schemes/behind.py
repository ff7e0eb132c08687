"""Schemes of velocities with a filter behind them that bounds the jerk of the joints."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from drake_rnn import Array
from peer_schemes.scheme import Aim, AimedScheme
from peer_schemes.tasks import Task

#: Bound of the jerk, as that of `adaptive_jerk` [rad/s^3].
JERK = 20.0
#: Gain of the feedback within it, of all who bound the jerk [1/s].
JERK_GAIN = 100.0


class Shaper(ABC):
    """Moves joints within all bounds to the jerk, and as near as it can to velocities wanted.

    Args:
        task: What it is to do.

    Attributes:
        v, a: Velocity and acceleration at the sample, shape (n,).
    """

    name: ClassVar[str]
    setting: ClassVar[str]

    def __init__(self, task: Task) -> None:
        self.task = task
        self.v, self.a = np.zeros(task.arm.n), np.zeros(task.arm.n)

    @abstractmethod
    def moved(self, q: Array, v: Array, a: Array) -> Array:
        """Return the joint positions a sample later, and update velocity and acceleration.

        Args:
            q: Joint positions, shape (n,) [rad].
            v: Velocity wanted a sample later, shape (n,) [rad/s].
            a: Acceleration wanted then, likewise [rad/s^2].
        """


class _Behind(AimedScheme):
    """A scheme's velocities, each the mean over a sample, through a shaper."""

    shaper: ClassVar[type[Shaper]]

    def __init__(self, task: Task) -> None:
        super().__init__(task)
        self._shaper = self.shaper(task)
        self._wanted = np.zeros(task.arm.n)

    def towards(self, aim: Aim, q: Array, v: Array) -> Array:
        h, bound = self.task.period, self.task.limits.acceleration
        wanted = super().towards(aim, q, v)
        a = np.clip((wanted - self._wanted) / h, -bound, bound)
        self._wanted = wanted
        # What is wanted is a mean over the sample; the shaper is told of its end.
        return (self._shaper.moved(q, wanted + 0.5 * h * a, a) - q) / h


def behind(shaper: type[Shaper], scheme: type[AimedScheme]) -> type[AimedScheme]:
    """Return a scheme with a shaper behind it.

    Args:
        shaper: The shaper.
        scheme: The scheme, which need not bound the acceleration.
    """
    about: dict[str, Any] = {
        "name": f"{shaper.name} behind {scheme.name}",
        "setting": f"{shaper.setting}, {JERK:g} rad/s^3, feedback {JERK_GAIN:g}",
        "braking": replace(scheme.braking, gain=JERK_GAIN),
        "turn_braking": replace(scheme.turn_braking, gain=JERK_GAIN),
        "shaper": shaper,
    }
    return type(f"{shaper.__name__}Behind{scheme.__name__}", (_Behind, scheme), about)

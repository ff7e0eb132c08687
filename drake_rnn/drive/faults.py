"""Faults of messages and of a robot, on request, so that what stops a drive can be tried."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field

from ..inputs.fields import Finite, NonNegative, validated

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
        lost, overtaken = self._rng.random(2) < (self._faults.loss, self._faults.reorder)
        if lost:
            return
        due = now + self._faults.delay + (_OVERTAKEN if overtaken else 0.0)
        self._count += 1
        self._under_way.append((due, self._count, data))

    def take(self, now: float) -> list[bytes]:
        """Return the messages that have arrived by a time [s], in the order of their arrival."""
        # Times that are sums of steps are compared with some room.
        arrived = sorted(each for each in self._under_way if each[0] <= now + 1e-9)
        self._under_way = [each for each in self._under_way if each[0] > now + 1e-9]
        return [data for _, _, data in arrived]

"""Joint targets as a signal: each at the sample at which it has come."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.systems.framework import Context

from ..paths import JointTargets
from .block import Block


class TargetSource(Block):
    """Source of joint targets: the output ``target``, shape (n,) [rad].

    At a sample it is the newest target that has come since the sample before; NaN if none has.

    Args:
        targets: The targets, with the times at which they come.
        period: Sampling period of the controller [s].
    """

    def __init__(self, targets: JointTargets, period: float) -> None:
        super().__init__()
        size = targets.position.shape[1]
        none = np.full(size, np.nan)

        def arrived(context: Context, output: Any) -> None:
            sample = round(context.get_time() / period)
            before, newest = targets.newest(period * np.array((sample - 1, sample))).tolist()
            output.set_value(none if newest == before else targets.position[newest])

        self.DeclareVectorOutputPort("target", size, arrived, {self.time_ticket()})

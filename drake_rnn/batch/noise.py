"""The dither of robots side by side, with the same numbers as `drake_rnn.systems.Dither`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays.namespace import AnyArray
from ..experiment import Experiment
from ..inputs.fields import Array
from ..systems.dither import dither_noise
from ..systems.white_noise import BLOCK


class Noises:
    """Held white noise on the joint velocities of robots with seeds of their own.

    Args:
        experiments: Their experiments, all with dither of one hold.
    """

    def __init__(self, experiments: Sequence[Experiment]) -> None:
        settings = [d for each in experiments if (d := each.document.dither) is not None]
        seeds = [experiment.document.seed for experiment in experiments]
        distinct = list(dict.fromkeys(seeds))
        n = experiments[0].arm.n
        self._noises = [dither_noise(n, seed) for seed in distinct]
        self._which = np.array([distinct.index(seed) for seed in seeds])
        self._sigma = np.array([each.sigma for each in settings])
        self._hold = settings[0].hold
        # A memo of a pure function: the next sample asked for is usually in the same block.
        self._block, self._values = -1, np.empty(0)

    def row(self, t: float) -> Array:
        """Return the noise of each seed from a time on, of standard deviation 1, (n, seeds)."""
        block, row = divmod(round(t / self._hold), BLOCK)
        if block != self._block:
            self._values = np.stack([noise.block(block) for noise in self._noises], axis=-1)
            self._block = block
        values: Array = self._values[row]
        return values

    def of_each(self, row: AnyArray) -> AnyArray:
        """Return the noise of each robot, shape (robots, n) [rad/s], of NumPy's row or JAX's."""
        return (self._sigma * row[:, self._which]).T

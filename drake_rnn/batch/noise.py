"""Noise of robots side by side, with the same numbers as the blocks of a diagram."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays.namespace import AnyArray
from ..experiment import Experiment
from ..features.joint_noise import Samples
from ..inputs.fields import Array
from ..systems.lateness import sample_number
from ..systems.pose_sensor import pose_noise
from ..systems.white_noise import BLOCK


class _Rows:
    """Samples of several noises, of which the next one asked for is usually in the same block.

    Args:
        noises: The noises.
    """

    def __init__(self, noises: Sequence[Samples]) -> None:
        self._noises = noises
        # A memo of a pure function.
        self._block, self._values = -1, np.empty(0)

    def row(self, number: int) -> Array:
        """Return the sample of that number of each noise, shape (size, noises)."""
        block, row = divmod(number, BLOCK)
        if block != self._block:
            self._values = np.stack([noise.block(block) for noise in self._noises], axis=-1)
            self._block = block
        values: Array = self._values[row]
        return values


class Noises:
    """Held noise on the joint velocities of robots with seeds of their own.

    Args:
        experiments: Their experiments, all with dither or a disturbance of one hold.
    """

    def __init__(self, experiments: Sequence[Experiment]) -> None:
        documents = [each.document for each in experiments]
        settings = [noise for each in documents if (noise := each.joint_noise) is not None]
        # Those that differ in size alone share their samples.
        kinds = [
            (each.section, each.course, document.seed)
            for each, document in zip(settings, documents, strict=True)
        ]
        distinct = list(dict.fromkeys(kinds))
        n = experiments[0].arm.n
        self._rows = _Rows([settings[kinds.index(kind)].samples(n, kind[-1]) for kind in distinct])
        self._which = np.array([distinct.index(kind) for kind in kinds])
        self._scale = np.array([each.scale for each in settings])
        self._hold = settings[0].hold

    def row(self, t: float) -> Array:
        """Return the noise of each seed from a time on, of standard deviation 1, (n, seeds)."""
        return self._rows.row(round(t / self._hold))

    def of_each(self, row: AnyArray) -> AnyArray:
        """Return the noise of each robot, shape (robots, n) [rad/s], of NumPy's row or JAX's."""
        return (self._scale * row[:, self._which]).T


class PoseNoise:
    """Noise of positions that are measured from outside, of robots with seeds of their own.

    Args:
        experiments: Their experiments, all with a measured position and one period.
    """

    def __init__(self, experiments: Sequence[Experiment]) -> None:
        documents = [each.document for each in experiments]
        seeds = [document.seed for document in documents]
        distinct = list(dict.fromkeys(seeds))
        self._rows = _Rows([pose_noise(seed) for seed in distinct])
        self._which = np.array([distinct.index(seed) for seed in seeds])
        sizes = [each.sensing and each.sensing.p_WE_noise for each in documents]
        self._scale = np.array([size or 0.0 for size in sizes])
        self._period = documents[0].period or 1.0

    def row(self, t: float) -> Array:
        """Return the noise of each seed of the sample at a time, or after it, (3, seeds)."""
        return self._rows.row(sample_number(t, self._period))[:3]

    def of_each(self, row: AnyArray) -> AnyArray:
        """Return the noise of each robot, shape (robots, 3) [m], of NumPy's row or JAX's."""
        return (self._scale * row[:, self._which]).T

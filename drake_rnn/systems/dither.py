"""Excitation: what a learning law adds to the joints' motion, to see all of its directions."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from ..inputs.fields import Array, Positive, validated

_BLOCK = 1024


@validated
class DitherSettings:
    """Seeded white noise, held between samples, and where it enters.

    Args:
        model: ``actuated``: the arm moves with it, and what is measured shows it.
            ``virtual``: the arm moves without it, and yet the law is shown ``velocity`` and
            ``v_WE`` as if it did; only a simulation can do that. ``printed``: the law is
            shown ``velocity`` with it and ``v_WE`` without, as the paper prints it.
        sigma: Standard deviation of each joint [rad/s]; cut off at three sigma.
        hold: Time for which a value is held [s].
    """

    model: Literal["actuated", "virtual", "printed"] = "actuated"
    sigma: Positive
    hold: Positive


class Dither(LeafSystem):
    """White noise, normal and cut off at three sigma, a new value each ``hold``.

    Its output ``dither``, shape (n,) [rad/s], is a function of seed and sample number alone:
    every run and every process sees the same values.

    Args:
        size: Number of joints.
        sigma: Standard deviation [rad/s].
        hold: Time for which a value is held [s].
        seed: Of the generator.
    """

    def __init__(self, size: int, sigma: float, hold: float, seed: int = 0) -> None:
        super().__init__()
        settings = DitherSettings(sigma=sigma, hold=hold)
        self._size = size
        self._sigma = settings.sigma
        self._hold = settings.hold
        self._seed = seed
        self._block = (-1, np.zeros((0, size)))
        state = self.DeclareDiscreteState(size)
        self.DeclareStateOutputPort("dither", state)
        self.DeclarePeriodicDiscreteUpdateEvent(self._hold, 0.0, self._update)

    def sample(self, number: int) -> Array:
        """The value of one sample, shape (n,) [rad/s]."""
        block, row = divmod(number, _BLOCK)
        if self._block[0] != block:
            rng = np.random.default_rng([self._seed, 1, block])
            values = np.clip(rng.standard_normal((_BLOCK, self._size)), -3.0, 3.0)
            self._block = (block, self._sigma * values)
        return self._block[1][row]

    def _update(self, context: Context, state: DiscreteValues) -> None:
        state.set_value(self.sample(round(context.get_time() / self._hold)))

"""Normal white noise as a function of seed and sample number."""

from __future__ import annotations

import numpy as np

from ..errors import InvalidInputError
from ..inputs.complaints import short
from ..inputs.fields import Array

#: Number of samples that are drawn together.
BLOCK = 1024


class WhiteNoise:
    """Independent standard normal values that depend on seed and sample number alone.

    Every run and every process gets the same values, in whichever order samples are requested.

    Args:
        size: Number of values of each sample.
        seed: Seed of an experiment.
        stream: Number of this noise; noises of one experiment have different numbers.
        clip: Largest magnitude of a value; infinite for no bound.

    Raises:
        InvalidInputError: If the size or the seed is not a valid number.
    """

    def __init__(self, size: int, seed: int, stream: int, clip: float = np.inf) -> None:
        if not isinstance(size, (int, np.integer)) or size < 1:
            raise InvalidInputError(
                f"size: must be a whole number of at least 1, not {short(size)}"
            )
        require_seed(seed)
        self._size = size
        self._key = (seed, stream)
        self._clip = clip
        # Memo of a pure function: samples are asked for one after the other.
        self._block = (-1, np.zeros((0, size)))

    def sample(self, number: int) -> Array:
        """Return the values of one sample, shape (size,)."""
        block, row = divmod(number, BLOCK)
        if self._block[0] != block:
            self._block = (block, self.block(block))
        return self._block[1][row]

    def block(self, number: int) -> Array:
        """Return the values of `BLOCK` samples, of which that block is the ``number``-th.

        Args:
            number: Number of the block, from 0.

        Returns:
            Shape (BLOCK, size).
        """
        rng = np.random.default_rng([*self._key, number])
        values = rng.standard_normal((BLOCK, self._size))
        return np.clip(values, -self._clip, self._clip)


def require_seed(seed: object) -> None:
    """Raise an InvalidInputError unless a seed is a whole number of at least 0."""
    if not isinstance(seed, (int, np.integer)) or isinstance(seed, bool) or seed < 0:
        raise InvalidInputError(f"seed: must be a whole number of at least 0, not {short(seed)}")

r"""A noise that is added to the rate of a network's error, as papers on noise tolerance do.

=============  =================================================================
kind           noise of each entry at the time t
=============  =================================================================
``constant``   size
``ramp``       size t
``sine``       size sin(2 pi t), one turn a second
``random``     uniform in [-size, size], another number at each sample
=============  =================================================================

The random numbers are those of a multiplicative congruential generator,
:math:`s \leftarrow 26590841\, s \bmod (2^{26} - 5)`, one for each entry, which the experiment's
seed begins: its integers are exact in floating-point numbers, so that they are the same in any
array and on any machine (L'Ecuyer, "Tables of linear congruential generators of different sizes and
good lattice structure", Mathematics of Computation 68 (1999); tests hold its full period).
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np

from ...arrays.algebra import functions_of
from ...inputs.fields import Array, GainOrZero, validated
from ...inputs.keys import Meaning

#: Modulus and multiplier of the generator.
MODULUS, MULTIPLIER = 67108859.0, 26590841.0


@validated
class NetworkNoise:
    """A noise in the equations of a network."""

    kind: Annotated[
        Literal["constant", "ramp", "sine", "random"],
        Meaning("How it varies in time: ``constant``, ``ramp``, ``sine`` or ``random``."),
    ] = "constant"
    size: Annotated[
        GainOrZero,
        Meaning(
            "Its size; of a ramp that after a second. In units of the network's error a second: "
            "rad/s^2 in the rows of the joints, m/s^2 in those of the task.",
        ),
    ] = 1.0

    def start(self, rng: np.random.Generator, count: int) -> Array:
        """Return the generators' initial numbers, shape (count,).

        Args:
            rng: Random generator with the experiment's seed.
            count: Number of entries.
        """
        return rng.integers(1, int(MODULUS), count).astype(float)

    def after(self, numbers: Array, t: Any) -> tuple[Array, Array]:
        """Return the noise at a time [s] and the generators' next numbers, shape (..., k) each.

        Args:
            numbers: The generators' numbers, shape (..., k).
            t: The time [s].
        """
        if self.kind == "random":
            after = functions_of(numbers).fmod(MULTIPLIER * numbers, MODULUS)
            return self.size * (2.0 * after / MODULUS - 1.0), after
        course = {"constant": 1.0, "ramp": t}
        share = course[self.kind] if self.kind in course else functions_of(t).sin(2.0 * np.pi * t)
        return self.size * share + 0.0 * numbers, numbers

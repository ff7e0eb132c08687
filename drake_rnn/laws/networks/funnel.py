r"""A funnel that the task's residual should stay in: prescribed performance.

.. math::
    |\epsilon_i| < \rho(t), \qquad \rho = \rho_0 e^{-\delta t} + \rho_\infty, \qquad
    \chi = \ln \frac{\rho + \epsilon}{\rho - \epsilon} .

chi is infinite at the wall. A sampled residual may step past it, where no logarithm is: from a
share of 0.99 on chi goes on along its tangent, so that the network comes back from there too.
"""

from __future__ import annotations

from typing import Annotated, Any

from ...arrays.algebra import functions_of
from ...inputs.fields import Array, GainOrZero, Positive, validated
from ...inputs.keys import Meaning

# Share of the funnel from which on chi goes on along its tangent.
_TANGENT = 0.99


@validated
class Funnel:
    """The funnel; its numbers are velocities, of each row of the task."""

    start: Annotated[
        GainOrZero,
        Meaning(
            "Width rho_0 that it loses, its half width at the start being ``start + end`` [m/s, "
            "rad/s].",
        ),
    ] = 2.0
    end: Annotated[
        Positive,
        Meaning("Half width rho_inf that is left in the end [m/s, rad/s]."),
    ] = 0.005
    decay: Annotated[GainOrZero, Meaning("Rate delta of its decay.", unit="1/s")] = 100.0

    def width(self, t: Any) -> tuple[Any, Any]:
        """Return the half width rho and its rate at a time [s]."""
        left = self.start * functions_of(t, self.decay).exp(-self.decay * t)
        return left + self.end, -self.decay * left

    def barrier(self, residual: Array, t: Any) -> tuple[Array, Array, Array]:
        """Return chi, its slope by the residual and its rate as the funnel narrows.

        Args:
            residual: Residual of the task, shape (..., m).
            t: The time [s].
        """
        width, narrowing = self.width(t)
        share = residual / width
        xp = functions_of(residual)
        inner = xp.clip(share, -_TANGENT, _TANGENT)
        steepness = 2.0 / (1.0 - inner * inner)
        chi = xp.log((1.0 + inner) / (1.0 - inner)) + steepness * (share - inner)
        slope = steepness / width
        return chi, slope, -slope * share * narrowing

    def used(self, residual: Array, t: Any) -> Array:
        """Return the largest share of the funnel that a residual takes, shape (..., 1)."""
        return functions_of(residual).abs(residual).max(axis=-1, keepdims=True) / self.width(t)[0]

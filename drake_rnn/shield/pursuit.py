r"""How a shield goes along a way of joint positions, and returns to it.

At each sample it wants the velocity of the way a ``lookahead`` T later, which takes away the lag of
a controller that waits for each target, and besides the speed w(e) at which a joint that is off the
way by e returns to it:

.. math::
    w(e) = \frac{2 e}{T + \sqrt{T^2 + 2 e / A}}

That is the speed from which it can stop in e if it decelerates with A after the time T, for which
e / T stands where it is near. No joint wants to be faster than it could stop so before it passes
all that its source has asked for from now on.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..arrays.algebra import AnyArray, functions_of
from ..inputs.fields import Array
from ..laws.law import Layout, SampledReading, Signals


@dataclass(frozen=True, eq=False)
class Pursuit(SampledReading):
    """The velocity that a shield wants on its way, as a law, so that it is compiled as laws are.

    Its inputs: ``position`` of the joints, shape (n,) [rad]; ``way``, the targets before and after
    now, the lookahead and a period later, shape (3, 2, n); ``share``, how far each of these times
    is between its two targets, 0 to 1; ``lower`` and ``upper``, the least and the largest of the
    targets that are left, shape (n,) each.

    Attributes:
        lookahead: T [s].
        period: Time between two commands [s].
        deceleration: A, shape (n,) [rad/s^2]; infinite if it is not bounded.
    """

    lookahead: float
    period: float
    deceleration: Array

    takes_many = True

    @property
    def state(self) -> Layout:
        """The velocity that is wanted."""
        return Layout(v=self.deceleration.shape)

    @property
    def inputs(self) -> Layout:
        """See above."""
        (n,) = self.deceleration.shape
        return Layout(position=(n,), way=(3, 2, n), share=(3,), lower=(n,), upper=(n,))

    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        """Return the velocity that is wanted, shape (..., n) [rad/s]; see `SampledReading.step`."""
        q, T = u["position"], self.lookahead
        xp, share = functions_of(q), u["share"][..., None]
        way = (1.0 - share) * u["way"][..., 0, :] + share * u["way"][..., 1, :]
        here, begin, end = way[..., 0, :], way[..., 1, :], way[..., 2, :]
        v_way = (end - begin) / self.period
        # Off the way; and what of all that is asked for is left, of what is not passed already.
        off = xp.stack(
            (
                begin - T * v_way - q,
                xp.minimum(xp.minimum(u["lower"], here) - q, 0.0),
                xp.maximum(xp.maximum(u["upper"], here) - q, 0.0),
            ),
            axis=-2,
        )
        stopping = T + xp.sqrt(T**2 + 2.0 * xp.abs(off) / self.deceleration)
        back: AnyArray = 2.0 * off / stopping
        v = xp.minimum(xp.maximum(v_way + back[..., 0, :], back[..., 1, :]), back[..., 2, :])
        return v

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

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..arrays.algebra import AnyArray, clip, functions_of
from ..inputs.fields import Array
from ..laws.guard import StepInPlace
from ..laws.law import Layout, SampledReading, Signals
from .chunks import Chunk, ChunkPath


@dataclass(frozen=True, eq=False)
class Pursuit(SampledReading):
    """The velocity that a shield wants on its way, as a law, so that it is compiled as laws are.

    Its inputs: ``position`` of the joints, shape (n,) [rad]; ``times``, now, the lookahead and a
    period later, shape (3,) [s]; ``way``, the targets before and after each, shape (3, 2, n);
    ``begin`` and ``length``, when the first of these two is and how much later the other, shape
    (3,) each [s]; ``lower`` and ``upper``, the least and the largest of the targets that are left,
    shape (n,) each. Its state is what it returns: the velocity that is wanted, and the ``target``
    that leads there in the lookahead.

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
        """See above."""
        return Layout(v=self.deceleration.shape, target=self.deceleration.shape)

    @property
    def inputs(self) -> Layout:
        """See above."""
        (n,) = self.deceleration.shape
        times = {"times": (3,), "begin": (3,), "length": (3,)}
        return Layout(position=(n,), way=(3, 2, n), **times, lower=(n,), upper=(n,))

    def step(self, t: float, x: Array, u: Signals, period: float) -> Array:
        """Return the state, shape (..., 2 n); see `SampledReading.step`."""
        q, T = u["position"], self.lookahead
        xp, share = functions_of(q), clip((u["times"] - u["begin"]) / u["length"], 0.0, 1.0)
        share = share[..., None]
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
        return xp.concatenate((v, q + T * v), axis=-1)


# Times that are nearer to those at which another piece of a way begins may be on that [s].
_NEAR = 1e-6


class WayPursuit:
    """The pursuit of a way, whose pieces are looked for only where others are reached.

    Args:
        law: The law.
        bind: Returns what makes its steps.

    Attributes:
        wanted: The velocity that was wanted last, shape (n,) [rad/s]; each step overwrites it.
        target: The positions that lead there, shape (n,) [rad]; likewise.
    """

    def __init__(self, law: Pursuit, bind: Callable[[SampledReading, float], StepInPlace]) -> None:
        self._law, step = law, bind(law, law.period)
        self._make, self._u = step.make, step.u
        self._q, self._times = step.u["position"], step.u["times"]
        parts = law.state.by_name(step.x)
        self.wanted, self.target = parts["v"], parts["target"]
        # The way, how fast it went on, and from when until when its pieces are those of the step.
        self._path: Chunk | None = None
        self._rate, self._span = 0.0, (np.inf, -np.inf)

    def step(self, way: ChunkPath, now: float, q: Array, rate: float = 1.0) -> None:
        """Work out what is wanted.

        Args:
            way: The way; there must be a chunk.
            now: Time [s].
            q: Where the joints are, shape (n,) [rad].
            rate: How fast the way goes on, 0 to 1.
        """
        law, times = self._law, self._times
        ahead = now + rate * law.lookahead
        after = ahead + rate * law.period
        first, last = self._span
        if not first < now < last or rate != self._rate or way.path is not self._path:
            self._look(way, (now, ahead, after))
            self._rate = rate
        times[0], times[1], times[2] = now, ahead, after
        self._q[...] = q
        self._make()

    def _look(self, way: ChunkPath, times: tuple[float, float, float]) -> None:
        """Look for the pieces of the way at times [s]."""
        u, now, spans = self._u, times[0], []
        for k, t in enumerate(times):
            u["way"][k], u["begin"][k], u["length"][k], span = way.piece(t)
            spans.append((span[0] - (t - now), span[1] - (t - now)))
        u["lower"][...], u["upper"][...], span = way.range_after(now)
        firsts, lasts = zip(*spans, span, strict=True)
        self._path, self._span = way.path, (max(firsts) + _NEAR, min(lasts) - _NEAR)

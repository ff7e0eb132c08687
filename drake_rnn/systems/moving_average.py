r"""Bounds up to the fifth order for whatever a law commands: a chain of moving averages.

With bounds b_1 .. b_m on velocity, acceleration, ... the command u goes through

.. math::
    y_0 = \min(\max(u, -b_1), b_1), \qquad
    y_j(t) = \frac{1}{\tau_j} \int_{t - \tau_j}^t y_{j-1}, \qquad \tau_j = 2 b_j / b_{j+1}.

From rest, with derivatives in brackets,

.. math::
    |y_j^{(j)}(t)| = |y_{j-1}^{(j-1)}(t) - y_{j-1}^{(j-1)}(t - \tau_j)| / \tau_j
    \le 2 b_j / \tau_j = b_{j+1},

and a mean is never larger than what it is taken of: whatever u is, the last y keeps all bounds.
Samples and differences in place of signals and derivatives change no word of this, nor do windows
longer than tau_j. The price is a delay, half the sum of the windows. Positions are not bounded.

Rounding: what is averaged is first put on a lattice so coarse that no sum over a window is ever
rounded, 2^-53 of the largest sum. Running sums thus stay exact however long the run; and what the
lattice adds to differences of the output is no more than the rounding of the output itself does.
"""

from __future__ import annotations

from math import isfinite
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from ..errors import InvalidInputError, SimulationError
from ..inputs.fields import validated
from ..laws.law import Layout
from ..robot.limits import DERIVATIVE_UNITS, JointLimits

# More would take longer than the run.
_MOST_SAMPLES = 1e6
# By how much of a sample a window may fall short of its time: rounding of quotients.
_SLACK = 1e-9


@validated
class FilterSettings:
    """What stands between law and arm, with the bounds of the experiment's ``limits``.

    Args:
        precompensate: Undo what the means take from a smooth command, to second order; only
            with ``feedback: unfiltered``, as it amplifies noise.
        delay_desired: Whether the law sees ``p_WE_desired`` as late as the filter makes the
            arm, its other signals as ever; only with ``feedback: commanded``.
    """

    kind: Literal["moving_average"] = "moving_average"
    precompensate: bool = False
    delay_desired: bool = False


def averaging_windows(limits: JointLimits, period: float) -> NDArray[np.intp]:
    """Lengths of the windows in samples of ``period`` [s], shape (levels, n).

    As many levels as there are bounds above that of the velocity. All joints are given the same
    delay, by wider first windows: with different ones the end effector would leave its path.

    Raises:
        InvalidInputError: Naming the bound that is missing.
    """
    names = list(DERIVATIVE_UNITS)
    known = [name for name in names if limits.bounds[name] is not None]
    chain = names[: max(2, 1 + names.index(known[-1]))]
    bounds = np.array([limits.require(name, "filter: moving_average") for name in chain])
    for level, name in enumerate(chain[:-1]):
        loose = ~np.isfinite(bounds[level])
        if level > 0:
            loose &= np.isfinite(bounds[level + 1 :]).any(axis=0)
        if loose.any():
            raise InvalidInputError(
                f"limits.{name}: must be finite for filter: moving_average, "
                f"not {bounds[level].tolist()}"
            )
    with np.errstate(invalid="ignore"):
        samples = np.ceil(2.0 * bounds[:-1] / (bounds[1:] * period) - _SLACK)
    longest = np.nan_to_num(samples, nan=1.0).sum(axis=0).max()
    if longest > _MOST_SAMPLES:
        raise InvalidInputError(
            f"filter: its windows may hold {_MOST_SAMPLES:g} samples, not {longest:.3g} of "
            f"{period:g} s; take a longer period"
        )
    # Above a joint's last bound there is nothing to hold: inf / inf.
    windows = np.maximum(1, np.nan_to_num(samples, nan=1.0)).astype(np.intp)
    late = windows.sum(axis=0)
    windows[0] += late.max() - late
    return windows


def averaging_delay(windows: NDArray[np.intp], period: float) -> float:
    """How much later than commanded the filtered velocity is [s]: half the windows, and a tick."""
    return period * (1.0 + float((windows - 1).sum(axis=0).max()) / 2.0)


class MovingAverage(LeafSystem):
    """The chain of moving averages, one window a joint and level; it starts at rest.

    The input ``commanded_velocity`` and the output ``filtered_velocity`` have shape (n,) [rad/s].
    The output is held between samples. It and its differences over the period, up to those of the
    highest order that is bounded, keep the bounds whatever the input is, but for the rounding of
    the output itself: 2^-53 of it, over the period to the power of the order.

    Args:
        limits: The bounds of velocity, acceleration and as many more as there are.
        period: Between two samples [s].
        precompensate: Feed u - u'' sum(tau_j^2) / 24, of which the means make u again but for
            terms of fourth order; u'' from differences of the input.

    Raises:
        InvalidInputError: If a bound that is needed is missing or infinite.
        SimulationError: While simulating, if the input is not a number.
    """

    def __init__(self, limits: JointLimits, period: float, *, precompensate: bool = False) -> None:
        super().__init__()
        if not (period > 0 and isfinite(period)):
            raise InvalidInputError(f"period: must be positive, not {period}")
        windows = averaging_windows(limits, period)
        levels, n = windows.shape
        self.period = period
        self.windows = windows
        self.delay = averaging_delay(windows, period)
        gain = (windows.astype(float) ** 2 - 1.0).sum(axis=0) / 24.0
        self._gain = gain if precompensate else None

        # Sums of fewer than 2^53 steps of a lattice are exact. Adding and taking away 1.5 2^52
        # steps rounds to it, if there is room for the number beside them.
        _, exponent = np.frexp(np.maximum(windows, 4) * limits.velocity)
        coarsest = np.ldexp(1.0, exponent.max(axis=0) - 53)
        self._most = np.floor(limits.velocity / coarsest) * coarsest
        self._least = -self._most

        # Behind the count, the last two inputs and the sums lie the windows, joint by joint;
        # a joint's oldest entry gives way to its newest.
        self._layout = Layout(
            count=(1,), previous=(2, n), sums=(levels, n), entries=(int(windows.sum()),)
        )
        first = self._layout.parts["entries"][0].start
        ends = np.cumsum(windows.ravel()).reshape(windows.shape)
        self._starts = first + ends - windows
        self._rounding = list(np.ldexp(1.5, exponent - 1))
        self._lengths = list(windows.astype(float))

        input_port = self.DeclareVectorInputPort("commanded_velocity", n)
        self._read = input_port.Eval
        self.DeclareDiscreteState(self._layout.size)
        last = self._layout.parts["sums"][0]
        at = slice(last.stop - n, last.stop)
        length = self._lengths[-1]

        def filtered_velocity(context: Context, output: Any) -> None:
            output.set_value(context.get_discrete_state_vector().value()[at] / length)

        self.DeclareVectorOutputPort("filtered_velocity", n, filtered_velocity, {self.xd_ticket()})
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def _update(self, context: Context, state: DiscreteValues) -> None:
        x = state.get_mutable_vector(0).get_mutable_value()
        count, previous, sums, _ = self._layout.split(x)
        u = self._read(context)
        if self._gain is not None:
            before, last = previous
            compensated = u - self._gain * (u - 2.0 * last + before)
            before[:] = last
            last[:] = u
            u = compensated
        y = np.minimum(np.maximum(u, self._least), self._most)
        if not isfinite(sum(y.tolist())):
            raise SimulationError(
                f"{self.get_name()}: commanded_velocity is {u.tolist()}", context.get_time()
            )
        places = self._starts + int(count[0]) % self.windows
        levels = zip(places, sums, self._rounding, self._lengths, strict=True)
        for place, total, rounding, length in levels:
            y = (y + rounding) - rounding
            total += y - x[place]
            x[place] = y
            y = total / length
        count += 1.0

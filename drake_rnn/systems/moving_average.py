r"""A chain of moving averages that bounds any command up to the fifth derivative of position.

With bounds b_1 .. b_m on velocity, acceleration, ... the command u is filtered by

.. math::
    y_0 = \min(\max(u, -b_1), b_1), \qquad
    y_j(t) = \frac{1}{\tau_j} \int_{t - \tau_j}^t y_{j-1}, \qquad \tau_j = 2 b_j / b_{j+1}.

From rest, with the order of derivatives in parentheses,

.. math::
    |y_j^{(j)}(t)| = |y_{j-1}^{(j-1)}(t) - y_{j-1}^{(j-1)}(t - \tau_j)| / \tau_j
    \le 2 b_j / \tau_j = b_{j+1},

and a mean never exceeds the largest value that it averages, so for any u the last y keeps all
bounds. The same holds for samples and differences instead of signals and derivatives, and for
windows longer than tau_j. The price is a delay of half the sum of the windows. Positions are not
bounded.

If the law's own command keeps the bounds up to b_k, the first k - 1 windows are not needed, because
every mean keeps the bounds that its input keeps.

Rounding: values are first rounded to a lattice with a step of 2^-53 of the largest sum, so that no
sum over a window is ever rounded. Running sums thus stay exact in a run of any length, and the
lattice adds no more error to differences of the output than the rounding of the output itself.
"""

from __future__ import annotations

from math import isfinite
from typing import Annotated, Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context, DiscreteValues

from ..errors import InvalidInputError, SimulationError
from ..inputs.arguments import checked, choice, flag, instance, number
from ..inputs.fields import Flag, validated
from ..inputs.keys import Meaning
from ..robot.limits import DERIVATIVE_UNITS, JointLimits
from .averages import Averages
from .block import Block

# Filling longer windows would take longer than any run.
_MOST_SAMPLES = 1e6
# Share of a sample by which a window may be too short, because quotients are rounded.
_SLACK = 1e-9


#: Limits that a law may keep before the filter.
Kept = Literal["velocity", "acceleration", "jerk"]


@validated
class FilterSettings:
    """Filter between law and arm, with the bounds of the experiment's ``limits``."""

    kind: Annotated[Literal["moving_average"], Meaning("Kind of filter.")] = "moving_average"
    precompensate: Annotated[
        Flag,
        Meaning(
            "Whether to compensate, to second order, the attenuation of a smooth command by the "
            "means; only with ``feedback: unfiltered``, because it amplifies noise.",
        ),
    ] = False
    delay_desired: Annotated[
        Flag,
        Meaning(
            "Whether the law sees ``p_WE_desired``, and no other signal, delayed by the filter's "
            "delay; only with ``feedback: commanded``.",
        ),
    ] = False
    above: Annotated[
        Kept,
        Meaning("Highest limit that the law's own command keeps: windows bound what is above it."),
    ] = "velocity"

    def __post_init__(self) -> None:
        if self.precompensate and self.above != "velocity":
            raise ValueError(
                f"above: only without precompensate, after which the command keeps no "
                f"{self.above}, not {self.above}"
            )


def averaged_limits(limits: JointLimits) -> tuple[str, ...]:
    """Return the names of the limits that a chain keeps, from velocity to the highest known."""
    names = tuple(DERIVATIVE_UNITS)
    known = [name for name in names if limits.bounds[name] is not None]
    return names[: max(2, 1 + names.index(known[-1]))]


def averaging_windows(
    limits: JointLimits, period: float, above: Kept = "velocity"
) -> NDArray[np.intp]:
    """Return the lengths of the windows in samples of ``period`` [s], shape (levels, n).

    There is one level per bound above the velocity's, or above the highest bound that the command
    keeps. Longer first windows give all joints the same delay; with different delays the end
    effector would leave its path.

    Args:
        limits: The bounds.
        period: Sampling period [s].
        above: Highest limit that the command keeps.

    Raises:
        InvalidInputError: If a bound is missing or not finite, none is above what the command
            keeps, or the windows are too long.
    """
    chain = averaged_limits(limits)
    chain = chain[chain.index(above) :] if above in chain else ()
    if len(chain) < 2:
        raise InvalidInputError(
            f"filter.above: {above} is the highest limit that is known, so there is nothing to "
            "filter; give a higher one, or leave the filter out"
        )
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
            f"filter: its windows may hold at most {_MOST_SAMPLES:g} samples, not {longest:.3g} "
            f"of {period:g} s; give a longer period"
        )
    # Above a joint's last bound the quotient is inf / inf, and nothing is averaged.
    windows = np.maximum(1, np.nan_to_num(samples, nan=1.0)).astype(np.intp)
    late = windows.sum(axis=0)
    windows[0] += late.max() - late
    return windows


def averaging_delay(windows: NDArray[np.intp], period: float) -> float:
    """Return the delay of the filtered velocity [s]: half the windows plus one sample."""
    return period * (1.0 + float((windows - 1).sum(axis=0).max()) / 2.0)


class MovingAverage(Block):
    """Chain of moving averages with one window per joint and level, initially at rest.

    The input ``commanded_velocity`` and the output ``filtered_velocity`` have shape (n,) [rad/s].
    The output is held between samples. For any input, the output and its differences over the
    period, up to the highest bounded order, keep the bounds, except for the rounding of the output
    itself: 2^-53 of it, divided by the period to the power of the order.

    Args:
        limits: Bounds on velocity, acceleration and, if given, higher derivatives.
        period: Sampling period [s].
        precompensate: Whether to filter u - u'' sum(tau_j^2) / 24 instead of the input u. The means
            turn this into u again up to terms of fourth order; u'' is a difference of the input.
        above: Highest limit that the input keeps.

    Raises:
        InvalidInputError: If a necessary bound is missing or infinite.
        SimulationError: During a simulation, if the input is not finite.
    """

    @checked(
        limits=instance(JointLimits),
        period=number(above=0.0),
        precompensate=flag,
        above=choice(get_args(Kept)),
    )
    def __init__(
        self,
        limits: JointLimits,
        period: float,
        *,
        precompensate: bool = False,
        above: Kept = "velocity",
    ) -> None:
        super().__init__()
        windows = averaging_windows(limits, period, above)
        n = windows.shape[1]
        self.period = period
        self.windows = windows
        self.delay = averaging_delay(windows, period)
        velocity = limits.require("velocity", "filter: moving_average")
        self._averages = Averages(windows, velocity, precompensate=precompensate)

        input_port = self.DeclareVectorInputPort("commanded_velocity", n)
        self._read = input_port.Eval
        self.DeclareDiscreteState(*self._averages.shape)
        mean = self._averages.mean

        def filtered_velocity(context: Context, output: Any) -> None:
            output.set_value(mean(context.get_discrete_state_vector().value()))

        self.DeclareVectorOutputPort("filtered_velocity", n, filtered_velocity, {self.xd_ticket()})
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def _update(self, context: Context, state: DiscreteValues) -> None:
        x = state.get_mutable_vector(0).get_mutable_value()
        u = self._read(context)
        added = self._averages.add(x, u)
        if not isfinite(sum(added.tolist())):
            raise SimulationError(
                f"{self.get_name()}: commanded_velocity is {u.tolist()}", context.get_time()
            )

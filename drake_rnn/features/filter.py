r"""The filter behind a law: moving averages that bound any command up to the fifth derivative.

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

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Annotated, Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context, DiscreteValues, System

from ..errors import InvalidInputError, SimulationError
from ..inputs.fields import (
    Array,
    Flag,
    checked,
    choice,
    flag,
    instance,
    number,
    validated,
)
from ..inputs.keys import Meaning
from ..laws import Law
from ..laws.law import Layout
from ..robot.limits import DERIVATIVE_UNITS, JointLimits
from ..signals import DESIRED_ORIENTATION, DESIRED_POSITION
from ..systems.block import Block
from ..systems.controllers import Controller
from ..systems.sources import PathSource
from .feature import Feature, Guarantee, JointVelocity, LoopBuild, LoopPart

# Filling longer windows would take longer than any run.
_MOST_SAMPLES = 1e6
# Share of a sample by which a window may be too short, because quotients are rounded.
_SLACK = 1e-9


#: Limits that a law may keep before the filter.
LimitName = Literal["velocity", "acceleration", "jerk"]


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
        LimitName,
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
    names_in_use = [name for name in names if limits.bounds[name] is not None]
    return names[: max(2, 1 + names.index(names_in_use[-1]))]


def averaging_windows(
    limits: JointLimits, period: float, above: LimitName = "velocity"
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
    limits.require_one_bound("filter: moving_average")
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


class Averages:
    """Moving averages of joint velocities, one window per joint and level, at rest at first.

    The windows of robots that stand side by side are the same; their bounds may differ. See
    the top of this file for what is computed, and how it is rounded.

    Args:
        windows: Lengths of the windows in samples, shape (levels, n).
        velocity: Bounds of the velocities, shape (n,), or (n, robots) [rad/s].
        precompensate: Whether to amplify beforehand what the means attenuate.

    Attributes:
        shape: Shape of the state, (size,), or (size, robots).
    """

    def __init__(self, windows: NDArray[np.intp], velocity: Array, *, precompensate: bool) -> None:
        levels, n = windows.shape
        lengths = windows.astype(float).reshape(levels, n, *np.ones(velocity.ndim - 1, int))
        gain = (lengths**2 - 1.0).sum(axis=0) / 24.0
        self._windows = windows
        self._gain = gain if precompensate else None

        # Sums of fewer than 2^53 lattice steps are exact. Adding and subtracting 1.5 * 2^52 steps
        # rounds a number to the lattice, if it is small enough beside them.
        _, exponent = np.frexp(np.maximum(lengths, 4.0) * velocity)
        coarsest = np.ldexp(1.0, exponent.max(axis=0) - 53)
        self._most = np.floor(velocity / coarsest) * coarsest
        self._least = -self._most
        self._rounding = list(np.ldexp(1.5, exponent - 1))
        self._lengths = list(lengths)

        # The state: the number of samples, the two velocities before, the sums, and all windows one
        # after another; in each of them the newest value overwrites the oldest.
        first = 1 + 2 * n + levels * n
        self.shape = (first + int(windows.sum()), *velocity.shape[1:])
        self._previous, self._sums = slice(1, 1 + 2 * n), slice(1 + 2 * n, first)
        self._last = slice(first - n, first)
        ends = np.cumsum(windows.ravel()).reshape(windows.shape)
        self._starts = first + ends - windows

    def mean(self, x: Array) -> Array:
        """Return the last means, shape (n,) or (n, robots) [rad/s]."""
        mean: Array = x[self._last] / self._lengths[-1]
        return mean

    def add(self, x: Array, u: Array) -> Array:
        """Add velocities, shape (n,) or (n, robots) [rad/s], to a state, in place.

        Returns:
            The velocities that are averaged, which lie within their bounds.
        """
        n = len(u)
        if self._gain is not None:
            before, last = x[self._previous].reshape(2, n, *u.shape[1:])
            command = u - self._gain * (u - 2.0 * last + before)
            before[:] = last
            last[:] = u
            u = command
        clipped_command: Any = np.minimum(np.maximum(u, self._least), self._most)
        y, sums = clipped_command, x[self._sums].reshape(-1, n, *u.shape[1:])
        places = self._starts + int(x.item(0)) % self._windows
        levels = zip(places, sums, self._rounding, self._lengths, strict=True)
        for place, total, rounding, length in levels:
            y = (y + rounding) - rounding
            total += y - x[place]
            x[place] = y
            y = total / length
        x[0] += 1.0
        return clipped_command


class MovingAverage(Block, LoopPart):
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

    role = "command"

    @checked(
        limits=instance(JointLimits),
        period=number(above=0.0),
        precompensate=flag,
        above=choice(get_args(LimitName)),
    )
    def __init__(
        self,
        limits: JointLimits,
        period: float,
        *,
        precompensate: bool = False,
        above: LimitName = "velocity",
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

    def traits(self) -> Mapping[str, Any]:
        return {"filter": True}

    def check(self, controller: Controller) -> None:
        """Raise an InvalidInputError if the controller has another period."""
        if controller.period is not None and controller.period != self.period:
            raise InvalidInputError(
                f"filter: its period, {self.period:g} s, must be the controller's, "
                f"{controller.period:g} s"
            )

    def change_command(self, loop: LoopBuild) -> None:
        """Add itself; ahead of it a virtual arm moves, if the law sees one."""
        loop.wiring.add("filter", self)
        if not loop.virtual:
            loop.wiring.connect(loop.velocity.moved, self.get_input_port())
            output = self.get_output_port()
            loop.velocity = JointVelocity(output, output, output)

    def _update(self, context: Context, state: DiscreteValues) -> None:
        x = state.get_mutable_vector(0).get_mutable_value()
        u = self._read(context)
        averages = self._averages.add(x, u)
        if not isfinite(sum(averages.tolist())):
            raise SimulationError(
                f"{self.get_name()}: commanded_velocity is {u.tolist()}", context.get_time()
            )


class FilterDelay(NamedTuple):
    """Delays caused by a filter.

    Attributes:
        path: Delay with which the arm follows the path [s].
        loop: Delay between the law's command and its inputs [s].
    """

    path: float = 0.0
    loop: float = 0.0


def filter_delay(
    settings: FilterSettings | None,
    feedback: str,
    keeps: Sequence[str],
    limits: JointLimits,
    period: float | None,
    duration: float,
) -> FilterDelay:
    """Return the delays that an experiment's filter causes, zero without one.

    Args:
        settings: Settings of the filter; None without one.
        feedback: Arm that the law sees.
        keeps: Names of the limits that the command before the filter keeps.
        limits: Limits of the joints.
        period: Sampling period [s].
        duration: Duration of the run [s].

    Raises:
        InvalidInputError: If the filter relies on a limit that the command does not keep, its
            windows are too long, or its delay is longer than the run.
    """
    if settings is None or period is None:
        return FilterDelay()
    _require_kept(settings.above, keeps)
    delay = averaging_delay(averaging_windows(limits, period, settings.above), period)
    if delay >= duration:
        raise InvalidInputError(
            f"filter: with these limits its delay is {delay:.4g} s; the duration must be longer "
            f"than that, not {duration:g}"
        )
    if feedback == "unfiltered":
        return FilterDelay(path=delay)
    return FilterDelay(path=delay * settings.delay_desired, loop=delay)


def _require_kept(above: LimitName, keeps: Sequence[str]) -> None:
    """Raise an InvalidInputError if a filter relies on a limit that the command does not keep."""
    able = [name for name in get_args(LimitName) if name == "velocity" or name in keeps]
    if above not in able:
        raise InvalidInputError(
            f"filter.above: the command of this law keeps no limit of the {above}; it may "
            f"be {', '.join(able)}"
        )


def delay_doubts(law: Law, kind: str, delay: float, sensing_delay: float) -> list[str]:
    """Return a warning about the delay of a filter in the law's loop.

    Args:
        law: The law.
        kind: Its kind in the document.
        delay: Delay of the filter in the loop [s].
        sensing_delay: Delay of the sensors [s].

    Raises:
        InvalidInputError: If a gain of the law is too high for both delays.
    """
    late = delay + sensing_delay
    if late == 0.0:
        return []
    whose = " and ".join(
        name for name, part in (("filter", delay), ("sensing", sensing_delay)) if part
    )
    remedy = "" if sensing_delay else "; or give feedback: unfiltered"
    for name, gain in law.loop_gains.items():
        if gain * late >= 1.0:
            raise InvalidInputError(
                f"law.{name}: must be below {1.0 / late:.4g} /s with the {whose}'s delay of "
                f"{late:.4g} s in its loop, not {gain:g}{remedy}"
            )
    if law.loop_gains or delay == 0.0:
        return []
    return [
        f"filter: delays the law's loop by {delay:.4g} s; whether {kind} stays stable with this "
        "delay is not known; consider feedback: unfiltered"
    ]


def kept_by_filter(command: Guarantee, limits: JointLimits, *, means: bool) -> Guarantee:
    """Return what an arm keeps behind a filter.

    Its positions are means of those of an unfiltered arm that the law sees, if neither a bound on
    the velocity nor a precompensation changes the command before.

    Args:
        command: What the command before the filter keeps.
        limits: Limits of the joints.
        means: Whether the positions are such means.
    """
    names = averaged_limits(limits)
    within = means and {"position", "velocity"} <= {*command.limits}
    return Guarantee(("position", *names) if within else names)


class FilterFeature(Feature):
    """The section ``filter``."""

    key = "filter"

    def loop_arguments(self, experiment: Any) -> Mapping[str, Any]:
        settings, period = experiment.document.filter, experiment.document.period
        if settings is None or period is None:
            return {}
        precompensate, above = settings.precompensate, settings.above
        return {
            "filter": MovingAverage(
                experiment.limits, period, precompensate=precompensate, above=above
            )
        }

    def signal_sources(
        self, experiment: Any, inputs: Layout
    ) -> Mapping[str, tuple[System, Sequence[str]]]:
        """Return the path with the delay of the filter."""
        document = experiment.document
        if document.filter is None or not document.filter.delay_desired:
            return {}
        if DESIRED_POSITION not in inputs:
            return {}
        delay = experiment.path_delay
        past = PathSource(experiment.desired, task=experiment.law_task, delay=delay)
        used = [name for name in (DESIRED_POSITION, DESIRED_ORIENTATION) if name in inputs]
        return {"delayed_path": (past, used)}

    def doubts(self, experiment: Any) -> list[str]:
        document = experiment.document
        delay_of_sensor = 0.0 if document.sensing is None else document.sensing.delay
        delay = experiment_delay(experiment)
        return delay_doubts(experiment.law, document.law["kind"], delay.loop, delay_of_sensor)

    def guarantee(self, arm: Guarantee, experiment: Any) -> Guarantee:
        settings: FilterSettings | None = experiment.document.filter
        if settings is None:
            return arm
        means = experiment.feedback == "unfiltered" and not settings.precompensate
        return kept_by_filter(arm, experiment.limits, means=means)


def experiment_delay(experiment: Any) -> FilterDelay:
    """Return the delays that the filter of a `drake_rnn.Experiment` causes; see `filter_delay`."""
    document, keeps = experiment.document, experiment.guarantees.command.limits
    times = document.period, document.duration
    return filter_delay(document.filter, experiment.feedback, keeps, experiment.limits, *times)

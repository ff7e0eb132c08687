"""What a metric is: its name, unit and meaning, how it is taken, and where it is shown.

A metric is gathered from its values at steps, which come in parts. A gathering is a function from
what was gathered so far and new values to what is gathered now; the state that it was given is not
used again (the histogram of a median is updated in place). It serves one run, many side by side,
and a run that JAX traces. What is gathered is a tuple of arrays of shape (...): nothing for one
run, or the number of robots.

Extremes, times and medians do not depend on the parts. A mean of several parts does in its last
digits, because sums are rounded in another order.

- Values at the steps of a motion, where they are more than a field of it.
- `Yardsticks`: what the motion of a run is measured against.
- Numbers as they are read: few digits, superscripts, and units with the prefix that suits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any, Literal, Protocol

import numpy as np

from ..arrays.algebra import AnyArray, added_up, functions_of, lengths, root, sum_entries
from ..inputs.fields import Array
from ..robot.limits import DERIVATIVE_UNITS, LIMIT_UNITS, JointLimits
from ..robot.velocity_envelope import VelocityEnvelope
from ..signals import SERIES_UNITS
from .motion import Motion


@dataclass(frozen=True)
class Yardsticks:
    """What motions are measured against; ``...`` is nothing for one run, or the number of robots.

    Attributes:
        limits: Limits of the joints by the names of the fields of `JointLimits`, each of shape
            (..., n); infinite where a joint has none, None where no joint has one.
        window: Start and end of the time in which errors count [s]; None for the whole run.
        settling_tolerance: Position error below which an arm has settled, shape (...) [m].
    """

    limits: Mapping[str, AnyArray | None]
    window: tuple[float, float] | None
    settling_tolerance: AnyArray

    @classmethod
    def of(
        cls, limits: JointLimits, window: tuple[float, float] | None, settling_tolerance: float
    ) -> Yardsticks:
        """Return those of one run.

        Args:
            limits: Limits of the experiment.
            window: Start and end of the window [s]; None for the whole run.
            settling_tolerance: Position error below which the arm has settled [m].
        """
        finite = {name: _finite(bound) for name, bound in limits.bounds.items()}
        return cls(finite, window, settling_tolerance)

    @classmethod
    def side_by_side(cls, each: Sequence[Yardsticks]) -> Yardsticks:
        """Return those of several runs with the same window."""
        first = each[0]
        limits = {name: _stack([one.limits[name] for one in each]) for name in first.limits}
        tolerances = np.array([one.settling_tolerance for one in each])
        return cls(limits, first.window, tolerances)


def _finite(bound: Array | None) -> Array | None:
    return bound if bound is not None and np.isfinite(bound).any() else None


def _stack(bounds: Sequence[Array | None]) -> Array | None:
    """Return bounds of robots, shape (robots, n), which lie side by side in memory."""
    finite = [bound for bound in bounds if bound is not None]
    if not finite:
        return None
    none = np.full_like(finite[0], np.inf)
    return np.stack([none if bound is None else bound for bound in bounds], axis=-1).T


#: Time after the last lock of a joint from which an error counts as lasting [s].
LASTING = 2.0
#: Distance below which a point has settled in an image [px].
NEAR_PX = 0.5
# Sample times carry rounding errors [s].
_ROUNDING = 1e-9
#: Values of a metric at the steps of a motion, shape (k, ...), or of the last k - 1 of them; None
#: if the motion has none.
Values = Callable[[Motion, Yardsticks], AnyArray | None]


def top(vectors: AnyArray) -> AnyArray:
    """Return the largest magnitude of an entry of each vector."""
    return abs(vectors).max(axis=-1)


def mean(vectors: AnyArray) -> AnyArray:
    """Return the mean magnitude of the entries of each vector."""
    return sum_entries(abs(vectors)) / vectors.shape[-1]


def root_of(squares: AnyArray) -> AnyArray:
    """Return the roots of squares, which rounding may have made negative."""
    return root(functions_of(squares).maximum(0.0, squares))


def square(values: AnyArray | None) -> AnyArray | None:
    """Return the squares of values, if there are any."""
    return None if values is None else values**2


def below(values: AnyArray | None, bound: float) -> AnyArray | None:
    """Return whether values, if there are any, are below a bound."""
    return None if values is None else values < bound


def distance(places: AnyArray, others: AnyArray | None) -> AnyArray | None:
    """Return the distances of places from others, if there are any."""
    return None if others is None else lengths(places - others)


def margin(motion: Motion, against: Yardsticks) -> AnyArray | None:
    """Return the smallest distance of a joint to its position limits, if there are any [rad]."""
    lower, upper = (against.limits[f"position_{side}"] for side in ("lower", "upper"))
    gaps = []
    if lower is not None:
        gaps.append((motion.position - lower).min(axis=-1))
    if upper is not None:
        gaps.append((upper - motion.position).min(axis=-1))
    return reduce(functions_of(motion.position).minimum, gaps) if gaps else None


def envelope_margin(motion: Motion, against: Yardsticks) -> AnyArray | None:
    """Return by how much a joint might be faster under its envelope, if there is any [rad/s]."""
    if (bounds := _envelope(motion, against)) is None:
        return None
    (lowest, highest), v = bounds, motion.velocity
    return functions_of(v).minimum(v - lowest, highest - v).min(axis=-1)


def envelope_ratio(motion: Motion, against: Yardsticks) -> AnyArray | None:
    """Return the largest ratio of a velocity to that of its envelope, both with the offset added.

    None without an envelope.
    """
    if (bounds := _envelope(motion, against)) is None:
        return None
    (lowest, highest), v, offset = bounds, motion.velocity, against.limits["envelope_offset"]
    xp = functions_of(v)
    up, down = ((side + offset) / (bound + offset) for side, bound in ((v, highest), (-v, -lowest)))
    return xp.maximum(up, down).max(axis=-1)


def _envelope(motion: Motion, against: Yardsticks) -> tuple[AnyArray, AnyArray] | None:
    """Return the lowest and the highest velocities under the envelope; None without one."""
    limits = against.limits
    offset, deceleration = limits["envelope_offset"], limits["envelope_deceleration"]
    if offset is None or deceleration is None:
        return None
    ends = ("position_lower", -np.inf), ("position_upper", np.inf)
    lower, upper = (none if limits[name] is None else limits[name] for name, none in ends)
    envelope = VelocityEnvelope(offset, deceleration)
    return envelope.velocities(motion.position, (lower, upper))


def returning(motion: Motion, against: Yardsticks) -> AnyArray | None:
    """Return the joint positions of arms on closed paths; NaN for other arms."""
    if motion.target is not None or not np.any(motion.returns):
        return None
    if np.all(motion.returns):
        return motion.position
    xp = functions_of(motion.position)
    return xp.where(motion.returns[:, None], motion.position, np.nan)


def error_before_lock(motion: Motion, against: Yardsticks) -> AnyArray | None:
    """Return the position error until the first joint locks [m]; None if none does."""
    return None if motion.locked is None else _error_within(motion, 0.0, motion.locked[0])


def error_after_lock(motion: Motion, against: Yardsticks) -> AnyArray | None:
    """Return the position error from the last lock of a joint on [m]; None if none locks."""
    return None if motion.locked is None else _error_within(motion, motion.locked[1], np.inf)


def error_lasting(motion: Motion, against: Yardsticks) -> AnyArray | None:
    """Return the position error from `LASTING` after the last lock on [m]; None if none locks."""
    if motion.locked is None:
        return None
    return _error_within(motion, motion.locked[1] + LASTING, np.inf)


def settled_after_lock(motion: Motion, against: Yardsticks) -> AnyArray | None:
    """Return whether all locks are past and the position error is small; None if none locks."""
    if motion.locked is None:
        return None
    small = motion.error_length < against.settling_tolerance
    return (motion.time >= motion.locked[1]) & small


def _error_within(motion: Motion, begin: float, end: float) -> AnyArray:
    """Return the position error in an interval of time [m]; less than any error out of it."""
    within = (motion.time >= begin) & (motion.time <= end)
    return np.where(within, motion.error_length, -np.inf)


def pixel_error(motion: Motion, against: Yardsticks) -> AnyArray | None:
    """Return the largest distance of a point from where it is to be seen [px]."""
    return None if motion.image is None else motion.image.farthest


def pixel_error_before_swap(motion: Motion, against: Yardsticks) -> AnyArray | None:
    """Return the same before the first swap of the camera; None without a swap."""
    if motion.image is None or motion.image.swapped is None:
        return None
    before = motion.time < motion.image.swapped[0] - _ROUNDING
    return np.where(before, motion.image.farthest, -np.inf)


def pixel_error_after_swap(motion: Motion, against: Yardsticks) -> AnyArray | None:
    """Return the same from the last swap of the camera on; None without a swap."""
    if motion.image is None or motion.image.swapped is None:
        return None
    after = motion.time >= motion.image.swapped[1] - _ROUNDING
    return np.where(after, motion.image.farthest, -np.inf)


def seen_close(motion: Motion, against: Yardsticks) -> AnyArray | None:
    """Return whether all points are seen near to where they are to be."""
    return below(pixel_error(motion, against), NEAR_PX)


def seen_close_again(motion: Motion, against: Yardsticks) -> AnyArray | None:
    """Return the same, and that all swaps of the camera are past; None without a swap."""
    if motion.image is None or motion.image.swapped is None:
        return None
    after = motion.time >= motion.image.swapped[1] - _ROUNDING
    return after & (motion.image.farthest < NEAR_PX)


@dataclass(frozen=True)
class LargestObservable:
    """The largest magnitude in an observable of the law.

    Attributes:
        name: Name of the observable.
    """

    name: str

    def __call__(self, motion: Motion, against: Yardsticks) -> AnyArray | None:
        """Return the values; None if the law does not tell it."""
        observable = motion.observed.get(self.name)
        return None if observable is None else top(observable)


#: What is gathered so far.
State = tuple[Any, ...]
#: From what was gathered to the metric.
Finish = Callable[[AnyArray], AnyArray]

# Bins of a histogram: a bin is a factor of 10^(1 / 200), 1.2 % wide, and the first begins at 1e-9.
_PER_DECADE, _LEAST, _BINS = 200, 9, 2400


class Gathering(Protocol):
    """A way to gather a metric.

    Attributes:
        differentiable: Whether JAX can trace it and take its derivative.
        start: What is gathered before the first step.
    """

    differentiable: bool

    @property
    def start(self) -> State: ...

    def add(self, state: State, values: AnyArray, time: AnyArray) -> State:
        """Return what is gathered with further values.

        Args:
            state: What was gathered before.
            values: Values of at least one step, shape (k, ...) or as the gathering says.
            time: Times of the steps, shape (k,) [s].
        """

    def value(self, state: State) -> AnyArray:
        """Return the metric, shape (...); not finite where there is none."""


def _same(value: AnyArray) -> AnyArray:
    return value


def excess(value: AnyArray) -> AnyArray:
    """Return by how much a value is above 0, or 0; NaN where it is not finite."""
    xp = functions_of(value)
    return xp.where(xp.isfinite(value), xp.maximum(0.0, value), np.nan)


def shortfall(value: AnyArray) -> AnyArray:
    """Return by how much a value is below 0, or 0; NaN where it is not finite."""
    return excess(-value)


@dataclass(frozen=True)
class _OfOneNumber:
    """A gathering whose metric follows from one number for each robot."""

    finish: Finish = _same

    def value(self, state: State) -> AnyArray:
        return self.finish(state[0])


@dataclass(frozen=True)
class Largest(_OfOneNumber):
    """The largest of all values."""

    differentiable = True
    start = (-np.inf,)

    def add(self, state: State, values: AnyArray, time: AnyArray) -> State:
        return (functions_of(values).maximum(state[0], values.max(axis=0)),)


@dataclass(frozen=True)
class Smallest(_OfOneNumber):
    """The smallest of all values."""

    differentiable = True
    start = (np.inf,)

    def add(self, state: State, values: AnyArray, time: AnyArray) -> State:
        return (functions_of(values).minimum(state[0], values.min(axis=0)),)


@dataclass(frozen=True)
class Mean:
    """The mean of all values."""

    finish: Finish = _same
    differentiable = True
    start = (0.0, 0.0)

    def add(self, state: State, values: AnyArray, time: AnyArray) -> State:
        # Truth values count as 0 and 1.
        return added_up(state[0], 1.0 * values), state[1] + float(len(values))

    def value(self, state: State) -> AnyArray:
        total, count = state
        some = functions_of(count).where(count > 0.0, count, np.nan)
        return self.finish(total / some)


#: The root of the mean of values that are squares.
RootMean = Mean(root)


@dataclass(frozen=True)
class Share(Mean):
    """The share of the steps at which something is so, of truth values: it has no slope."""

    differentiable = False


@dataclass(frozen=True)
class Last(_OfOneNumber):
    """The value of the last step."""

    differentiable = True
    start = (np.nan,)

    def add(self, state: State, values: AnyArray, time: AnyArray) -> State:
        return (values[-1],)


@dataclass(frozen=True)
class Integral:
    """The integral over time of a value that is held from its step to the next."""

    differentiable = False
    start = (0.0, np.nan, np.nan)

    def add(self, state: State, values: AnyArray, time: AnyArray) -> State:
        total, last, then = state
        if not np.isnan(then):
            total = total + last * (time[0] - then)
        held = np.diff(time).reshape((-1, *(1,) * (values.ndim - 1)))
        return added_up(total, values[:-1] * held), values[-1], time[-1]

    def value(self, state: State) -> AnyArray:
        total, last, _ = state
        return total + 0.0 * last


@dataclass(frozen=True)
class Change:
    """The change from the first step to the last one, of vectors, shape (k, ..., n).

    A single step makes no change.
    """

    finish: Finish
    differentiable = True
    start = (np.nan, np.nan)

    def add(self, state: State, values: AnyArray, time: AnyArray) -> State:
        first, last = state
        xp = functions_of(values)
        begins = xp.isnan(first)
        first = xp.where(begins, values[0], first)
        if len(values) > 1:
            # A copy: the next part may be written to the same place.
            return first, xp.array(values[-1])
        return first, xp.where(begins, last, values[-1])

    def value(self, state: State) -> AnyArray:
        first, last = state
        return self.finish(abs(last - first))


@dataclass(frozen=True)
class FirstTime(_OfOneNumber):
    """The time at which something is first so, of truth values."""

    differentiable = False
    start = (np.nan,)

    def add(self, state: State, values: AnyArray, time: AnyArray) -> State:
        (before,) = state
        so = values != 0
        now = np.where(so.any(axis=0), time[np.argmax(so, axis=0)], np.nan)
        return (np.where(np.isnan(before), now, before),)


@dataclass(frozen=True)
class Settling(_OfOneNumber):
    """The time from which on something stays so, of truth values; none if it is not in the end."""

    differentiable = False
    start = (np.inf,)

    def add(self, state: State, values: AnyArray, time: AnyArray) -> State:
        otherwise = ~values
        # The step after the last at which it was not so.
        after = len(values) - np.argmax(otherwise[::-1], axis=0)
        again = np.where(after < len(values), time[np.minimum(after, len(values) - 1)], np.inf)
        return (np.where(otherwise.any(axis=0), again, np.minimum(state[0], time[0])),)


@dataclass(frozen=True)
class Median:
    """The median of all values that are numbers; NaN does not count.

    The values of one run are kept, 8 bytes each. Those of robots side by side are counted in a
    histogram: their median is found within 0.6 %, from 1e-9 to 1e3.
    """

    differentiable = False
    start: State = ()

    def add(self, state: State, values: AnyArray, time: AnyArray) -> State:
        if values.ndim == 1:
            return (*state, values[~np.isnan(values)])
        often = state[0] if state else np.zeros((values.shape[1], _BINS), dtype=np.int32)
        robots = np.arange(len(often))
        place = np.clip(_PER_DECADE * (np.log10(values) + _LEAST), 0, _BINS - 1)
        for row in place:
            counts = ~np.isnan(row)
            often[robots, np.where(counts, row, 0.0).astype(int)] += counts
        return (often,)

    def value(self, state: State) -> AnyArray:
        if not state:
            return np.float64(np.nan)
        if state[0].ndim == 1:
            values = np.concatenate(state)
            return np.median(values) if values.size else np.float64(np.nan)
        below = np.cumsum(state[0], axis=1)
        count = below[:, -1:]
        # Of an even number of values two are in the middle, perhaps with a gap between them.
        middle = [
            10.0 ** (((below >= place).argmax(axis=1) + 0.5) / _PER_DECADE - _LEAST)
            for place in ((count + 1) // 2, count // 2 + 1)
        ]
        return np.where(count[:, 0] > 0, 0.5 * (middle[0] + middle[1]), np.nan)


#: Steps that a metric is taken over: those of the experiment's window, or those of the whole run.
Over = Literal["window", "run"]

#: Places that show a metric: overviews, by what the run is about, and the table of a sweep.
ReportPart = Literal["path", "posture", "return", "force", "sweep"]


def _ending(unit: str) -> str:
    """Return a unit in the form in which it ends the name of a metric."""
    return "_" + unit.replace("/s^", "_s").replace("/", "_")


# Units by the endings of names, longest first: a name that ends in ``_m_s`` is of no time.
_UNITS = {_ending(unit): unit for unit in ("m", "s", "N", "J", "px", "m/s", *LIMIT_UNITS.values())}
_ENDINGS = sorted(_UNITS, key=len, reverse=True)


@dataclass(frozen=True)
class Metric:
    """A number computed from a run.

    Attributes:
        name: Key in ``metrics.json``; it ends in the unit.
        meaning: Description for the documentation.
        over: Steps it is taken over.
        shown: Places that show it in addition to the metrics in the experiment's ``accept``.
        of: Function that gives the values at the steps of a motion; None if a `Group` takes the
            metric, or if no motion shows it.
        by: How the metric is gathered from these values.
        unit_if_unnamed: SI unit if the name does not end in one; "1" for a pure number.
    """

    name: str
    meaning: str
    over: Over = "run"
    shown: tuple[ReportPart, ...] = ()
    of: Values | None = None
    by: Gathering = Largest()
    unit_if_unnamed: str = "1"

    @property
    def unit(self) -> str:
        """SI unit; "1" for a pure number."""
        units = (_UNITS[ending] for ending in _ENDINGS if self.name.endswith(ending))
        return next(units, self.unit_if_unnamed)

    @property
    def of_law(self) -> bool:
        """Whether the values are observables of the law."""
        return isinstance(self.of, LargestObservable)

    @property
    def differentiable(self) -> bool:
        """Whether a compiled run can take the metric and its derivative."""
        return self.of is not None and self.by.differentiable and not self.of_law

    @property
    def words(self) -> str:
        """The name in words, without the unit."""
        words = self.name.removesuffix(_ending(self.unit)).replace("_", " ")
        for order, derivative in enumerate(DERIVATIVE_UNITS, start=1):
            words = words.replace(f"limit ratio {order}", f"{derivative} / bound")
        return words


def violation_metric(limit: str) -> str:
    """Return the name of the metric of a limit's violation.

    Args:
        limit: A key of `LIMIT_UNITS`.
    """
    return f"{limit}_violation_max{_ending(LIMIT_UNITS[limit])}"


#: Metric of the largest ratio of each derivative to its bound, by the derivative's name.
RATIO_METRICS = {
    name: f"limit_ratio_{order}_max" for order, name in enumerate(DERIVATIVE_UNITS, start=1)
}
#: Units of the series of a run, by name; a series that is not listed has none.
UNITS = SERIES_UNITS
#: Prefixes and the factors to them, the coarsest first.
PREFIXES = (("", 1.0), ("m", 1e3), ("µ", 1e6), ("n", 1e9))
#: Units that take a prefix.
PREFIXED_UNITS = (
    *("m", "rad", "N", "s", "N m", "m/s", "m/s^2"),
    *("rad/s", "rad/s^2", "rad/s^3", "rad/s^4", "rad/s^5"),
)
#: Least number for which a coarser prefix is taken: 0.1, up to rounding.
LEAST = 0.1 * (1 - 1e-9)
_SUPERSCRIPTS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")


def superscript(unit: str) -> str:
    """Return a unit with its powers as superscripts, such as ``rad/s²``."""
    head, *powers = unit.split("^")
    return head + "".join(power[:1].translate(_SUPERSCRIPTS) + power[1:] for power in powers)


def prefix_unit(size: float, unit: str) -> tuple[str, float]:
    """Return a unit as it is written, with the prefix that suits a size, and the factor to it.

    The coarsest prefix is taken that leaves at least 0.1. Units that nobody says with a prefix, and
    sizes that are zero or no numbers, have none.
    """
    unit_text = superscript(unit)
    if unit not in PREFIXED_UNITS or not math.isfinite(size) or size == 0.0:
        return unit_text, 1.0
    suiting = (each for each in PREFIXES if abs(size) * each[1] >= LEAST)
    prefix, factor = next(suiting, PREFIXES[-1])
    return prefix + unit_text, factor


def format_number(number: float) -> str:
    """Return a number as tables have it, with four significant digits."""
    return f"{number:.4g}"


def format_quantity(value: float, unit: str, digits: int = 4) -> str:
    """Return a number and its unit, such as ``0.37 µm``."""
    # Rounded before the prefix is chosen: 0.1 m rather than 1e+02 mm.
    value = float(f"{value:.{digits}g}") + 0.0
    unit_text, factor = ("", 1.0) if unit == "1" else prefix_unit(value, unit)
    return f"{factor * value:.{max(digits, 4)}g} {unit_text}".rstrip()

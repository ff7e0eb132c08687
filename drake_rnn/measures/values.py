"""Values of metrics at the steps of a motion, where they are more than a field of it.

- What the motion of a run is measured against.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np

from ..arrays.algebra import AnyArray, functions_of, lengths, root, sum_entries
from ..inputs.fields import Array
from ..robot.limits import JointLimits
from ..robot.velocity_envelope import VelocityEnvelope
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

"""Groups of metrics, each taken from the parts of a run as they come.

- What a group of metrics is.
- How the derivatives of the joint positions keep their bounds.
- Drift of joints and end effector, and what a law tells of how far it has moved the latter.
- The largest distance of an arm from the command to its motors.
- A gap in the contact of a tool with a surface.
- Derivatives of the joint positions beyond the acceleration.
- The acceleration of a law's own velocity, where that differs from the arm's.

Motion of the joints while the target rests: what goes to and fro, and how fast it is in the end.

A target rests from the last step on at which it moves. The first seconds after that are those in
which an arm may arrive.
"""

from __future__ import annotations

from collections.abc import Callable
from math import ceil
from typing import Protocol

import numpy as np

from ..arrays.algebra import AnyArray, lengths, sum_entries
from ..inputs.fields import Array
from ..robot.limits import DERIVATIVE_UNITS, LOWER
from ..robot.sides import Sides
from .metric import (
    RATIO_METRICS,
    Largest,
    Mean,
    RootMean,
    State,
    Yardsticks,
    excess,
    violation_metric,
)
from .motion import Motion, tick_ends

#: Metrics by name: a number for one run, shape (robots,) for robots side by side. A metric that
#: does not apply, or whose event did not occur, is not finite.
MetricValues = dict[str, AnyArray]


class Group(Protocol):
    """Metrics that must remember more of earlier steps than a `Gathering` does."""

    def add(self, motion: Motion) -> None:
        """Add the next part of the run, of at least one step; its arrays are reused afterwards."""

    def metrics(self) -> MetricValues:
        """Return the metrics of all parts so far, by name."""


#: Share of a bound at which a joint is said to be at it: laws approach their bounds smoothly.
AT_BOUND = 0.99


class Bound:
    """The ratio of a derivative to its bound, and the excess over it.

    Args:
        name: Name of the derivative.
        against: Bounds of each joint.
    """

    def __init__(self, name: str, against: Yardsticks) -> None:
        self._name, self.bound = name, against.limits[name]
        lower = against.limits[LOWER[name]] if name in LOWER else None
        self._sides = None if lower is None else Sides(-lower, self.bound)
        self._ratio: State = Largest.start
        self._excess: State = Largest.start

    def toward(self, values: Callable[[], AnyArray]) -> AnyArray | None:
        """Return the bounds in the directions of values, shape (k, ..., n); None without."""
        return self.bound if self._sides is None else self._sides.toward(values() > 0.0)

    def add(self, values: AnyArray, time: AnyArray, bound: AnyArray | None) -> None:
        """Add magnitudes, shape (k, ..., n), at times, shape (k,) [s], and their bounds."""
        if bound is not None and len(values):
            self._ratio = Largest().add(self._ratio, (values / bound).max(axis=-1), time)
            self._excess = Largest().add(self._excess, (values - bound).max(axis=-1), time)

    def metrics(self) -> MetricValues:
        """Return the metrics, by name; none without a bound, NaN for robots without one."""
        if self.bound is None:
            return {}
        beyond = excess(Largest().value(self._excess))
        ratio = np.where(np.isnan(beyond), np.nan, Largest().value(self._ratio))
        return {RATIO_METRICS[self._name]: ratio, violation_metric(self._name): beyond}


class BoundMetrics:
    """How velocity and acceleration keep their bounds, and how often some joint is at one.

    Args:
        against: Limits of the joints.
    """

    def __init__(self, against: Yardsticks) -> None:
        self._velocity = _BoundParts("velocity", against)
        self._acceleration = _BoundParts("acceleration", against)

    def add(self, motion: Motion) -> None:
        """Add the next part of the run."""
        fresh = motion.fresh
        v, a = self._velocity, self._acceleration
        v.add(motion.speed[fresh], motion.time[fresh], lambda: motion.velocity[fresh])
        if motion.time.size > 1:
            a.add(motion.acceleration_magnitude, motion.time[1:], lambda: motion.joint_acceleration)

    def metrics(self) -> MetricValues:
        """Return the metrics, by name."""
        return self._velocity.metrics() | self._acceleration.metrics()


class _BoundParts:
    """What there is to say of a bound, and how often some joint is at it."""

    def __init__(self, name: str, against: Yardsticks) -> None:
        self._name = name
        self._beyond = Bound(name, against)
        self._any: State = Mean.start
        self._often: AnyArray = 0

    def add(self, values: AnyArray, time: AnyArray, signed: Callable[[], AnyArray]) -> None:
        bound = self._beyond.toward(signed)
        self._beyond.add(values, time, bound)
        if bound is not None and len(values):
            at = values >= AT_BOUND * bound
            self._any = Mean().add(self._any, at.any(axis=-1).astype(float), time)
            self._often = self._often + at.sum(axis=0)

    def metrics(self) -> MetricValues:
        if not (values := self._beyond.metrics()):
            return {}
        has_bounds = ~np.isnan(values[violation_metric(self._name)])
        is_reached = np.any(self._often, axis=-1)
        often = 1.0 + np.argmax(self._often, axis=-1)
        return values | {
            f"{self._name}_bound_fraction": np.where(has_bounds, Mean().value(self._any), np.nan),
            f"{self._name}_bound_joint": np.where(is_reached, often, np.nan),
        }


class DriftMetrics:
    """How far the arm is from where it was."""

    def __init__(self) -> None:
        # Time at which the last lap begins, and the joints then; NaN until that time.
        self._lap: tuple[AnyArray, AnyArray] | None = None
        self._lap_drift: AnyArray = np.nan
        self._start: AnyArray | None = None
        self._moved: State = Largest.start
        self._moved_in_the_end: AnyArray = np.nan

    def add(self, motion: Motion) -> None:
        """Add the next part of the run."""
        if motion.target is None and motion.lap_start is not None:
            # Joints that move to a target posture do not drift.
            self._add_lap(motion, np.asarray(motion.lap_start))
        if self._start is None:
            self._start = motion.p_WE[0].copy()
        distance = lengths(motion.p_WE - self._start)
        self._moved = Largest().add(self._moved, distance, motion.time)
        self._moved_in_the_end = distance[-1]

    def _add_lap(self, motion: Motion, began: AnyArray) -> None:
        """Take the lap's drift if the run ends here; the lap's start may be in an earlier part."""
        time, q = motion.time, motion.position
        if self._lap is None:
            self._lap = np.full(began.shape, np.nan), np.full(q.shape[1:], np.nan)
        here = (time[0] - 1e-9 <= began) & (began <= time[-1] + 1e-9)
        for start in np.unique(began[here]):
            now = (began == start)[..., None]
            step = int(np.searchsorted(time, start - 1e-9))
            known_start, known_q = self._lap
            self._lap = np.where(now[..., 0], start, known_start), np.where(now, q[step], known_q)
        self._lap_drift = np.nan
        if motion.until is None or time[-1] >= motion.until - 1e-9:
            # A run that is cut short has another last lap, whose start is no longer known.
            same = abs(self._lap[0] - began) < 1e-9
            self._lap_drift = np.where(same, abs(q[-1] - self._lap[1]).max(axis=-1), np.nan)

    def metrics(self) -> MetricValues:
        """Return the metrics, by name."""
        return {
            "lap_drift_max_rad": self._lap_drift,
            "end_effector_drift_max_m": Largest().value(self._moved),
            "end_effector_drift_end_m": self._moved_in_the_end,
        }


class DisplacementMetrics:
    """Differences of the end effector's displacement from that in the law's multipliers."""

    def __init__(self) -> None:
        self._invariant: State = Largest.start
        # End effector and displacement at the start.
        self._start: tuple[AnyArray, AnyArray] | None = None

    def add(self, motion: Motion) -> None:
        """Add the next part of the run."""
        if (displacement := motion.observed.get("displacement")) is None:
            return
        p_WE = motion.motion_seen_by_law.p_WE
        if self._start is None:
            self._start = p_WE[0].copy(), displacement[0].copy()
        distance, displacement_so_far = p_WE - self._start[0], displacement - self._start[1]
        self._invariant = Largest().add(
            self._invariant, lengths(distance - displacement_so_far), motion.time
        )

    def metrics(self) -> MetricValues:
        """Return the metric, by name."""
        return {"invariant_error_max_m": Largest().value(self._invariant)}


class FollowingMetrics:
    """The largest distance of a joint from the command to its motor, and where it was.

    Attributes:
        worst: Distance [rad], number of the joint and time [s] where a joint is farthest from it;
            None for an arm without motors.
    """

    worst: tuple[float, int, float] | None = None

    def add(self, motion: Motion) -> None:
        """Add the next part of the run, of one arm."""
        if motion.position_commanded is None:
            return
        off = np.abs(motion.position - motion.position_commanded)
        step, joint = np.unravel_index(int(np.argmax(off)), off.shape)
        if self.worst is None or off[step, joint] > self.worst[0]:
            self.worst = float(off[step, joint]), int(joint), float(motion.time[step])

    def metrics(self) -> MetricValues:
        """Return the metric, by name."""
        return {} if self.worst is None else {"command_error_max_rad": self.worst[0]}


#: A gap in the contact that is longer than this counts as its loss [s].
LOSS_TIME = 0.05


class GapMetrics:
    """When the contact was lost, after it had been made.

    Attributes:
        force_seen: Whether there was any force along the normal; None without a surface.
    """

    force_seen: bool | None = None

    def __init__(self) -> None:
        self._since: AnyArray = np.nan
        self._last: AnyArray = -np.inf

    def add(self, motion: Motion) -> None:
        """Add the next part of the run."""
        if (pressing := motion.pressing) is None:
            return
        touching = pressing.touching
        self.force_seen = bool(self.force_seen) or bool(pressing.force.any())
        time = motion.time.reshape(-1, *(1,) * (touching.ndim - 1))
        # Time of the last contact.
        last = np.maximum.accumulate(np.where(touching, time, -np.inf))
        last = np.maximum(last, self._last)
        is_lost = (time - last > LOSS_TIME) & np.isfinite(last)
        if is_lost.any():
            first = np.take_along_axis(last, np.argmax(is_lost, axis=0)[None], axis=0)[0]
            new = np.isnan(self._since) & is_lost.any(axis=0)
            self._since = np.where(new, first, self._since)
        self._last = last[-1]

    def metrics(self) -> MetricValues:
        """Return the metric, by name."""
        return {"contact_lost_time_s": self._since}


_HIGHER = tuple(DERIVATIVE_UNITS)[2:]
#: Time between the velocities whose differences give these derivatives [s].
DIFFERENCE = 0.01


def difference_time(tick: float | None) -> float:
    """Return the time between the velocities whose differences give higher derivatives [s].

    It is 10 ms, or the next multiple of the tick. With a tick of 4 ms and differences over 10 ms,
    every second velocity would be read 2 ms late, and the differences would be wrong.

    Args:
        tick: Time for which velocities are held [s]; None if they are not.
    """
    if tick is None:
        return DIFFERENCE
    whole = tick * ceil(DIFFERENCE / tick - 1e-9)
    return DIFFERENCE if abs(whole - DIFFERENCE) < 1e-9 else whole


class HigherMetrics:
    """Jerk, and snap and crackle where they are bounded.

    They are differences of the velocity over 10 ms, see `difference_time`: over 1 ms, the rounding
    of positions would dominate the fifth derivative.

    Args:
        against: Limits of the joints.
    """

    def __init__(self, against: Yardsticks) -> None:
        self._bounds = {name: Bound(name, against) for name in _HIGHER}
        self._jerk: State = Largest.start
        self._square: State = RootMean.start
        # Begin and length of the run, number of the velocities taken, and the last of them.
        self._begin, self._length = 0.0, 0.0
        self._difference = DIFFERENCE
        self._count = 0
        self._velocities: AnyArray | None = None

    def add(self, motion: Motion) -> None:
        """Add the next part of the run."""
        if motion.begins:
            self._begin = float(motion.time[0])
            self._difference = difference_time(motion.tick)
        self._length = motion.time[-1] - self._begin
        steps = self._steps(motion.time)
        if not steps.size:
            return
        new = motion.velocity[steps]
        velocities = new
        if self._velocities is not None:
            velocities = np.concatenate((self._velocities, new))
        count_before = len(velocities) - len(new)
        for order, name in enumerate(_HIGHER, start=2):
            if name != "jerk" and self._bounds[name].bound is None:
                continue
            # Differences of kept velocities alone were taken with the part before.
            part = velocities[max(0, count_before - order) :]
            if len(part) > order:
                values = np.abs(np.diff(part, n=order, axis=0)) / self._difference**order
                self._add(name, values, motion.time)
        self._velocities = velocities[-len(DERIVATIVE_UNITS) :]

    def _add(self, name: str, values: AnyArray, time: AnyArray) -> None:
        """Add magnitudes of a derivative, shape (k, ..., n)."""
        self._bounds[name].add(values, time, self._bounds[name].bound)
        if name == "jerk":
            self._jerk = Largest().add(self._jerk, values.max(axis=-1), time)
            mean = sum_entries(values * values) / values.shape[-1]
            self._square = RootMean.add(self._square, mean, time)

    def _steps(self, time: Array) -> Array:
        """Return the step at, or first after, each further multiple of 10 ms."""
        # Times are computed as np.arange computes them, so that rounding errors do not add up.
        step = (self._begin + self._difference) - self._begin
        most = int((time[-1] - self._begin) / step) + 2
        times = self._begin + np.arange(self._count, max(most, self._count)) * step
        times = times[times - 1e-9 <= time[-1]]
        self._count += times.size
        return np.searchsorted(time, times - 1e-9)

    def metrics(self) -> MetricValues:
        """Return the metrics, by name; none of a run that is too short for differences."""
        if self._length < 6 * self._difference:
            return {}
        values: MetricValues = {
            "joint_jerk_max_rad_s3": Largest().value(self._jerk),
            "joint_jerk_rms_rad_s3": RootMean.value(self._square),
        }
        for bound in self._bounds.values():
            values |= bound.metrics()
        return values


class HeldJerkMetrics:
    """How velocities that are held keep the bound of the jerk, where there is one.

    `HigherMetrics` takes differences over 10 ms, which do not show an oscillation within them.

    Args:
        against: Limits of the joints.
    """

    def __init__(self, against: Yardsticks) -> None:
        self._bound = against.limits["jerk"]
        self._excess: State = Largest.start
        # The last two velocities.
        self._before: AnyArray | None = None

    def add(self, motion: Motion) -> None:
        """Add the next part of the run."""
        if self._bound is None or motion.tick is None or motion.time.size < 2:
            return
        last, _ = tick_ends(motion.time, motion.tick, motion.first_time)
        velocities = motion.velocity[last]
        if self._before is not None:
            velocities = np.concatenate((self._before, velocities[1:]))
        self._before = velocities[-2:].copy()
        jerk = np.abs(np.diff(velocities, n=2, axis=0)) / motion.tick**2
        if len(jerk):
            beyond = (jerk - self._bound).max(axis=-1)
            self._excess = Largest().add(self._excess, beyond, motion.time)

    def metrics(self) -> MetricValues:
        """Return the metric, by name; not finite without a bound or without held velocities."""
        return {"held_jerk_violation_max_rad_s3": excess(Largest().value(self._excess))}


class NetworkMetrics:
    """The law's own acceleration; none where its velocity is the arm's."""

    def __init__(self) -> None:
        self._largest: State = Largest.start
        self._differs: AnyArray = False

    def add(self, motion: Motion) -> None:
        """Add the next part of the run."""
        network, velocity = motion.network_velocity, motion.velocity
        if network is velocity or motion.time.size < 2:
            return
        # A ramp ends at its law's velocity except for rounding.
        away: AnyArray = ~np.isclose(network, velocity, rtol=1e-9, atol=1e-12)
        self._differs = self._differs | away.any(axis=-1).any(axis=0)
        acceleration = np.abs(motion.network_acceleration).max(axis=-1)
        self._largest = Largest().add(self._largest, acceleration, motion.time[1:])

    def metrics(self) -> MetricValues:
        """Return the metric, by name."""
        acceleration = np.where(self._differs, Largest().value(self._largest), np.nan)
        return {"network_acceleration_max_rad_s2": acceleration}


#: Time after which an arm should have arrived at a target at rest, and that for which it is looked
#: at from then on, at least [s].
ARRIVING, LOOKING = 2.0, 2.0
# Time over which the last speeds are averaged [s], and rounding of times.
_AVERAGED, _ROUNDING = 0.5, 1e-9


class RestMetrics:
    """Speeds of joints whose target rests until the run ends."""

    def __init__(self) -> None:
        self._target: AnyArray | None = None
        # Time since which the target rests, shape (...).
        self._since: AnyArray = np.nan
        # Ways of the joints since the arm should have arrived, in all and from there to here, and
        # squares of their speeds, shape (..., n); how long that is, and the weight of the squares,
        # shape (...).
        self._travel: AnyArray = 0.0
        self._net: AnyArray = 0.0
        self._squares: AnyArray = 0.0
        self._time: AnyArray = 0.0
        self._weight: AnyArray = 0.0

    def add(self, motion: Motion) -> None:
        """Add the next part of the run."""
        time, q = motion.time, motion.position
        self._find_rest(motion)
        if time.size < 2:
            return
        steps = np.diff(time).reshape(-1, *(1,) * (q.ndim - 2))
        before = time[:-1].reshape(steps.shape)
        counts = 1.0 * (before >= self._since + ARRIVING - _ROUNDING)
        ways = np.diff(q, axis=0) * counts[..., None]
        weight = np.exp((before - time[-1]) / _AVERAGED) * counts
        fading = np.exp((time[0] - time[-1]) / _AVERAGED)
        speeds = ways / np.maximum(steps, _ROUNDING)[..., None]
        self._travel = self._travel + abs(ways).sum(axis=0)
        self._net = self._net + ways.sum(axis=0)
        self._time = self._time + (steps * counts).sum(axis=0)
        weights = weight * steps
        self._squares = self._squares * fading + (speeds**2 * weights[..., None]).sum(axis=0)
        self._weight = self._weight * fading + weights.sum(axis=0)

    def _find_rest(self, motion: Motion) -> None:
        """Find since when the target rests; what was gathered before it moved does not count."""
        time, target = motion.time, motion.p_WE_desired
        goal = motion.target
        if goal is not None and goal.ndim == motion.position.ndim:
            target = np.concatenate((target, goal), axis=-1)
        before = target[:1] if self._target is None else self._target[None]
        positions = np.concatenate((before, target))
        moves = (positions[1:] != positions[:-1]).any(axis=-1)
        self._target = target[-1].copy()
        last = np.where(moves, time.reshape(-1, *(1,) * (moves.ndim - 1)), -np.inf).max(axis=0)
        has_moved = last > -np.inf
        since = np.where(np.isnan(self._since), time[0], self._since)
        self._since = np.where(has_moved, last, since)
        stays = 1.0 * ~has_moved
        self._travel, self._net, self._squares = (
            part * stays[..., None] for part in (self._travel, self._net, self._squares)
        )
        self._time, self._weight = self._time * stays, self._weight * stays

    def metrics(self) -> MetricValues:
        """Return the metrics, by name."""
        time, weight = np.asarray(self._time), np.asarray(self._weight)
        long = time >= LOOKING - _ROUNDING
        swing = (self._travel - abs(self._net)) / np.where(long, time, np.nan)[..., None]
        square = self._squares / np.where(long, weight, np.nan)[..., None]
        return {
            "rest_swing_max_rad_s": swing.max(axis=-1),
            "rest_velocity_max_rad_s": np.sqrt(square.max(axis=-1)),
        }

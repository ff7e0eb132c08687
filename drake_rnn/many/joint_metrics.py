"""Positions, velocities and higher derivatives of many robots' joints, and their limits."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..inputs.fields import Array
from ..measures import violation_metric
from ..measures.groups.held_jerk import HELD_JERK
from ..measures.groups.higher import difference_time
from ..measures.groups.joints import AT_BOUND
from ..measures.ticks import tick_ends
from ..robot.limits import DERIVATIVE_UNITS, JointLimits
from .running import Largest, Mean, Smallest
from .schedule import Schedule
from .step import Found, Step, summed

_HIGHER = tuple(DERIVATIVE_UNITS)[2:]


class JointMetrics:
    """Speeds, accelerations and margins of the joints over the whole run.

    Args:
        limits: Limits of each robot's joints.
        schedule: Steps of the run.
    """

    def __init__(self, limits: Sequence[JointLimits], schedule: Schedule) -> None:
        count = len(limits)
        self._lower = _together([each.position_lower for each in limits])
        self._upper = _together([each.position_upper for each in limits])
        self._speed, self._margin, self._singular = Largest(count), Smallest(count), Smallest(count)
        self._velocity = _Secant(schedule, schedule.tick)
        self._network = _Secant(schedule, schedule.period)
        self._acceleration, self._network_acceleration = Largest(count), Largest(count)
        self._differs = np.zeros(count, dtype=bool)
        self._initial: Found = {}
        self._bounds = {
            name: _Reached(name, _bounds(limits, name)) for name in ("velocity", "acceleration")
        }

    def add(self, step: Step) -> None:
        """Add the next step."""
        q, speed = step.position, np.abs(step.velocity)
        self._speed.add(speed)
        self._margin.add(np.minimum(q - self._lower, self._upper - q))
        self._singular.add(least_eigenvalue(step.J))
        self._bounds["velocity"].add(speed, 1)
        if step.network_velocity is not step.velocity:
            away = np.abs(step.network_velocity - step.velocity)
            self._differs |= (away > 1e-12 + 1e-9 * speed).any(axis=0)
        if (ended := self._network.over(step.number, step.network_velocity)) is not None:
            self._network_acceleration.add(np.abs(ended[0]))
        if (ended := self._velocity.over(step.number, step.velocity)) is None:
            return
        acceleration, steps = np.abs(ended[0]), ended[1]
        self._acceleration.add(acceleration)
        self._bounds["acceleration"].add(acceleration, steps)
        if not self._initial:
            self._initial = {
                "joint_velocity_initial_rad_s": speed.max(axis=0),
                "joint_acceleration_initial_rad_s2": acceleration.max(axis=0),
            }

    def found(self) -> Found:
        """Return the metrics, by name."""
        margin = self._margin.value
        network = self._network_acceleration.value
        found: Found = {
            "joint_velocity_max_rad_s": self._speed.value,
            "joint_limit_margin_min_rad": margin,
            "singular_value_min": np.sqrt(np.maximum(0.0, self._singular.value)),
            "joint_acceleration_max_rad_s2": self._acceleration.value,
            "network_acceleration_max_rad_s2": np.where(self._differs, network, np.nan),
            violation_metric("position"): np.maximum(0.0, -margin),
            **self._initial,
        }
        for bound in self._bounds.values():
            found |= bound.found()
        return found


class HigherMetrics:
    """Jerk, and snap and crackle where they are bounded, from velocities 10 ms apart.

    Args:
        limits: Limits of each robot's joints.
        schedule: Steps of the run.
    """

    def __init__(self, limits: Sequence[JointLimits], schedule: Schedule) -> None:
        count, times = len(limits), schedule.times
        self._difference = difference_time(schedule.tick)
        instants = np.arange(int(times[-1] / self._difference) + 2) * self._difference
        instants = instants[instants - 1e-9 <= times[-1]]
        # As often as a step ends several of these times.
        self._steps = np.searchsorted(times, instants - 1e-9).tolist()
        self._next = 0
        self._now = 0.0
        self._bounds = {name: Bound(name, _bounds(limits, name)) for name in _HIGHER}
        self._jerk, self._square = Largest(count), Mean(count)
        self._velocities: list[Array] = []

    def add(self, step: Step) -> None:
        """Add the next step."""
        self._now = step.time
        while self._next < len(self._steps) and self._steps[self._next] == step.number:
            self._next += 1
            self._velocities = [*self._velocities[-len(_HIGHER) - 1 :], step.velocity]
            self._add_differences()

    def _add_differences(self) -> None:
        known = self._velocities
        for order, name in enumerate(_HIGHER, start=2):
            if len(known) <= order:
                return
            if name != "jerk" and self._bounds[name].absent:
                continue
            last = np.stack(known[-order - 1 :])
            values = np.abs(np.diff(last, n=order, axis=0)[0]) / self._difference**order
            self._bounds[name].add(values)
            if name == "jerk":
                self._jerk.add(values)
                self._square.add(summed(values * values) / len(values))

    def found(self) -> Found:
        """Return the metrics, by name; none of a run that is too short for differences."""
        if self._now < 6 * self._difference:
            return {}
        found: Found = {
            "joint_jerk_max_rad_s3": self._jerk.value,
            "joint_jerk_rms_rad_s3": self._square.root,
        }
        for bound in self._bounds.values():
            found |= bound.found()
        return found


class HeldJerkMetrics:
    """Excess of the jerk over its bound, from one held velocity to the next.

    Args:
        limits: Limits of each robot's joints.
        schedule: Steps of the run.
    """

    def __init__(self, limits: Sequence[JointLimits], schedule: Schedule) -> None:
        bound = _bounds(limits, "jerk")
        self._bound = bound if bound is not None and np.isfinite(bound).any() else None
        self._excess = Largest(len(limits))
        self._ends = set(tick_ends(schedule.times, schedule.tick, 0.0)[0].tolist())
        self._tick = schedule.tick
        self._velocities: list[Array] = []

    def add(self, step: Step) -> None:
        """Add the next step."""
        if self._bound is None or step.number not in self._ends:
            return
        self._velocities = [*self._velocities[-2:], step.velocity]
        if len(self._velocities) == 3:
            first, second, third = self._velocities
            jerk = np.abs((third - second) - (second - first)) / self._tick**2
            self._excess.add(jerk - self._bound)

    def found(self) -> Found:
        """Return the metric, by name; none without a bound."""
        if self._bound is None or len(self._velocities) < 3:
            return {}
        bounded = np.isfinite(self._bound).any(axis=0)
        excess = np.maximum(0.0, self._excess.value)
        return {HELD_JERK: np.where(bounded, excess, np.nan)}


class Bound:
    """The ratio of a derivative of the joint positions to its bound, and the excess over it.

    Args:
        name: Name of the derivative.
        bound: Bounds of the joints, shape (n, robots); None without them.
    """

    def __init__(self, name: str, bound: Array | None) -> None:
        self._name = name
        self.absent = bound is None or not np.isfinite(bound).any()
        self._bound = np.empty(0) if bound is None or self.absent else bound
        count = self._bound.shape[-1]
        self._ratio, self._excess = Largest(count), Largest(count)

    def add(self, values: Array) -> None:
        """Add magnitudes, shape (n, robots)."""
        if not self.absent:
            self._ratio.add(values / self._bound)
            self._excess.add(values - self._bound)

    def found(self) -> Found:
        """Return the metrics, by name; none without a bound."""
        if self.absent:
            return {}
        order = 1 + list(DERIVATIVE_UNITS).index(self._name)
        bounded = np.isfinite(self._bound).any(axis=0)
        return {
            f"limit_ratio_{order}_max": np.where(bounded, self._ratio.value, np.nan),
            violation_metric(self._name): np.maximum(0.0, self._excess.value),
        }


class _Reached:
    """What there is to say of a bound, and how often some joint is at it."""

    def __init__(self, name: str, bound: Array | None) -> None:
        self._name = name
        self._beyond = Bound(name, bound)
        self._near = np.empty(0) if bound is None else AT_BOUND * bound
        self._any = Mean(self._near.shape[-1])
        self._often = np.zeros(self._near.shape, dtype=np.int32)

    def add(self, values: Array, steps: int) -> None:
        """Add magnitudes, shape (n, robots), that hold for a number of steps."""
        if self._beyond.absent:
            return
        self._beyond.add(values)
        at = values >= self._near
        if at.any():
            self._any.add(at.any(axis=0).astype(float), steps)
            self._often += steps * at
        else:
            self._any.pass_by(steps)

    def found(self) -> Found:
        """Return the metrics, by name; none without a bound."""
        if not (found := self._beyond.found()):
            return {}
        bounded = ~np.isnan(found[violation_metric(self._name)])
        found[f"{self._name}_bound_fraction"] = np.where(bounded, self._any.value, np.nan)
        reached = self._often.any(axis=0)
        often = 1.0 + np.argmax(self._often, axis=0)
        found[f"{self._name}_bound_joint"] = np.where(reached, often, np.nan)
        return found


class _Secant:
    """Difference quotients of velocities over ticks."""

    def __init__(self, schedule: Schedule, tick: float) -> None:
        last, ends = tick_ends(schedule.times, tick, 0.0)
        self._ends = dict(zip(last.tolist(), ends.tolist(), strict=True))
        self._before: tuple[int, Array] | None = None

    def over(self, number: int, velocity: Array) -> tuple[Array, int] | None:
        """Return the quotient over the tick that a step ends, and its steps; None if it does not.

        Args:
            number: Number of the step.
            velocity: Velocities at its end, shape (n, robots).
        """
        if number not in self._ends:
            return None
        before, self._before = self._before, (number, velocity)
        if before is None:
            return None
        time = self._ends[number] - self._ends[before[0]]
        return (velocity - before[1]) / time, number - before[0]


def least_eigenvalue(J: Array) -> Array:
    """Return the smallest eigenvalue of J J^T, shape (robots,), in elementwise operations.

    Of a symmetric matrix of three rows it is a root of a cubic (O. K. Smith, "Eigenvalues of a
    symmetric 3 x 3 matrix", 1961).

    Args:
        J: Matrices, shape (m, n, robots).
    """
    m = len(J)
    gram = {(i, k): summed(J[i] * J[k]) for i in range(m) for k in range(i, m)}
    if m == 2:
        half = 0.5 * (gram[0, 0] - gram[1, 1])
        mean = 0.5 * (gram[0, 0] + gram[1, 1])
        return np.asarray(mean - np.sqrt(half * half + gram[0, 1] * gram[0, 1]))
    if m != 3:
        matrices = np.stack([gram[min(i, k), max(i, k)] for i in range(m) for k in range(m)], -1)
        values = np.linalg.eigvalsh(matrices.reshape(-1, m, m))[:, 0]
        return np.asarray(values, dtype=float)
    mean = (gram[0, 0] + gram[1, 1] + gram[2, 2]) / 3.0
    a, b, c = gram[0, 0] - mean, gram[1, 1] - mean, gram[2, 2] - mean
    d, e, f = gram[0, 1], gram[0, 2], gram[1, 2]
    p = np.sqrt((a * a + b * b + c * c + 2.0 * (d * d + e * e + f * f)) / 6.0)
    determinant = a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e)
    cube = np.where(p > 0.0, p * p * p, 1.0)
    angle = np.arccos(np.clip(0.5 * determinant / cube, -1.0, 1.0)) / 3.0
    return np.asarray(mean + 2.0 * p * np.cos(angle + 2.0 * np.pi / 3.0))


def _bounds(limits: Sequence[JointLimits], name: str) -> Array | None:
    bounds = [each.bounds[name] for each in limits]
    known = [bound for bound in bounds if bound is not None]
    return _together(known) if known else None


def _together(arrays: Sequence[Array]) -> Array:
    """Return arrays side by side, shape (..., robots)."""
    return np.stack(arrays, axis=-1)

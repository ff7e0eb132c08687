"""Metrics of many robots, taken on the way: those of `drake_rnn.measures`, without any series.

Inside, robots are last: a number of one robot lies next to the same number of the next.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from ..experiment import Experiment
from ..inputs.fields import Array
from ..measures import ARRIVED
from ..measures.groups.jacobian import MOVING
from .contact_metrics import ContactMetrics
from .joint_metrics import HeldJerkMetrics, HigherMetrics, JointMetrics
from .running import Largest, Mean, Median, Settling, Smallest
from .schedule import Schedule
from .step import Found, Step, lengths, summed


class Group(Protocol):
    """Metrics that are taken together."""

    def add(self, step: Step) -> None:
        """Add the next step."""

    def found(self) -> Found:
        """Return the metrics of all steps so far, by name."""


class ManyMetrics:
    """The metrics of many runs.

    Args:
        experiments: What is run.
        schedule: Its steps.
    """

    def __init__(self, experiments: Sequence[Experiment], schedule: Schedule) -> None:
        self._count, self._delay = len(experiments), experiments[0].path_delay
        self._groups: tuple[Group, ...] = (
            _ErrorMetrics(experiments, schedule),
            _DriftMetrics(experiments, schedule),
            JointMetrics([experiment.limits for experiment in experiments], schedule),
            HigherMetrics([experiment.limits for experiment in experiments], schedule),
            HeldJerkMetrics([experiment.limits for experiment in experiments], schedule),
            _PostureMetrics(experiments, schedule),
            ContactMetrics(experiments, schedule),
            _LawMetrics(len(experiments), schedule),
        )

    def add(self, step: Step) -> None:
        """Add the next step of all robots."""
        for group in self._groups:
            group.add(step)

    def found(self) -> Found:
        """Return the metrics so far, by name; not a number for a robot that has none."""
        metrics: Found = {}
        for group in self._groups:
            found = group.found()
            for name in metrics.keys() & found.keys():
                # A loss that the law detects counts even if some contact is left.
                found[name] = np.where(np.isnan(found[name]), metrics[name], found[name])
            metrics |= found
        if self._delay > 0.0:
            metrics["path_delay_s"] = np.full(self._count, self._delay)
        return metrics


class _ErrorMetrics:
    def __init__(self, experiments: Sequence[Experiment], schedule: Schedule) -> None:
        count = len(experiments)
        self._within = schedule.within
        self._largest, self._component, self._square = Largest(count), Largest(count), Mean(count)
        self._slip, self._slip_component = Largest(count), Largest(count)
        tolerances = [experiment.document.settling_tolerance_m for experiment in experiments]
        self._settling = Settling(np.array(tolerances))

    def add(self, step: Step) -> None:
        error = step.aside(step.p_WE - step.p_WE_desired)
        norm = lengths(error)
        if self._within[step.number]:
            slip = step.aside(step.v_WE - step.v_WE_desired)
            self._largest.add(norm)
            self._component.add(np.abs(error))
            self._square.add(norm * norm)
            self._slip.add(lengths(slip))
            self._slip_component.add(np.abs(slip))
        self._settling.add(step.time, norm)

    def found(self) -> Found:
        return {
            "position_error_max_m": self._largest.value,
            "position_error_component_max_m": self._component.value,
            "position_error_rms_m": self._square.root,
            "velocity_error_max_m_s": self._slip.value,
            "velocity_error_component_max_m_s": self._slip_component.value,
            "settling_time_s": self._settling.time,
        }


class _DriftMetrics:
    def __init__(self, experiments: Sequence[Experiment], schedule: Schedule) -> None:
        count, times = len(experiments), schedule.times
        self._within = schedule.within
        seeks = experiments[0].target is not None
        closed = [experiment.desired.closed and not seeks for experiment in experiments]
        self._closed = np.array(closed)
        self._first: Array | None = None
        self._last: Array | None = None
        # The step at which each robot's last lap begins; -1 for none.
        laps = [None if seeks else _last_lap(each, float(times[-1])) for each in experiments]
        self._lap_step = np.array(
            [-1 if lap is None else int(np.searchsorted(times, lap - 1e-9)) for lap in laps]
        )
        self._lap_steps = set(self._lap_step.tolist())
        self._lap: Array | None = None
        self._ended = float(times[-1])
        self._now, self._position = 0.0, np.empty(0)
        self._start: Array | None = None
        self._moved, self._moved_in_the_end = Largest(count), np.empty(0)

    def add(self, step: Step) -> None:
        self._now, self._position = step.time, step.position
        if self._within[step.number]:
            if self._first is None:
                self._first = step.position
            else:
                self._last = step.position
        if step.number in self._lap_steps:
            known = np.full_like(step.position, np.nan) if self._lap is None else self._lap
            self._lap = np.where(self._lap_step == step.number, step.position, known)
        self._start = step.p_WE if self._start is None else self._start
        self._moved_in_the_end = lengths(step.p_WE - self._start)
        self._moved.add(self._moved_in_the_end)

    def found(self) -> Found:
        found = {
            "end_effector_drift_max_m": self._moved.value,
            "end_effector_drift_end_m": self._moved_in_the_end,
        }
        if self._first is not None and self._last is not None:
            drift = np.where(self._closed, np.abs(self._last - self._first), np.nan)
            found |= {
                "joint_drift_max_rad": drift.max(axis=0),
                "joint_drift_mean_rad": summed(drift) / len(drift),
            }
        # A run that is cut short ends with another lap.
        if self._lap is not None and self._now == self._ended:
            found["lap_drift_max_rad"] = np.abs(self._position - self._lap).max(axis=0)
        return found


def _last_lap(experiment: Experiment, until: float) -> float | None:
    """Return the time at which the last whole lap of a run begins [s]; None without one."""
    delay = experiment.path_delay
    began = experiment.desired.last_lap(until - delay)
    # The first lap begins with the run, whatever the delay.
    return began + delay if began is not None and began > 0.0 else began


class _PostureMetrics:
    def __init__(self, experiments: Sequence[Experiment], schedule: Schedule) -> None:
        count = len(experiments)
        self._within = schedule.within
        self._angle, self._square = Largest(count), Mean(count)
        targets = [target for e in experiments if (target := e.target) is not None]
        self._target = np.stack(targets, axis=-1) if targets else None
        self._error = np.full(count, np.nan)
        self._settling = Settling(np.full(count, ARRIVED))

    def add(self, step: Step) -> None:
        if step.turned is not None and self._within[step.number]:
            self._angle.add(step.turned)
            self._square.add(step.turned * step.turned)
        if self._target is not None:
            self._error = np.abs(step.position - self._target).max(axis=0)
            self._settling.add(step.time, self._error)

    def found(self) -> Found:
        found = {
            "orientation_error_max_rad": self._angle.value,
            "orientation_error_rms_rad": self._square.root,
        }
        if self._target is not None:
            found |= {
                "joint_error_max_rad": self._error,
                "joint_settling_time_s": self._settling.time,
            }
        return found


class _LawMetrics:
    def __init__(self, count: int, schedule: Schedule) -> None:
        self._within = schedule.within
        self._saturated, self._demand = Mean(count), Largest(count)
        self._rank, self._jacobian = Smallest(count), Largest(count)
        self._median, self._excited = Median(count), Median(count)
        self._lost = np.full(count, np.nan)
        self._invariant = Largest(count)
        # End effector and displacement at the start.
        self._start: tuple[Array, Array] | None = None

    def add(self, step: Step) -> None:
        observed = step.observed
        if "saturated" in observed:
            self._saturated.add(observed["saturated"][:, 0].astype(float))
        if "acceleration_demand" in observed:
            self._demand.add(np.abs(observed["acceleration_demand"].T))
        if "orientation_rank" in observed:
            self._rank.add(observed["orientation_rank"].T)
        if "contact_lost" in observed:
            lost = np.isnan(self._lost) & (observed["contact_lost"][:, 0] != 0.0)
            self._lost = np.where(lost, step.time, self._lost)
        if "displacement" in observed:
            self._add_displacement(step.seen.p_WE, observed["displacement"].T)
        if step.J_hat is not None and self._within[step.number]:
            self._add_jacobian(step.seen.J - step.J_hat, step.network_velocity)

    def _add_jacobian(self, difference: Array, v: Array) -> None:
        size, speed = lengths(difference.reshape(-1, difference.shape[-1])), lengths(v)
        self._jacobian.add(size)
        self._median.add(size)
        along = lengths(np.stack([summed(row * v) for row in difference]))
        self._excited.add(along / speed, speed > MOVING)

    def _add_displacement(self, p_WE: Array, displacement: Array) -> None:
        self._start = (p_WE, displacement) if self._start is None else self._start
        moved, told = p_WE - self._start[0], displacement - self._start[1]
        self._invariant.add(lengths(moved - told))

    def found(self) -> Found:
        return {
            "saturated_fraction": self._saturated.value,
            "joint_acceleration_demand_max_rad_s2": self._demand.value,
            "orientation_rank_min": self._rank.value,
            "jacobian_error_max": self._jacobian.value,
            "jacobian_error_median": self._median.value,
            "jacobian_error_excited_median": self._excited.value,
            "contact_lost_time_s": self._lost,
            "invariant_error_max_m": self._invariant.value,
        }

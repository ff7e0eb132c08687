"""Metrics of compiled runs, with derivatives where they have any: some of those of `METRICS`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from ..arrays.algebra import functions_of, root
from ..arrays.namespace import AnyArray
from ..errors import InvalidInputError
from ..experiment import Experiment
from ..inputs.complaints import nearest
from ..many.schedule import Schedule
from ..many.step import Step, summed


class Counts(NamedTuple):
    """What a step counts for.

    Attributes:
        window: Whether it lies in the window.
        first, last: Whether it is the first or the last of these.
        end: Whether it is the last of the run.
    """

    window: AnyArray
    first: AnyArray
    last: AnyArray
    end: AnyArray


def counts_of(schedule: Schedule) -> Counts:
    """Return what the steps of a run count for, each of shape (steps,)."""
    window = schedule.within
    numbers, inside = np.arange(window.size), np.flatnonzero(window)
    first, last = (-1, -1) if not inside.size else (inside[0], inside[-1])
    return Counts(window, numbers == first, numbers == last, numbers == window.size - 1)


@dataclass(frozen=True)
class Taken:
    """How a metric is taken.

    Attributes:
        of: Values of a step, shape (..., robots).
        over: ``mean`` and ``largest`` of the steps of the window, ``peak`` of all steps, ``end`` of
            the last one, ``change`` from the first to the last one of the window.
        finish: From what was gathered to the metric, shape (robots,).
    """

    of: Callable[[Step], AnyArray]
    over: Literal["mean", "largest", "peak", "end", "change"]
    finish: Callable[[AnyArray], AnyArray] = lambda gathered: gathered

    def started(self, values: AnyArray) -> AnyArray:
        """Return what is gathered before the first step.

        Args:
            values: Values of any step, of which the shape matters.
        """
        least = -np.inf if self.over in ("largest", "peak") else 0.0
        return functions_of(values).full_like(values, least)

    def added(self, gathered: AnyArray, values: AnyArray, counts: Counts) -> AnyArray:
        """Return what is gathered with the values of another step."""
        xp = functions_of(gathered)
        if self.over == "mean":
            return gathered + xp.where(counts.window, values, 0.0)
        if self.over == "largest":
            return xp.where(counts.window, xp.maximum(gathered, values), gathered)
        if self.over == "peak":
            return xp.maximum(gathered, values)
        if self.over == "end":
            return xp.where(counts.end, values, gathered)
        change = xp.where(counts.last, values, 0.0) - xp.where(counts.first, values, 0.0)
        return gathered + change


def metrics_of(experiments: Sequence[Experiment]) -> dict[str, Taken]:
    """Return how metrics are taken, those that these experiments have, by name.

    Args:
        experiments: Experiments that run side by side.
    """
    first = experiments[0]
    known = dict(_OF_PATHS)
    if first.holds_orientation:
        known |= _OF_ORIENTATIONS
    if first.contact is not None:
        known |= _OF_FORCES
    if first.target is not None:
        target = np.stack([each.target for each in experiments if each.target is not None], -1)
        known["joint_error_max_rad"] = Taken(lambda step: _top(step.position - target), "end")
    elif all(each.desired.closed for each in experiments):
        known["joint_drift_max_rad"] = Taken(lambda step: step.position, "change", _top)
        known["joint_drift_mean_rad"] = Taken(lambda step: step.position, "change", _mean)
    return known


def require_metrics(known: Mapping[str, Taken], names: Sequence[str]) -> None:
    """Refuse names of metrics that cannot be taken.

    Raises:
        InvalidInputError: If a metric is none of these.
    """
    for name in names:
        if name not in known:
            told = nearest(str(name), list(known))
            raise InvalidInputError(f"metric: {name!r} cannot be taken of this run; {told}")


def _error(step: Step) -> AnyArray:
    return step.aside(step.p_WE - step.p_WE_desired)


def _slip(step: Step) -> AnyArray:
    return step.aside(step.v_WE - step.v_WE_desired)


def _square(vectors: AnyArray) -> AnyArray:
    return summed(vectors * vectors)


def _top(vectors: AnyArray) -> AnyArray:
    return abs(vectors).max(axis=0)


def _mean(vectors: AnyArray) -> AnyArray:
    return abs(vectors).mean(axis=0)


def _turned(step: Step) -> AnyArray:
    return step.turned


def _force(step: Step) -> AnyArray:
    pressed: Any = step.pressed
    return pressed.force - pressed.desired


_OF_PATHS = {
    "position_error_rms_m": Taken(lambda step: _square(_error(step)), "mean", root),
    "position_error_max_m": Taken(lambda step: _square(_error(step)), "largest", root),
    "position_error_component_max_m": Taken(lambda step: _top(_error(step)), "largest"),
    "velocity_error_max_m_s": Taken(lambda step: _square(_slip(step)), "largest", root),
    "velocity_error_component_max_m_s": Taken(lambda step: _top(_slip(step)), "largest"),
    "joint_velocity_max_rad_s": Taken(lambda step: _top(step.velocity), "peak"),
}
_OF_ORIENTATIONS = {
    "orientation_error_rms_rad": Taken(lambda step: _turned(step) ** 2, "mean", root),
    "orientation_error_max_rad": Taken(_turned, "largest"),
}
_OF_FORCES = {
    "force_error_mean_N": Taken(_force, "mean"),
    "force_error_rms_N": Taken(lambda step: _force(step) ** 2, "mean", root),
    "force_error_max_N": Taken(lambda step: abs(_force(step)), "largest"),
    "lateral_error_max_m": Taken(lambda step: _square(_error(step)), "largest", root),
}

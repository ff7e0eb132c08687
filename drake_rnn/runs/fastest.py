"""The fastest run of a path within bounds on all derivatives of the joint positions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..errors import InvalidInputError, old_arguments
from ..experiment import Experiment, make_experiment
from ..features.pairs import refuse
from ..inputs.fields import (
    checked,
    function,
    instance,
    optional,
)
from ..laws import LAWS
from ..paths import Curve
from ..robot.limits import DERIVATIVE_UNITS
from .result import Result
from .simulation import simulate

_ORDERS = range(1, 1 + len(DERIVATIVE_UNITS))
# Range in which the largest ratio to a bound is accepted, and the ratio that is aimed at.
_NEAR, _ADMISSIBLE = 0.99, 1.0
_AIM = 0.998
_TRIES = 8
# Distance from the path above which the arm does not start on it [m].
_ASIDE = 1e-6
# Ratio assumed for a run in which a bound cut the law's demand.
_CUT = 1.05
#: A larger stretch is attributed to a singularity near the path.
LONGEST_STRETCH = 5.0


@dataclass(frozen=True)
class Fastest:
    """The shortest admissible run of a path.

    Attributes:
        experiment: The path at its shortest duration; a run of it gives ``result`` again.
        result: Result of that run; ``shortest_duration_s`` is among its metrics.
        stretch: Shortest duration divided by the duration asked for.
        binding: Name of the derivative with the bound that prevents a faster run.
    """

    experiment: Experiment
    result: Result
    stretch: float
    binding: str


@old_arguments(told="progress")
@checked(experiment=instance(Experiment), progress=optional(function()))
def fastest(experiment: Experiment, progress: Callable[[str], None] | None = None) -> Fastest:
    """Run a path from rest to rest as fast as the limits allow.

    Stretching the path in time by kappa divides the i-th derivative of the joint positions by
    kappa^i, exactly for a law that stays on its path and approximately for any other. The path is
    therefore run, stretched according to the ratios to the bounds, and run again, until the largest
    ratio lies between 0.99 and 1.

    Args:
        experiment: Experiment with a path on which the arm starts. A curve is run once, with the
            timing "ramps"; waypoints with a period as they are. The experiment's own timing, laps,
            pause, duration, window and accept do not apply.
        progress: Called with a message about each trial.

    Raises:
        InvalidInputError: If there is no path or no bound on a derivative; if the law or a filter
            does not let the motion scale with the path; or if position limits or a singularity
            prevent the run at any speed.
    """
    check_stretchable(experiment)
    document = _smooth(experiment, progress)
    stretch = 1.0
    period_now = float(document["path"]["period"])
    for _ in range(_TRIES):
        period = period_now * stretch
        path = {**document["path"], "period": period}
        experiment_faster = make_experiment({**document, "path": path, "duration": period})
        result = simulate(experiment_faster)
        ratios = _ratios(result)
        _require_position_limits(result)
        largest = max(ratios.values())
        if result.metrics.get("saturated_fraction", 0.0) > 0.0:
            # The law has kept its bounds by leaving its path.
            largest, ratios[1] = max(largest, _CUT), max(ratios.get(1, 0.0), _CUT)
        if progress is not None:
            progress(
                f"{period_now * stretch:.4g} s: largest ratio {largest:.4g} ({_binding(ratios)})"
            )
        if _NEAR <= largest <= _ADMISSIBLE:
            result.metrics["shortest_duration_s"] = period_now * stretch
            return Fastest(experiment_faster, result, stretch, _binding(ratios))
        stretch *= max((ratio / _AIM) ** (1.0 / order) for order, ratio in ratios.items())
        if stretch > LONGEST_STRETCH:
            raise InvalidInputError(_too_slow(result, stretch, period_now))
    kind, longest = experiment.document.law["kind"], experiment_faster.document.duration
    raise InvalidInputError(
        f"path: no duration found at which {kind} just keeps its bounds; at {longest:.4g} s the "
        f"largest ratio is {largest:.4g}: its motion does not follow the path closely enough to "
        "scale with it"
    )


def check_stretchable(experiment: Experiment) -> None:
    """Refuse a path that cannot be stretched in time, and an experiment without bounds.

    Args:
        experiment: The experiment.
    """
    path = experiment.document.path
    if path is None or path["kind"] == "rest":
        raise InvalidInputError(
            "path: must be given, and of another kind than rest, to be run faster"
        )
    _require_period(experiment)
    bounds = (experiment.limits.bounds[name] for name in DERIVATIVE_UNITS)
    if not any(bound is not None and np.isfinite(bound).any() for bound in bounds):
        raise InvalidInputError(
            "limits: must bound at least one derivative; without bounds any speed is allowed"
        )
    _require_that_it_scales(experiment)


def _require_that_it_scales(experiment: Experiment) -> None:
    if not experiment.law.stays_on_path:
        able = ", ".join(kind for kind, law in LAWS.items() if law.stays_on_path)
        raise InvalidInputError(
            f"law.kind: may be {able} for stretching a path in time, not "
            f"{experiment.document.law['kind']}: its class does not say that it stays_on_path"
        )
    refuse(replace(experiment.combination, host="fastest"))
    away = experiment.desired.position(0.0)[0] - experiment.p_WE_start
    if (distance := float(np.linalg.norm(away[list(experiment.task.axes)]))) > _ASIDE:
        raise InvalidInputError(
            "path: must begin where the arm starts, not "
            f"{distance:.3g} m away; leave out offset and whatever else places it"
        )


def _smooth(experiment: Experiment, progress: Callable[[str], None] | None) -> dict[str, Any]:
    document = experiment.document.contents()
    path = document["path"]
    smooth = {"timing": "ramps", "laps": 1} if isinstance(experiment.path, Curve) else {}
    sentences = [
        f"path.{key}: {value}, not {path.get(key, 'its default')}"
        for key, value in smooth.items()
        if path.get(key) != value
    ]
    path |= smooth
    if path.pop("pause", None):
        sentences.append("no path.pause")
    if document["duration"] != path["period"]:
        sentences.append(f"duration: the path's, not {document['duration']:g} s")
    keys = [key for key in ("window", "accept") if document.pop(key, None) is not None]
    sentences += [f"no {key}" for key in keys]
    if sentences and progress is not None:
        progress(f"runs the path once, from rest to rest: {'; '.join(sentences)}")
    document["expect"] = "on its path, as fast as the limits allow"
    document["name"] = f"{experiment.name}_fastest"
    return document


def _require_period(experiment: Experiment) -> None:
    """Raise an InvalidInputError for a path whose time no period stretches."""
    path = experiment.document.path or {}
    if path.get("period") is None:
        kind = type(experiment.path).__name__
        raise InvalidInputError(
            f"path.period: must be given, for the path to be stretched in time; a {kind} without "
            "one has times of its own"
        )
    if path.get("blend_time") is not None:
        raise InvalidInputError(
            "path.blend_time: would not be stretched with the path; give a blend_radius"
        )


def _ratios(result: Result) -> dict[int, float]:
    """Return the largest ratio to the bound, by order of the derivative, where it has one."""
    names = {order: f"limit_ratio_{order}_max" for order in _ORDERS}
    return {n: result.metrics[name] for n, name in names.items() if name in result.metrics}


def _binding(ratios: dict[int, float]) -> str:
    order = max(ratios, key=lambda n: ratios[n] ** (1.0 / n))
    return list(DERIVATIVE_UNITS)[order - 1]


def _require_position_limits(result: Result) -> None:
    """Raise an InvalidInputError if a joint leaves its position limits, at whatever speed."""
    experiment = result.experiment
    excess = experiment.limits.violation(result.series["position"])
    k, joint = np.unravel_index(int(np.argmax(excess)), excess.shape)
    if excess[k, joint] <= 0.0:
        return
    lower, upper = experiment.limits.position_lower[joint], experiment.limits.position_upper[joint]
    name, unit = experiment.arm.joints[joint], experiment.arm.units[joint]
    raise InvalidInputError(
        f"limits.position: {name} reaches {result.series['position'][k, joint]:.4g} {unit} at "
        f"t = {result.time[k]:.4g} s and would do so at any speed; it may be "
        f"{lower:.4g} to {upper:.4g}; start from another posture"
    )


def _too_slow(result: Result, stretch: float, period: float) -> str:
    smallest = np.linalg.svd(result.series["J"], compute_uv=False)[:, -1]
    k = int(np.argmin(smallest))
    place = ", ".join(f"{value:.4g}" for value in result.desired_position[k])
    return (
        f"path.period: {period:g} s would have to be stretched by a factor of {stretch:.3g}; near "
        f"({place}) m the smallest singular value of J is {smallest[k]:.3g}; if that is not the "
        f"reason, give {period * stretch:.3g} s"
    )

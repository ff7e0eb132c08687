"""How much of each limit a run uses, and which ones it breaks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..experiment import Experiment
from ..inputs.fields import Array
from ..measures import violation_metric
from ..robot.limits import DERIVATIVE_UNITS, LIMIT_UNITS, JointLimits
from .result import Result

#: Ratio above which a bound counts as broken; secants at a bound have rounding errors.
EXCEEDED = 1.0 + 1e-9
#: Excess over a limit that is more than a rounding error [rad, rad/s].
_BEYOND = 1e-6
# Metrics of limits that are no derivatives, besides that of their violation.
_METRICS = {
    "position": ("joint_limit_margin_min_rad",),
    "envelope": ("envelope_margin_min_rad_s", "envelope_ratio_max"),
}


@dataclass(frozen=True)
class Use:
    """How much of a limit a run uses.

    Attributes:
        name: ``position``, ``velocity`` and so on.
        share: Largest ratio to the bound of any joint; of a position, distance from the middle of
            its range over half of that; of an envelope, with its offset added to both.
        broken: Whether the bound is exceeded, by more than rounding.
    """

    name: str
    share: float
    broken: bool


def counted_limits(experiment: Experiment) -> list[str]:
    """Return the limits that count in a run, of `LIMIT_UNITS`.

    These are what the law or a filter keeps by construction, be it of the command alone, what the
    document's ``limits`` sets, and what its ``accept`` bounds, as far as any joint has a bound.
    """
    document = experiment.document
    asked = set(document.limits) if isinstance(document.limits, dict) else set()
    if {"position_lower", "position_upper"} & asked:
        asked.add("position")
    if {"envelope_offset", "envelope_deceleration"} & asked:
        asked.add("envelope")
    for name in LIMIT_UNITS:
        others = _METRICS[name] if name in _METRICS else (share_metric(name),)
        if {violation_metric(name), *others} & document.accept.keys():
            asked.add(name)
    counted = asked | {*experiment.guarantees.arm.limits, *experiment.guarantees.command.limits}
    return [name for name in LIMIT_UNITS if name in counted and _is_bounded(experiment, name)]


def uses(result: Result) -> list[Use]:
    """Return how much a run uses of each limit that counts, from its metrics of every step.

    No arm can exceed limits of position and velocity: where they are broken, they count.
    """
    counted = counted_limits(result.experiment)
    for name in ("position", "velocity"):
        if result.metrics.get(violation_metric(name), 0.0) > _BEYOND:
            counted.append(name)
    found = []
    for name in (name for name in LIMIT_UNITS if name in counted):
        if name == "position":
            shares = share_of_range(result.series["position"], result.experiment.limits)
            share = float(shares[np.isfinite(shares)].max(initial=0.0))
            broken = result.metrics.get("joint_limit_margin_min_rad", 0.0) < 1.0 - EXCEEDED
        elif name == "envelope":
            share = result.metrics.get("envelope_ratio_max", np.nan)
            broken = result.metrics.get(violation_metric(name), 0.0) > EXCEEDED - 1.0
        else:
            share = result.metrics.get(share_metric(name), np.nan)
            broken = share > EXCEEDED
        if np.isfinite(share):
            found.append(Use(name, float(share), broken))
    return found


def share_metric(limit: str) -> str:
    """Return the name of the metric that tells how much of a limit a run uses.

    Args:
        limit: A key of `LIMIT_UNITS`.
    """
    if limit in DERIVATIVE_UNITS:
        return f"limit_ratio_{list(DERIVATIVE_UNITS).index(limit) + 1}_max"
    return _METRICS[limit][-1]


def share_of_range(position: Array, limits: JointLimits) -> Array:
    """Return how far the worst joint is from the middle of its range; 1 at either limit.

    Joints without two limits have no middle; NaN if there are no others.
    """
    lower, upper = limits.position_lower, limits.position_upper
    bounded = np.isfinite(lower) & np.isfinite(upper)
    middle = np.add(upper, lower, out=np.full_like(upper, np.nan), where=bounded) / 2
    half = np.subtract(upper, lower, out=np.full_like(upper, np.nan), where=bounded) / 2
    return np.asarray(np.fmax.reduce(np.abs(position - middle) / half, axis=1))


def _is_bounded(experiment: Experiment, name: str) -> bool:
    limits = experiment.limits
    if name == "envelope":
        return limits.envelope is not None
    if name == "position":
        return bool(np.isfinite(limits.position_upper - limits.position_lower).any())
    bound = limits.bounds[name]
    return bound is not None and bool(np.isfinite(bound).any())

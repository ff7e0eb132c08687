"""How much of each limit a run uses, and which ones it breaks.

- What a run has come to, in a few words: whether it is accepted, and which limits it broke.
- Derivatives of a run's motion up to the fifth, from its stored series.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..experiment import Experiment
from ..inputs.fields import Array
from ..measures import violation_metric
from ..measures.metric_groups import difference_time
from ..robot.limits import DERIVATIVE_UNITS, LIMIT_UNITS, JointLimits
from .result import Result, criteria_text

#: Ratio above which a bound counts as broken; secants at a bound have rounding errors.
EXCESS_RATIO = 1.0 + 1e-9
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
    names = set(document.limits) if isinstance(document.limits, dict) else set()
    if {"position_lower", "position_upper"} & names:
        names.add("position")
    if {"envelope_offset", "envelope_deceleration"} & names:
        names.add("envelope")
    for name in LIMIT_UNITS:
        others = _METRICS[name] if name in _METRICS else (share_metric(name),)
        if {violation_metric(name), *others} & document.accept.keys():
            names.add(name)
    all_names = names | {*experiment.guarantees.arm.limits, *experiment.guarantees.command.limits}
    return [name for name in LIMIT_UNITS if name in all_names and _is_bounded(experiment, name)]


def uses(result: Result) -> list[Use]:
    """Return how much a run uses of each limit that counts, from its metrics of every step.

    No arm can exceed limits of position and velocity: where they are broken, they count.
    """
    names = counted_limits(result.experiment)
    for name in ("position", "velocity"):
        if result.metrics.get(violation_metric(name), 0.0) > _BEYOND:
            names.append(name)
    limit_uses = []
    for name in (name for name in LIMIT_UNITS if name in names):
        if name == "position":
            shares = share_of_range(result.series["position"], result.experiment.limits)
            share = float(shares[np.isfinite(shares)].max(initial=0.0))
            exceeds = result.metrics.get("joint_limit_margin_min_rad", 0.0) < 1.0 - EXCESS_RATIO
        elif name == "envelope":
            share = result.metrics.get("envelope_ratio_max", np.nan)
            exceeds = result.metrics.get(violation_metric(name), 0.0) > EXCESS_RATIO - 1.0
        else:
            share = result.metrics.get(share_metric(name), np.nan)
            exceeds = share > EXCESS_RATIO
        if np.isfinite(share):
            limit_uses.append(Use(name, float(share), exceeds))
    return limit_uses


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
    has_bounds = np.isfinite(lower) & np.isfinite(upper)
    middle = np.add(upper, lower, out=np.full_like(upper, np.nan), where=has_bounds) / 2
    half = np.subtract(upper, lower, out=np.full_like(upper, np.nan), where=has_bounds) / 2
    return np.asarray(np.fmax.reduce(np.abs(position - middle) / half, axis=1))


def _is_bounded(experiment: Experiment, name: str) -> bool:
    limits = experiment.limits
    if name == "envelope":
        return limits.envelope is not None
    if name == "position":
        return bool(np.isfinite(limits.position_upper - limits.position_lower).any())
    bound = limits.bounds[name]
    return bound is not None and bool(np.isfinite(bound).any())


@dataclass(frozen=True)
class Conclusion:
    """A run in a line.

    Attributes:
        kind: "good" or "bad"; empty for a run of which nothing is asked.
        verdict: The verdict in words.
        criteria: How many criteria are met.
        broken: Names of the limits that are broken.
        limited: Whether any limit counts.
        ending: How it ended early, as `Result.ending`; empty if it did not.
    """

    kind: Literal["good", "bad", ""]
    verdict: str
    criteria: str
    broken: tuple[str, ...]
    limited: bool
    ending: str = ""

    def __str__(self) -> str:
        text = f"{self.verdict}: {self.criteria}"
        return f"{text}; {self.limits}" if self.limits else text

    @property
    def limits(self) -> str:
        """Whether limits were kept, in words; empty if none counts."""
        if self.broken:
            return f"limits broken: {', '.join(self.broken)}"
        return f"limits kept{' until then' if self.ending else ''}" if self.limited else ""


def conclusion_of(result: Result) -> Conclusion:
    """Return what a run has come to."""
    limits = uses(result)
    kind, verdict = _verdict(result)
    exceeded_names = tuple(use.name for use in limits if use.broken)
    criteria = criteria_text(result.verdicts) if result.verdicts else "no criteria"
    return Conclusion(kind, verdict, criteria, exceeded_names, bool(limits), result.ending)


def _verdict(result: Result) -> tuple[Literal["good", "bad", ""], str]:
    if result.ending:
        return "bad", result.ending
    if not result.verdicts:
        return "", "ran to its end"
    if all(verdict.met for verdict in result.verdicts):
        return "good", "accepted"
    return "bad", "not accepted"


#: Times, shape (k,) [s], and values of all joints, shape (k, n).
Signal = tuple[Array, Array]


def derivatives_of_motion(result: Result) -> list[Signal]:
    """Return positions, velocities, and the second to fifth derivative.

    The latter are differences of the velocity over some 10 ms, or over the distance of the samples
    if that is larger, and belong to the middle of that interval. Where the period of the law does
    not divide that of the series, samples are unevenly far apart, so each difference is taken by
    its own time.
    """
    position, velocity = result.series["position"], result.series["velocity"]
    derivatives = [(result.time, position), (result.time, velocity)]
    document = result.experiment.document
    step = max(difference_time(document.period), document.log_period)
    grid = np.arange(result.time[0], result.time[-1] + 1e-9, step)
    at = np.minimum(np.searchsorted(result.time, grid - 1e-9), result.time.size - 1)
    at = np.unique(at)
    time, values = result.time[at], velocity[at]
    for _ in range(1, len(DERIVATIVE_UNITS)):
        # A run that diverged may contain infinite values.
        with np.errstate(invalid="ignore", over="ignore"):
            values = np.diff(values, axis=0) / np.diff(time)[:, None]
        time = (time[1:] + time[:-1]) / 2.0
        derivatives.append((time, values))
    return derivatives

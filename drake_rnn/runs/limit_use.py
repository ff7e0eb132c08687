"""How much of each limit a run uses, and which ones it breaks.

- What a run has come to, in a few words: whether it is accepted, and which limits it broke.
- Derivatives of a run's motion up to the fifth, from its stored series.
- The fastest run of a path within bounds on all derivatives of the joint positions.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from ..errors import InvalidInputError, old_arguments
from ..experiment import COUNTED_LIMITS, Experiment, make_experiment
from ..experiment.experiment import CountedLimit
from ..features.pairs import refuse
from ..inputs.fields import Array, checked, function, instance, optional
from ..laws import LAWS
from ..measures.metric import RATIO_METRICS, violation_metric
from ..measures.metric_groups import difference_time
from ..paths import Curve
from ..robot.limits import DERIVATIVE_UNITS, JointLimits
from .evaluation import hard_limits
from .result import Result, Verdict, criteria_text
from .simulation import simulate

#: Excess over a limit that is more than a rounding error [rad, rad/s].
_BEYOND = 1e-6


@dataclass(frozen=True)
class Use:
    """How much of a limit a run uses.

    Attributes:
        name: ``position``, ``velocity`` and so on, ``torque``, ``distance`` or ``force``; or
            ``held jerk`` of one that only the velocities break that are held, from each to the
            next two.
        share: Largest ratio to the bound of any joint; of a position, distance from the middle of
            its range over half of that; of an envelope, with its offset added to both; of a
            distance, what is kept over what is left.
        broken: Whether the bound is exceeded, by more than rounding.
    """

    name: str
    share: float
    broken: bool


def counted_limits(experiment: Experiment) -> list[str]:
    """Return the limits that count in a run, of `COUNTED_LIMITS`.

    These are what the law or a filter keeps by construction, be it of the command alone, what the
    document's ``limits`` sets, and what its ``accept`` bounds, as far as any joint has a bound.
    Torques that a law commands always count, and so do distances that the law or its command keeps,
    and a largest force.
    """
    document = experiment.document
    names = set(document.limits) if isinstance(document.limits, dict) else set()
    if {"position_lower", "position_upper"} & names:
        names.add("position")
    if {"envelope_offset", "envelope_deceleration"} & names:
        names.add("envelope")
    names |= {"torque", "distance", "force"}
    names |= {*experiment.guarantees.arm.limits, *experiment.guarantees.command.limits}
    return [
        name
        for name, limit in COUNTED_LIMITS.items()
        if limit.is_bounded(experiment)
        and (name in names or {limit.metric, limit.share, *limit.others} & document.accept.keys())
    ]


def uses(result: Result) -> list[Use]:
    """Return how much a run uses of each limit that counts, from its metrics of every step.

    Where `hard_limits` are broken, they count.
    """
    experiment, metrics = result.experiment, result.metrics
    names = counted_limits(experiment)
    for name in hard_limits(experiment):
        if metrics.get(violation_metric(name), 0.0) > _BEYOND:
            names.append(name)
    limit_uses = []
    for name, limit in COUNTED_LIMITS.items():
        value = metrics.get(limit.metric_of(experiment), np.nan)
        share = _share(limit, value, result) if name in names else np.nan
        if not np.isfinite(share):
            continue
        broken = not (np.isnan(value) or limit.judged_by(experiment).holds(value))
        limit_uses.append(Use(name, share, broken))
        if name == "jerk" and not broken:
            limit_uses += _held_jerk(result)
    return limit_uses


def _share(limit: CountedLimit, value: float, result: Result) -> float:
    """Return the share of a limit's bound that a run uses; NaN if that is not known.

    Args:
        limit: The limit.
        value: Its metric.
        result: The run.
    """
    if limit.name == "position":
        shares = share_of_range(result.series["position"], result.experiment.limits)
        return float(shares[np.isfinite(shares)].max(initial=0.0))
    if limit.name != "distance":
        return float(result.metrics.get(limit.share, np.nan))
    floor = result.experiment.guarantees.command.distance or 0.0
    if value < floor:
        return 1.0 + (floor - value) / floor
    return floor / value if floor else 0.0


def _held_jerk(result: Result) -> list[Use]:
    """Return the jerk from one held velocity to the next, if it alone breaks the bound of the jerk.

    Differences over 10 ms do not show it; a robot that judges each command does.
    """
    excess = result.metrics.get("held_jerk_violation_max_rad_s3", 0.0)
    bound = result.experiment.limits.bounds["jerk"]
    if bound is None or not excess > _BEYOND:
        return []
    return [Use("held jerk", 1.0 + excess / float(np.min(bound)), True)]


def share_of_range(position: Array, limits: JointLimits) -> Array:
    """Return how far the worst joint is from the middle of its range; 1 at either limit.

    Joints without two limits have no middle; NaN if there are no others.
    """
    lower, upper = limits.position_lower, limits.position_upper
    has_bounds = np.isfinite(lower) & np.isfinite(upper)
    middle = np.add(upper, lower, out=np.full_like(upper, np.nan), where=has_bounds) / 2
    half = np.subtract(upper, lower, out=np.full_like(upper, np.nan), where=has_bounds) / 2
    return np.asarray(np.fmax.reduce(np.abs(position - middle) / half, axis=1))


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
    limits = {use.name: use.broken for use in uses(result)}
    verdicts = result.verdicts
    if result.second is not None:
        limits |= {f"second {use.name}": use.broken for use in uses(result.second)}
        verdicts = [*verdicts, *result.second.verdicts]
    kind, verdict = _verdict(result, verdicts)
    exceeded_names = tuple(name for name, is_broken in limits.items() if is_broken)
    criteria = criteria_text(verdicts) if verdicts else "no criteria"
    return Conclusion(kind, verdict, criteria, exceeded_names, bool(limits), result.ending)


def _verdict(result: Result, verdicts: Sequence[Verdict]) -> tuple[Literal["good", "bad", ""], str]:
    if result.ending:
        return "bad", result.ending
    if not verdicts:
        return "", result.headline or "ran to its end"
    if all(verdict.met for verdict in verdicts):
        # Without bounds of its own, limits alone are judged: it may be anywhere.
        asked = bool(result.experiment.document.accept)
        return "good", "accepted" if asked else result.headline or "ran to its end"
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
    names = enumerate(RATIO_METRICS.values(), start=1)
    return {order: result.metrics[name] for order, name in names if name in result.metrics}


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

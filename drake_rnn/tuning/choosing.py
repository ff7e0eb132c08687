"""Choice among the gains of a history: the best that keep bounds, verified by Drake's runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..batch import run_many
from ..errors import InvalidInputError, SimulationError
from ..experiment import Arms, Experiment, expected_bounds, load_experiment
from ..inputs.fields import Array
from ..runs import Result, simulate

# Places that are looked at on the way from one step to the next.
_BETWEEN = 5


@dataclass(frozen=True)
class Trial:
    """Gains that were reached.

    Attributes:
        gains: Their values, by key.
        value: The metric of the run with them.
        slopes: Its derivatives with respect to their logarithms, by key.
    """

    gains: Mapping[str, float]
    value: float
    slopes: Mapping[str, float]


@dataclass(frozen=True)
class _Judged:
    """Gains, and the bounds that a run with them breaks.

    Attributes:
        place: Their place in the history.
        value: The metric.
        broken: Names of metrics whose bounds the run breaks, of those that the start keeps.
    """

    place: float
    value: float
    broken: tuple[str, ...]


def choose(
    before: Result, history: Sequence[Trial], metric: str
) -> tuple[float, tuple[str, ...], Result]:
    """Return the place of the best gains, the bounds that stop there, and Drake's run with them.

    The best gains are the last ones, if Drake's run with them has a smaller metric than the start,
    and breaks no bound that the start keeps. If not, gains of all steps, and some between, are run
    side by side without Drake, by `run_many`; the best that are good are then run by Drake.

    Args:
        before: Result of Drake's run at the start.
        history: Gains, those of the start first.
        metric: Name of the metric.

    Returns:
        The place, the number of a step or a number between two, 0 for the start; names of the
        metrics whose bounds gains break beyond it; and Drake's result.
    """
    last = len(history) - 1
    if last == 0:
        return 0.0, (), before
    if (after := _verified(before, history, metric, last)) is not None:
        return last, (), after
    places = np.arange(1, _BETWEEN * last + 1) / _BETWEEN
    judged = _judged(before, history, metric, places)
    good = [each for each in judged if not each.broken and each.value < before.metrics[metric]]
    for each in sorted(good, key=lambda each: each.value):
        if (after := _verified(before, history, metric, each.place)) is not None:
            return each.place, _beyond(judged, each.place), after
    return 0.0, _beyond(judged, 0.0), before


def gains_at(history: Sequence[Trial], place: float) -> dict[str, float]:
    """Return the gains at a place of a history, by key; between two steps, in geometric mean.

    Args:
        history: The history.
        place: Number of a step, or a number between two.
    """
    number = min(int(place), len(history) - 1)
    before, after = history[number].gains, history[min(number + 1, len(history) - 1)].gains
    share = place - number
    return {key: before[key] ** (1.0 - share) * after[key] ** share for key in before}


def written(gains: Mapping[str, float]) -> dict[str, float]:
    """Return gains as they are written, with six digits."""
    return {key: float(f"{value:.6g}") for key, value in gains.items()}


def _judged(before: Result, history: Sequence[Trial], metric: str, places: Array) -> list[_Judged]:
    arms = Arms()
    made: dict[float, Experiment] = {}
    for place in places.tolist():
        gains = written(gains_at(history, place))
        try:
            made[place] = load_experiment(before.experiment, gains, arms=arms)
        except InvalidInputError:
            # Gains that the law allows one by one, but not together.
            continue
    if not made:
        return []
    many = run_many(list(made.values()))
    rows = [many.row(number) for number in range(len(made))]
    return [
        _Judged(place, row.get(metric, np.inf), _broken(before, row))
        for place, row in zip(made, rows, strict=True)
    ]


def _verified(before: Result, history: Sequence[Trial], metric: str, place: float) -> Result | None:
    """Return Drake's run with the gains at a place; None if it is not better than the start's."""
    gains = written(gains_at(history, place))
    try:
        after = simulate(load_experiment(before.experiment, gains))
    except (InvalidInputError, SimulationError):
        # The law does not allow them together, or fails with them.
        return None
    better = after.metrics[metric] < before.metrics[metric] and not _broken(before, after.metrics)
    return after if better else None


def _broken(before: Result, metrics: Mapping[str, float]) -> tuple[str, ...]:
    """Return the metrics whose bounds are broken, of those that were kept before."""
    bounds = expected_bounds(before.experiment)
    kept = (verdict.metric for verdict in before.verdicts if verdict.met)
    return tuple(n for n in kept if n not in metrics or not bounds[n].holds(metrics[n]))


def _beyond(judged: Sequence[_Judged], place: float) -> tuple[str, ...]:
    return next((each.broken for each in judged if each.place > place), ())

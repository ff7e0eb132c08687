"""Gains of a law tuned to make a metric of a whole run small, and verified by Drake."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..compiled import Slopes
from ..errors import InvalidInputError
from ..experiment import Described, Experiment, load_experiment
from ..inputs.fields import Array
from ..runs import Result, simulate
from .bounds import Between, bounds_of
from .descent import SHARES, Point, descend

# How near to the first gains that are not good those that are taken lie [steps].
_FINEST = 0.125


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


@dataclass(frozen=True, eq=False)
class Tuned:
    """What tuning came to.

    Attributes:
        metric: Name of the metric.
        history: Gains that were reached one after the other, from those of the start on.
        chosen: Place in it of the last gains with which Drake's run has a smaller metric than
            before, and breaks no bound that it kept before, of ``accept`` or of a limit that the
            law keeps: the number of a step, or a number between two; 0 if there are none.
        stopped_by: Names of the metrics whose bounds gains break beyond this place.
        bounds: Lowest and highest value of each gain, by key.
        before: Result of Drake's run with the gains of the start.
        after: Result of Drake's run with the chosen gains, those of `experiment`.
    """

    metric: str
    history: tuple[Trial, ...]
    chosen: float
    stopped_by: tuple[str, ...]
    bounds: Mapping[str, Between]
    before: Result
    after: Result

    @property
    def experiment(self) -> Experiment:
        """The experiment with the chosen gains."""
        return self.after.experiment

    @property
    def gains(self) -> dict[str, float]:
        """The chosen gains by key, with six digits."""
        return written(gains_at(self.history, self.chosen))

    @property
    def better(self) -> bool:
        """Whether there are better gains than those of the start."""
        return self.chosen > 0


def tune(
    experiment: Described,
    over: Sequence[str],
    least: str,
    *,
    between: Mapping[str, Between] | None = None,
    duration: float | None = None,
    steps: int = 30,
    told: Callable[[Trial], None] | None = None,
) -> Tuned:
    """Tune gains of a law until a metric of the run is small, and verify them by Drake's runs.

    The runs are compiled by JAX, with derivatives through the closed loop: `value_and_gradient`.
    Descent in the logarithms of the gains finds a minimum near the start, within the bounds; there
    may be lower ones elsewhere. It has the one run before its eyes: its path, start, arm and noise.
    Nothing is random; the same call gives the same gains. ::

        tuned = tune("slc_nephroid_known", ["law.kappa", "law.return_gain"], "position_error_rms_m")
        tuned.experiment                          # with the new gains
        tuned.before.metrics, tuned.after.metrics

    Args:
        experiment: An experiment that `run_many` can run, or what `load_experiment` takes.
        over: Dotted keys of numbers of the law, e.g. ``law.kappa``.
        least: Name of the metric to make small.
        between: Lowest and highest values, by key. By default, a thirtieth and thirty times the
            start, or what the law allows of that.
        duration: Duration of the runs to tune on [s], e.g. to save time; a window that ends later
            does not apply. Drake's runs have the experiment's own.
        steps: Largest number of steps, each of which takes four runs side by side.
        told: Called with the start and after each step that made the metric smaller.

    Raises:
        InvalidInputError: If JAX is not installed, the experiment cannot be run so, or a key, a
            metric or a bound is none.
    """
    if not isinstance(steps, int) or steps < 1:
        raise InvalidInputError(f"steps: must be a whole number of at least 1, not {steps!r}")
    made = experiment if isinstance(experiment, Experiment) else load_experiment(experiment)
    tuned_on = made if duration is None else load_experiment(made, {"duration": duration})
    slopes = Slopes(tuned_on, over, least, rows=SHARES.size)
    low, high = bounds_of(made, slopes.keys, slopes.start, between or {})
    before = simulate(made)

    def trial(point: Point) -> Trial:
        gains = dict(zip(slopes.keys, np.exp(point.x).tolist(), strict=True))
        return Trial(gains, point.value, dict(zip(slopes.keys, point.slope.tolist(), strict=True)))

    def of_logarithms(x: Array) -> tuple[Array, Array]:
        gains = np.exp(x)
        values, derivatives = slopes.at(gains)
        return values, derivatives * gains

    points = descend(
        of_logarithms,
        np.log(slopes.start),
        (np.log(low), np.log(high)),
        steps,
        lambda point: told(trial(point)) if told is not None else None,
    )
    history = tuple(trial(point) for point in points)
    bounds = {k: (float(a), float(b)) for k, a, b in zip(slopes.keys, low, high, strict=True)}
    checked = _Checked(before, history, least)
    chosen, after = checked.last_good()
    return Tuned(least, history, chosen, checked.stopped_by, bounds, before, after)


class _Checked:
    """Drake's runs with gains along a history, of which the last good ones are wanted.

    The last gains are tried first. If they break a bound, those before are searched by halves, as
    if all were good before some place and none after; the place may lie between two steps.

    Args:
        before: Result of the run with the first gains.
        history: The history.
        metric: Name of the metric that is to become smaller.

    Attributes:
        stopped_by: Names of the metrics whose bounds the nearest gains break that are not good.
    """

    def __init__(self, before: Result, history: Sequence[Trial], metric: str) -> None:
        self._before, self._history, self._metric = before, history, metric
        self._good, self._result = 0.0, before
        self.stopped_by: tuple[str, ...] = ()

    def last_good(self) -> tuple[float, Result]:
        """Return the place of the last good gains, and the run with them."""
        last = len(self._history) - 1
        if last == 0 or self._is_good(last):
            return self._good, self._result
        bad = float(last)
        while bad - self._good > _FINEST:
            middle = 0.5 * (self._good + bad)
            # Whole steps first.
            middle = float(int(middle)) if bad - self._good > 1.0 else middle
            bad = bad if self._is_good(max(middle, self._good + _FINEST)) else middle
        return self._good, self._result

    def _is_good(self, place: float) -> bool:
        gains = written(gains_at(self._history, place))
        result = simulate(load_experiment(self._before.experiment, gains))
        kept = {verdict.metric for verdict in self._before.verdicts if verdict.met}
        broken = tuple(v.metric for v in result.verdicts if v.metric in kept and not v.met)
        value, before = (each.metrics[self._metric] for each in (result, self._before))
        if broken or not value < before:
            self.stopped_by = broken
            return False
        self._good, self._result = place, result
        return True


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

"""Gains of a law tuned to make a metric of a whole run small, and verified by Drake."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..batch import Slopes
from ..errors import InvalidInputError
from ..experiment import Described, Experiment, load_experiment
from ..inputs.arguments import checked, each, function, instance, number, optional, whole
from ..inputs.fields import Array
from ..runs import Result, simulate
from .bounds import Between, bounds_of
from .choosing import Trial, choose, gains_at, written
from .descent import SHARES, Point, descend


@dataclass(frozen=True, eq=False)
class Tuned:
    """The outcome of a tuning.

    Attributes:
        metric: Name of the metric.
        history: Gains that were reached one after the other, from those of the start on.
        chosen: Place in it of the best gains with which Drake's run has a smaller metric than
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
        """Whether the chosen gains are better than the gains of the start."""
        return self.chosen > 0


@checked(
    over=each(str),
    least=instance(str),
    between=instance(Mapping, None),
    duration=optional(number(above=0.0)),
    steps=whole(1),
    told=optional(function()),
)
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
    may be lower ones elsewhere. The gains suit this one run: its path, start, arm and noise.
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
    return Tuning(experiment, over, least, between=between, duration=duration).run(steps, told)


class Tuning:
    """A tuning that is checked and has not begun.

    Args:
        experiment, over, least, between, duration: See `tune`.

    Raises:
        InvalidInputError: As `tune` does.
    """

    def __init__(
        self,
        experiment: Described,
        over: Sequence[str],
        least: str,
        *,
        between: Mapping[str, Between] | None = None,
        duration: float | None = None,
    ) -> None:
        made = experiment if isinstance(experiment, Experiment) else load_experiment(experiment)
        tuned_on = made if duration is None else load_experiment(made, {"duration": duration})
        self._experiment, self._metric = made, least
        self._slopes = Slopes(tuned_on, over, least, rows=SHARES.size)
        start = self._slopes.start
        self._bounds = bounds_of(made, self._slopes.keys, start, between or {})

    def run(self, steps: int = 30, told: Callable[[Trial], None] | None = None) -> Tuned:
        """Tune; see `tune`."""
        if not isinstance(steps, int) or isinstance(steps, bool) or steps < 1:
            raise InvalidInputError(f"steps: must be a whole number of at least 1, not {steps!r}")
        before = simulate(self._experiment)
        low, high = self._bounds
        points = descend(
            self._of_logarithms,
            np.log(self._slopes.start),
            (np.log(low), np.log(high)),
            steps,
            lambda point: told(self._trial(point)) if told is not None else None,
        )
        history = tuple(self._trial(point) for point in points)
        chosen, stopped_by, after = choose(before, history, self._metric)
        keys = self._slopes.keys
        bounds = {k: (float(a), float(b)) for k, a, b in zip(keys, low, high, strict=True)}
        return Tuned(self._metric, history, chosen, stopped_by, bounds, before, after)

    def _of_logarithms(self, x: Array) -> tuple[Array, Array]:
        gains = np.exp(x)
        values, derivatives = self._slopes.at(gains)
        return values, derivatives * gains

    def _trial(self, point: Point) -> Trial:
        keys = self._slopes.keys
        gains = dict(zip(keys, np.exp(point.x).tolist(), strict=True))
        return Trial(gains, point.value, dict(zip(keys, point.slope.tolist(), strict=True)))

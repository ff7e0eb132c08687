"""Gains of a law tuned by descent along derivatives through the closed loop.

- Gains of a law tuned to make a metric of a whole run small, and verified by Drake.
- Choice among the gains of a history: the best that keep bounds, verified by Drake's runs.
- Descent in a few unknowns within bounds: quasi-Newton steps, several lengths tried at once.
- Bounds between which gains are tuned.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, sqrt
from numbers import Real

import numpy as np

from .batch import Slopes, run_many
from .errors import InvalidInputError, SimulationError, old_arguments
from .experiment import Arms, Experiment, ExperimentSource, expected_bounds, load_experiment
from .inputs.fields import Array, checked, each, function, instance, number, optional, whole
from .inputs.messages import decimal, short
from .runs import Result, simulate

# What was a module in this one until 0.3 is found under its name, see `moved_modules`.
__path__: list[str] = []

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
class _Candidate:
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
    if (after := _verify(before, history, metric, last)) is not None:
        return last, (), after
    places = np.arange(1, _BETWEEN * last + 1) / _BETWEEN
    candidates = _judge(before, history, metric, places)
    good = [each for each in candidates if not each.broken and each.value < before.metrics[metric]]
    for trial in sorted(good, key=lambda trial: trial.value):
        if (after := _verify(before, history, metric, trial.place)) is not None:
            return trial.place, _beyond(candidates, trial.place), after
    return 0.0, _beyond(candidates, 0.0), before


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


def format_gains(gains: Mapping[str, float]) -> dict[str, float]:
    """Return gains as they are written, with six digits."""
    return {key: float(f"{value:.6g}") for key, value in gains.items()}


def _judge(
    before: Result, history: Sequence[Trial], metric: str, places: Array
) -> list[_Candidate]:
    arms = Arms()
    experiments: dict[float, Experiment] = {}
    for place in places.tolist():
        gains = format_gains(gains_at(history, place))
        try:
            experiments[place] = load_experiment(before.experiment, gains, arms=arms)
        except InvalidInputError:
            # Gains that the law allows one by one, but not together.
            continue
    if not experiments:
        return []
    many = run_many(list(experiments.values()))
    candidates = []
    for row_number, place in enumerate(experiments):
        if many.status[row_number] != "complete":
            # Its metrics are those of a part of the run, whose errors have not grown yet.
            candidates.append(_Candidate(place, np.inf, ()))
            continue
        row = many.row(row_number)
        candidates.append(_Candidate(place, row.get(metric, np.inf), _broken_bounds(before, row)))
    return candidates


def _verify(before: Result, history: Sequence[Trial], metric: str, place: float) -> Result | None:
    """Return Drake's run with the gains at a place; None if it is not better than the start's."""
    gains = format_gains(gains_at(history, place))
    try:
        after = simulate(load_experiment(before.experiment, gains))
    except (InvalidInputError, SimulationError):
        # The law does not allow them together, or fails with them.
        return None
    better = after.metrics[metric] < before.metrics[metric] and not _broken_bounds(
        before, after.metrics
    )
    return after if better else None


def _broken_bounds(before: Result, metrics: Mapping[str, float]) -> tuple[str, ...]:
    """Return the metrics whose bounds are broken, of those that were kept before."""
    bounds = expected_bounds(before.experiment)
    names = (verdict.metric for verdict in before.verdicts if verdict.met)
    return tuple(n for n in names if n not in metrics or not bounds[n].holds(metrics[n]))


def _beyond(candidates: Sequence[_Candidate], place: float) -> tuple[str, ...]:
    return next((each.broken for each in candidates if each.place > place), ())


#: Lengths of a step that are tried side by side, as shares of the step.
SHARES = np.array([1.0, 0.3, 0.1, 0.01])
# Largest change of an unknown in a step; unknowns are logarithms, and this is a factor of 3.
_LONGEST = 1.1
# How much shorter steps are after none was good, and how often that may happen in a row.
_SHORTER, _TRIES = 1e-2, 2
# Share of a value below which its decrease over a few steps counts as none.
_LITTLE, _STEPS = 3e-2, 3

#: Values, shape (rows,), and slopes, shape (rows, k), of points, shape (rows, k).
Function = Callable[[Array], tuple[Array, Array]]


@dataclass(frozen=True)
class Point:
    """A point of a descent.

    Attributes:
        x: The unknowns, shape (k,).
        value: The value there.
        slope: Its slope, shape (k,).
    """

    x: Array
    value: float
    slope: Array


def descend(
    function: Function,
    start: Array,
    bounds: tuple[Array, Array],
    steps: int,
    tell: Callable[[Point], None],
) -> list[Point]:
    """Return the points of a descent from a start, each lower than the one before.

    Each step goes along the direction of Broyden, Fletcher, Goldfarb and Shanno, 1970, cut at the
    bounds, by the best of some lengths. If none is lower, steps get shorter along the slope itself.
    It ends when that does not help, when three steps gain less than 3 % of the value, or after a
    number of steps. Nothing is random.

    Args:
        function: The function to minimise. It is given as many points at once as there are
            `SHARES`; a point whose value is not finite is never taken.
        start: The first point, shape (k,), within the bounds.
        bounds: Lowest and highest unknowns, each of shape (k,).
        steps: Largest number of times that the function is asked.
        tell: Called with each new point.
    """
    here = _best(function, np.tile(start, (SHARES.size, 1)))
    points = [here]
    tell(here)
    inverse: Array | None = None
    scale, tries = 1.0, 0
    for _ in range(steps - 1):
        if (direction := _direction(here, inverse, bounds, scale)) is None:
            break
        candidates = np.clip(here.x + SHARES[:, np.newaxis] * direction, *bounds)
        there = _best(function, candidates)
        if not there.value < here.value:
            tries += 1
            if tries > _TRIES:
                break
            inverse, scale = None, scale * _SHORTER
            continue
        inverse = _update_inverse(inverse, there.x - here.x, there.slope - here.slope)
        here, scale, tries = there, 1.0, 0
        points.append(here)
        tell(here)
        before = points[max(0, len(points) - 1 - _STEPS)]
        if len(points) > _STEPS and before.value - here.value < _LITTLE * abs(before.value):
            break
    return points


def _best(function: Function, x: Array) -> Point:
    values, slopes = function(x)
    sound = np.isfinite(values) & np.isfinite(slopes).all(axis=1)
    best = int(np.argmin(np.where(sound, values, np.inf)))
    value = float(values[best]) if sound[best] else np.inf
    return Point(x[best], value, slopes[best])


def _direction(
    here: Point, inverse: Array | None, bounds: tuple[Array, Array], scale: float
) -> Array | None:
    """Return the longest step to try; None where no slope leads on within the bounds.

    Args:
        here: Where it begins.
        inverse: Inverse of the curvature, shape (k, k); None if it is unknown.
        bounds: Lowest and highest unknowns.
        scale: Share of the step.
    """
    low, high = bounds
    is_stuck = ((here.x <= low) & (here.slope > 0.0)) | ((here.x >= high) & (here.slope < 0.0))
    slope = np.where(is_stuck, 0.0, here.slope)
    if not slope.any():
        return None
    # As far as a step may go, unless the curvature says better.
    direction = -slope / np.abs(slope).max() * _LONGEST
    if inverse is not None:
        newton_step = -(inverse * np.outer(~is_stuck, ~is_stuck)) @ slope
        direction = newton_step if newton_step @ slope < 0.0 else direction
    longest = np.abs(direction).max()
    return np.asarray(direction * min(1.0, _LONGEST / longest) * scale)


def _update_inverse(inverse: Array | None, step: Array, change: Array) -> Array | None:
    """Return the inverse of the curvature, updated by the change of the slope over a step."""
    along = float(step @ change)
    if along <= 1e-12 * float(np.linalg.norm(step) * np.linalg.norm(change)):
        return inverse
    if inverse is None:
        inverse = along / float(change @ change) * np.eye(step.size)
    left = np.eye(step.size) - np.outer(step, change) / along
    return np.asarray(left @ inverse @ left.T + np.outer(step, step) / along)


#: Lowest and highest value of a gain.
Between = tuple[float, float]

# Factor from the start to a bound that is not given.
_FACTOR = 30.0
# How often the way to a value that the law refuses is halved.
_HALVES = 12


def parse_between(text: str) -> tuple[str, Between]:
    """Return key and bounds of ``KEY=LOW,HIGH``.

    Raises:
        InvalidInputError: If the text is not of this form.
    """
    key, _, values = text.partition("=")
    try:
        low, high = (decimal(value) for value in values.split(","))
    except ValueError:
        raise InvalidInputError(f"--between: must be KEY=LOW,HIGH, not {text!r}") from None
    return key.strip(), (low, high)


def bounds_of(
    experiment: Experiment,
    keys: Sequence[str],
    start: Array,
    between: Mapping[str, Between],
) -> tuple[Array, Array]:
    """Return the lowest and the highest gains, each of shape (keys,).

    Bounds that are not given are 30 times lower and higher than the start, or as far on the way
    there as the law allows with the other gains at the start.

    Args:
        experiment: The experiment.
        keys: Dotted keys of numbers of its law.
        start: Their values.
        between: Bounds by key.

    Raises:
        InvalidInputError: If a start is not greater than 0, or a bound is not one that the law
            allows, with the start between both.
    """
    if unknown := [key for key in between if key not in keys]:
        raise InvalidInputError(f"between: {unknown[0]} is not among {', '.join(keys)}")
    pairs = []
    for key, value in zip(keys, start.tolist(), strict=True):
        if not value > 0.0:
            raise InvalidInputError(
                f"{key}: must be greater than 0 to be tuned by factors, not {value:g}"
            )
        if key in between:
            pairs.append(_range_of(experiment, key, value, between[key]))
        else:
            low, high = value / _FACTOR, value * _FACTOR
            lowest = _farthest_allowed(experiment, key, value, low)
            pairs.append((lowest, _farthest_allowed(experiment, key, value, high)))
    return np.array([pair[0] for pair in pairs]), np.array([pair[1] for pair in pairs])


def _range_of(experiment: Experiment, key: str, start: float, pair: Between) -> Between:
    numbers = isinstance(pair, (list, tuple)) and len(pair) == 2
    numbers = numbers and all(isinstance(each, Real) and isfinite(each) for each in pair)
    if not numbers or not 0.0 < pair[0] < pair[1]:
        raise InvalidInputError(
            f"between: {key}: must be two numbers greater than 0, the lower one first, not "
            f"{short(pair)}"
        )
    if not pair[0] <= start <= pair[1]:
        raise InvalidInputError(
            f"between: {key}: must have the start, {start:g}, between both, not {short(pair)}"
        )
    for bound in pair:
        load_experiment(experiment, {key: float(bound)})
    return float(pair[0]), float(pair[1])


def _farthest_allowed(experiment: Experiment, key: str, start: float, end: float) -> float:
    """Return the value farthest on the way from a start to an end that the law allows."""
    if _allows(experiment, key, end):
        return end
    good, bad = start, end
    for _ in range(_HALVES):
        middle = sqrt(good * bad)
        if _allows(experiment, key, middle):
            good = middle
        else:
            bad = middle
    return good


def _allows(experiment: Experiment, key: str, value: float) -> bool:
    try:
        load_experiment(experiment, {key: value})
    except InvalidInputError:
        return False
    return True


@dataclass(frozen=True, eq=False)
class TuningOutcome:
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
        return format_gains(gains_at(self.history, self.chosen))

    @property
    def better(self) -> bool:
        """Whether the chosen gains are better than the gains of the start."""
        return self.chosen > 0


@old_arguments(told="progress")
@checked(
    over=each(str),
    least=instance(str),
    between=instance(Mapping, None),
    duration=optional(number(above=0.0)),
    steps=whole(1),
    progress=optional(function()),
)
def tune(
    experiment: ExperimentSource,
    over: Sequence[str],
    least: str,
    *,
    between: Mapping[str, Between] | None = None,
    duration: float | None = None,
    steps: int = 30,
    progress: Callable[[Trial], None] | None = None,
) -> TuningOutcome:
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
        progress: Called with the start and after each step that made the metric smaller.

    Raises:
        InvalidInputError: If JAX is not installed, the experiment cannot be run so, or a key, a
            metric or a bound is none.
    """
    return Tuning(experiment, over, least, between=between, duration=duration).run(steps, progress)


class Tuning:
    """A tuning that is checked and has not begun.

    Args:
        experiment, over, least, between, duration: See `tune`.

    Raises:
        InvalidInputError: As `tune` does.
    """

    def __init__(
        self,
        experiment: ExperimentSource,
        over: Sequence[str],
        least: str,
        *,
        between: Mapping[str, Between] | None = None,
        duration: float | None = None,
    ) -> None:
        base = experiment if isinstance(experiment, Experiment) else load_experiment(experiment)
        tuned_on = base if duration is None else load_experiment(base, {"duration": duration})
        self._experiment, self._metric = base, least
        self._slopes = Slopes(tuned_on, over, least, rows=SHARES.size)
        start = self._slopes.start
        self._bounds = bounds_of(base, self._slopes.keys, start, between or {})

    def run(
        self, steps: int = 30, progress: Callable[[Trial], None] | None = None
    ) -> TuningOutcome:
        """Tune; see `tune`."""
        if not isinstance(steps, int) or isinstance(steps, bool) or steps < 1:
            raise InvalidInputError(f"steps: must be a whole number of at least 1, not {steps!r}")
        before = simulate(self._experiment)
        low, high = self._bounds
        points = descend(
            self._checked_at_start(),
            np.log(self._slopes.start),
            (np.log(low), np.log(high)),
            steps,
            lambda point: progress(self._trial(point)) if progress is not None else None,
        )
        history = tuple(self._trial(point) for point in points)
        place, stopped_by, after = choose(before, history, self._metric)
        keys = self._slopes.keys
        bounds = {k: (float(a), float(b)) for k, a, b in zip(keys, low, high, strict=True)}
        return TuningOutcome(self._metric, history, place, stopped_by, bounds, before, after)

    def _checked_at_start(self) -> Function:
        """Return the function of logarithms, refused if it has no derivatives where it begins."""
        begun = False

        def function(x: Array) -> tuple[Array, Array]:
            nonlocal begun
            values, slopes = self._of_logarithms(x)
            if not begun:
                self._require_slopes(float(values[0]), slopes[0])
            begun = True
            return values, slopes

        return function

    def _require_slopes(self, value: float, slopes: Array) -> None:
        if not isfinite(value):
            raise InvalidInputError(
                f"{self._metric}: is {value:g} in the compiled run with the gains of the start; "
                "there is nothing to descend from"
            )
        pairs = zip(self._slopes.keys, np.isfinite(slopes), strict=True)
        if wrong := [key for key, finite in pairs if not finite]:
            raise InvalidInputError(
                f"{', '.join(wrong)}: the derivative of {self._metric} by it is not a number at "
                f"the start, where the value is {value:.4g}: the law, or a path or start on which "
                "it depends, has no slope there; drake-rnn sweep needs none"
            )

    def _of_logarithms(self, x: Array) -> tuple[Array, Array]:
        gains = np.exp(x)
        values, derivatives = self._slopes.at(gains)
        return values, derivatives * gains

    def _trial(self, point: Point) -> Trial:
        keys = self._slopes.keys
        gains = dict(zip(keys, np.exp(point.x).tolist(), strict=True))
        return Trial(gains, point.value, dict(zip(keys, point.slope.tolist(), strict=True)))

"""Derivatives of a run's metric with respect to gains, through the closed loop."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..arrays.jax_module import require_jax
from ..arrays.namespace import AnyArray
from ..errors import InvalidInputError
from ..experiment import Described, Experiment, load_experiment
from ..inputs.arguments import checked, each, instance, whole
from ..inputs.complaints import require_several, short
from ..inputs.dataclass_fields import fields_of
from ..inputs.fields import Array
from ..laws import SampledReading
from .compiled_runs import CompiledRuns
from .compiling import compiled_in_order

_LAW = "law."


@checked(keys=each(str), metric=instance(str))
def value_and_gradient(
    experiment: Described, keys: Sequence[str], metric: str
) -> tuple[float, dict[str, float]]:
    """Return a metric of a whole run and its derivatives with respect to numbers of the law.

    The run is that of the experiment, with its seed, compiled by JAX: the value equals that of
    `simulate` except for rounding. Derivatives are taken in forward mode, step by step through the
    closed loop. Where the law switches, e.g. at a bound, they are one-sided, on the side of the
    run. For several calls keep a `Slopes`. ::

        value, gradient = value_and_gradient(
            "slc_nephroid_known", ["law.kappa", "law.return_gain"], "position_error_rms_m"
        )

    Args:
        experiment: An experiment that `run_many` can run, or what `load_experiment` takes.
        keys: Dotted keys of numbers of the law, e.g. ``law.kappa``.
        metric: Name of the metric.

    Returns:
        The metric and, by key, its derivative.

    Raises:
        InvalidInputError: If JAX is not installed, the experiment cannot be run so, a key is no
            number of the law, or there is no such metric.
    """
    slopes = Slopes(experiment, keys, metric)
    value, slope = slopes.at(slopes.start[np.newaxis])
    return float(value[0]), dict(zip(slopes.keys, slope[0].tolist(), strict=True))


class Slopes:
    """A metric of an experiment as a function of gains, with its derivatives.

    Args:
        experiment: An experiment that `run_many` can run, or what `load_experiment` takes.
        keys: Dotted keys of numbers of the law, e.g. ``law.kappa``.
        metric: Name of the metric.
        rows: How many sets of gains are asked for at a time; they run side by side.

    Attributes:
        experiment: The experiment.
        keys: The keys.
        start: The experiment's own gains, shape (keys,).

    Raises:
        InvalidInputError: As `value_and_gradient` does.
    """

    @checked(keys=each(str), metric=instance(str), rows=whole(1, 1000))
    def __init__(
        self, experiment: Described, keys: Sequence[str], metric: str, rows: int = 1
    ) -> None:
        self._jax = require_jax()
        require_several("keys", keys)
        made = experiment if isinstance(experiment, Experiment) else load_experiment(experiment)
        self.experiment, self.keys, self._metric = made, tuple(keys), metric
        self._runs = CompiledRuns([made] * rows, [metric])
        self._fields = tuple(_field(key) for key in self.keys)
        if len(set(self.keys)) < len(self.keys) or not self.keys:
            raise InvalidInputError(f"keys: must be given, each once, not {short(list(keys))}")
        pairs = zip(self.keys, self._fields, strict=True)
        self.start = np.array([_number(made, key, field) for key, field in pairs])
        self._require_run_alone(self._runs.law)
        self._compiled = compiled_in_order(self._derived)

    def at(self, gains: Array) -> tuple[Array, Array]:
        """Return metrics, shape (rows,), and derivatives, shape (rows, keys).

        Args:
            gains: Sets of gains, shape (rows, keys). They are not checked against the law.

        Raises:
            InvalidInputError: If the gains have another shape, or the law needs to know one of the
                numbers before it runs.
        """
        if np.shape(gains) != (shape := (len(self._runs.experiments), len(self.keys))):
            raise InvalidInputError(f"gains: must have shape {shape}, not {np.shape(gains)}")
        try:
            values, slopes = self._compiled(np.asarray(gains, float).T, self._runs.table)
        except self._jax.errors.ConcretizationTypeError:
            raise InvalidInputError(
                f"keys: one of {', '.join(self.keys)} decides which way the program goes; there "
                "is no derivative with respect to it"
            ) from None
        return np.asarray(values), np.asarray(slopes).T

    def _derived(self, gains: AnyArray, table: Any) -> tuple[AnyArray, AnyArray]:
        def metric(gains: AnyArray) -> AnyArray:
            named = dict(zip(self._fields, gains, strict=True))
            return self._runs.of_gains(named, table)[self._metric]

        def along(direction: AnyArray) -> tuple[AnyArray, AnyArray]:
            value, slope = self._jax.jvp(metric, (gains,), (direction,))
            return value, slope

        # One gain of all rows at once: no row depends on the gains of another.
        each = np.eye(len(self.keys))[:, :, np.newaxis] * np.ones(gains.shape)
        derived: Any = self._jax.vmap(along, out_axes=(None, 0))(each)
        return derived[0], derived[1]

    def _require_run_alone(self, law: SampledReading) -> None:
        """Refuse numbers that the initial state depends on, since it is drawn before the run."""
        x = self._runs.start_of({})
        for key, field, value in zip(self.keys, self._fields, self.start, strict=True):
            if not np.array_equal(x, self._runs.start_of({field: 1.01 * float(value)})):
                raise InvalidInputError(
                    f"{key}: sets the law's initial state, through which there is no derivative"
                )


def _field(key: str) -> str:
    if not isinstance(key, str) or not key.startswith(_LAW) or key == _LAW:
        raise InvalidInputError(
            f"keys: must be numbers of the law, e.g. law.kappa, not {short(key)}"
        )
    return key.removeprefix(_LAW)


def _number(experiment: Experiment, key: str, field: str) -> float:
    """Return a number of the law by the name of its field."""
    value: Any = experiment.law
    for name in field.split("."):
        fields: Mapping[str, Any] = fields_of(value)
        if name not in fields:
            raise InvalidInputError(f"{key}: no such key of {type(experiment.law).__name__}")
        value = fields[name]
    if value is None or value == "none":
        raise InvalidInputError(f"{key}: is not given; give it a number to start from")
    if not isinstance(value, float):
        raise InvalidInputError(f"{key}: must be a number, not {short(value)}")
    return value

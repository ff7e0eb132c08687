"""The planner: rows of values, and the runs that they ask for.

- The document of a campaign: the experiment, what varies in it, and what the summary shows.
- The JSON schema of campaigns, for editors.
- How a key varies: over all values of a list or range, or drawn from a distribution.
"""

from __future__ import annotations

import json
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from itertools import product
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ..batch.grouping import BLOCK, why_not_arm, why_not_law
from ..diagrams import CAMPAIGNS
from ..errors import InvalidInputError
from ..experiment import (
    Arms,
    Experiment,
    ExperimentSource,
    Sections,
    document_class,
    load_experiment,
    read_document,
    read_sections,
    require_apart,
    require_distinct,
    require_none_lost,
    shipped_experiments,
)
from ..experiment.files import forget_files
from ..experiment.keys import CHANGES, KNOWN_CHANGES, OpenFields, experiment_definitions
from ..inputs.documents import (
    construct,
    read_named,
    require_folder_name,
    without_extensions,
    without_kind,
)
from ..inputs.fields import Array, Count, Finite, FiniteEach, Positive, Seed, Whole, validated
from ..inputs.files import is_file
from ..inputs.keys import Meaning, Schema, of_kinds, whole_document, with_kind
from ..inputs.kinds import look_beside
from ..inputs.messages import given_twice, nearest, plain, require_type, short
from ..measures import METRICS
from ..runs.simulation import check_experiment, effort_of, require_effort
from .pool import kind_of
from .requests import Method, RunRequest, request_of


class Axis(ABC):
    """Values that are all run, in combination with the values of the other keys."""

    @abstractmethod
    def values_in_order(self) -> list[Any]:
        """Return the values, in their order."""

    @property
    @abstractmethod
    def size(self) -> int:
        """Number of values, known without listing them."""

    @property
    def is_distinct(self) -> bool:
        """Whether no value can come twice, known without listing them."""
        return False


class Distribution(ABC):
    """Values that are drawn, one for each sample."""

    @abstractmethod
    def draw(self, rng: np.random.Generator) -> Any:
        """Return one value as plain data.

        Args:
            rng: Random generator of this value alone.
        """


@validated
class Values(Axis):
    """Values that are given one by one."""

    values: Annotated[list[Any], Meaning("The values.")]

    def __post_init__(self) -> None:
        if not self.values:
            raise ValueError("values: must not be empty")

    def values_in_order(self) -> list[Any]:
        return self.values

    @property
    def size(self) -> int:
        return len(self.values)


@validated
class Range(Axis):
    """Values at equal distances, or in equal ratios."""

    low: Annotated[Whole | Finite, Meaning("First value.")]
    high: Annotated[Whole | Finite, Meaning("Last value.")]
    count: Annotated[
        Count,
        Meaning(
            "Number of values. The values are whole numbers if ``low``, ``high`` and the "
            "distance between two values are.",
        ),
    ]
    spacing: Annotated[
        Literal["linear", "log"],
        Meaning("``linear`` for equal distances, ``log`` for equal ratios."),
    ] = "linear"

    def __post_init__(self) -> None:
        if not self.low <= self.high:
            raise ValueError(f"high: must be at least low, {self.low:g}, not {self.high:g}")
        if self.spacing == "log" and self.low <= 0:
            raise ValueError(f"low: must be greater than 0 with log spacing, not {self.low:g}")

    def values_in_order(self) -> list[Any]:
        low, high, steps = self.low, self.high, max(self.count - 1, 1)
        if self.spacing == "log":
            return [float(v) for v in np.geomspace(low, high, self.count)]
        if isinstance(low, int) and isinstance(high, int) and (high - low) % steps == 0:
            return [low + (high - low) // steps * k for k in range(self.count)]
        return [float(v) for v in np.linspace(low, high, self.count)]

    @property
    def size(self) -> int:
        return self.count

    @property
    def is_distinct(self) -> bool:
        return self.low < self.high


@validated
class Grid:
    """A section of a document, some keys of which have several values."""

    fixed: Annotated[dict[str, Any], Meaning("Keys that have one value.")]
    over: Annotated[
        dict[str, list[Any]],
        Meaning(
            "Values of the other keys, by key; all combinations are run, the last key fastest.",
        ),
    ] = Field(default_factory=dict)

    def __post_init__(self) -> None:
        for key, values in self.over.items():
            if key in self.fixed:
                raise ValueError(f"over.{key}: is also in fixed; it cannot be both")
            if not values:
                raise ValueError(f"over.{key}: must have one value or more, not []")

    def values_in_order(self) -> list[dict[str, Any]]:
        """Return the sections, in their order."""
        combinations = product(*self.over.values())
        return [{**self.fixed, **dict(zip(self.over, each, strict=True))} for each in combinations]


@validated
class Grids(Axis):
    """Sections of a document, one grid of them after the other.

    So laws are varied, each with gains of its own.
    """

    of: Annotated[list[Grid], Meaning("The grids.")]

    def __post_init__(self) -> None:
        if not self.of:
            raise ValueError("of: must not be empty")

    def values_in_order(self) -> list[Any]:
        return [section for grid in self.of for section in grid.values_in_order()]

    @property
    def size(self) -> int:
        return sum(math.prod(map(len, grid.over.values())) for grid in self.of)


_About = Annotated[
    Literal["home"] | None,
    Meaning(
        "``home`` for draws of ``start`` that are added to the arm's home; a number is then one "
        "for each joint.",
    ),
]


@validated
class Uniform(Distribution):
    """A number, or each entry of a list, that is uniform between two bounds."""

    low: Annotated[FiniteEach, Meaning("The bounds, each a number or one for each entry.")]
    high: Annotated[FiniteEach, Meaning("The bounds, each a number or one for each entry.")]
    about: _About = None

    def __post_init__(self) -> None:
        _require_order(self.low, self.high)

    def draw(self, rng: np.random.Generator) -> Any:
        return _plain(rng.uniform(self.low, self.high))

    def around(self, center: Array) -> Uniform:
        """Return the distribution moved by a center, shape (n,)."""
        return Uniform(low=_moved(self.low, center, "low"), high=_moved(self.high, center, "high"))


@validated
class LogUniform(Distribution):
    """A number, or each entry of a list, whose logarithm is uniform."""

    low: Annotated[
        FiniteEach,
        Meaning("Bounds, greater than 0, each a number or one for each entry."),
    ]
    high: Annotated[
        FiniteEach,
        Meaning("Bounds, greater than 0, each a number or one for each entry."),
    ]

    def __post_init__(self) -> None:
        if not np.all(np.asarray(self.low) > 0):
            raise ValueError(f"low: must be greater than 0, not {short(self.low)}")
        _require_order(self.low, self.high)

    def draw(self, rng: np.random.Generator) -> Any:
        return _plain(np.exp(rng.uniform(np.log(self.low), np.log(self.high))))


@validated
class Normal(Distribution):
    """A number, or each entry of a list, from a normal distribution."""

    mean: Annotated[FiniteEach, Meaning("Mean, a number or one for each entry.")]
    deviation: Annotated[FiniteEach, Meaning("Standard deviation, a number or one for each entry.")]
    about: _About = None

    def __post_init__(self) -> None:
        _require_sizes(self.mean, self.deviation, "mean", "deviation")
        if not np.all(np.asarray(self.deviation) >= 0):
            raise ValueError(f"deviation: must be at least 0, not {short(self.deviation)}")

    def draw(self, rng: np.random.Generator) -> Any:
        return _plain(rng.normal(self.mean, self.deviation))

    def around(self, center: Array) -> Normal:
        """Return the distribution moved by a center, shape (n,)."""
        mean = _moved(self.mean, center, "mean")
        _moved(self.deviation, center, "deviation")
        return Normal(mean=mean, deviation=self.deviation)


@validated
class Integers(Distribution):
    """A whole number between two bounds, all equally likely."""

    low: Annotated[Whole, Meaning("The bounds, both included.")]
    high: Annotated[Whole, Meaning("The bounds, both included.")]

    def __post_init__(self) -> None:
        if not -(2**62) <= self.low <= self.high <= 2**62:
            raise ValueError(f"high: must be at least low, {self.low}, not {self.high}")

    def draw(self, rng: np.random.Generator) -> Any:
        return int(rng.integers(self.low, self.high, endpoint=True))


@validated
class Choice(Distribution):
    """One of some values."""

    values: Annotated[list[Any], Meaning("The values.")]
    weights: Annotated[
        list[Positive] | None,
        Meaning("Relative probabilities of the values; equal by default."),
    ] = None

    def __post_init__(self) -> None:
        if not self.values:
            raise ValueError("values: must not be empty")
        if self.weights is not None and len(self.weights) != len(self.values):
            raise ValueError(
                f"weights: must have {len(self.values)} entries, one per value, "
                f"not {len(self.weights)}"
            )

    def draw(self, rng: np.random.Generator) -> Any:
        if self.weights is None:
            return self.values[int(rng.integers(len(self.values)))]
        ends = np.cumsum(self.weights)
        return self.values[int(np.searchsorted(ends, rng.uniform(0.0, ends[-1]), "right"))]


#: Classes of variations, by ``kind``.
VARIATIONS: dict[str, type[Axis] | type[Distribution]] = {
    "values": Values,
    "range": Range,
    "grids": Grids,
    "uniform": Uniform,
    "log_uniform": LogUniform,
    "normal": Normal,
    "integers": Integers,
    "choice": Choice,
}


def variation_of(section: Any, place: str) -> Axis | Distribution:
    """Return the variation that a section of ``vary`` describes.

    Args:
        section: The section: a list of values, or a mapping with a ``kind``.
        place: Key of the section, for messages.

    Raises:
        InvalidInputError: If a key is wrong, missing or unknown.
    """
    if isinstance(section, list):
        section = {"kind": "values", "values": section}
    if not isinstance(section, Mapping):
        raise InvalidInputError(
            f"{place}: must be a list of values, or a mapping with a kind, not {short(section)}"
        )
    kind = section.get("kind")
    if kind not in VARIATIONS:
        may_be = nearest(str(kind), list(VARIATIONS))
        raise InvalidInputError(f"{place}.kind: no such kind, {kind!r}; {may_be}")
    return construct(VARIATIONS[kind], without_kind(section), place)


def _moved(bound: float | Array, center: Array, name: str) -> Array:
    """Return a bound beside a center, shape (n,), as one for each of its entries."""
    if np.ndim(bound) and np.size(bound) != center.size:
        raise InvalidInputError(
            f"vary.start.{name}: must be a number or have {center.size} entries, one per joint, "
            f"not {np.size(bound)}"
        )
    return center + np.asarray(bound)


def _require_order(low: float | Array, high: float | Array) -> None:
    _require_sizes(low, high, "low", "high")
    if not np.all(np.asarray(low) <= np.asarray(high)):
        raise ValueError(f"high: must be at least low, {short(low)}, not {short(high)}")
    with np.errstate(over="ignore"):
        distance = np.asarray(high) - np.asarray(low)
    if not np.all(np.isfinite(distance)):
        raise ValueError("high: is too far from low for a number")


def _require_sizes(first: float | Array, second: float | Array, *names: str) -> None:
    sizes = {np.size(value) for value in (first, second) if np.ndim(value)}
    if len(sizes) > 1:
        raise ValueError(f"{names[1]}: must have as many entries as {names[0]}")


def _plain(value: Any) -> Any:
    plain = np.asarray(value, dtype=float).tolist()
    if isinstance(plain, float) and not math.isfinite(plain):
        raise InvalidInputError("vary: drew a number that is not finite")
    return plain


_Share = Annotated[float, Field(strict=True, gt=0, lt=1)]
#: Largest number of rows of a campaign; each row is a file while the campaign runs.
MOST_ROWS = 1_000_000


@validated
class StatisticsSettings:
    """Settings of a campaign's summary."""

    quantiles: Annotated[
        list[_Share],
        Meaning("Quantiles of each metric."),
    ] = Field(default_factory=lambda: [0.05, 0.5, 0.95])
    worst: Annotated[
        int,
        Field(strict=True, ge=0),
        Meaning("Number of the worst runs that are listed for each metric."),
    ] = 5
    confidence: Annotated[
        _Share,
        Meaning("Probability with which an interval covers the true value."),
    ] = 0.95


@validated
class CampaignDocument:
    """Everything that a campaign depends on, as plain data."""

    name: Annotated[str, Meaning("Name of the campaign; by default the file's name.")] = ""
    expect: Annotated[str, Meaning("Expected outcome, in one sentence.")] = ""
    experiment: Annotated[
        str | dict[str, Any],
        Meaning("Experiment that is run: a shipped name, a YAML file or a document."),
    ]
    changes: Annotated[
        dict[str, Any],
        Meaning("Changes of the experiment by dotted key, the same in each run."),
    ] = Field(default_factory=dict)
    vary: Annotated[
        dict[str, Any],
        Meaning(
            "What varies, by dotted key: a list of values, or a ``kind`` and its fields. Lists "
            "and ranges are run in all combinations; distributions are drawn from.",
        ),
    ]
    together: Annotated[
        list[list[str]],
        Meaning("Groups of keys whose lists or ranges advance together instead of being combined."),
    ] = Field(default_factory=list)
    samples: Annotated[
        Count | None,
        Meaning("Number of draws of all distributions, for each combination."),
    ] = None
    seed: Annotated[Seed, Meaning("Seed of the draws.")] = 0
    metrics: Annotated[
        list[str],
        Meaning(
            "Metrics of the table and the summary; by default all in the table, and in the "
            "summary those that vary.",
        ),
    ] = Field(default_factory=list)
    statistics: Annotated[
        StatisticsSettings,
        Meaning("Settings of the summary."),
    ] = Field(default_factory=StatisticsSettings)
    method: Annotated[
        Literal["auto", "simulate", "batch"],
        Meaning(
            "How runs are carried out: ``auto``, in a batch of runs side by side where a batch "
            "can run them, otherwise by `simulate`; ``batch``, refused where it cannot; or "
            "``simulate``.",
        ),
    ] = "auto"

    def __post_init__(self) -> None:
        require_folder_name("name", self.name)
        for metric in self.metrics:
            if metric not in METRICS.names:
                raise ValueError(
                    f"metrics: no metric {metric!r}; {nearest(metric, list(METRICS.names))}"
                )
        if not self.vary:
            raise ValueError("vary: must name what varies")
        for key in self.vary:
            if key in self.changes:
                raise ValueError(f"vary.{key}: is also in changes; it cannot be both")
        require_none_lost({**self.changes, **self.vary}, "vary")
        require_apart(self.vary, "vary")
        self._check_samples()
        self._check_together()
        if self.count > MOST_ROWS:
            raise ValueError(f"vary: makes {self.count} rows; there may be {MOST_ROWS}")
        self._check_steps()

    def _check_samples(self) -> None:
        if self.distributions and self.samples is None:
            raise ValueError(
                f"samples: must be given, as {next(iter(self.distributions))} is drawn"
            )
        if not self.distributions and self.samples is not None:
            raise ValueError("samples: must be left out, as nothing is drawn")
        for key, one in self.distributions.items():
            if key != "start" and isinstance(one, (Uniform, Normal)) and one.about is not None:
                raise ValueError(f"vary.{key}.about: only draws of start may be about home")

    def _check_together(self) -> None:
        keys = [key for group in self.together for key in group]
        for key in keys:
            if key not in self.axes:
                raise ValueError(
                    f"together: {key!r} must be a key of vary with a list or a range of values"
                )
        if (twice := given_twice(keys)) is not None:
            raise ValueError(f"together: {twice!r} is given twice")
        for group in self.together:
            counts = {key: self.axes[key].size for key in group}
            if len(set(counts.values())) > 1:
                text = ", ".join(f"{key} has {count}" for key, count in counts.items())
                raise ValueError(f"together: must have as many values as one another; {text}")

    def _check_steps(self) -> None:
        """Raise an InvalidInputError if a value, or values that advance together, come twice."""
        axes = self.axes
        for group in self.groups:
            if any(axes[key].is_distinct for key in group):
                continue
            values = [axes[key].values_in_order() for key in group]
            steps = values[0] if len(group) == 1 else list(zip(*values, strict=True))
            require_distinct(f"vary.{' and '.join(group)}", steps)

    @property
    def variations(self) -> dict[str, Axis | Distribution]:
        """What each varied key takes its values from."""
        return {key: variation_of(section, f"vary.{key}") for key, section in self.vary.items()}

    @property
    def axes(self) -> dict[str, Axis]:
        """The keys whose values are all run."""
        return {key: one for key, one in self.variations.items() if isinstance(one, Axis)}

    @property
    def distributions(self) -> dict[str, Distribution]:
        """The keys whose values are drawn."""
        return {key: one for key, one in self.variations.items() if isinstance(one, Distribution)}

    @property
    def groups(self) -> list[list[str]]:
        """The keys of `axes`, those that are walked together in one group."""
        group_of = {key: group for group in self.together for key in group}
        groups = [group_of.get(key, [key]) for key in self.axes]
        return [group for k, group in enumerate(groups) if group not in groups[:k]]

    @property
    def count(self) -> int:
        """Number of rows."""
        axes = self.axes
        return math.prod(axes[group[0]].size for group in self.groups) * (self.samples or 1)


def shipped_campaigns() -> list[str]:
    """Return the names of the shipped campaigns."""
    return sorted(file.stem for file in CAMPAIGNS.glob("*.yaml"))


def read_campaign(
    campaign: str | Path | Mapping[str, Any] | CampaignDocument, **changes: Any
) -> CampaignDocument:
    """Return the document of a campaign, checked.

    Args:
        campaign: A name from `shipped_campaigns`, a YAML file, or a document.
        changes: New values of its keys.

    Raises:
        InvalidInputError: If there is no such campaign, or a key is wrong.
    """
    require_type("campaign", campaign, str, Path, Mapping, CampaignDocument)
    if isinstance(campaign, CampaignDocument):
        return campaign
    if isinstance(campaign, Mapping):
        contents = without_extensions(campaign)
    else:
        contents = _read(str(campaign))
    contents |= changes
    return construct(CampaignDocument, contents, "")


def _read(name: str) -> dict[str, Any]:
    files = {file.stem: file for file in CAMPAIGNS.glob("*.yaml")}
    contents, file = read_named(name, files, "campaign", CampaignDocument)
    look_beside(contents, file.resolve().parent)
    experiment = contents.get("experiment")
    if isinstance(experiment, str) and is_file(file.parent / experiment):
        # Relative to the campaign, as files in an experiment are relative to it.
        contents["experiment"] = str((file.parent / experiment).resolve())
    return {**contents, "name": contents.get("name") or file.stem}


# Changes that may name a class of a user's own, which has keys of its own.
_MAY_BE_OWN = [key for name in ("law", "path", "environment") for key in (name, f"{name}.kind")]
_VARIATION = {"$ref": "#/$defs/variation"}


def campaign_schema() -> Schema:
    """Return the JSON schema of a campaign's document."""
    names_schema: Schema = {"enum": shipped_experiments()}
    open_fields: OpenFields = {
        (CampaignDocument, "experiment"): {
            "anyOf": [
                names_schema,
                {"type": "string", "pattern": r"\.ya?ml$"},
                {"$ref": "#/$defs/ExperimentDocument"},
            ]
        },
        (CampaignDocument, "changes"): CHANGES,
        (CampaignDocument, "vary"): {"allOf": [CHANGES], "additionalProperties": _VARIATION},
        (CampaignDocument, "metrics"): {"type": "array", "items": {"enum": [*METRICS.names]}},
    }
    definitions = experiment_definitions(open_fields, CampaignDocument, *VARIATIONS.values())
    for kind, cls in VARIATIONS.items():
        with_kind(definitions[cls.__name__], kind)
    refs: dict[str, Schema] = {
        kind: {"$ref": f"#/$defs/{cls.__name__}"} for kind, cls in VARIATIONS.items()
    }
    list_schema: Schema = {"type": "array", "minItems": 1}
    definitions["variation"] = {"anyOf": [list_schema, of_kinds(refs, VARIATIONS, own=False)]}
    document = definitions.pop("CampaignDocument")
    own: Any = {"anyOf": [{"required": [key]} for key in _MAY_BE_OWN]}
    document["if"] = {
        "required": ["experiment"],
        "properties": {"experiment": names_schema, "changes": {"not": own}, "vary": {"not": own}},
    }
    document["then"] = {"properties": {"changes": KNOWN_CHANGES, "vary": KNOWN_CHANGES}}
    return whole_document(document, "A campaign of drake_rnn", definitions)


@dataclass(frozen=True)
class Plan:
    """The runs of a campaign or a sweep.

    Attributes:
        campaign: Document of the campaign; of a sweep, one whose axes are lists.
        experiment: Contents of the experiment's document, with the changes that all rows share.
        rows: The request of each row, whose ``changes`` are the values of the varied keys. Rows
            with the same values have the same key.
        time: Estimated time of all runs one after another, within a factor of a few [s].
    """

    campaign: CampaignDocument
    experiment: dict[str, Any]
    rows: list[RunRequest]
    time: float


#: Time to load, check and evaluate a run of any length [s], by its method.
_EACH = {"simulate": 0.1, "batch": 0.01}
#: Time of a step of a batch, however few runs are side by side, and what each run adds [s].
_BATCH_STEP, _STEP = 6e-4, 6e-6


def plan_campaign(
    campaign: CampaignDocument, changes: Mapping[str, Any] | None = None, *, anyway: bool = False
) -> Plan:
    """Return the runs of a campaign, with the document of each row checked.

    The first row is checked as a whole; in the other rows, each section is checked by itself. A
    fault that shows only when the run starts, such as a path out of reach, becomes a row.

    Args:
        campaign: The campaign.
        changes: Further changes of the experiment, by dotted key.
        anyway: Whether a run may take any number of steps.

    Raises:
        InvalidInputError: If a row is no valid experiment, or a run would take too many steps.
    """
    for key in changes or {}:
        if key in campaign.vary:
            raise InvalidInputError(f"--set: {key!r} varies in this campaign; it cannot be both")
    require_none_lost({**(changes or {}), **campaign.vary}, "--set")
    base = shared_document(campaign.experiment, {**campaign.changes, **(changes or {})})
    arms, rows, time = Arms(), [], 0.0
    steps_of_kinds: dict[str, list[float]] = {}

    for number, values in enumerate(row_values(campaign, _homes(base, arms))):
        try:
            if number == 0:
                load_experiment(base, values)
            contents = read_document(base, values)
            parts = read_sections(construct(document_class(contents), contents, ""), arms)
            effort = effort_of(parts.document)
            if not anyway:
                require_effort(effort, parts.document.duration)
            method = _choose(campaign.method, parts, arms)
        except InvalidInputError as error:
            raise InvalidInputError(f"{error} (row {number})") from None
        rows.append(request_of(contents, anyway=anyway, method=method, changes=values))
        time += _EACH[method] + (0.0 if method == "batch" else effort.time)
        if method == "batch":
            steps_of_kinds.setdefault(kind_of(rows[-1]), []).append(effort.steps)
    return Plan(campaign, base, rows, time + sum(map(_time_of_batch, steps_of_kinds.values())))


def _homes(base: Mapping[str, Any], arms: Arms) -> Callable[[Mapping[str, Any]], Array]:
    """Return a function from a row's values to the home of its arm, shape (n,)."""

    def home_of(values: Mapping[str, Any]) -> Array:
        contents = read_document(base, values)
        arm = arms.of(construct(document_class(contents), contents, "").arm)
        if arm.home is None:
            raise InvalidInputError(f"vary.start.about: {arm.name} has no home; give arm.home")
        return arm.home

    return home_of


def _time_of_batch(steps: Sequence[float]) -> float:
    """Return the time that runs of one kind take side by side [s]; arguments are their steps."""
    blocks = math.ceil(len(steps) / BLOCK)
    return _BATCH_STEP * max(steps) * blocks + _STEP * sum(steps)


def plan_sweep(
    experiment: ExperimentSource,
    over: Mapping[str, Sequence[Any]],
    changes: Mapping[str, Any] | None = None,
    *,
    anyway: bool = False,
) -> Plan:
    """Return the runs of a sweep: a campaign over lists, in which each row is checked as a whole.

    Args:
        experiment: A shipped name, a YAML file, a document or an experiment.
        over: Values to run, by dotted key.
        changes: New values of other keys, the same in each run.
        anyway: Whether a run may take any number of steps.

    Raises:
        InvalidInputError: If a combination is not a valid experiment, a path is out of reach, or a
            key is both swept and changed.
    """
    _check_lists(over)
    changes = changes or {}
    if both := sorted(over.keys() & changes.keys()):
        raise InvalidInputError(f"--over: {both[0]!r} is also set; it cannot be both")
    require_none_lost({**changes, **over}, "--over")
    require_apart(over, "--over")
    base = shared_document(experiment, changes)
    lists = {key: list(values) for key, values in over.items()}
    document = {"experiment": base, "vary": lists, "method": "simulate"}
    campaign = construct(CampaignDocument, document, "")
    arms, paths, rows, time = Arms(), set[str](), [], 0.0
    for values in row_values(campaign):
        row_experiment = load_experiment(base, values, arms=arms)
        # Following a path takes most of the time, and most combinations share one path.
        path = _path_text(row_experiment)
        check_experiment(row_experiment, anyway, in_reach=path in paths)
        paths.add(path)
        contents = read_document(base, values)
        rows.append(request_of(contents, anyway=anyway, learning=True, changes=values))
        time += effort_of(row_experiment.document).time
    return Plan(campaign, base, rows, time)


def _check_lists(over: Mapping[str, Sequence[Any]]) -> None:
    """Raise an InvalidInputError unless each key has values, none of them twice."""
    require_type("over", over, Mapping)
    if not over:
        raise InvalidInputError("over: must have one key or more, not {}")
    for key, values in over.items():
        if not isinstance(key, str):
            raise InvalidInputError(f"over: keys must be dotted keys, e.g. law.kappa, not {key!r}")
        require_type(f"over.{key}", values, list, tuple)
        if not values:
            raise InvalidInputError(f"over.{key}: must have one value or more, not []")
        require_distinct(f"over.{key}", values)


#: Keys that decide whether a path is in reach, besides whether the law holds the orientation.
_REACH = ("arm", "task", "path", "level", "environment", "force", "start", "duration")


def _path_text(experiment: Experiment) -> str:
    contents = experiment.document.contents()
    parts = [*(contents.get(key) for key in _REACH), experiment.holds_orientation]
    return json.dumps(parts, default=repr)


def _choose(method: str, parts: Sections, arms: Arms) -> Method:
    """Return what carries out a run, chosen by its document alone.

    Raises:
        InvalidInputError: If a batch is asked for and cannot carry it out.
    """
    if method == "simulate":
        return "simulate"
    reason = why_not_law(parts.document, parts.law) or arms.share(
        "why not", _joints_of(parts.document.arm), lambda: why_not_arm(parts.arm)
    )
    if reason is not None and method == "batch":
        raise InvalidInputError(f"method: may not be batch here; {reason}")
    return "batch" if reason is None else "simulate"


def _joints_of(arm: str | Mapping[str, Any]) -> Any:
    """Return what a document says about an arm, without the errors of its links."""
    if isinstance(arm, str):
        return arm
    return {key: value for key, value in arm.items() if key != "link_errors"}


def shared_document(experiment: ExperimentSource, changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the contents of a document with the changes that all rows share, as plain data."""
    forget_files()
    contents: dict[str, Any] = plain(read_document(experiment, changes))
    return contents


def row_values(
    campaign: CampaignDocument, home_of: Callable[[Mapping[str, Any]], Array] | None = None
) -> Iterator[dict[str, Any]]:
    """Yield the values of the varied keys of each row, the last list fastest, then the samples.

    The same sample draws the same values in each combination, so that combinations can be compared
    draw by draw. Values depend on the seed, the key and the number of the sample alone; those
    about home on the arm, too.

    Args:
        campaign: The campaign.
        home_of: Returns the home of the arm, shape (n,), where a row's other values are given;
            needed where draws are about home.
    """
    axes, groups, distributions = campaign.axes, campaign.groups, campaign.distributions
    start = distributions.get("start")
    about_home = start if isinstance(start, (Uniform, Normal)) and start.about else None
    if about_home is not None:
        del distributions["start"]
    steps = [
        list(zip(*(axes[key].values_in_order() for key in group), strict=True)) for group in groups
    ]
    samples = [
        {key: _draw(one, campaign.seed, key, k) for key, one in distributions.items()}
        for k in range(campaign.samples or 1)
    ]
    for combination in product(*steps):
        selection: dict[str, Any] = {}
        for group, values in zip(groups, combination, strict=True):
            selection |= zip(group, values, strict=True)
        for k, sample in enumerate(samples):
            every = selection | sample
            if about_home is not None and home_of is not None:
                one = about_home.around(home_of(every))
                every["start"] = _draw(one, campaign.seed, "start", k)
            yield {key: every[key] for key in campaign.vary}


def _draw(distribution: Distribution, seed: int, key: str, sample: int) -> Any:
    words = np.frombuffer(sha256(key.encode()).digest()[:16], dtype=np.uint32)
    sequence = np.random.SeedSequence(seed, spawn_key=(*map(int, words), sample))
    return distribution.draw(np.random.default_rng(sequence))

"""The document of a campaign: the experiment, what varies in it, and what the summary shows.

The JSON schema of campaigns, for editors.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from ..diagrams import CAMPAIGNS
from ..experiment import require_apart, require_distinct, require_none_lost, shipped_experiments
from ..experiment.keys import CHANGES, KNOWN_CHANGES, OpenFields, experiment_definitions
from ..inputs.documents import construct, read_named, require_folder_name, without_extensions
from ..inputs.fields import Count, Seed, validated
from ..inputs.files import is_file
from ..inputs.keys import Meaning, Schema, of_kinds, whole_document, with_kind
from ..inputs.messages import nearest, require_type
from ..measures import METRICS
from .variation import VARIATIONS, Axis, Distribution, variation_of

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

    def _check_together(self) -> None:
        named = [key for group in self.together for key in group]
        for key in named:
            if key not in self.axes:
                raise ValueError(
                    f"together: {key!r} must be a key of vary with a list or a range of values"
                )
            if named.count(key) > 1:
                raise ValueError(f"together: {key!r} is given twice")
        for group in self.together:
            counts = {key: self.axes[key].size for key in group}
            if len(set(counts.values())) > 1:
                told = ", ".join(f"{key} has {count}" for key, count in counts.items())
                raise ValueError(f"together: must have as many values as one another; {told}")

    def _check_steps(self) -> None:
        """Raise an InvalidInputError if a value, or values that advance together, come twice."""
        axes = self.axes
        for group in self.groups:
            if any(axes[key].is_distinct for key in group):
                continue
            listed = [axes[key].listed() for key in group]
            steps = listed[0] if len(group) == 1 else list(zip(*listed, strict=True))
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
        named = {key: group for group in self.together for key in group}
        groups = [named.get(key, [key]) for key in self.axes]
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
    shipped = {file.stem: file for file in CAMPAIGNS.glob("*.yaml")}
    contents, file = read_named(name, shipped, "campaign", CampaignDocument)
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
    shipped: Schema = {"enum": shipped_experiments()}
    open_fields: OpenFields = {
        (CampaignDocument, "experiment"): {
            "anyOf": [
                shipped,
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
    listed: Schema = {"type": "array", "minItems": 1}
    definitions["variation"] = {"anyOf": [listed, of_kinds(refs, VARIATIONS, own=False)]}
    document = definitions.pop("CampaignDocument")
    own: Any = {"anyOf": [{"required": [key]} for key in _MAY_BE_OWN]}
    document["if"] = {
        "required": ["experiment"],
        "properties": {"experiment": shipped, "changes": {"not": own}, "vary": {"not": own}},
    }
    document["then"] = {"properties": {"changes": KNOWN_CHANGES, "vary": KNOWN_CHANGES}}
    return whole_document(document, "A campaign of drake_rnn", definitions)

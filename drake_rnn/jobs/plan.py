"""The planner: rows of values, and the runs that they ask for."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from itertools import product
from typing import Any

import numpy as np

from ..batch.grouping import why_not_arm, why_not_law
from ..errors import InvalidInputError
from ..experiment import (
    Arms,
    Described,
    Experiment,
    Sections,
    document_class,
    load_experiment,
    read_document,
    read_sections,
    require_apart,
    require_distinct,
    require_none_lost,
)
from ..experiment.fingerprint import forget_files
from ..inputs.documents import construct
from ..inputs.messages import plain, require_type
from ..runs.simulation import check_experiment, effort_of, require_effort
from .document import CampaignDocument
from .requests import Method, RunRequest, request_of
from .variation import Distribution


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
#: Time of a step of a run in a batch [s].
_STEP = 3e-6


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
    for number, values in enumerate(row_values(campaign)):
        try:
            if number == 0:
                load_experiment(base, values)
            contents = read_document(base, values)
            parts = read_sections(construct(document_class(contents), contents, ""), arms)
            effort = effort_of(parts.document)
            if not anyway:
                require_effort(effort, parts.document.duration)
            method = _chosen(campaign.method, parts, arms)
        except InvalidInputError as error:
            raise InvalidInputError(f"{error} (row {number})") from None
        rows.append(request_of(contents, anyway=anyway, method=method, changes=values))
        time += _EACH[method] + (_STEP * effort.steps if method == "batch" else effort.time)
    return Plan(campaign, base, rows, time)


def plan_sweep(
    experiment: Described,
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
    arms, followed, rows, time = Arms(), set[str](), [], 0.0
    for values in row_values(campaign):
        loaded = load_experiment(base, values, arms=arms)
        # Following a path takes most of the time, and most combinations share one path.
        path = _path_text(loaded)
        check_experiment(loaded, anyway, in_reach=path in followed)
        followed.add(path)
        contents = read_document(base, values)
        rows.append(request_of(contents, anyway=anyway, learning=True, changes=values))
        time += effort_of(loaded.document).time
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
    told = [*(contents.get(key) for key in _REACH), experiment.holds_orientation]
    return json.dumps(told, default=repr)


def _chosen(asked: str, parts: Sections, arms: Arms) -> Method:
    """Return what carries out a run, chosen by its document alone.

    Raises:
        InvalidInputError: If a batch is asked for and cannot carry it out.
    """
    if asked == "simulate":
        return "simulate"
    reason = why_not_law(parts.document, parts.law) or arms.shared(
        "why not", _joints_of(parts.document.arm), lambda: why_not_arm(parts.arm)
    )
    if reason is not None and asked == "batch":
        raise InvalidInputError(f"method: may not be batch here; {reason}")
    return "batch" if reason is None else "simulate"


def _joints_of(arm: str | Mapping[str, Any]) -> Any:
    """Return what a document says about an arm, without the errors of its links."""
    if isinstance(arm, str):
        return arm
    return {key: value for key, value in arm.items() if key != "link_errors"}


def shared_document(experiment: Described, changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the contents of a document with the changes that all rows share, as plain data."""
    forget_files()
    contents: dict[str, Any] = plain(read_document(experiment, changes))
    return contents


def row_values(campaign: CampaignDocument) -> Iterator[dict[str, Any]]:
    """Yield the values of the varied keys of each row, the last list fastest, then the samples.

    The same sample draws the same values in each combination, so that combinations can be compared
    draw by draw. Values depend on the seed, the key and the number of the sample alone.
    """
    axes, groups, distributions = campaign.axes, campaign.groups, campaign.distributions
    walked = [list(zip(*(axes[key].listed() for key in group), strict=True)) for group in groups]
    samples = [
        {key: _drawn(one, campaign.seed, key, k) for key, one in distributions.items()}
        for k in range(campaign.samples or 1)
    ]
    for combination in product(*walked):
        chosen: dict[str, Any] = {}
        for group, values in zip(groups, combination, strict=True):
            chosen |= zip(group, values, strict=True)
        for sample in samples:
            every = chosen | sample
            yield {key: every[key] for key in campaign.vary}


def _drawn(distribution: Distribution, seed: int, key: str, sample: int) -> Any:
    words = np.frombuffer(sha256(key.encode()).digest()[:16], dtype=np.uint32)
    sequence = np.random.SeedSequence(seed, spawn_key=(*map(int, words), sample))
    return distribution.draw(np.random.default_rng(sequence))

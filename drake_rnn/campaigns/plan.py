"""The rows of a campaign: the values of each row, and the run that they ask for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from itertools import product
from typing import Any

import numpy as np

from ..batch.why_not import why_not_arm, why_not_law
from ..errors import InvalidInputError
from ..experiment import (
    Arms,
    Described,
    ExperimentDocument,
    Sections,
    load_experiment,
    read_document,
    read_sections,
    require_none_lost,
)
from ..experiment.fingerprint import forget_files, row_key, stamp, surroundings
from ..inputs.complaints import plain
from ..inputs.documents import construct
from ..runs.effort import effort_of, require_effort
from .document import CampaignDocument
from .outcome import Method, Order
from .variation import Distribution


@dataclass(frozen=True)
class PlannedRow:
    """A row of a campaign.

    Attributes:
        number: Number of the row, from 0.
        values: Values of the varied keys.
        order: Order of the row's run; rows with the same values share one order.
    """

    number: int
    values: dict[str, Any]
    order: Order


@dataclass(frozen=True)
class Plan:
    """The runs of a campaign.

    Attributes:
        campaign: Document of the campaign.
        experiment: Contents of the experiment's document, with the changes that all rows share.
        rows: The rows.
        time: Estimated time of all runs one after another, within a factor of a few [s].
    """

    campaign: CampaignDocument
    experiment: dict[str, Any]
    rows: list[PlannedRow]
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
            parts = read_sections(construct(ExperimentDocument, contents, ""), arms)
            effort = effort_of(parts.document)
            if not anyway:
                require_effort(effort, parts.document.duration)
            method = _chosen(campaign.method, parts, arms)
        except InvalidInputError as error:
            raise InvalidInputError(f"{error} (row {number})") from None
        order = order_of(contents, anyway=anyway, method=method)
        rows.append(PlannedRow(number, values, order))
        time += _EACH[method] + (_STEP * effort.steps if method == "batch" else effort.time)
    return Plan(campaign, base, rows, time)


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


def order_of(
    contents: Mapping[str, Any],
    *,
    anyway: bool = False,
    learning: bool = False,
    method: Method = "simulate",
) -> Order:
    """Return the order of the run of a document.

    Args:
        contents: Contents of the document.
        anyway: Whether the run may take any number of steps.
        learning: Whether the error of a learned Jacobian is wanted over time.
        method: How to carry out the run.
    """
    document: dict[str, Any] = plain(contents)
    around = surroundings(document)
    # A run that is refused for its many steps is kept apart from the same run made anyway.
    said = f"row 2 {method}{' learning' * learning}{' anyway' * anyway}"
    key = row_key(document, around, said)
    return Order(key, document, stamp(), around, anyway, learning, method)


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


def unique_orders(rows: Sequence[PlannedRow]) -> list[Order]:
    """Return the orders of rows, each once, in their order."""
    return list({row.order.key: row.order for row in rows}.values())

"""The rows of a campaign: which values each has, and what is to be run for it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from itertools import product
from typing import Any

import numpy as np

from ..errors import InvalidInputError
from ..experiment import (
    Arms,
    Checked,
    Described,
    QuickCheck,
    load_experiment,
    read_document,
    require_none_lost,
)
from ..inputs.complaints import plain
from ..many.why_not import why_not_arm, why_not_law
from ..runs.effort import effort_of, require_effort
from .document import CampaignDocument
from .fingerprint import forget_files, row_key, stamp, surroundings
from .outcome import Method, Order
from .variation import Distribution


@dataclass(frozen=True)
class PlannedRow:
    """A row of a campaign.

    Attributes:
        number: Its number, from 0.
        values: Values of the varied keys.
        order: What is to be run for it; rows of the same values have the same.
    """

    number: int
    values: dict[str, Any]
    order: Order


@dataclass(frozen=True)
class Plan:
    """What a campaign will run.

    Attributes:
        campaign: Its document.
        experiment: Contents of the experiment's document, with the changes that all rows share.
        rows: Its rows.
        time: Time that they may take one after another, within a factor of a few [s].
    """

    campaign: CampaignDocument
    experiment: dict[str, Any]
    rows: list[PlannedRow]
    time: float


#: What loading, checking and evaluating a run takes, however short it is [s], by its method.
_EACH = {"simulate": 0.1, "batch": 0.01}
#: What a step of a run costs in a batch [s].
_STEP = 3e-6


def plan_campaign(
    campaign: CampaignDocument, changes: Mapping[str, Any] | None = None, *, anyway: bool = False
) -> Plan:
    """Return what a campaign will run, with the document of each row checked.

    The first row is checked as a whole; of the others, each section by itself. What only shows when
    a run is made, such as a path out of reach, becomes a row.

    Args:
        campaign: The campaign.
        changes: Further changes of its experiment, by dotted key.
        anyway: Whether a run may take as many steps as it likes.

    Raises:
        InvalidInputError: If a row is no valid experiment, or a run would take very many steps.
    """
    for key in changes or {}:
        if key in campaign.vary:
            raise InvalidInputError(f"--set: {key!r} varies in this campaign; it cannot be both")
    require_none_lost({**(changes or {}), **campaign.vary}, "--set")
    base = shared_document(campaign.experiment, {**campaign.changes, **(changes or {})})
    check, choice, rows, time = QuickCheck(), _Choice(campaign.method), [], 0.0
    for number, values in enumerate(row_values(campaign)):
        try:
            if number == 0:
                load_experiment(base, values)
            contents = read_document(base, values)
            checked = check.check(contents)
            effort = effort_of(checked.document)
            if not anyway:
                require_effort(effort, checked.document.duration)
            method = choice.of(checked)
        except InvalidInputError as error:
            raise InvalidInputError(f"{error} (row {number})") from None
        order = order_of(contents, anyway=anyway, method=method)
        rows.append(PlannedRow(number, values, order))
        time += _EACH[method] + (_STEP * effort.steps if method == "batch" else effort.time)
    return Plan(campaign, base, rows, time)


class _Choice:
    """Chooses what carries a run out, by its document alone.

    Args:
        asked: What the campaign asks for.
    """

    def __init__(self, asked: str) -> None:
        self._asked = asked
        self._arms = Arms()

    def of(self, checked: Checked) -> Method:
        """Return what carries out the run of a document.

        Raises:
            InvalidInputError: If a batch is asked for and cannot.
        """
        if self._asked == "simulate":
            return "simulate"
        reason = why_not_law(checked.document, checked.law) or self._arms.shared(
            "why not", _joints_of(checked.document.arm), lambda: why_not_arm(checked.arm)
        )
        if reason is not None and self._asked == "batch":
            raise InvalidInputError(f"method: may not be batch here; {reason}")
        return "batch" if reason is None else "simulate"


def _joints_of(arm: str | Mapping[str, Any]) -> Any:
    """Return what a document says of the kind of an arm's joints."""
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
        anyway: Whether it may take as many steps as it likes.
        learning: Whether the error of a learned Jacobian is wanted over time.
        method: What is to carry it out.
    """
    document: dict[str, Any] = plain(contents)
    around = surroundings(document)
    # Without the limit on its steps a run that was refused is another one.
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

"""The claims files: one for each paper, beside the module with its measures."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

from ..errors import InvalidInputError
from ..experiment import shipped_experiments
from ..inputs.complaints import nearest
from ..inputs.documents import construct, read_yaml
from ..inputs.extensions import without_extensions
from ..inputs.fields import validated
from ..inputs.keys import Meaning
from ..measures import METRIC_NAMES
from .claim import Claim, Paper, Quantity

_FOLDER = Path(__file__).parent / "papers"
#: The papers' schemes; each has a claims file and a module with its measures.
SCHEMES = tuple(sorted(file.stem for file in _FOLDER.glob("*.yaml")))


@validated
class ClaimsFile:
    """What one paper claims, as plain data."""

    prefix: Annotated[str, Meaning("What the names of its claims begin with, before a hyphen.")]
    paper: Annotated[dict[str, Any], Meaning("The paper, the fields of `Paper`.")]
    page: Annotated[str, Meaning("Page of the repository about it.")]
    claims: Annotated[list[dict[str, Any]], Meaning("Its claims, each with the fields of `Claim`.")]


@dataclass(frozen=True)
class Claims:
    """All that one paper claims.

    Attributes:
        scheme: The paper's scheme, one of `SCHEMES`.
        paper: The paper.
        page: Page of the repository about it.
        claims: Its claims.
        measures: Functions that the claims' criteria name; each takes a function
            ``run(name, changes) -> Result`` and the criterion's arguments, and returns a number.
    """

    scheme: str
    paper: Paper
    page: str
    claims: tuple[Claim, ...]
    measures: Mapping[str, Callable[..., float]]

    def sharing(self, claim: Claim) -> tuple[str, ...]:
        """Return the names of the other claims that are judged by a number of this one."""
        numbers = set(map(str, claim.criteria))
        return tuple(
            other.id
            for other in self.claims
            if other.id != claim.id and not numbers.isdisjoint(map(str, other.criteria))
        )

    def reason(self, claim: Claim) -> str:
        """Return why the verdict is what it is, with the claims that rest on the same numbers."""
        told = claim.because or claim.unchecked
        if shared := ", ".join(self.sharing(claim)):
            told = f"{told} Shares a number with {shared}.".strip()
        return told


def schemes_in(folder: Path | None = None) -> tuple[str, ...]:
    """Return the schemes that have a claims file in a folder; by default `SCHEMES`.

    Raises:
        InvalidInputError: If there is none.
    """
    if folder is None:
        return SCHEMES
    if not (found := tuple(sorted(file.stem for file in folder.glob("*.yaml")))):
        raise InvalidInputError(f"claims: no claims file, *.yaml, in {folder}")
    return found


def read_claims(scheme: str, folder: Path | None = None) -> Claims:
    """Return the claims of a paper.

    Args:
        scheme: Its scheme, one of `schemes_in` the folder.
        folder: Folder with claims files; by default that of the shipped ones, which are read once.
            Measures are those of the shipped file of the same name.

    Raises:
        InvalidInputError: If a claim is not as it should be; the message names claim and key.
    """
    if scheme not in (known := schemes_in(folder)):
        raise InvalidInputError(f"claims: no scheme {scheme!r}; {nearest(scheme, list(known))}")
    return _shipped(scheme) if folder is None else _read(folder / f"{scheme}.yaml")


@cache
def _shipped(scheme: str) -> Claims:
    return _read(_FOLDER / f"{scheme}.yaml")


def _read(file: Path) -> Claims:
    content = construct(ClaimsFile, without_extensions(read_yaml(file)), file.name)
    claims = tuple(
        construct(Claim, claim, f"{file.name}: {claim.get('id', f'claim {number}')}")
        for number, claim in enumerate(content.claims, start=1)
    )
    measures = _measures(file.stem) if file.stem in SCHEMES else {}
    for claim in claims:
        for quantity in quantities_of(claim):
            _check_known(f"{file.name}: {claim.id}", quantity, measures)
        if not claim.id.startswith(f"{content.prefix}-"):
            raise InvalidInputError(f"{file.name}: {claim.id}: must begin with {content.prefix}-")
    names = [claim.id for claim in claims]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise InvalidInputError(f"{file.name}: {twice[0]} is there twice")
    paper = construct(Paper, content.paper, f"{file.name}: paper")
    return Claims(file.stem, paper, content.page, claims, measures)


def _measures(scheme: str) -> dict[str, Callable[..., float]]:
    module = import_module(f"{__package__}.papers.{scheme}")
    return {
        name: function
        for name, function in inspect.getmembers(module, inspect.isfunction)
        if function.__module__ == module.__name__ and not name.startswith("_")
    }


def quantities_of(claim: Claim) -> list[Quantity]:
    """Return the numbers that judge a claim, and those that they are divided by."""
    divisors = [criterion.per for criterion in claim.criteria if criterion.per is not None]
    return [*claim.criteria, *divisors]


def _check_known(place: str, quantity: Quantity, measures: Mapping[str, Any]) -> None:
    for name, known, what in (
        (quantity.run, shipped_experiments(), "experiment"),
        (quantity.metric, METRIC_NAMES, "metric"),
        (quantity.measure, measures, "measure"),
    ):
        if name is not None and name not in known:
            raise InvalidInputError(
                f"{place}: no {what} {name!r}; {nearest(name, list(known)) if known else 'none'}"
            )
    if quantity.measure is not None:
        try:
            inspect.signature(measures[quantity.measure]).bind(None, **quantity.given)
        except TypeError as error:
            raise InvalidInputError(f"{place}: {quantity.measure}: given: {error}") from None

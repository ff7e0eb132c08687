"""The papers' claims in the terminal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from ..claims import (
    Claim,
    Claims,
    Finding,
    Judge,
    Judgement,
    Part,
    SimulatedRuns,
    read_claims,
    schemes_in,
)
from ..errors import InvalidInputError
from ..inputs.complaints import nearest
from .asked import ShowClaims
from .console import errors, print_table

#: Colour of each verdict in the terminal.
VERDICT_COLOURS = {
    "holds": "green",
    "holds with correction": "yellow",
    "does not hold": "red",
    "cannot be checked": "default",
    "failed": "bold red",
}


def chosen_claims(
    ids: Sequence[str], folder: Path | None = None
) -> Iterator[tuple[Claims, list[Claim]]]:
    """Yield papers with the claims that are asked for: all, or those with these ids or schemes.

    Args:
        ids: Ids, e.g. ``slc-F2a``, their beginnings up to the dash, e.g. ``slc``, or names of
            schemes, e.g. ``simultaneous_learning``.
        folder: Folder with claims files; by default the shipped ones.

    Raises:
        InvalidInputError: If there is no such claim.
    """
    papers = [read_claims(scheme, folder) for scheme in schemes_in(folder)]
    names = {claim.id: _names(paper, claim) for paper in papers for claim in paper.claims}
    known = sorted({name for several in names.values() for name in several})
    for name in ids:
        if name not in known:
            raise InvalidInputError(f"no claim {name!r}; {nearest(name, known)}")
    for paper in papers:
        chosen = [claim for claim in paper.claims if not ids or not names[claim.id].isdisjoint(ids)]
        if chosen:
            yield paper, chosen


def _names(paper: Claims, claim: Claim) -> set[str]:
    """Return the names by which a claim can be asked for."""
    return {claim.id, claim.id.partition("-")[0], paper.scheme}


def claims_table(paper: Claims, claims: Sequence[Claim]) -> Table:
    """Return a table of claims and how each is judged."""
    table = Table(box=SIMPLE_HEAD, title=escape(str(paper.paper)))
    for column in ("claim", "place", "the paper says", "judged by"):
        table.add_column(column, overflow="fold", no_wrap=column == "claim")
    for claim in claims:
        judged = [claim.unchecked] if claim.unchecked else []
        judged += [
            f"{_note(part)}{criterion}: {criterion.bounds}"
            for part, criteria in claim.parts.items()
            for criterion in criteria
        ]
        table.add_row(*map(escape, (claim.id, claim.where, claim.says, "\n".join(judged))))
    return table


def judgement_table(paper: Claims, judgement: Judgement) -> Table:
    """Return a table of what was measured for one claim of a paper."""
    claim = judgement.claim
    colour = VERDICT_COLOURS[judgement.verdict]
    title = f"{escape(claim.id)}: [{colour}]{judgement.verdict}[/]"
    table = Table(box=SIMPLE_HEAD, title=title, caption=escape(paper.reason(claim)))
    table.add_column("of", overflow="fold")
    for column in ("measured", "asked", "paper"):
        table.add_column(column, overflow="fold", justify="right")
    for part, findings in judgement.parts.items():
        for finding in findings:
            table.add_row(*map(escape, _cells(finding, _note(part))))
    return table


def _note(part: Part) -> str:
    return "" if part == "as stated" else f"{part}: "


def _cells(finding: Finding, note: str) -> tuple[str, str, str, str]:
    criterion = finding.criterion
    return f"{note}{criterion}", str(finding), str(criterion.bounds), criterion.paper


def show_claims(asked: ShowClaims) -> None:
    """List the claims, or judge them."""
    runs = SimulatedRuns()
    with errors():
        for paper, claims in chosen_claims(asked.ids or []):
            if not asked.judge:
                print_table(claims_table(paper, claims))
                continue
            judging = Judge(paper, runs)
            for claim in claims:
                print_table(judgement_table(paper, judging.judge(claim)))

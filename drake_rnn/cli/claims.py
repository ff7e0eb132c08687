"""The papers' claims in the terminal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from ..claims import SCHEMES, Claim, Claims, Finding, Judgement, read_claims
from ..errors import InvalidInputError
from ..inputs.complaints import nearest


def chosen_claims(ids: Sequence[str]) -> Iterator[tuple[Claims, list[Claim]]]:
    """Yield papers with the claims that are asked for: all, or those with these ids or schemes.

    Args:
        ids: Ids, e.g. ``slc-F2a``, or their beginnings up to the dash, e.g. ``slc``.

    Raises:
        InvalidInputError: If there is no such claim.
    """
    papers = [read_claims(scheme) for scheme in SCHEMES]
    known = {claim.id for paper in papers for claim in paper.claims}
    schemes = {name.partition("-")[0] for name in known}
    for name in ids:
        if name not in known | schemes:
            raise InvalidInputError(f"no claim {name!r}; {nearest(name, sorted(known | schemes))}")
    for paper in papers:
        chosen = [
            claim
            for claim in paper.claims
            if not ids or claim.id in ids or claim.id.partition("-")[0] in ids
        ]
        if chosen:
            yield paper, chosen


def claims_table(paper: Claims, claims: Sequence[Claim]) -> Table:
    """Return a table of claims and how each is judged."""
    table = Table(box=SIMPLE_HEAD, title=escape(str(paper.paper)))
    for column in ("claim", "place", "the paper says", "judged by"):
        table.add_column(column, overflow="fold", no_wrap=column == "claim")
    for claim in claims:
        judged = [f"{criterion}: {criterion.bounds}" for criterion in claim.as_stated]
        judged += [f"corrected: {criterion}: {criterion.bounds}" for criterion in claim.corrected]
        table.add_row(
            *map(escape, (claim.id, claim.where, claim.says, "\n".join(judged) or claim.unchecked))
        )
    return table


def judgement_table(judgement: Judgement) -> Table:
    """Return a table of what was measured for one claim."""
    claim = judgement.claim
    colour = {"holds": "green", "holds with correction": "yellow"}.get(judgement.verdict, "red")
    title = f"{escape(claim.id)}: [{colour}]{judgement.verdict}[/]"
    table = Table(box=SIMPLE_HEAD, title=title, caption=escape(claim.because or claim.unchecked))
    table.add_column("of", overflow="fold")
    for column in ("measured", "asked", "paper"):
        table.add_column(column, overflow="fold", justify="right")
    for findings, note in ((judgement.as_stated, ""), (judgement.corrected, "corrected: ")):
        for finding in findings:
            table.add_row(*map(escape, _cells(finding, note)))
    return table


def _cells(finding: Finding, note: str) -> tuple[str, str, str, str]:
    criterion = finding.criterion
    return f"{note}{criterion}", str(finding), str(criterion.bounds), criterion.paper

"""The papers' claims in the terminal.

- The report of the papers.
"""

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
from ..inputs.messages import nearest
from ..jobs.requests import RunRecord
from ..report import Format, Progress, ReportSettings, make_report
from ..report import Report as Made
from ..tables import Column, Heading, Sheet
from .arguments import Report, ShowClaims
from .console import err, errors, finish, out, print_table, silence
from .running import Tell, jobs_progress
from .saving import require_writable
from .tables import fitted, require_tables, write_tables

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
    available = sorted({name for several in names.values() for name in several})
    for name in ids:
        if name not in available:
            raise InvalidInputError(f"no claim {name!r}; {nearest(name, available)}")
    for paper in papers:
        selection = [
            claim for claim in paper.claims if not ids or not names[claim.id].isdisjoint(ids)
        ]
        if selection:
            yield paper, selection


def _names(paper: Claims, claim: Claim) -> set[str]:
    """Return the names by which a claim can be asked for."""
    return {claim.id, claim.id.partition("-")[0], paper.scheme}


def claims_sheet(paper: Claims, claims: Sequence[Claim]) -> Sheet:
    """Return a table of claims and how each is judged."""
    sheet = Sheet(_columns("claim", "place", "the paper says", "judged by"), title=str(paper.paper))
    for claim in claims:
        texts = [claim.unchecked] if claim.unchecked else []
        texts += [
            f"{_note(part)}{criterion}: {criterion.bounds}"
            for part, criteria in claim.parts.items()
            for criterion in criteria
        ]
        sheet.rows.append((claim.id, claim.where, claim.says, "\n".join(texts)))
    return sheet


def judgements_sheet(judgements: Sequence[Judgement]) -> Sheet:
    """Return a table of what was measured for some claims."""
    columns = _columns("claim", "verdict", "of", "measured", "asked", "paper")
    sheet = Sheet(columns)
    for judgement in judgements:
        for part, findings in judgement.parts.items():
            for finding in findings:
                cells = _cells(finding, _note(part))
                sheet.rows.append((judgement.claim.id, judgement.verdict, *cells))
        if not judgement.parts:
            sheet.rows.append((judgement.claim.id, judgement.verdict, *[""] * 4))
    return sheet


#: Columns of the tables that have sentences.
_SENTENCES = {"place", "the paper says", "judged by", "of"}


def _columns(*names: str) -> tuple[Column, ...]:
    columns = {"measured", "asked", "paper"}
    return tuple(Column(Heading(each), each in columns, each in _SENTENCES) for each in names)


def judgement_table(paper: Claims, judgement: Judgement) -> Table:
    """Return a table of what was measured for one claim of a paper, for the terminal."""
    claim, sheet = judgement.claim, judgements_sheet([judgement])
    rows = sheet.rows if judgement.parts else []
    table = fitted(Sheet(sheet.columns[2:], [row[2:] for row in rows], note=paper.reason(claim)))
    table.title = (
        f"{escape(claim.id)}: [{VERDICT_COLOURS[judgement.verdict]}]{judgement.verdict}[/]"
    )
    return table


def _note(part: Part) -> str:
    return "" if part == "as stated" else f"{part}: "


def _cells(finding: Finding, note: str) -> tuple[str, str, str, str]:
    criterion = finding.criterion
    return f"{note}{criterion}", str(finding), str(criterion.bounds), criterion.paper


def show_claims(args: ShowClaims) -> None:
    """List the claims, or judge them."""
    runs, lines = SimulatedRuns(), []
    with errors():
        require_tables(args.tables)
        for paper, claims in chosen_claims(args.ids or []):
            if not args.judge:
                sheet = claims_sheet(paper, claims)
                lines += sheet.rows
                print_table(_unbroken(fitted(sheet)))
                continue
            judging = Judge(paper, runs)
            for claim in claims:
                judgement = judging.judge(claim)
                print_table(judgement_table(paper, judgement))
                sheet = judgements_sheet([judgement])
                lines += sheet.rows
        write_tables(Sheet(sheet.columns, lines), args.tables)


def _unbroken(table: Table) -> Table:
    """Return a table of claims whose ids are not broken."""
    table.columns[0].no_wrap = True
    return table


def report(args: Report) -> None:
    """Judge the papers' claims, and write what came out."""
    with silence(args.quiet):
        with errors():
            claims = list(chosen_claims(args.ids or [], args.claims))
            require_writable(args.folder)
            playbacks = args.pictures and args.playbacks
            settings = ReportSettings(args.jobs, args.form, args.pictures, playbacks, args.again)
            with jobs_progress("report") as tell:
                contents = make_report(claims, args.folder, settings, _progress(tell))
        _tell(contents, args.form)
    finish(contents.complete and not contents.failures, True)


def _progress(tell: Tell) -> Progress:
    """Return what tells of the parts of a report, which come kind by kind and round by round."""
    last, before = "", 0

    def done(what: str, count: int, total: int) -> None:
        nonlocal last, before
        begins = what != last or count <= before
        last, before = what, count
        tell(count, total, None if begins else RunRecord("complete"), what)

    return done


def _tell(judged_claims: Made, form: Format) -> None:
    if judged_claims.contents:
        print_table(verdicts_table(judged_claims))
        for name, error in judged_claims.failures:
            err.print(f"[red]failed[/] {escape(f'{name}: {error}')}")
        out.print(escape(f"report  {judged_claims.folder / f'index.{form}'}"), soft_wrap=True)
    if not judged_claims.complete:
        err.print("[red]interrupted[/]: run the same command again to continue")


def verdicts_table(judged_claims: Made) -> Table:
    """Return a table of how many claims of each paper hold."""
    counts = judged_claims.contents["counts"]
    verdicts = [each for each in counts if each != "failed" or counts[each]]
    table = Table(box=SIMPLE_HEAD, show_footer=len(judged_claims.contents["papers"]) > 1)
    table.add_column("paper", footer="all")
    for verdict in verdicts:
        colour = VERDICT_COLOURS[verdict]
        table.add_column(verdict, justify="right", style=colour, footer=str(counts[verdict]))
    for paper in judged_claims.contents["papers"]:
        name = paper["scheme"].replace("_", " ")
        table.add_row(escape(name), *(str(paper["counts"][verdict]) for verdict in verdicts))
    return table

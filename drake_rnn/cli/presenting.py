"""Commands on what there is: figures, playbacks, exports and films of saved results, and claims.

- Figures and playbacks of results that are saved, made again.
- Results that are saved, in the formats of other tools.
- Moving pictures of results that are saved.
- One figure of several runs, for print.
- The papers' claims in the terminal, and the report of the papers.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import typer
from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.progress import BarColumn, TextColumn
from rich.progress import Progress as Bar
from rich.table import Table

from .. import figures
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
from ..exports import export, exported_file
from ..figures import drawn_for
from ..figures.comparison import compared_figure
from ..figures.style import FORMS, save
from ..film import FilmProgress, FilmSettings, write_film
from ..inputs.messages import drawn_of, nearest
from ..jobs.requests import RunRecord
from ..report import Format, Progress, ReportSettings, make_report
from ..report import Report as Made
from ..runs.folder import claim_folder, require_output, require_replaceable
from ..tables import Column, Heading, Sheet
from .arguments import Export, Figure, Film, Plot, Replay, Report, ShowClaims
from .comparing import compared_folder, label, relabel, saved_result
from .console import err, errors, finish, out, print_table, silence, status
from .running import Tell, jobs_progress
from .saving import draw_figures, paper_of, require_writable, write_page
from .starting import INTERRUPTED
from .tables import fitted, require_tables, split_words, write_tables


def plot(args: Plot) -> None:
    """Draw the figures of a saved result again."""
    with errors():
        result = saved_result(args.folder, args.files)
        paper = paper_of(args)
        drawable = figures.drawable(result)
        for name in args.only or []:
            if name not in drawable:
                raise InvalidInputError(f"--only: no figure {name!r}; {nearest(name, drawable)}")
        with status("drawing figures"), claim_folder(args.folder, is_shared=True):
            files = draw_figures(result, args.folder / "figures", args.only, paper=paper)
        names_drawn = {file.stem for file in files}
        if left := [name for name in args.only or drawable if name not in names_drawn]:
            text = f"{', '.join(left)}: not drawn, too narrow at {args.width}"
            out.print(f"[yellow]note[/] {escape(text)}", soft_wrap=True)
        for file in files:
            out.print(escape(f"figure    {file}"), soft_wrap=True)


def replay(args: Replay) -> None:
    """Write the playback of a saved result again."""
    with errors():
        folders = (args.folder, *(args.beside or []))
        result, *others = (saved_result(each, args.files) for each in folders)
        require_replaceable(args.folder / "playback.html")
        if result.time.size < 2:
            raise InvalidInputError(
                f"{args.folder}: holds a single instant, which cannot be played"
            )
        with claim_folder(args.folder, is_shared=True):
            write_page(result, args.folder, others)


def export_result(args: Export) -> None:
    """Write the series of a saved result for other tools."""
    with errors(), ExitStack() as claims:
        if args.file is not None and not args.file.is_dir():
            require_output(args.file, "--to")
        exported_file(args.file or args.folder, args.form)
        result = saved_result(args.folder, args.files)
        if args.file is not None:
            require_writable(args.file.parent, "--to")
        else:
            claims.enter_context(claim_folder(args.folder, is_shared=True))
        with status("writing"):
            file = export(result, args.file or args.folder, args.form, args.series)
        out.print(escape(f"series    {file}"), soft_wrap=True)


_UNITS = {"": 1, "B": 1, "KB": 1_000, "MB": 1_000_000}
#: Options that have other names than the settings that they are.
_OPTIONS = {
    "begin": "--from",
    "end": "--to",
    "frames_per_second": "--fps",
    "most_bytes": "--most-bytes",
    "seconds": "--seconds",
    "size": "--size",
}


def film(args: Film) -> None:
    """Write a saved result as a moving picture."""
    with errors(), _named_as_options():
        settings = FilmSettings(
            size=_size_of(args.size),
            frames_per_second=args.frames_per_second,
            seconds=args.seconds,
            begin=args.begin,
            end=args.end,
            view=args.view,
            theme=args.theme,
            most_bytes=_bytes_of(args.most_bytes),
        )
        folders = (args.folder, *(args.beside or []))
        result, *others = (saved_result(each, args.files) for each in folders)
        file = args.folder / f"film.{args.form}"
        require_replaceable(file)
        try:
            with claim_folder(args.folder, is_shared=True), _bar() as progress:
                film_file = write_film(result, file, settings, others, progress)
        except KeyboardInterrupt:
            err.print("interrupted: no film was written")
            raise typer.Exit(INTERRUPTED) from None
    out.print(escape(f"film      {film_file}"), soft_wrap=True)


def _size_of(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d{1,5})x(\d{1,5})", text)
    if match is None:
        raise InvalidInputError(f"--size: must be width and height, e.g. 640x400, not {text!r}")
    return int(match[1]), int(match[2])


def _bytes_of(text: str) -> int:
    match = re.fullmatch(r"(\d+(?:\.\d+)?) ?(k?B|MB|)", text, re.IGNORECASE)
    if match is None:
        raise InvalidInputError(
            f"--most-bytes: must be a number of bytes, kB or MB, e.g. 800kB, not {text!r}"
        )
    return round(float(match[1]) * _UNITS[match[2].upper()])


@contextmanager
def _named_as_options() -> Iterator[None]:
    """Name options in errors in place of the settings that they are."""
    try:
        yield
    except InvalidInputError as error:
        match = re.match(r"(?:FilmSettings\.)?(\w+)(?:\.\d)?(: .*)", str(error), re.DOTALL)
        if match is None or match[1] not in _OPTIONS:
            raise
        raise InvalidInputError(_OPTIONS[match[1]] + match[2]) from None


def _print_quarters(share: int, count: int) -> None:
    if share == count or share % max(1, count // 4) == 0:
        err.print(f"film: {share} of {count} pictures are drawn")


@contextmanager
def _bar() -> Iterator[FilmProgress]:
    """Show a progress bar on a terminal; elsewhere a line for each quarter."""
    if not err.is_terminal:
        yield _print_quarters
        return
    columns: tuple[Any, ...] = (
        TextColumn("drawing pictures"),
        BarColumn(),
        TextColumn("{task.completed:.0f} / {task.total:.0f}"),
    )
    with Bar(*columns, console=err, transient=True) as bar:
        task = bar.add_task("", total=None)
        yield lambda done, count: bar.update(task, completed=done, total=count)


def figure(args: Figure) -> None:
    """Draw one figure of several runs."""
    with errors():
        paper = paper_of(args)
        if args.file is not None:
            require_output(args.file, "--to")
        names = [str(folder) for folder in args.runs]
        results = label(names, [saved_result(name, args.files) for name in names])
        file = args.file or Path("out") / compared_folder(list(results)) / f"figure.{paper.form}"
        if file.suffix.removeprefix(".") not in FORMS:
            suffixes = ", ".join(f".{form}" for form in FORMS)
            raise InvalidInputError(f"--to: {file}: must end in one of {suffixes}")
        require_output(file, "--to")
        runs = relabel(results, args.labels)
        with drawn_of("figure"):
            comparison = compared_figure(runs, split_words(args.panels), paper)
        require_writable(file.parent, "--to")
        with drawn_for(paper), drawn_of("figure"):
            save(comparison, file)
        out.print(escape(f"figure    {file}"), soft_wrap=True)


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
                with status(f"{claim.id}: judging"):
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

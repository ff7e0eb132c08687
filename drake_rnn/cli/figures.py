"""Commands on saved results: figures, playbacks, exports and films.

- Figures and playbacks of results that are saved, made again.
- Results that are saved, in the formats of other tools.
- Moving pictures of results that are saved.
- One figure of several runs, for print.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import typer
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn

from .. import figures
from ..errors import InvalidInputError
from ..exports import export, exported_file
from ..figures import drawn_for
from ..figures.comparison import compared_figure
from ..figures.style import FORMS, save
from ..film import FilmProgress, FilmSettings, write_film
from ..inputs.messages import drawn_of, nearest
from ..runs.folder import claim_folder, require_output, require_replaceable
from .arguments import Export, Figure, Film, Plot, Replay
from .comparing import compared_folder, label, relabel, saved_result
from .console import err, errors, out, status
from .saving import draw_figures, paper_of, require_writable, write_page
from .starting import INTERRUPTED
from .tables import split_words


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
    with Progress(*columns, console=err, transient=True) as bar:
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

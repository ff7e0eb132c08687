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
from ..runs.folder import claimed, require_output, require_replaceable
from .arguments import Export, Figure, Film, Plot, Replay
from .changing import require_writable
from .comparing import compared_folder, labelled, relabelled, saved_result
from .console import err, errors, out, status
from .drawing import draw_figures, paper_of
from .saving import write_page
from .starting import INTERRUPTED
from .tables import listed


def plot(asked: Plot) -> None:
    """Draw the figures of a saved result again."""
    with errors():
        result = saved_result(asked.folder, asked.files)
        paper = paper_of(asked)
        known = figures.drawable(result)
        for name in asked.only or []:
            if name not in known:
                raise InvalidInputError(f"--only: no figure {name!r}; {nearest(name, known)}")
        with status("drawing figures"), claimed(asked.folder, shared=True):
            files = draw_figures(result, asked.folder / "figures", asked.only, paper=paper)
        drawn = {file.stem for file in files}
        if left := [name for name in asked.only or known if name not in drawn]:
            told = f"{', '.join(left)}: not drawn, too narrow at {asked.width}"
            out.print(f"[yellow]note[/] {escape(told)}", soft_wrap=True)
        for file in files:
            out.print(escape(f"figure    {file}"), soft_wrap=True)


def replay(asked: Replay) -> None:
    """Write the playback of a saved result again."""
    with errors():
        folders = (asked.folder, *(asked.beside or []))
        result, *others = (saved_result(each, asked.files) for each in folders)
        require_replaceable(asked.folder / "playback.html")
        if result.time.size < 2:
            raise InvalidInputError(
                f"{asked.folder}: holds a single instant, which cannot be played"
            )
        with claimed(asked.folder, shared=True):
            write_page(result, asked.folder, others)


def export_result(asked: Export) -> None:
    """Write the series of a saved result for other tools."""
    with errors(), ExitStack() as claims:
        if asked.file is not None and not asked.file.is_dir():
            require_output(asked.file, "--to")
        exported_file(asked.file or asked.folder, asked.form)
        result = saved_result(asked.folder, asked.files)
        if asked.file is not None:
            require_writable(asked.file.parent, "--to")
        else:
            claims.enter_context(claimed(asked.folder, shared=True))
        with status("writing"):
            file = export(result, asked.file or asked.folder, asked.form, asked.series)
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


def film(asked: Film) -> None:
    """Write a saved result as a moving picture."""
    with errors(), _named_as_options():
        settings = FilmSettings(
            size=_size_of(asked.size),
            frames_per_second=asked.frames_per_second,
            seconds=asked.seconds,
            begin=asked.begin,
            end=asked.end,
            view=asked.view,
            theme=asked.theme,
            most_bytes=_bytes_of(asked.most_bytes),
        )
        folders = (asked.folder, *(asked.beside or []))
        result, *others = (saved_result(each, asked.files) for each in folders)
        file = asked.folder / f"film.{asked.form}"
        require_replaceable(file)
        try:
            with claimed(asked.folder, shared=True), _bar() as progress:
                written = write_film(result, file, settings, others, progress)
        except KeyboardInterrupt:
            err.print("interrupted: no film was written")
            raise typer.Exit(INTERRUPTED) from None
    out.print(escape(f"film      {written}"), soft_wrap=True)


def _size_of(text: str) -> tuple[int, int]:
    found = re.fullmatch(r"(\d{1,5})x(\d{1,5})", text)
    if found is None:
        raise InvalidInputError(f"--size: must be width and height, e.g. 640x400, not {text!r}")
    return int(found[1]), int(found[2])


def _bytes_of(text: str) -> int:
    found = re.fullmatch(r"(\d+(?:\.\d+)?) ?(k?B|MB|)", text, re.IGNORECASE)
    if found is None:
        raise InvalidInputError(
            f"--most-bytes: must be a number of bytes, kB or MB, e.g. 800kB, not {text!r}"
        )
    return round(float(found[1]) * _UNITS[found[2].upper()])


@contextmanager
def _named_as_options() -> Iterator[None]:
    """Name options in errors in place of the settings that they are."""
    try:
        yield
    except InvalidInputError as error:
        found = re.match(r"(?:FilmSettings\.)?(\w+)(?:\.\d)?(: .*)", str(error), re.DOTALL)
        if found is None or found[1] not in _OPTIONS:
            raise
        raise InvalidInputError(_OPTIONS[found[1]] + found[2]) from None


def _told_by_quarters(done: int, count: int) -> None:
    if done == count or done % max(1, count // 4) == 0:
        err.print(f"film: {done} of {count} pictures are drawn")


@contextmanager
def _bar() -> Iterator[FilmProgress]:
    """Show a progress bar on a terminal; elsewhere a line for each quarter."""
    if not err.is_terminal:
        yield _told_by_quarters
        return
    columns: tuple[Any, ...] = (
        TextColumn("drawing pictures"),
        BarColumn(),
        TextColumn("{task.completed:.0f} / {task.total:.0f}"),
    )
    with Progress(*columns, console=err, transient=True) as bar:
        task = bar.add_task("", total=None)
        yield lambda done, count: bar.update(task, completed=done, total=count)


def figure(asked: Figure) -> None:
    """Draw one figure of several runs."""
    with errors():
        paper = paper_of(asked)
        if asked.file is not None:
            require_output(asked.file, "--to")
        names = [str(folder) for folder in asked.runs]
        loaded = labelled(names, [saved_result(name, asked.files) for name in names])
        file = asked.file or Path("out") / compared_folder(list(loaded)) / f"figure.{paper.form}"
        if file.suffix.removeprefix(".") not in FORMS:
            known = ", ".join(f".{form}" for form in FORMS)
            raise InvalidInputError(f"--to: {file}: must end in one of {known}")
        require_output(file, "--to")
        runs = relabelled(loaded, asked.labels)
        with drawn_of("figure"):
            drawn = compared_figure(runs, listed(asked.panels), paper)
        require_writable(file.parent, "--to")
        with drawn_for(paper), drawn_of("figure"):
            save(drawn, file)
        out.print(escape(f"figure    {file}"), soft_wrap=True)

"""Moving pictures of results that are saved."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import typer
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn

from ..errors import InvalidInputError
from ..film import FilmProgress, FilmSettings, write_film
from ..runs.folder import claimed
from ..runs.result import Result
from ..runs.whole_file import require_replaceable
from .asked import Film
from .console import err, errors, out
from .statuses import INTERRUPTED

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
        result, *others = (Result.load(each, modules=True) for each in folders)
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

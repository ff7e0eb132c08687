"""Figures and playbacks of results that are saved, made again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from ..errors import InvalidInputError
from ..figures import drawable
from ..inputs.complaints import nearest
from ..runs.result import Result
from .console import errors, out, status
from .drawing import draw_figures
from .saving import write_page

Folder = Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder that a run has written.")]


def plot(
    folder: Folder,
    only: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Draw this figure only, e.g. overview; repeatable."),
    ] = None,
) -> None:
    """Draw the figures of a saved result again, into its folder."""
    with errors():
        result = Result.load(folder, modules=True)
        known = drawable(result)
        for name in only or []:
            if name not in known:
                raise InvalidInputError(f"--only: no figure {name!r}; {nearest(name, known)}")
        with status("drawing figures"):
            files = draw_figures(result, folder / "figures", only)
        for file in files:
            out.print(escape(f"figure    {file}"), soft_wrap=True)


def replay(
    folder: Folder,
    beside: Annotated[
        list[Path] | None,
        typer.Option(metavar="FOLDER", help="Show the path of this result beside it; repeatable."),
    ] = None,
) -> None:
    """Write the playback of a saved result again, into its folder."""
    with errors():
        result, *others = (Result.load(each, modules=True) for each in (folder, *(beside or [])))
        if result.time.size < 2:
            raise InvalidInputError(f"{folder}: holds a single instant, which cannot be played")
        write_page(result, folder, others)

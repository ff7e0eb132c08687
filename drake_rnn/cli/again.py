"""Figures and playbacks of results that are saved, made again."""

from __future__ import annotations

from rich.markup import escape

from .. import figures
from ..errors import InvalidInputError
from ..inputs.complaints import nearest
from ..runs.folder import claimed
from ..runs.result import Result
from ..runs.whole_file import require_replaceable
from .asked import Plot, Replay
from .console import errors, out, status
from .drawing import draw_figures
from .printed import paper_of
from .saving import write_page


def plot(asked: Plot) -> None:
    """Draw the figures of a saved result again."""
    with errors():
        result = Result.load(asked.folder, modules=True)
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
        result, *others = (Result.load(each, modules=True) for each in folders)
        require_replaceable(asked.folder / "playback.html")
        if result.time.size < 2:
            raise InvalidInputError(
                f"{asked.folder}: holds a single instant, which cannot be played"
            )
        with claimed(asked.folder, shared=True):
            write_page(result, asked.folder, others)

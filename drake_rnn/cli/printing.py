"""One figure of several runs, for print."""

from __future__ import annotations

from pathlib import Path

from rich.markup import escape

from ..errors import InvalidInputError
from ..figures import drawn_for
from ..figures.compared import compared_figure
from ..figures.paper import FORMS
from ..figures.style import save
from ..inputs.complaints import drawn_of
from ..runs.folder import require_output
from ..runs.result import Result
from .asked import Figure
from .changing import require_writable
from .comparing import compared_folder, labelled, relabelled
from .console import errors, out
from .printed import paper_of
from .written_tables import listed


def figure(asked: Figure) -> None:
    """Draw one figure of several runs."""
    with errors():
        paper = paper_of(asked)
        if asked.file is not None:
            require_output(asked.file, "--to")
        names = [str(folder) for folder in asked.runs]
        loaded = labelled(names, [Result.load(name, modules=True) for name in names])
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

"""The figures that apply to a result: for a notebook, or written to a folder."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path

from matplotlib.figure import Figure

from ..errors import InvalidInputError
from ..inputs.fields import (
    checked,
    each,
    instance,
    optional,
)
from ..inputs.messages import (
    drawn_of,
    nearest,
)
from ..runs.folder import make_folder, require_replaceable
from ..runs.result import Result
from . import force_panels, joint_panels, overview, single  # noqa: F401  These register figures.
from .registry import FIGURES as FIGURES
from .style import (
    SCREEN,
    Paper,
    drawn_for,
    save,
)


def drawable(result: Result) -> list[str]:
    """Return the names of the figures that apply to a result; none to a single sample."""
    if result.time.size < 2:
        return []
    return [
        name
        for name, drawing in FIGURES.items()
        if drawing.needs <= result.series.keys() and drawing.applies(result)
    ]


def fitting(names: Sequence[str], paper: Paper) -> list[str]:
    """Return those of some figures that can be read in the width of a paper."""
    return [name for name in names if paper.width is None or paper.width >= FIGURES[name].least]


@checked(result=instance(Result), name=instance(str), paper=instance(Paper))
def figure(result: Result, name: str = "overview", paper: Paper = SCREEN) -> Figure:
    """Return a figure of a result, to show in a notebook or to change.

    Args:
        result: The run to show.
        name: Name of the figure, one of those that are `drawable`.
        paper: What it is drawn for.

    Raises:
        InvalidInputError: If there is no such figure of this result, or it cannot be read in the
            width of the paper.
    """
    if name not in (drawable_names := drawable(result)):
        what = nearest(name, drawable_names) if drawable_names else "a single instant has none"
        raise InvalidInputError(f"figure: no figure {name!r} of this result; {what}")
    if not fitting([name], paper):
        raise InvalidInputError(
            f"figure: {name} needs a width of {25.4 * FIGURES[name].least:.0f} mm or more"
        )
    with drawn_for(paper), drawn_of(f"figure {name}"):
        return FIGURES[name].draw(result)


@checked(
    result=instance(Result),
    folder=instance(str, Path),
    names=optional(each(str)),
    paper=instance(Paper),
)
def write_figures(
    result: Result,
    folder: str | Path,
    names: Sequence[str] | None = None,
    paper: Paper = SCREEN,
) -> list[Path]:
    """Write figures of a result, as ``<name>.png`` or in another format.

    Args:
        result: The run to show.
        folder: Folder to write to; created if it does not exist.
        names: Names of the figures; by default all that apply and can be read in the width of the
            paper.
        paper: What they are drawn for.

    Returns:
        The files.

    Raises:
        InvalidInputError: If the folder cannot be written to, ``result`` is none, or there is no
            such figure of it.
    """
    folder = Path(folder)
    names = names or fitting(drawable(result), paper)
    files = [folder / f"{name}.{paper.form}" for name in names]
    try:
        make_folder(folder)
        for file in files:
            require_replaceable(file)
        for file in files:
            with drawn_for(paper), drawn_of(f"figure {file.stem}"):
                save(figure(result, file.stem, paper), file)
    except OSError as error:
        raise InvalidInputError(f"figures folder {folder}: {error.strerror}") from None
    return files


def overview_in_notebook(result: Result) -> str:
    """Return the overview as HTML; nothing for a result that has none."""
    if "overview" not in drawable(result):
        return ""
    picture = BytesIO()
    save(figure(result, "overview"), picture)
    code = b64encode(picture.getvalue()).decode()
    return f'<img alt="overview" style="width: 100%" src="data:image/png;base64,{code}">'

"""The figures that apply to a result: for a notebook, or written to a folder."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path

from matplotlib.figure import Figure

from ..errors import InvalidInputError
from ..inputs.complaints import nearest, require_type
from ..runs.result import Result
from . import (  # noqa: F401  These register figures.
    derivatives,
    overview,
    pressing,
    single,
)
from .registry import FIGURES as FIGURES
from .style import save


def drawable(result: Result) -> list[str]:
    """Return the names of the figures that apply to a result; none to a single sample."""
    if result.time.size < 2:
        return []
    return [
        name
        for name, drawing in FIGURES.items()
        if drawing.needs <= result.series.keys() and drawing.applies(result)
    ]


def figure(result: Result, name: str = "overview") -> Figure:
    """Return a figure of a result, to show in a notebook or to change.

    Args:
        result: The run to show.
        name: Name of the figure, one of those that are `drawable`.

    Raises:
        InvalidInputError: If there is no such figure of this result.
    """
    require_type("result", result, Result)
    if name not in (known := drawable(result)):
        what = nearest(name, known) if known else "a single instant has none"
        raise InvalidInputError(f"figure: no figure {name!r} of this result; {what}")
    return FIGURES[name].draw(result)


def write_figures(
    result: Result, folder: str | Path, names: Sequence[str] | None = None
) -> list[Path]:
    """Write figures of a result as ``<name>.png``.

    Args:
        result: The run to show.
        folder: Folder to write to; created if it does not exist.
        names: Names of the figures; by default all that apply.

    Returns:
        The files.

    Raises:
        InvalidInputError: If the folder cannot be written to, ``result`` is none, or there is no
            such figure of it.
    """
    require_type("result", result, Result)
    folder = Path(folder)
    files = [folder / f"{name}.png" for name in names or drawable(result)]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for file in files:
            save(figure(result, file.stem), file)
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

"""Which figures there are, and writing those for which a result has the series."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from pathlib import Path

from matplotlib.figure import Figure

from ..errors import InvalidInputError
from ..runs.result import Result
from .style import save, styled

Draw = Callable[[Result], Figure]


@dataclass(frozen=True)
class Drawing:
    """How a figure is drawn, and the series without which it is not.

    Attributes:
        draw: Draws it.
        needs: Names of series.
        applies: Whether it says anything of a result that has them.
    """

    draw: Draw
    needs: frozenset[str]
    applies: Callable[[Result], bool]


#: Every figure, by name.
FIGURES: dict[str, Drawing] = {}


def draws(
    *needs: str, applies: Callable[[Result], bool] = lambda result: True
) -> Callable[[Draw], Draw]:
    """Register a function as the figure of its name, drawn in the common style."""

    def register(draw: Draw) -> Draw:
        @wraps(draw)
        def wrapped(result: Result) -> Figure:
            with styled():
                return draw(result)

        FIGURES[draw.__name__] = Drawing(wrapped, frozenset(needs), applies)
        return wrapped

    return register


def drawable(result: Result) -> list[str]:
    """Names of the figures for which ``result`` has the series; none of a single sample."""
    if result.time.size < 2:
        return []
    return [
        name
        for name, drawing in FIGURES.items()
        if drawing.needs <= result.series.keys() and drawing.applies(result)
    ]


def write_figures(result: Result, folder: str | Path) -> list[Path]:
    """Write every figure for which ``result`` has the series, as ``<name>.png``.

    Args:
        result: What to show.
        folder: Made if it is not there.

    Returns:
        The files.

    Raises:
        InvalidInputError: If the folder cannot be written to.
    """
    folder = Path(folder)
    files = [folder / f"{name}.png" for name in drawable(result)]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for file in files:
            save(FIGURES[file.stem].draw(result), file)
    except OSError as error:
        raise InvalidInputError(f"figures folder {folder}: {error.strerror}") from None
    return files

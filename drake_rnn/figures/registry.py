"""The register of figures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps

from matplotlib.figure import Figure

from ..runs.result import Result
from .style import styled

Draw = Callable[[Result], Figure]


@dataclass(frozen=True)
class Drawing:
    """A registered figure.

    Attributes:
        draw: Function that draws it.
        needs: Names of the series it needs.
        applies: Whether it is meaningful for a result that has these series.
        least: Least width in which it can be read [inch].
    """

    draw: Draw
    needs: frozenset[str]
    applies: Callable[[Result], bool]
    least: float


#: All figures, by name.
FIGURES: dict[str, Drawing] = {}


def draws(
    *needs: str,
    applies: Callable[[Result], bool] = lambda result: True,
    least: float = 0.0,
) -> Callable[[Draw], Draw]:
    """Register a function as the figure of that name, drawn in the common style.

    Args:
        needs: Names of the series that the figure needs.
        applies: Whether it is meaningful for a result that has these series.
        least: Least width in which it can be read [inch].
    """

    def register(draw: Draw) -> Draw:
        @wraps(draw)
        def wrapped(result: Result) -> Figure:
            with styled():
                return draw(result)

        FIGURES[draw.__name__] = Drawing(wrapped, frozenset(needs), applies, least)
        return wrapped

    return register

"""Figures of a run, drawn from its result alone, in the sizes of a printed page.

Each figure is a function of a `Result`, registered in `FIGURES` under its name together with the
series it needs. A figure is not drawn for a result without its series. A new law therefore needs no
change here, unless it has something new to show.
"""

from . import (  # noqa: F401  These register figures.
    derivatives,
    orientation,
    overview,
    pressing,
    single,
)
from .registry import FIGURES, Drawing, drawable, figure, write_figures

__all__ = ["FIGURES", "Drawing", "drawable", "figure", "write_figures"]

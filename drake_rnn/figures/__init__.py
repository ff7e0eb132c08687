"""Figures of a run, drawn from its result alone, in the sizes of a printed page.

Each figure is one function of a `Result`, registered in `FIGURES` together with the series it
needs; its name is its file's. A figure whose series a law does not have is not drawn, so that
a new law needs nothing here unless it has something new to show.
"""

from . import derivatives, overview, pressing, single  # noqa: F401  They register figures.
from .registry import FIGURES, Drawing, drawable, write_figures

__all__ = ["FIGURES", "Drawing", "drawable", "write_figures"]

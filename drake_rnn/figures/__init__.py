"""Figures of a run, drawn from its result alone, in the sizes of a printed page.

Each figure is a function of a `Result`, registered in `FIGURES` under its name together with the
series it needs. A figure is not drawn for a result without its series. A new law therefore needs no
change here, unless it has something new to show.
"""

from ..inputs.packages import lent_names

__all__, __getattr__, __dir__ = lent_names(__name__, __file__)

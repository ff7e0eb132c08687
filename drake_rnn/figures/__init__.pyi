"""Names of this room, and the modules that they are lent from when they are first used."""

from .drawn import (
    FIGURES as FIGURES,
    drawable as drawable,
    figure as figure,
    write_figures as write_figures,
)

"""Names of this room, and the modules that they are lent from when they are first used."""

from .result_figures import (
    FIGURES as FIGURES,
    drawable as drawable,
    figure as figure,
    fitting as fitting,
    write_figures as write_figures,
)
from .style import (
    Paper as Paper,
    drawn_for as drawn_for,
    parse_width as parse_width,
)

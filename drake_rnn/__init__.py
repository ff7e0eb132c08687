"""Recurrent-neural-network controllers for redundant manipulators, as Drake systems.

The public names are listed in ``__init__.pyi``. Each is imported when it is first asked for.
"""

from .inputs.html import VIEWS
from .inputs.lending import lent_names

__all__, __getattr__, __dir__ = lent_names(__name__, __file__)

# A notebook shows these of a result; runs/ does not know the rooms that draw them.
VIEWS.update(
    overview="drake_rnn.figures.drawn:overview_in_notebook",
    playback="drake_rnn.playback:playback_in_notebook",
)

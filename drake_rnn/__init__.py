"""Recurrent-neural-network controllers for redundant manipulators, as Drake systems.

The public names are listed in ``__init__.pyi``. Each is imported when it is first asked for.
"""

import sys

from .inputs.packages import VIEWS, lent_names
from .moved_modules import MovedModules

# Last, so that it costs nothing where a name is right.
sys.meta_path.append(MovedModules())

_OLD_NAMES = {
    "Driven": "drive.session:DriveOutcome",
    "Paced": "drive.driving:PacedConnection",
    "Tuned": "tuning:TuningOutcome",
}

__all__, __getattr__, __dir__ = lent_names(__name__, __file__, _OLD_NAMES)

# A notebook shows these of a result; runs/ does not know the rooms that draw them.
VIEWS.update(
    overview="drake_rnn.figures.result_figures:overview_in_notebook",
    playback="drake_rnn.playback:playback_in_notebook",
)

"""The start of the command line, before anything large is imported."""

from __future__ import annotations

import logging
import os
import sys
from pathlib import Path

from ..inputs.lending import lent
from .interrupting import interruptible


def main() -> None:
    """Run the command line ``drake-rnn``.

    Modules in the current folder can be named in a document, as with ``python -m``. The folder
    comes last, so that no file in it stands in for an installed module.
    """
    with interruptible():
        if not sys.flags.safe_path:
            sys.path.append(str(Path.cwd()))
        # Figures are written to files, whatever windows the environment asks for.
        os.environ["MPLBACKEND"] = "Agg"
        # Where its cache cannot be written to, it works nevertheless, and says so at length.
        logging.getLogger("matplotlib").setLevel(logging.ERROR)
        # Importing it takes long enough to be interrupted.
        lent(f"{__package__}.commands:app")()

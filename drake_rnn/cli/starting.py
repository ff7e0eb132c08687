"""The start of the command line, before anything large is imported."""

from __future__ import annotations

import logging
import os
import sys
from contextlib import suppress
from pathlib import Path

from ..inputs.lending import lent
from .interrupting import interruptible
from .statuses import FAILED
from .streams import Streams

# What the loader says of a library that it does not find.
_MISSING = "cannot open shared object file"


def main() -> None:
    """Run the command line ``drake-rnn``.

    Modules in the current folder can be named in a document, as with ``python -m``. The folder
    comes last, so that no file in it stands in for an installed module.
    """
    streams = Streams()
    try:
        with interruptible():
            _start()
    except SystemExit as end:
        # Typer ends each command so, with a number.
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
        raise SystemExit(streams.status(code)) from end.__cause__


def _start() -> None:
    if sys.argv[1:] == ["--version"]:
        # The options of two dozen commands are not needed for that.
        sys.stdout.write(lent("drake_rnn.inputs.versions:versions_text")())
        raise SystemExit(0)
    if not sys.flags.safe_path:
        # A folder that was removed has no modules.
        with suppress(OSError):
            sys.path.append(str(Path.cwd()))
    # Figures are written to files, whatever windows the environment asks for.
    os.environ["MPLBACKEND"] = "Agg"
    # Where its cache cannot be written to, it works nevertheless, and says so at length.
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    # Importing it takes long enough to be interrupted.
    try:
        lent(f"{__package__}.commands:app")()
    except ImportError as error:
        if _MISSING not in str(error):
            raise
        library = str(error).partition(":")[0]
        sys.stderr.write(
            f"error {library}: this library of the system, which Drake needs, is missing; "
            "on Debian and Ubuntu: apt-get install libglib2.0-0 libegl1 libgl1-mesa-dri\n"
        )
        raise SystemExit(FAILED) from None

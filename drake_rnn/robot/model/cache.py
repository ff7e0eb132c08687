"""Files that are made once and kept in the user's cache folder."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from tempfile import mkstemp

from ...errors import InvalidInputError


def cache_folder() -> Path:
    """Return this package's folder in the user's cache, which need not exist.

    It is ``$XDG_CACHE_HOME/drake_rnn``, by default ``~/.cache/drake_rnn``.
    """
    home = os.environ.get("XDG_CACHE_HOME")
    return (Path(home) if home else Path.home() / ".cache") / "drake_rnn"


def cached_file(name: str, make: Callable[[], bytes]) -> Path:
    """Return a file of the cache, made first if it is not there.

    The file appears under its name only once it is complete, so two processes may make it at the
    same time: both end up with the same file.

    Args:
        name: Name of the file, which must determine its content.
        make: Returns the content.

    Raises:
        InvalidInputError: If the file cannot be written.
    """
    file = cache_folder() / name
    if file.is_file():
        return file
    content = make()
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        handle, unfinished = mkstemp(dir=file.parent, suffix=".unfinished")
        with os.fdopen(handle, "wb") as stream:
            stream.write(content)
        os.replace(unfinished, file)
    except OSError as error:
        raise InvalidInputError(
            f"XDG_CACHE_HOME: cannot keep {file}: {error.strerror}; give a folder that can be "
            "written"
        ) from None
    return file

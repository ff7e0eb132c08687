"""Files that a user names: read only if they are files, and only as much as such a file holds."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path

_MEGABYTE = 1_000_000


def content_of(file: str | Path, most: int) -> bytes:
    """Return what a file holds.

    Args:
        file: The file.
        most: Largest size that such a file may have [bytes].

    Raises:
        OSError: If it cannot be opened or read.
        ValueError: If it is a folder, a pipe, a device or too large, or its name is none.
    """
    # A pipe would keep its reader waiting until something is written to it.
    handle = os.open(file, os.O_RDONLY | os.O_NONBLOCK)
    with os.fdopen(handle, "rb") as stream:
        found = os.fstat(handle)
        if stat.S_ISDIR(found.st_mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        if not stat.S_ISREG(found.st_mode):
            raise ValueError("must be a regular file, not a pipe or a device")
        if found.st_size > most:
            raise ValueError(
                f"has {found.st_size / _MEGABYTE:.3g} MB, and may have {most / _MEGABYTE:g} MB"
            )
        # Some files that the system makes up, and some that grow, are longer than they say.
        content = stream.read(most + 1)
    if len(content) > most:
        raise ValueError(f"has more than {most / _MEGABYTE:g} MB, which it may have")
    return content

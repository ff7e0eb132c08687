"""Files that are written completely or not at all, even if the writing process is killed.

Only regular files are written and replaced. A link, a pipe or a device in the place of one is left
as it is, whoever names it.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import get_native_id
from typing import TextIO

from ..errors import InvalidInputError

#: What may stand where a file is to be written, besides a regular file.
_OTHERS = (
    (stat.S_ISLNK, "a symbolic link"),
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
)


def require_replaceable(file: Path, what: str = "") -> None:
    """Refuse a file to write that exists as anything but a regular file that may be written.

    Args:
        file: The file.
        what: What names it, for messages, e.g. ``--to``.

    Raises:
        InvalidInputError: If it is a link, a folder, a pipe, a socket, a device or read-only, or
            there can be no file of that name.
    """
    place = f"{what}: {file}" if what else f"{file}"
    try:
        found = file.lstat().st_mode
    except FileNotFoundError:
        return
    except OSError as error:
        raise InvalidInputError(f"{place}: {error.strerror}") from None
    except ValueError as error:
        raise InvalidInputError(f"{place!r}: {error}") from None
    if not stat.S_ISREG(found):
        kind = next((name for is_kind, name in _OTHERS if is_kind(found)), "a device")
        raise InvalidInputError(f"{place}: is {kind}; only a regular file is written")
    if not os.access(file, os.W_OK):
        raise InvalidInputError(f"{place}: is read-only, and is not replaced")


def room_in(folder: Path) -> int:
    """Return how much may still be written to the disk of a folder [bytes]."""
    found = os.statvfs(folder)
    return found.f_bavail * found.f_frsize


@contextmanager
def written_whole(file: Path) -> Iterator[TextIO]:
    """Open a text file for writing that replaces another one in a single step at the end.

    Args:
        file: The file to replace; it stays until the block has ended.

    Raises:
        InvalidInputError: If something else than a regular file has that name.
        OSError: If it cannot be written.
    """
    with replacing(file) as new, new.open("w", newline="", encoding="utf-8") as stream:
        yield stream


@contextmanager
def replacing(file: Path) -> Iterator[Path]:
    """Name a file to write, which replaces another one in a single step at the end.

    Threads and processes that write the same file at a time do not disturb each other; the last one
    to end has written it.

    Args:
        file: The file to replace; it stays until the block has ended, and if that fails.

    Raises:
        InvalidInputError: If something else than a regular file has that name.
        OSError: If it cannot be replaced.
    """
    require_replaceable(file)
    new = file.with_name(f".{file.name}.{get_native_id()}.new")
    new.unlink(missing_ok=True)
    try:
        # Not opened if it has come to exist meanwhile, as a link to another file might have.
        os.close(os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
        yield new
        os.replace(new, file)
    finally:
        new.unlink(missing_ok=True)

"""Files that are written completely or not at all, even if the writing process is killed."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO


@contextmanager
def written_whole(file: Path) -> Iterator[TextIO]:
    """Open a text file for writing that replaces another one in a single step at the end.

    Args:
        file: The file to replace; it stays until the block has ended.

    Raises:
        OSError: If it cannot be written.
    """
    with replacing(file) as new, new.open("w", newline="", encoding="utf-8") as stream:
        yield stream


@contextmanager
def replacing(file: Path) -> Iterator[Path]:
    """Name a file to write, which replaces another one in a single step at the end.

    Args:
        file: The file to replace; it stays until the block has ended, and if that fails.

    Raises:
        OSError: If it cannot be replaced.
    """
    new = file.with_name(f".{file.name}.new")
    try:
        yield new
        os.replace(new, file)
    finally:
        new.unlink(missing_ok=True)

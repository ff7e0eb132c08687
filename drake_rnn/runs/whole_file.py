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
    new = file.with_name(f".{file.name}.new")
    with new.open("w", newline="", encoding="utf-8") as stream:
        yield stream
    os.replace(new, file)

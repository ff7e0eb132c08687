"""Files that are whole or not there, whatever happens to the process that writes them."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO


@contextmanager
def written_whole(file: Path) -> Iterator[TextIO]:
    """Let a text be written beside its place, and put it there in one step.

    Args:
        file: The place; what is there stays until the block has ended.

    Raises:
        OSError: If it cannot be written.
    """
    new = file.with_name(f".{file.name}.new")
    with new.open("w", newline="", encoding="utf-8") as stream:
        yield stream
    os.replace(new, file)

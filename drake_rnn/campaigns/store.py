"""Rows of a campaign on disk: one file for each row, written whole or not at all."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import InvalidInputError
from ..inputs.given_file import json_of
from ..runs.folder import claimed
from ..runs.whole_file import written_whole
from .outcome import Order, Outcome


class RowStore:
    """A folder with the outcome of each run that has ended.

    Even if this process is killed, each file is complete or absent. The name of a file is a digest
    of all that its numbers depend on.

    Args:
        folder: The folder, which is created if missing.

    Raises:
        InvalidInputError: If it cannot be written to.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InvalidInputError(f"rows {folder}: {error.strerror}") from None

    def get(self, key: str) -> Outcome | None:
        """Return the outcome kept under a key; None if it is missing or damaged."""
        try:
            return Outcome.of(json_of(self._file(key)))
        except (OSError, ValueError):
            return None

    def put(self, order: Order, outcome: Outcome) -> None:
        """Keep the outcome of an order.

        Raises:
            InvalidInputError: If it cannot be written.
        """
        file = self._file(order.key)
        contents = {**outcome.contents(), "versions": order.stamp, "document": order.document}
        try:
            file.parent.mkdir(exist_ok=True)
            with written_whole(file) as stream:
                stream.write(json.dumps(contents, default=repr))
        except OSError as error:
            raise InvalidInputError(f"row {file}: {error.strerror}") from None

    def kept(self) -> list[str]:
        """Return the keys under which something is kept."""
        return sorted(file.stem for file in self.folder.glob("*/*.json"))

    def forget(self, key: str) -> None:
        """Forget what is kept under a key."""
        self._file(key).unlink(missing_ok=True)

    def remove(self) -> None:
        """Remove the folder with all that is in it."""
        shutil.rmtree(self.folder, ignore_errors=True)

    @contextmanager
    def claimed(self) -> Iterator[None]:
        """Keep other processes from working at the same rows within a with-block.

        The operating system releases the lock when this process ends, however it ends.

        Raises:
            InvalidInputError: If another process holds the lock.
        """
        with claimed(self.folder):
            yield

    def _file(self, key: str) -> Path:
        # A folder with many thousand files is slow.
        return self.folder / key[:2] / f"{key}.json"

"""Rows of a campaign on disk: a file each, whole or not there."""

from __future__ import annotations

import fcntl
import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import InvalidInputError
from ..runs.whole_file import written_whole
from .outcome import Order, Outcome


class RowStore:
    """A folder with the outcome of each run that has ended.

    Whatever happens to this process, a file is whole or not there. Its name stands for all that its
    numbers depend on.

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
        """Return the outcome that is kept under a key; None if there is none, or half of one."""
        try:
            return Outcome.of(json.loads(self._file(key).read_text()))
        except (OSError, ValueError, KeyError, TypeError):
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
        """Let no other process work at the same rows.

        The system takes the claim back when this process ends, however it ends.

        Raises:
            InvalidInputError: If another one does.
        """
        with (self.folder / ".claim").open("w") as claim:
            try:
                fcntl.flock(claim, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise InvalidInputError(
                    f"{self.folder}: another process is working at these rows; wait for it, or "
                    "give another --out"
                ) from None
            yield

    def _file(self, key: str) -> Path:
        # Folders of many thousand files are slow.
        return self.folder / key[:2] / f"{key}.json"

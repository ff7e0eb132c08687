"""The store of records: one file for each run, written whole or not at all."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import InvalidInputError
from ..inputs.files import json_of
from ..runs.folder import claimed, written_whole
from .requests import RunRecord, RunRequest


class RecordStore:
    """A folder with the record of each run that has ended.

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

    def get(self, key: str) -> RunRecord | None:
        """Return the record stored under a key; None if it is missing or damaged."""
        try:
            return RunRecord.of(json_of(self._file(key)))
        except (OSError, ValueError):
            return None

    def records(self, requests: Iterable[RunRequest], again: bool = False) -> dict[str, RunRecord]:
        """Return the records stored for requests, by their keys.

        Args:
            requests: The requests.
            again: Whether to leave out runs whose worker crashed, so that they are retried.
        """
        found = {request.key: self.get(request.key) for request in requests}
        return {
            key: record
            for key, record in found.items()
            if record is not None and not (again and record.status == "killed its worker")
        }

    def put(self, request: RunRequest, record: RunRecord) -> None:
        """Store the record of a request.

        Raises:
            InvalidInputError: If it cannot be written.
        """
        file = self._file(request.key)
        contents = {**record.contents(), "versions": request.stamp, "document": request.document}
        try:
            file.parent.mkdir(exist_ok=True)
            with written_whole(file) as stream:
                stream.write(json.dumps(contents, default=repr))
        except OSError as error:
            raise InvalidInputError(f"row {file}: {error.strerror}") from None

    def all_keys(self) -> list[str]:
        """Return the keys under which something is stored."""
        return sorted(file.stem for file in self.folder.glob("*/*.json"))

    def forget(self, key: str) -> None:
        """Remove what is stored under a key."""
        self._file(key).unlink(missing_ok=True)

    def remove(self) -> None:
        """Remove the folder with all that is in it."""
        shutil.rmtree(self.folder, ignore_errors=True)

    @contextmanager
    def claimed(self) -> Iterator[None]:
        """Keep other processes from working at the same records within a with-block.

        The operating system releases the lock when this process ends, however it ends.

        Raises:
            InvalidInputError: If another process holds the lock.
        """
        with claimed(self.folder):
            yield

    def _file(self, key: str) -> Path:
        # A folder with many thousand files is slow.
        return self.folder / key[:2] / f"{key}.json"

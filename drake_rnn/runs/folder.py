"""The folder of a run, which at any time holds a whole result or is marked as incomplete."""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

from ..errors import InvalidInputError
from .whole_file import written_whole

#: File with the record of the run; it is written first, as incomplete, and last.
RECORD = "run.json"
_INCOMPLETE = {"status": "incomplete"}
#: Errors that reading damaged or foreign files raises.
UNREADABLE = (OSError, EOFError, ValueError, KeyError, BadZipFile, zlib.error)
#: Files that runs write, also those of versions without a record.
_FILES = (
    "experiment.yaml",
    "result.npz",
    "metrics.json",
    "diagram.*",
    "playback.html",
    "film.*",
    "figures/*.png",
    "figures/*.pdf",
    "figures/*.svg",
)


@contextmanager
def filled(folder: str | Path, record: Mapping[str, Any]) -> Iterator[Path]:
    """Open a folder for the results of a run, which replace those of another run.

    The folder is marked as incomplete until the block has ended, even if this process is killed.

    Args:
        folder: The folder, which is created if missing. Files of other names than a run's stay.
        record: What the record says of the run.

    Raises:
        InvalidInputError: If the folder cannot be written to.
    """
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _write_record(folder, _INCOMPLETE)
        for pattern in _FILES:
            for file in folder.glob(pattern):
                file.unlink()
        yield folder
        _write_record(folder, record)
    except OSError as error:
        raise InvalidInputError(f"output folder {folder}: {error.strerror}") from None


def read_record(folder: Path) -> dict[str, Any]:
    """Return the record of a folder; empty for a folder from before there were records.

    Raises:
        InvalidInputError: If the folder is incomplete.
    """
    try:
        record: dict[str, Any] = json.loads((folder / RECORD).read_text())
    except FileNotFoundError:
        return {}
    except (OSError, ValueError) as error:
        raise InvalidInputError(f"{folder}: {RECORD} cannot be read: {error}") from None
    if record == _INCOMPLETE:
        raise InvalidInputError(
            f"{folder}: is incomplete; the command that wrote it was stopped before it ended"
        )
    if not isinstance(record, dict):
        raise InvalidInputError(f"{folder}: {RECORD} is no record of a run")
    return record


def _write_record(folder: Path, record: Mapping[str, Any]) -> None:
    with written_whole(folder / RECORD) as stream:
        stream.write(json.dumps(record, indent=2) + "\n")

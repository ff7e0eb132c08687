"""The folder of a run, which at any time holds a whole result or is marked as incomplete.

One process at a time writes to it, and no file of it is replaced by a table, a figure or an export.
"""

from __future__ import annotations

import errno
import fcntl
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from fnmatch import fnmatch
from pathlib import Path
from threading import get_ident
from typing import Any

from ..errors import InvalidInputError
from ..inputs.given_file import json_of
from .whole_file import replacing, require_replaceable, written_whole

#: File with the record of the run; it is written first, as incomplete, and last.
RECORD = "run.json"
_INCOMPLETE = {"status": "incomplete"}
#: File that the process that writes to a folder holds the lock of.
_CLAIM = ".claim"
#: Why a file system cannot lock a file; work goes on without a lock there.
_NO_LOCKS = {errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL}
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
    # What a process that was killed has left.
    ".*.new",
    "figures/.*.new",
)
#: Subfolders of a run's folder.
_FOLDERS = ("checkpoint", "figures", "second")
#: Files that commands write to folders of their own, by a file that tells such a folder.
_OWN = {
    RECORD: (RECORD, "cycles.npz", "pacer.npz", "checkpoint/*", *_FILES),
    "campaign.yaml": ("experiment.yaml", "campaign.*", "table.csv", "summary.html", "rows/*"),
    "sweep.csv": ("sweep.*", "learning.*"),
    "comparison.csv": ("comparison.*",),
    "report.json": ("report.json", "index.*", "runs/*"),
}
#: Folders that this process writes to, with the thread that does.
_CLAIMS: set[tuple[int, int, str]] = set()


@contextmanager
def claimed(folder: Path, *, shared: bool = False, within: bool = False) -> Iterator[None]:
    """Keep other processes from writing to a folder within a with-block.

    The operating system releases the lock when this process ends, however it ends.

    Args:
        folder: The folder, which exists.
        shared: Whether others that also share it may write beside this process.
        within: Whether a claim of the same thread, in whose block this one is, suffices.

    Raises:
        InvalidInputError: If the folder is claimed already, there is none, or nobody can write to
            it.
    """
    if not folder.is_dir():
        what = "is a file, not a folder" if folder.exists() else "there is no such folder"
        raise InvalidInputError(f"{folder}: {what}")
    key = os.getpid(), get_ident(), os.path.realpath(folder)
    if within and key in _CLAIMS:
        yield
        return
    file = folder / _CLAIM
    handle = _locked(file, fcntl.LOCK_SH if shared else fcntl.LOCK_EX)
    _CLAIMS.add(key)
    try:
        yield
    finally:
        _CLAIMS.discard(key)
        with suppress(OSError):
            # Not while others share it.
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            file.unlink()
        os.close(handle)


def _locked(file: Path, kind: int) -> int:
    """Return the handle of a file of which this process holds the lock."""
    require_replaceable(file)
    try:
        while True:
            handle = os.open(file, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666)
            try:
                fcntl.flock(handle, kind | fcntl.LOCK_NB)
            except OSError as error:
                if error.errno not in _NO_LOCKS:
                    os.close(handle)
                    raise
            # Who held it before may have removed the file meanwhile.
            with suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(handle), os.stat(file)):
                    return handle
            os.close(handle)
    except BlockingIOError:
        raise InvalidInputError(
            f"{file.parent}: another process is working in it; wait for it, or give another folder"
        ) from None
    except OSError as error:
        raise InvalidInputError(f"output folder {file.parent}: {error.strerror}") from None


def make_folder(folder: Path) -> None:
    """Make a folder, and those that it is in, unless there is one.

    Raises:
        InvalidInputError: If something else has that name, or it is the name of none.
        OSError: If it cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise InvalidInputError(f"{folder}: is a file, not a folder") from None
    except ValueError as error:
        raise InvalidInputError(f"{str(folder)!r}: {error}") from None


def require_fillable(folder: Path) -> None:
    """Refuse a folder in which a result cannot take the place of what is there.

    Raises:
        InvalidInputError: If a file of a run's is there as a link, a folder, a pipe or a device, or
            one of its subfolders is none.
    """
    for file in (folder / RECORD, *_own_files(folder)):
        require_replaceable(file)
    for name in _FOLDERS:
        place = folder / name
        # What is in a folder elsewhere, to which a link leads, is not a run's to remove.
        if place.is_symlink():
            raise InvalidInputError(f"{place}: is a symbolic link; a run needs a folder there")
        if os.path.lexists(place) and not place.is_dir():
            raise InvalidInputError(f"{place}: is not a folder, which a run needs")


def require_output(file: Path, what: str, *besides: str) -> None:
    """Refuse a file that a user names for an output, unless it is new or a regular file.

    Args:
        file: The file.
        what: What names it, for messages, e.g. ``--to``.
        *besides: Patterns of a run's own files that may be written nevertheless.

    Raises:
        InvalidInputError: If it is a link, a folder, a pipe or a device, or one of the files that a
            run, a campaign, a sweep, a comparison or a report has written itself.
    """
    require_replaceable(file, what)
    place = Path(os.path.realpath(file.parent)) / file.name
    if any(fnmatch(str(place), f"*/{pattern}") for pattern in besides):
        return
    for folder in place.parents[:3]:
        inside = str(place.relative_to(folder))
        for told, patterns in _OWN.items():
            if (folder / told).is_file() and any(fnmatch(inside, each) for each in patterns):
                raise InvalidInputError(
                    f"{what}: {file}: belongs to the results in {folder}; give another file"
                )


@contextmanager
def filled(folder: str | Path, record: Mapping[str, Any]) -> Iterator[Path]:
    """Open a folder for the results of a run, which replace those of another run.

    The folder is marked as incomplete until the block has ended, even if this process is killed. If
    the block fails, what it has written is removed.

    Args:
        folder: The folder, which is created if missing. Files of other names than a run's stay.
        record: What the record says of the run.

    Raises:
        InvalidInputError: If another process writes to the folder, or a file cannot be replaced.
        OSError: If the folder cannot be written to.
    """
    folder = Path(folder)
    make_folder(folder)
    with claimed(folder, within=True):
        require_fillable(folder)
        with written_whole(folder / RECORD) as stream:
            stream.write(_text(_INCOMPLETE))
        _remove_own(folder)
        try:
            # Written first, so that at the end it needs no more room.
            with replacing(folder / RECORD) as new:
                new.write_text(_text(record))
                yield folder
        except OSError:
            _remove_own(folder)
            raise


def read_record(folder: Path) -> dict[str, Any]:
    """Return the record of a folder; empty for a folder from before there were records.

    Raises:
        InvalidInputError: If the folder is incomplete.
    """
    try:
        record = json_of(folder / RECORD)
    except FileNotFoundError:
        return {}
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise InvalidInputError(f"{folder}: {RECORD} cannot be read: {why}") from None
    if record == _INCOMPLETE:
        raise InvalidInputError(
            f"{folder}: is incomplete; the command that wrote it was stopped before it ended"
        )
    if not isinstance(record, dict):
        raise InvalidInputError(f"{folder}: {RECORD} is no record of a run")
    return record


def _text(record: Mapping[str, Any]) -> str:
    return json.dumps(record, indent=2) + "\n"


def _own_files(folder: Path) -> Iterator[Path]:
    """Yield the files in a folder that runs write; also links that lead nowhere."""
    for pattern in _FILES:
        place, name = (folder / pattern).parent, Path(pattern).name
        with suppress(FileNotFoundError, NotADirectoryError):
            yield from (place / each for each in os.listdir(place) if fnmatch(each, name))


def _remove_own(folder: Path) -> None:
    for file in _own_files(folder):
        file.unlink()

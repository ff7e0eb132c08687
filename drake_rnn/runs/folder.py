"""The folder of a result: files that are written completely, and checked when they are read.

At any time the folder of a run holds a whole result or is marked as incomplete. One process at a
time writes to it, and no file of it is replaced by a table, a figure or an export.

A file is written completely or not at all, even if the writing process is killed. Only regular
files are written and replaced. A link, a pipe or a device in the place of one is left as it is,
whoever names it.

What a saved result cannot hold is refused.
"""

from __future__ import annotations

import errno
import fcntl
import json
import os
import stat
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from fnmatch import fnmatch
from pathlib import Path
from threading import get_ident, get_native_id
from typing import Any, Literal, TextIO, TypeVar, get_args

import numpy as np

from ..errors import InvalidInputError
from ..experiment import Experiment
from ..inputs.documents import construct
from ..inputs.fields import Array
from ..inputs.files import ArrayHead, arrays_of, content_of, heads_of, is_file, json_of
from ..signals import OF_EVERY_MOTION, SERIES_SHAPES
from .series import RunOptions

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
        status = file.lstat().st_mode
    except FileNotFoundError:
        return
    except OSError as error:
        raise InvalidInputError(f"{place}: {error.strerror}") from None
    except ValueError as error:
        raise InvalidInputError(f"{place!r}: {error}") from None
    if not stat.S_ISREG(status):
        kind = next((name for is_kind, name in _OTHERS if is_kind(status)), "a device")
        raise InvalidInputError(f"{place}: is {kind}; only a regular file is written")
    if not os.access(file, os.W_OK):
        raise InvalidInputError(f"{place}: is read-only, and is not replaced")


def room_in(folder: Path) -> int:
    """Return how much may still be written to the disk of a folder [bytes]."""
    status = os.statvfs(folder)
    return status.f_bavail * status.f_frsize


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
_FOLDERS = ("checkpoint", "figures", "inputs", "second")
#: List of the files that a run has copied into its folder.
_COPIES = "inputs/inputs.json"
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
def claim_folder(folder: Path, *, is_shared: bool = False, within: bool = False) -> Iterator[None]:
    """Keep other processes from writing to a folder within a with-block.

    The operating system releases the lock when this process ends, however it ends.

    Args:
        folder: The folder, which exists.
        is_shared: Whether others that also share it may write beside this process.
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
    handle = _lock(file, fcntl.LOCK_SH if is_shared else fcntl.LOCK_EX)
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


def _lock(file: Path, kind: int) -> int:
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
        for label, patterns in _OWN.items():
            if (folder / label).is_file() and any(fnmatch(inside, each) for each in patterns):
                raise InvalidInputError(
                    f"{what}: {file}: belongs to the results in {folder}; give another file"
                )


@contextmanager
def fill_folder(folder: str | Path, record: Mapping[str, Any]) -> Iterator[Path]:
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
    with claim_folder(folder, within=True):
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
    yield from _copies(folder)


def _copies(folder: Path) -> Iterator[Path]:
    """Yield the copies of its inputs that a folder lists, and last the list."""
    place = folder / _COPIES
    if place.is_symlink() or place.parent.is_symlink():
        return
    with suppress(OSError, ValueError, KeyError, TypeError):
        names = {str(each["copy"]) for each in json_of(place)["files"]} | {"inputs/path.npz"}
        for name in sorted(names):
            file = folder / name
            # Nothing outside of the folder, whatever the list says.
            if file.parent.resolve().is_relative_to(place.parent.resolve()) and is_file(file):
                yield file
    if place.is_file():
        yield place


def _remove_own(folder: Path) -> None:
    for file in list(_own_files(folder)):
        file.unlink()
    # Folders of copies, if nothing else is in them.
    for place, _, _ in os.walk(folder / "inputs", topdown=False):
        with suppress(OSError):
            os.rmdir(place)


#: Whether a run came to its end, and if not, what stopped it.
Status = Literal["complete", "failed", "interrupted"]

_T = TypeVar("_T")
# What is driven or played may take longer than asked for: by this factor and time [s].
_LONGER, _LATER = 2.0, 60.0
# Largest number of numbers of a sample, and of samples beyond those that the document asks for.
_MOST_NUMBERS, _MORE_SAMPLES = 100_000, 1000
# What is said of a file itself begins with these words.
_OF_FILE = ("must ", "has ", "is ")
# Largest size of a diagram's text [bytes].
_MOST_TEXT = 10_000_000


def read_file(folder: Path, name: str, read: Callable[[Path], _T]) -> _T:
    """Return what a function reads from a file of a result.

    Raises:
        InvalidInputError: If the file is missing, or the function raises an OSError or ValueError.
    """
    try:
        return read(folder / name)
    except FileNotFoundError:
        why = f"{name} is missing" if folder.is_dir() else "there is no such folder"
    except OSError as error:
        why = f"{name}: {error.strerror or error}"
    except ValueError as error:
        text = str(error)
        why = f"{name} {text}" if text.startswith(_OF_FILE) else f"{name}: {text}"
    raise InvalidInputError(f"{folder}: holds no result: {why}")


def told_in(record: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Return what the record of a folder says of its result, by the names of its fields.

    Raises:
        InvalidInputError: If no run has written it.
    """
    values = {
        "status": record.get("status", "complete"),
        "failure": record.get("failure", ""),
        "warnings": record.get("warnings", []),
        "timings": record.get("timings", {}),
    }
    warnings, timings = values["warnings"], values["timings"]
    right = {
        f"status must be one of {', '.join(get_args(Status))}": values["status"]
        in get_args(Status),
        "failure must be a text": isinstance(values["failure"], str),
        "warnings must be texts": isinstance(warnings, list)
        and all(isinstance(text, str) for text in warnings),
        "timings must be numbers by name": isinstance(timings, dict)
        and all(isinstance(value, (int, float)) for value in timings.values()),
    }
    for what, holds in right.items():
        if not holds:
            raise InvalidInputError(f"{folder}: holds no result: run.json: {what}")
    try:
        options = construct(RunOptions, record.get("options", {}), "options")
    except InvalidInputError as error:
        raise InvalidInputError(f"{folder}: holds no result: run.json: {error}") from None
    return values | {"options": options}


def metrics_of(file: Path) -> dict[str, float]:
    """Return the metrics in a file, by name; OSError and ValueError if no run has written it."""
    metrics = json_of(file)
    if isinstance(metrics, dict):
        try:
            numbers = {name: value + 0.0 for name, value in metrics.items()}
        except (TypeError, OverflowError):
            pass
        else:
            return numbers
    raise ValueError("must hold numbers by name")


def graph_of(file: Path) -> str:
    """Return the text of a diagram; empty if there is none."""
    try:
        return content_of(file, _MOST_TEXT).decode()
    except FileNotFoundError:
        return ""


def series_of(file: Path, experiment: Experiment) -> dict[str, Array]:
    """Return the series in a file, ``time`` included.

    Args:
        file: The file.
        experiment: The experiment that was run.

    Raises:
        OSError: If the file cannot be read.
        ValueError: If it holds anything but series of such a run.
    """
    document = experiment.document
    most = _MORE_SAMPLES + int(_LONGER * document.duration / document.log_period)
    joints = len(experiment.arm.joints)
    _require_series(heads_of(file), joints, most)
    series = {name: np.asarray(each, dtype=float) for name, each in arrays_of(file).items()}
    time = series["time"]
    if not np.isfinite(time).all() or (np.diff(time) < 0.0).any():
        raise ValueError("time must be finite numbers that do not fall")
    longest = _LONGER * document.duration + _LATER
    if time.size and not (time[0] >= 0.0 and time[-1] <= longest):
        raise ValueError(f"time must be from 0 to {longest:g} s, not to {time[-1]:g} s")
    return series


def _require_series(heads: Mapping[str, ArrayHead], joints: int, most: int) -> None:
    """Refuse arrays that are none of a run.

    Args:
        heads: What is said of the arrays, by name.
        joints: Number of joints of the arm.
        most: Largest number of samples.
    """
    for name in ("time", *OF_EVERY_MOTION):
        if name not in heads:
            raise ValueError(f"{name} is missing")
    if len(heads["time"].shape) != 1:
        raise ValueError("time must be finite numbers that do not fall, shape (k,)")
    (count,) = heads["time"].shape
    if count > most:
        raise ValueError(f"has {count} samples, and its experiment makes at most {most}")
    if sum(head.size for head in heads.values()) > 8 * _MOST_NUMBERS * max(count, 1):
        raise ValueError(f"has more than {_MOST_NUMBERS} numbers at each time")
    lengths = {"n": joints}
    for name, head in heads.items():
        _require_shape(name, head.shape, count, lengths)


def _require_shape(name: str, shape: tuple[int, ...], count: int, lengths: dict[str, int]) -> None:
    """Refuse a series of another shape; lengths that were not known before are noted."""
    if shape[:1] != (count,):
        raise ValueError(f"{name} has shape {shape}, but there are {count} samples")
    if name not in SERIES_SHAPES or _fits(shape[1:], SERIES_SHAPES[name], lengths):
        return
    shape_text = ", ".join(
        str(lengths.get(each, each)) for each in (str(count), *SERIES_SHAPES[name])
    )
    raise ValueError(f"{name} has shape {shape}, not ({shape_text})")


def _fits(shape: tuple[int, ...], shape_expected: tuple[str, ...], lengths: dict[str, int]) -> bool:
    """Return whether a shape is the expected one."""
    return len(shape) == len(shape_expected) and all(
        lengths.setdefault(name, length) == length
        for name, length in zip(shape_expected, shape, strict=True)
    )

"""Files that a user names: read only if they are files, and only as much as such a file holds.

- CSV files that a user names: their rows, and errors that name file and row.
- Templates of HTML pages about runs.
- Files that are made once and kept in the user's cache folder.
"""

from __future__ import annotations

import csv
import errno
import json
import math
import os
import re
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from glob import escape
from hashlib import sha256
from io import StringIO
from pathlib import Path
from stat import S_ISDIR
from tempfile import gettempdir, mkstemp
from typing import Any, BinaryIO, NamedTuple, TypeVar
from zipfile import ZIP_DEFLATED, ZIP_STORED, ZipFile, ZipInfo

import numpy as np
from numpy.typing import NDArray

from ..errors import InvalidInputError
from .messages import given_twice
from .packages import import_name

_MEGABYTE = 1_000_000
# Largest size of a file of JSON, and of what the arrays of a file may take [bytes].
_MOST_JSON, _MOST_ARRAYS = 64 * _MEGABYTE, 4000 * _MEGABYTE
# Largest size of a file of the cache [bytes].
_MOST_CACHED = 1000 * _MEGABYTE
# Size of what is read at a time [bytes].
_PART = 2**20
# Kinds of numbers: logical, signed, unsigned and real ones.
_NUMBERS = "biuf"
# Largest size of the head of an array in a file [bytes].
_MOST_HEAD = 10_000


def is_file(file: str | Path) -> bool:
    """Return whether a name is that of a file; one that no file can have is not."""
    try:
        return Path(file).is_file()
    except (OSError, ValueError):
        return False


# What is done with files of other formats, by their endings.
_OTHER_FORMATS = {
    **dict.fromkeys(
        (".script", ".urscript", ".urp"),
        "is a program of Universal Robots; record the joints that it moves, by RTDE, as CSV",
    ),
    **dict.fromkeys(
        (".src", ".dat", ".krl"),
        "is a program of KUKA; give its points as CSV, with columns x [mm], y [mm], z [mm], yaw "
        "[deg], pitch [deg], roll [deg] for X, Y, Z, A, B, C",
    ),
    **dict.fromkeys(
        (".mod", ".modx", ".ls", ".gcode", ".nc"),
        "is a robot's or a machine's program; give its points as CSV, with columns x, y, z",
    ),
    **dict.fromkeys(
        (".hdf5", ".h5", ".hdf"),
        "is HDF5, as ALOHA and robomimic write it; save times and positions by "
        "numpy.savez('file.npz', t=t, q=q), with a column of q for each joint",
    ),
    **dict.fromkeys(
        (".npy", ".pkl", ".pickle", ".pt", ".pth", ".mat"),
        "is not read; save times and positions by numpy.savez('file.npz', t=t, q=q), with a column "
        "of q for each joint",
    ),
    **dict.fromkeys(
        (".gz", ".svgz", ".bz2", ".xz", ".zst", ".zip", ".tar", ".tgz"),
        "is compressed; unpack it first",
    ),
    **dict.fromkeys(
        (".dxf", ".dwg"),
        "is a drawing of a CAD program; save it as SVG, e.g. by Inkscape, for path: {kind: svg}",
    ),
}


def require_readable(file: str | Path) -> None:
    """Raise a ValueError that says what to do with a file of a format that is not read."""
    if (text := _OTHER_FORMATS.get(Path(file).suffix.lower())) is not None:
        raise ValueError(f"file {file}: {text}")


def open_regular(file: str | Path, most: int) -> BinaryIO:
    """Open a regular file of at most a size for reading.

    Args:
        file: The file.
        most: Largest size that such a file may have [bytes].

    Raises:
        OSError: If it cannot be opened or read.
        ValueError: If it is a folder, a pipe, a device or too large, or its name is none.
    """
    # A pipe would keep its reader waiting until something is written to it.
    stream = os.fdopen(os.open(file, os.O_RDONLY | os.O_NONBLOCK), "rb")
    try:
        status = os.fstat(stream.fileno())
        if stat.S_ISDIR(status.st_mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        if not stat.S_ISREG(status.st_mode):
            raise ValueError("must be a regular file, not a pipe or a device")
        if status.st_size > most:
            raise ValueError(
                f"has {status.st_size / _MEGABYTE:.3g} MB, and may have {most / _MEGABYTE:g} MB"
            )
    except (OSError, ValueError):
        stream.close()
        raise
    return stream


def content_of(file: str | Path, most: int) -> bytes:
    """Return what a file holds; arguments and errors are those of `open_regular`."""
    content = bytearray()
    with open_regular(file, most) as stream:
        # Some files that the system makes up, and some that grow, are longer than they say.
        while part := stream.read(_PART):
            content += part
            if len(content) > most:
                raise ValueError(f"has more than {most / _MEGABYTE:g} MB, which it may have")
    return bytes(content)


def json_of(file: str | Path) -> Any:
    """Return the contents of a file of JSON.

    Raises:
        OSError: If it cannot be opened or read.
        ValueError: If it is no regular file, too large, no JSON, nested too deeply, or holds a key
            twice.
    """
    try:
        return json.loads(content_of(file, _MOST_JSON), object_pairs_hook=with_keys_once)
    except RecursionError:
        raise ValueError("is nested too deeply") from None
    except ValueError as error:
        # Python reads no whole number of more than 4300 digits.
        text = "holds a number of too many digits" if "digits" in str(error) else str(error)
        raise ValueError(text) from None


def with_keys_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return a mapping of JSON; raise a ValueError if a key is there twice."""
    mapping = dict(pairs)
    if len(mapping) != len(pairs):
        raise ValueError(f"the key {given_twice(key for key, _ in pairs)!r} is given twice")
    return mapping


class ArrayHead(NamedTuple):
    """What the head of an array in a file says of it."""

    shape: tuple[int, ...]
    kind: str
    size: int


def arrays_of(file: str | Path) -> dict[str, NDArray[Any]]:
    """Return the arrays of numbers that `numpy.savez` has written to a file.

    Nothing that is read can run code. An array that the file does not hold is not made room for.

    Raises:
        OSError: If it cannot be opened or read.
        ValueError: If it is no such file, is damaged, or holds anything but numbers.
    """
    with _archive(file) as archive:
        _heads_in(archive)
        return {_name_of(member): _array_of(archive, member) for member in archive.infolist()}


def heads_of(file: str | Path) -> dict[str, ArrayHead]:
    """Return what a file says of its arrays, by name; errors are those of `arrays_of`.

    Arrays that are not wanted can so be refused before they take memory or time.
    """
    with _archive(file) as archive:
        return _heads_in(archive)


@contextmanager
def _archive(file: str | Path) -> Iterator[ZipFile]:
    """Open a file of arrays; whatever its damage raises within is a ValueError."""
    with open_regular(file, _MOST_ARRAYS) as stream:
        try:
            with ZipFile(stream) as archive:
                yield archive
        except OSError:
            raise
        # What a damaged file raises in these libraries is not documented.
        except Exception as error:
            text = " ".join(str(error).split()) or type(error).__name__
            if isinstance(error, ValueError):
                raise ValueError(text) from None
            raise ValueError(f"is damaged: {text}") from None


def _heads_in(archive: ZipFile) -> dict[str, ArrayHead]:
    members = archive.infolist()
    heads = {_name_of(member): _head_of(archive, member) for member in members}
    if len(heads) != len(members):
        raise ValueError("an array is there twice")
    if sum(head.size for head in heads.values()) > _MOST_ARRAYS:
        raise ValueError(f"its arrays take more than {_MOST_ARRAYS / _MEGABYTE:g} MB")
    return heads


def _name_of(member: ZipInfo) -> str:
    return member.filename.removesuffix(".npy")


def _head_of(archive: ZipFile, member: ZipInfo) -> ArrayHead:
    """Return what the head of an array says, if the file holds as much as it says."""
    name = _name_of(member)
    if member.compress_type not in (ZIP_STORED, ZIP_DEFLATED) or member.flag_bits & 0x1:
        raise ValueError(f"{name} is not stored as NumPy does")
    with archive.open(member) as stream:
        version = np.lib.format.read_magic(stream)
        read = {
            (1, 0): np.lib.format.read_array_header_1_0,
            (2, 0): np.lib.format.read_array_header_2_0,
        }
        if version not in read:
            raise ValueError(f"{name} is of version {version} of NumPy's format")
        shape, _, kind = read[version](stream, max_header_size=_MOST_HEAD)
        begin = stream.tell()
    if kind.kind not in _NUMBERS:
        raise ValueError(f"{name} must hold numbers, not {kind}")
    size = kind.itemsize
    for length in shape:
        size *= length
    if size != member.file_size - begin or min(shape, default=0) < 0:
        raise ValueError(f"{name} of shape {shape} has {member.file_size - begin} bytes")
    return ArrayHead(shape, kind.kind, size)


def _array_of(archive: ZipFile, member: ZipInfo) -> NDArray[Any]:
    with archive.open(member) as stream:
        array: NDArray[Any] = np.lib.format.read_array(stream, allow_pickle=False)
    return array


#: Number of a row in its file, and its cells without the spaces around them.
Row = tuple[int, list[str]]

T = TypeVar("T")


# What comments begin with.
_COMMENTS = ("#", "%")


def read_rows(file: str, most_bytes: int, most_rows: int, parse: Callable[[list[Row]], T]) -> T:
    """Return what a function makes of the rows of a CSV file that are not empty.

    Entries are separated by commas, semicolons, tabs or blanks, as in the first line that is no
    comment; with semicolons, numbers may have decimal commas. Lines that begin with # or % are
    comments. A comment just above the rows names the columns if it has as many entries.

    Args:
        file: Name of the file.
        most_bytes: Size that it may have [bytes].
        most_rows: Number of rows that it may have below its header.
        parse: Function of the rows, of which there is one or more; what it raises as a ValueError
            is told with the name of the file.

    Raises:
        ValueError: If the file cannot be read; the message names file, row and column.
    """
    try:
        text = content_of(file, most_bytes).decode("utf-8-sig")
        require_few(max(text.count("\n"), text.count("\r")) - 1, "rows", most_rows)
        rows = _rows(text)
        if not rows:
            raise ValueError("is empty")
        return parse(rows)
    except OSError as error:
        raise ValueError(f"file {file}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ValueError(f"file {file}: is not a text file") from None
    except (ValueError, csv.Error) as error:
        raise ValueError(f"file {file}: {error}") from None


def _rows(text: str) -> list[Row]:
    """Return the rows of a text that are not empty, the first of which may be a comment."""
    lines = list(StringIO(text, newline=""))
    is_comment = [line.lstrip().startswith(_COMMENTS) for line in lines]
    whole = (k for k, line in enumerate(lines) if line.strip() and not is_comment[k])
    first = next(whole, len(lines))
    separator = _separator(lines[first]) if first < len(lines) else ","
    if lines[first : first + 1] and lines[first].strip().lower() == f"sep={separator}":
        # A hint to spreadsheets.
        is_comment[first], first = True, next(whole, len(lines))
    rows = _split(
        ["\n" if k else line for k, line in zip(is_comment, lines, strict=True)], separator
    )
    comments = [k for k in range(first) if is_comment[k]]
    if rows and comments and not is_header(rows[0][1]):
        # NumPy writes the names of columns as a comment.
        above = _split([lines[comments[-1]].lstrip(" \t#%")], separator)
        if above and len(above[0][1]) == len(rows[0][1]) and is_header(above[0][1]):
            rows.insert(0, (comments[-1] + 1, above[0][1]))
    return rows


def _separator(line: str) -> str:
    """Return what is between the entries of a line."""
    return next((each for each in (";", ",", "\t", " ") if each in line.strip()), ",")


def _split(lines: list[str], separator: str) -> list[Row]:
    """Return the rows of lines that are not empty."""
    if separator == " ":
        lines = [line.strip() + "\n" for line in lines]
    reader = csv.reader(lines, delimiter=separator, skipinitialspace=separator == " ")
    rows = [(reader.line_num, [cell.strip() for cell in cells]) for cells in reader]
    if separator == ";":
        rows = [(row, [_with_point(cell) for cell in cells]) for row, cells in rows]
    return [(row, cells) for row, cells in rows if any(cells)]


def _with_point(cell: str) -> str:
    """Return a number with a decimal point in place of a comma."""
    return cell.replace(",", ".") if re.fullmatch(r"[-+]?\d*,\d+(?:[eE][-+]?\d+)?", cell) else cell


def require_few(count: int, what: str, most: int) -> None:
    """Raise a ValueError if there are more rows or points than anybody needs."""
    if count > most:
        share = math.ceil(count / most)
        raise ValueError(f"has {count} {what}, and may have {most}; keep one of {share} of them")


def is_header(cells: list[str]) -> bool:
    """Return whether no cell of a row is a number.

    NaN, infinity and what is no decimal are told of as numbers, not as names of columns.
    """
    return not any(map(_is_number, cells))


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def page_templates(*folders: Path) -> Any:
    """Return the templates in folders; they escape values, and refuse names without a value."""
    return import_name("jinja2:Environment")(
        loader=import_name("jinja2:FileSystemLoader")(folders),
        autoescape=True,
        undefined=import_name("jinja2:StrictUndefined"),
        trim_blocks=True,
        lstrip_blocks=True,
    )


def cache_folder() -> Path:
    """Return this package's folder in the user's cache, which need not exist.

    It is ``$XDG_CACHE_HOME/drake_rnn``, by default ``~/.cache/drake_rnn``; for a user without a
    home a folder among the temporary ones, which is that user's alone.

    Raises:
        InvalidInputError: If there is no such folder.
    """
    home = os.environ.get("XDG_CACHE_HOME")
    try:
        return (Path(home) if home else Path.home() / ".cache") / "drake_rnn"
    except RuntimeError:
        return _own_temporary_folder()


def _own_temporary_folder() -> Path:
    """Return a folder into which nobody else writes: libraries of the cache are loaded."""
    folder = Path(gettempdir()) / f"drake_rnn-{os.getuid()}"
    with suppress(OSError):
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
        if S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and not found.st_mode & 0o022:
            return folder
    raise InvalidInputError(
        f"XDG_CACHE_HOME: must be given: this user has no home, and {folder} is not this user's "
        "alone"
    )


def cached_file(name: str, make: Callable[[], bytes]) -> Path:
    """Return a file of the cache, made first if it is not there whole.

    Behind its name the file has a digest of its content: one that was cut short or written over is
    made again. It appears only once it is complete, so two processes may make it at the same time.

    Args:
        name: Name of the file, which must determine its content; that of what is returned begins
            and ends as it does.
        make: Returns the content.

    Raises:
        InvalidInputError: If the file cannot be written.
    """
    if (file := kept_file(name)) is not None:
        return file
    content, place = make(), cache_folder() / name
    file = place.with_name(f"{place.stem}-{_digest(content)}{place.suffix}")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        handle, part_file = mkstemp(dir=file.parent, suffix=".unfinished")
        try:
            with os.fdopen(handle, "wb") as stream:
                stream.write(content)
            os.replace(part_file, file)
        except OSError:
            os.unlink(part_file)
            raise
    except OSError as error:
        raise InvalidInputError(
            f"XDG_CACHE_HOME: cannot keep {file}: {error.strerror}; give a folder that can be "
            "written"
        ) from None
    return file


def kept_file(name: str) -> Path | None:
    """Return a file of the cache that `cached_file` has made, if it is there whole; else None."""
    place = cache_folder() / name
    for file in place.parent.glob(f"{escape(place.stem)}-*{place.suffix}"):
        if _is_whole(file):
            return file
        # What cannot be removed is in nobody's way.
        with suppress(OSError):
            file.unlink()
    return None


def cached_numbers(name: str, make: Callable[[], NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return numbers that take long to find, shape (k,), of the cache if they were found before.

    Where the cache cannot be written they are found again next time.

    Args:
        name: Name of their file, which must determine them.
        make: Returns the numbers.
    """
    if (file := kept_file(name)) is not None:
        with suppress(OSError, ValueError):
            return np.frombuffer(content_of(file, _MOST_CACHED))
    numbers = np.ravel(np.asarray(make(), dtype=np.float64))
    with suppress(InvalidInputError):
        cached_file(name, numbers.tobytes)
    return numbers


def _is_whole(file: Path) -> bool:
    """Return whether a file of the cache still has the content that it was written with."""
    try:
        return file.stem.endswith(f"-{_digest(content_of(file, _MOST_CACHED))}")
    except (OSError, ValueError):
        return False


def _digest(content: bytes) -> str:
    return sha256(content).hexdigest()[:32]

"""Tables written to files, in the format that the file's name ends in."""

from __future__ import annotations

import csv
from collections.abc import Callable
from io import StringIO
from pathlib import Path

from ..errors import InvalidInputError
from ..runs.folder import require_output
from ..runs.whole_file import written_whole
from .latex import latex
from .markdown import markdown
from .sheet import Heading, Sheet


def _csv(sheet: Sheet) -> str:
    stream = StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow([column.heading.on_page for column in sheet.columns])
    for row in sheet.rows:
        writer.writerow([each.on_page if isinstance(each, Heading) else str(each) for each in row])
    return stream.getvalue()


#: What writes each format, by the ending of the file's name.
FORMATS: dict[str, Callable[[Sheet], str]] = {".md": markdown, ".tex": latex, ".csv": _csv}


def require_format(file: Path, what: str = "table") -> None:
    """Raise an InvalidInputError unless the name of a file ends in a known format."""
    if file.suffix not in FORMATS:
        known = ", ".join(FORMATS)
        raise InvalidInputError(f"{what}: {file}: must end in one of {known}")


def write_sheet(sheet: Sheet, file: Path) -> None:
    """Write a table to a file, which is replaced at once, in words and in units that suit.

    A CSV file has neither title, notes nor marks of broken bounds.

    Args:
        sheet: The table.
        file: The file, whose name ends in one of `FORMATS`; its folder is made.

    Raises:
        InvalidInputError: If there is no such format, or it cannot be written.
    """
    require_format(file)
    require_output(file, "table")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with written_whole(file) as stream:
            stream.write(FORMATS[file.suffix](sheet.for_page()))
    except OSError as error:
        raise InvalidInputError(f"table {file}: {error.strerror}") from None

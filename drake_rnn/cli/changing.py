"""What options mean for the documents of experiments."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.markup import escape

from ..errors import InvalidInputError
from ..experiment import ExperimentSource, parse_change, read_document
from ..runs.folder import claim_folder, make_folder, require_fillable, require_replaceable
from .console import err, out


def changes_of(
    changes: list[str] | None, seed: int | None = None, duration: float | None = None
) -> dict[str, Any]:
    """Return the changes that options ask for, by dotted key.

    Raises:
        InvalidInputError: If a change is not ``KEY=VALUE``, or a key is given twice.
    """
    keys = [("--set", *parse_change(change)) for change in changes or []]
    keys += [("--seed", "seed", seed), ("--duration", "duration", duration)]
    new: dict[str, Any] = {}
    for option, key, value in keys:
        if option != "--set" and value is None:
            continue
        if key in new:
            raise InvalidInputError(
                f"{option}: {key} is given twice, as {new[key]!r} and {value!r}"
            )
        new[key] = value
    return new


def tell_of_window(name: ExperimentSource, changes: Mapping[str, Any]) -> None:
    """Print a note if the duration ends before the window and therefore drops it."""
    others = {key: value for key, value in changes.items() if key != "duration"}
    before, now = read_document(name, others), read_document(name, changes)
    missing = [key for key in ("window", "accept") if key in before and key not in now]
    if "window" not in missing:
        return
    what = "and the bounds of accept are" if "accept" in missing else "is"
    # A change of what is measured is also told to those who want to hear of nothing else.
    (err if out.quiet else out).print(
        f"[yellow]note[/] {escape(str(now['name']))}: window {escape(str(before['window']))} s "
        f"{what} dropped: the run ends at {now['duration']:g} s",
        soft_wrap=True,
    )


@contextmanager
def claimed_folder(folder: Path, *names: str, may_exist: bool = False) -> Iterator[None]:
    """Make a folder for a with-block in which no other process writes to it.

    Args:
        folder: The folder.
        *names: Names of the files that are to be written to it.
        may_exist: Whether it is that of a run, whose result is to take the place of another one.

    Raises:
        InvalidInputError: If nothing can be written to it, or another process writes to it.
    """
    require_writable(folder)
    for name in names:
        require_replaceable(folder / name)
    with claim_folder(folder):
        if may_exist:
            require_fillable(folder)
        yield


def require_writable(folder: Path, option: str = "--out") -> None:
    """Make a folder, or say of an option why nothing can be written to it."""
    try:
        make_folder(folder)
    except InvalidInputError as error:
        raise InvalidInputError(f"{option}: {error}") from None
    except OSError as error:
        raise InvalidInputError(f"{option}: {folder}: {error.strerror}") from None
    if not os.access(folder, os.W_OK | os.X_OK):
        raise InvalidInputError(f"{option}: {folder}: not writable")

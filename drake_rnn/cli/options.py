"""Options that several commands have, and what they mean for a document."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape

from ..errors import InvalidInputError
from ..experiment import Described, Experiment, load_experiment, parse_change, read_document
from ..runs.stored import Series
from .completing import complete_experiments
from .console import err, out

One = Annotated[
    str,
    typer.Argument(
        metavar="EXPERIMENT",
        help="Name of a shipped experiment, or a YAML file.",
        autocompletion=complete_experiments,
    ),
]
Several = Annotated[
    list[str],
    typer.Argument(
        metavar="EXPERIMENT...",
        help="Names of shipped experiments, or YAML files.",
        autocompletion=complete_experiments,
    ),
]
Set = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Change a key, e.g. law.kappa=8; repeatable."),
]
Out = Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the result folders.")]
Seed = Annotated[int | None, typer.Option(help="Seed of all random numbers.")]
Check = Annotated[
    bool,
    typer.Option(
        "--check",
        help="Exit with status 3 if a bound is not kept: of accept, or a limit that the law keeps.",
    ),
]
Anyway = Annotated[
    bool, typer.Option("--anyway", help="Run even if it may take more than three hours.")
]
StoredSeries = Annotated[
    Series,
    typer.Option(
        "--series",
        help="Samples to store: one for each log_period, at most 2000 of them, or the last alone.",
    ),
]
Figures = Annotated[bool, typer.Option("--figures/--no-figures", help="Draw figures.")]
Playback = Annotated[bool, typer.Option(help="Write playback.html.")]
Beside = Annotated[
    list[str] | None,
    typer.Option(
        metavar="EXPERIMENT",
        help="Run this one first, and show its path beside the others' in their playbacks; "
        "repeatable.",
    ),
]
Jobs = Annotated[int, typer.Option(min=1, help="Number of runs at a time.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="Print only what went wrong.")]
AsJson = Annotated[
    bool, typer.Option("--json", help="Print metrics and verdicts as JSON, nothing else.")
]
DryRun = Annotated[
    bool, typer.Option("--dry-run", help="Check all, warn, and estimate the time; run nothing.")
]
Duration = Annotated[
    float | None,
    typer.Option(help="Simulated time [s]; a window that ends later is dropped."),
]


def load(
    name: str, changes: list[str] | None, seed: int | None, duration: float | None
) -> Experiment:
    """Return an experiment with the changes that options ask for."""
    return load_experiment(name, changes_of(changes, seed, duration))


def changes_of(
    changes: list[str] | None, seed: int | None, duration: float | None
) -> dict[str, object]:
    """Return the changes that options ask for, by dotted key."""
    new: dict[str, object] = {}
    for change in changes or []:
        key, value = parse_change(change)
        if key in new:
            raise InvalidInputError(f"--set: {key} is given twice, as {new[key]!r} and {value!r}")
        new[key] = value
    if seed is not None:
        new["seed"] = seed
    if duration is not None:
        new["duration"] = duration
    return new


def tell_of_window(name: Described, changes: Mapping[str, Any]) -> None:
    """Print a note if the duration ends before the window and therefore drops it."""
    kept = {key: value for key, value in changes.items() if key != "duration"}
    before, now = read_document(name, kept), read_document(name, changes)
    lost = [key for key in ("window", "accept") if key in before and key not in now]
    if "window" not in lost:
        return
    what = "and the bounds of accept are" if "accept" in lost else "is"
    # A change of what is measured is also told to those who want to hear of nothing else.
    (err if out.quiet else out).print(
        f"[yellow]note[/] {escape(str(now['name']))}: window {escape(str(before['window']))} s "
        f"{what} dropped: the run ends at {now['duration']:g} s",
        soft_wrap=True,
    )


def require_writable(folder: Path) -> None:
    """Make a folder, or say why nothing can be written to it."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InvalidInputError(f"--out: {folder}: {error.strerror}") from None
    if not os.access(folder, os.W_OK | os.X_OK):
        raise InvalidInputError(f"--out: {folder}: not writable")

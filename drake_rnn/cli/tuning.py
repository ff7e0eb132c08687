"""Tuning of gains."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape

from ..arrays.jax_module import require_jax
from ..errors import InvalidInputError
from ..experiment import read_document
from ..figures.tuning import tuning_figure
from ..inputs.documents import to_yaml
from ..runs.simulation import check_experiment
from ..runs.whole_file import written_whole
from ..tuning import Trial, Tuned, Tuning
from ..tuning.bounds import Between, parse_between
from .comparing import comparison_table
from .console import FAILED, NOT_MET, err, errors, out, silenced, status
from .options import (
    Figures,
    One,
    Out,
    Quiet,
    Seed,
    Set,
    changes_of,
    load,
    require_writable,
    tell_of_window,
)
from .tables import WIDE

_Over = Annotated[
    list[str],
    typer.Option(
        "--over",
        metavar="KEY,KEY,...",
        help="Numbers of the law to tune, e.g. law.kappa,law.rho; repeatable.",
    ),
]
_Least = Annotated[str, typer.Option("--least", metavar="METRIC", help="Metric to make small.")]
_Between = Annotated[
    list[str] | None,
    typer.Option(
        "--between",
        metavar="KEY=LOW,HIGH",
        help="Bounds of a number; repeatable. Default: a thirtieth and 30 times the start.",
    ),
]
_Duration = Annotated[
    float | None,
    typer.Option(help="Simulated time to tune on [s]; Drake's runs have the document's own."),
]


def tune_gains(  # noqa: PLR0913  one argument for each option
    experiment: One,
    numbers: _Over,
    least: _Least = "position_error_rms_m",
    between: _Between = None,
    out_folder: Out = Path("out"),
    changes: Set = None,
    seed: Seed = None,
    duration: _Duration = None,
    steps: Annotated[int, typer.Option(min=1, help="Largest number of steps.")] = 30,
    figures: Figures = True,
    check: Annotated[
        bool, typer.Option("--check", help="Exit with status 3 if no better gains are found.")
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Tune gains of a law by descent through the closed loop; write them, verified by Drake."""
    with silenced(quiet):
        with errors():
            require_jax()
            keys = [key.strip() for text in numbers for key in text.split(",")]
            bounds = _bounds(between)
            changed = changes_of(changes, seed, None)
            made = load(experiment, changes, seed, None)
            for warning in check_experiment(made):
                err.print(f"[yellow]warning[/] {escape(warning)}")
            tuning = Tuning(made, keys, least, between=bounds, duration=duration)
            folder = out_folder / f"tune_{made.name}_{'_'.join(keys)}"
            require_writable(folder)
            if duration is not None:
                tell_of_window(experiment, changed | {"duration": duration})
            # What an earlier call has found must not stand beside the figure of this one.
            (folder / "tuned.yaml").unlink(missing_ok=True)
            with _left_at_once(), status(f"{made.name}: tuning"):
                tuned = tuning.run(steps, _told)
            _print(tuned)
            if tuned.better:
                named = {"name": f"{made.name}_tuned"}
                _write(read_document(experiment, {**changed, **tuned.gains, **named}), folder)
            if figures:
                picture = tuning_figure(tuned, folder / "tuning.png")
                out.print(escape(f"picture  {picture}"), soft_wrap=True)
        if check and not tuned.better:
            raise typer.Exit(NOT_MET)


@contextmanager
def _left_at_once() -> Iterator[None]:
    """End this process when it is interrupted, while JAX computes on in threads of its own.

    To take these down in the usual way ends in a crash.
    """
    try:
        yield
    except KeyboardInterrupt:
        err.print("[red]failed[/] interrupted; nothing was written")
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        os._exit(FAILED)


def _bounds(between: list[str] | None) -> dict[str, Between]:
    """Return the bounds of all ``--between`` options, by key."""
    bounds: dict[str, Between] = {}
    for text in between or []:
        key, pair = parse_between(text)
        if key in bounds:
            raise InvalidInputError(f"--between: {key} is given twice")
        bounds[key] = pair
    return bounds


def _write(document: Mapping[str, Any], folder: Path) -> None:
    """Write the tuned document."""
    file = folder / "tuned.yaml"
    with written_whole(file) as stream:
        stream.write(to_yaml(document))
    out.print(escape(f"document {file}"), soft_wrap=True)


def _told(trial: Trial) -> None:
    if not out.quiet:
        gains = ", ".join(f"{key}={value:.6g}" for key, value in trial.gains.items())
        err.print(escape(f"{trial.value:.6g} with {gains}"))


def _print(tuned: Tuned) -> None:
    told = ", ".join(tuned.stopped_by)
    if not tuned.better:
        why = f"; others break the bound of {told}" if told else ""
        err.print(
            f"[yellow]not tuned[/] its slope led to no gains that make {tuned.metric} smaller{why}"
        )
        return
    if tuned.chosen < len(tuned.history) - 1:
        why = f"break the bound of {told}" if told else "are no better in Drake's runs"
        steps = f"step {tuned.chosen:g} of {len(tuned.history) - 1}"
        note = f"[yellow]note[/] gains beyond {steps} {why}, and were not taken"
        out.print(note, soft_wrap=True)
    wide = out if out.is_terminal or out.quiet else Console(width=WIDE, highlight=False)
    wide.print(comparison_table({"before": tuned.before, "tuned": tuned.after}))
    out.print(
        f"{tuned.metric}: {tuned.before.metrics[tuned.metric]:.4g} before, "
        f"{tuned.after.metrics[tuned.metric]:.4g} tuned, both run by Drake"
    )
    gains = ", ".join(f"{key}={value:g}" for key, value in tuned.gains.items())
    out.print(escape(f"gains    {gains}"), soft_wrap=True)

"""Tuning of gains."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from rich.markup import escape

from ..arrays.jax_module import require_jax
from ..errors import InterruptedRunError, InvalidInputError
from ..experiment import load_experiment, read_document
from ..figures.tuning import tuning_figure
from ..inputs.documents import to_yaml
from ..runs.simulation import check_experiment
from ..runs.whole_file import written_whole
from ..tuning import Trial, Tuned, Tuning
from ..tuning.bounds import Between, parse_between
from .asked import Tune
from .changing import changes_of, claimed_folder, tell_of_window
from .comparing import comparison_sheet
from .console import err, errors, finish, out, print_whole, silenced, status
from .statuses import INTERRUPTED
from .written_tables import shown


def tune_gains(asked: Tune) -> None:
    """Tune gains of a law, and write the document with them."""
    with silenced(asked.quiet), errors(), ExitStack() as claims:
        require_jax()
        keys = [key.strip() for text in asked.numbers for key in text.split(",")]
        bounds = _bounds(asked.between)
        changed = changes_of(asked.changes, asked.seed)
        made = load_experiment(asked.experiment, changed)
        for warning in check_experiment(made):
            err.print(f"[yellow]warning[/] {escape(warning)}")
        tuning = Tuning(made, keys, asked.least, between=bounds, duration=asked.duration)
        folder = asked.out_folder / f"tune_{made.name}_{'_'.join(keys)}"
        claims.enter_context(claimed_folder(folder, "tuned.yaml", "tuning.png"))
        if asked.duration is not None:
            tell_of_window(asked.experiment, changed | {"duration": asked.duration})
        # What an earlier call has found must not stand beside the figure of this one.
        (folder / "tuned.yaml").unlink(missing_ok=True)
        with _left_at_once(), status(f"{made.name}: tuning"):
            tuned = tuning.run(asked.steps, _told)
        _print(tuned)
        if tuned.better:
            named = {"name": f"{made.name}_tuned"}
            _write(read_document(asked.experiment, {**changed, **tuned.gains, **named}), folder)
        if asked.figures:
            picture = tuning_figure(tuned, folder / "tuning.png")
            out.print(escape(f"picture  {picture}"), soft_wrap=True)
    finish(True, tuned.better or not asked.check)


@contextmanager
def _left_at_once() -> Iterator[None]:
    """End this process when it is interrupted, while JAX computes on in threads of its own.

    To take these down in the usual way ends in a crash.
    """
    try:
        yield
    except (KeyboardInterrupt, InterruptedRunError):
        err.print("interrupted: nothing was written")
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        os._exit(INTERRUPTED)


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
        err.print(f"[yellow]not tuned[/] descent found no gains that reduce {tuned.metric}{why}")
        return
    if tuned.chosen < len(tuned.history) - 1:
        why = f"break the bound of {told}" if told else "are no better in Drake's runs"
        steps = f"step {tuned.chosen:g} of {len(tuned.history) - 1}"
        note = f"[yellow]note[/] gains beyond {steps} {why}, and were not taken"
        out.print(note, soft_wrap=True)
    print_whole(shown(comparison_sheet({"before": tuned.before, "tuned": tuned.after})))
    out.print(
        f"{tuned.metric}: {tuned.before.metrics[tuned.metric]:.4g} before, "
        f"{tuned.after.metrics[tuned.metric]:.4g} tuned, both run by Drake"
    )
    gains = ", ".join(f"{key}={value:g}" for key, value in tuned.gains.items())
    out.print(escape(f"gains    {gains}"), soft_wrap=True)

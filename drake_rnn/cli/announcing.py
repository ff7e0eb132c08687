"""What a command will do, and what it has done, for people and for scripts."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from typing import Any

import typer
from rich.markup import escape

from ..experiment import Experiment
from ..runs.effort import Effort, effort_of
from .changing import tell_of_window
from .console import err, out
from .queue import Task


def print_data(contents: Any) -> None:
    """Print plain data as JSON, with null for numbers that are not finite, which it has not."""
    typer.echo(json.dumps(_finite(contents), indent=2))


def print_plan(
    tasks: Sequence[Task],
    experiments: Sequence[Experiment],
    warnings: Sequence[Sequence[str]],
    as_json: bool,
) -> None:
    """Print what would be run, what it may take and what it warns of.

    Args:
        tasks: What would be run.
        experiments: The experiments that the tasks name.
        warnings: Warnings about each of them.
        as_json: Whether to print one JSON object, by name.
    """
    plan: dict[str, Any] = {}
    for task, experiment, complaints in zip(tasks, experiments, warnings, strict=True):
        effort = effort_of(experiment.document)
        plan[task.name] = {
            "folder": str(task.folder),
            "duration_s": experiment.document.duration,
            "steps": effort.steps if effort.key else None,
            "expected_time_s": effort.time if effort.key else None,
            "warnings": list(complaints),
        }
        tell_of_window(task.experiment, task.changes)
        for complaint in complaints:
            err.print(f"[yellow]warning[/] {escape(f'{task.name}: {complaint}')}")
        out.print(escape(f"{task.name}: {told_of(effort)}; {task.folder}"), soft_wrap=True)
    if as_json:
        print_data(plan)


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def told_of(effort: Effort) -> str:
    """Return in words what a run is expected to take."""
    if not effort.key:
        return "the integrator chooses its steps, so there is no estimate"
    return (
        f"{effort.steps:.3g} steps of {effort.key} {effort.step:g} s, about {effort.time:.2g} s "
        "without figures and playback"
    )

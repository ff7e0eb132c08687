"""A recorded stream of joint targets behind a shield: what it asks for, and what is commanded."""

from __future__ import annotations

import json
from dataclasses import asdict
from functools import partial
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from ..errors import InvalidInputError
from ..experiment import Experiment, make_experiment, read_document
from ..runs.folder import written_whole
from ..runs.result import Result
from ..shield.report import StreamReport, report_stream, rows_of
from .arguments import Shield
from .changing import changes_of
from .console import errors, finish, out, print_table
from .saving import Pictures, run_and_write, simulate_or_print

#: File of a run's folder with what the stream asked for and what was commanded.
REPORT = "stream.json"
# Time that is left after the last target [s].
_REST = 1.0


def shield(args: Shield) -> None:
    """Run the stream behind a guard, and print what would have stopped the robot."""
    with errors():
        experiment = _experiment(args)
        folder = args.out_folder / experiment.name
        pictures = Pictures(args.figures, args.playback)
        result = run_and_write(partial(simulate_or_print, experiment), folder, pictures)
        report = _report(experiment, result)
        _print(report, experiment)
        with written_whole(folder / REPORT) as stream:
            stream.write(json.dumps(asdict(report), indent=1) + "\n")
        out.print(escape(f"stream    {folder / REPORT}"), soft_wrap=True)
    finish(result.status == "complete", True)


def _experiment(args: Shield) -> Experiment:
    """Return the stream as an experiment, which lasts until a second after its last target."""
    if not args.file.is_file():
        raise InvalidInputError(f"FILE: no file {str(args.file)!r}")
    changes = changes_of(args.changes)
    document: dict[str, Any] = {
        "name": args.file.stem,
        "arm": args.arm,
        "targets": {"file": str(args.file)},
        "law": {"kind": "joint_stream"},
        "period": args.period,
        "log_period": args.period,
        "duration": 1.0,
    }
    whole = make_experiment(read_document(document, changes))
    assert whole.targets is not None
    if "duration" not in changes and len(whole.targets.time):
        document["duration"] = round(float(whole.targets.time[-1]) + _REST, 3)
    return make_experiment(read_document(document, changes))


def _report(experiment: Experiment, result: Result) -> StreamReport:
    targets = experiment.targets
    assert targets is not None
    came = targets.time <= result.time[-1]
    return report_stream(
        (targets.time[came], targets.position[came]),
        (result.time, result.series["position"]),
        experiment.start,
        experiment.limits,
        experiment.clearance,
    )


def _print(report: StreamReport, experiment: Experiment) -> None:
    table = Table(box=SIMPLE_HEAD)
    for title in ("", "the source's targets", "the shield's commands"):
        table.add_column(title)
    for row in rows_of(report, tuple(experiment.arm.joints)):
        table.add_row(*map(escape, row))
    print_table(table)
    trips = ", ".join(report.would_trip) or "nothing"
    out.print(escape(f"trips     {trips} would have stopped the robot without it"), soft_wrap=True)

"""Campaigns: many runs of one experiment, each kept when it ends, and their summary.

A sweep is a campaign over lists, of which a list of rows is returned.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from ..errors import DrakeRnnError, InvalidInputError, old_arguments
from ..experiment import ExperimentSource
from ..experiment.files import written_head
from ..inputs.documents import parse_yaml, to_yaml
from ..inputs.fields import checked, flag, function, instance, optional, whole
from ..inputs.messages import fields_of, require_type, short
from ..inputs.packages import versions
from ..runs.folder import written_whole
from .execution import run_each, simulate_each
from .plan import (
    CampaignDocument,
    Plan,
    plan_campaign,
    plan_sweep,
    read_campaign,
)
from .pool import (
    Executor,
    InOrder,
    Jobs,
    LostWorkersError,
    Workers,
    processes_of,
    workers_of,
)
from .requests import Perform, RecordStore, Row, RunRecord, RunRequest
from .summary import (
    Group,
    Line,
    Summary,
    group_by,
    lines_of,
    metrics_in,
    numbers_of,
    summarize,
    write_lines,
    write_table,
)

#: Called with the number of runs that have ended, the number of all runs, and the newest record;
#: the first call counts the runs kept from before, and its record is None.
Progress = Callable[[int, int, RunRecord | None], None]
#: How a campaign ended.
Ending = Literal["complete", "interrupted", "lost"]


@dataclass(frozen=True)
class CampaignResult:
    """Result of a campaign.

    Attributes:
        plan: The runs that were planned.
        folder: Folder with ``table.csv``, ``campaign.json`` and the files that the campaign was
            run from.
        lines: Rows that have ended, in their order.
        summary: Summary of these rows.
        ending: Whether all rows have ended; ``lost`` if the workers were lost before that.
        reason: Why not all rows have ended; empty if they have.
        kept: Number of runs that were kept from an earlier call.
    """

    plan: Plan
    folder: Path
    lines: list[Line]
    summary: Summary
    ending: Ending
    reason: str
    kept: int

    @property
    def missing(self) -> int:
        """Number of rows that have not ended."""
        return len(self.plan.rows) - len(self.lines)

    def showing(self, metrics: Sequence[str]) -> CampaignResult:
        """Return the result with a summary of other metrics; what is stored stays as it is.

        Args:
            metrics: Their names; those of the campaign's document if empty.
        """
        if not metrics:
            return self
        document = replace(self.plan.campaign, metrics=list(metrics))
        rows, file = len(self.plan.rows), self.folder / "experiment.yaml"
        return replace(self, summary=summarize(document, rows, self.lines, file))

    def groups(self, *by: str) -> list[Group]:
        """Return count, mean, deviation and quantiles of the summary's metrics for groups of rows.

        Args:
            *by: Keys whose values the rows of a group share, e.g. ``law.kind`` and ``arm``.

        Raises:
            InvalidInputError: If one does not vary.
        """
        metrics = [metric.name for metric in self.summary.metrics]
        quantiles = self.plan.campaign.statistics.quantiles
        return group_by(self.lines, by, metrics, quantiles)


@old_arguments(done="progress")
@checked(
    folder=instance(str, Path),
    jobs=whole(),
    perform=function(),
    batch=optional(whole(1)),
    progress=optional(function()),
    again=flag,
)
def run_campaign(
    campaign: str | Path | Mapping[str, Any] | CampaignDocument | Plan,
    folder: str | Path,
    *,
    jobs: int = 1,
    executor: Executor | Workers | None = None,
    perform: Perform = run_each,
    batch: int | None = None,
    progress: Progress | None = None,
    again: bool = False,
) -> CampaignResult:
    """Run the rows of a campaign that have not been run, and return all rows.

    Each row is kept in the folder when it ends. A second call, also after this process was killed,
    runs only the missing rows, and the table is the same to the last bit. A run that fails, is
    refused or kills its worker is a row too.

    Args:
        campaign: A shipped name, a YAML file, a document, or a plan from `plan_campaign`.
        folder: Folder for rows and results.
        jobs: Number of processes; 0 runs everything in this process, which knows the classes
            registered in it, but ends if a run crashes it.
        executor: Executor to use in place of processes: anything with ``submit``, such as an
            executor of `concurrent.futures` or a Dask client. The executor is not shut down.
        perform: Function that carries out a list of requests, in any process; by default each
            request by the method that the campaign's document names.
        batch: Number of rows handed to ``perform`` at a time; chosen by the requests by default.
        progress: Called when a run has ended.
        again: Whether to retry rows whose worker crashed.

    Raises:
        InvalidInputError: If a row is no valid experiment, the folder cannot be written to, or
            another process is running this campaign.
    """
    require_type("jobs", jobs, int)
    plan = campaign if isinstance(campaign, Plan) else plan_campaign(read_campaign(campaign))
    folder = Path(folder)
    store = RecordStore(folder / "rows")
    with store.claim():
        _describe(plan, folder)
        rows = Jobs(plan.rows, store, again)
        workers = processes_of(jobs) if executor is None else workers_of(executor)

        def tell(record: RunRecord | None) -> None:
            if progress is not None:
                progress(len(rows.records), len(rows.requests), record)

        tell(None)
        ending, reason = _run_to_end(
            lambda: rows.run(workers, perform, lambda _, record: tell(record), batch)
        )
        lines = lines_of(plan.rows, rows.records)
        summary = summarize(plan.campaign, len(plan.rows), lines, folder / "experiment.yaml")
        result = CampaignResult(plan, folder, lines, summary, ending, reason, rows.kept)
        _write(result, rows.records)
    return result


def _run_to_end(run: Callable[[], bool]) -> tuple[Ending, str]:
    """Run, and return how that ended and why."""
    try:
        return ("complete", "") if run() else ("interrupted", "interrupted")
    except LostWorkersError as error:
        return "lost", str(error)


def _describe(plan: Plan, folder: Path) -> None:
    """Write the documents of campaign and experiment, so that the folder documents itself."""
    campaign = {
        name: fields_of(value) or value for name, value in fields_of(plan.campaign).items() if value
    }
    try:
        with written_whole(folder / "experiment.yaml") as stream:
            stream.write(written_head("experiment") + to_yaml(plan.experiment))
        # The experiment's file already includes the changes.
        contents = {**campaign, "experiment": "experiment.yaml"}
        contents.pop("changes", None)
        with written_whole(folder / "campaign.yaml") as stream:
            stream.write(written_head("campaign") + to_yaml(contents))
    except OSError as error:
        raise InvalidInputError(f"output folder {folder}: {error.strerror}") from None


def _write(result: CampaignResult, records: Mapping[str, RunRecord]) -> None:
    metrics = result.plan.campaign.metrics or metrics_in(result.lines)
    write_table(result.folder / "table.csv", list(result.plan.campaign.vary), result.lines, metrics)
    record = {
        "status": result.ending,
        "reason": result.reason,
        "rows": len(result.plan.rows),
        "statuses": result.summary.statuses,
        "methods": result.summary.methods,
        "shares": {name: list(share) for name, share in result.summary.shares.items()},
        "versions": versions(),
        "timings": {"runs_wall_time_s": sum(each.wall_time_s for each in records.values())},
    }
    with suppress(OSError), written_whole(result.folder / "campaign.json") as stream:
        stream.write(json.dumps(record, indent=2) + "\n")


class InterruptedSweepError(DrakeRnnError):
    """A sweep that was interrupted from the keyboard.

    Attributes:
        rows: Rows that have ended.
        missing: Values of the rows that have not ended.
    """

    def __init__(self, rows: list[Row], missing: list[tuple[Any, ...]]) -> None:
        super().__init__(f"interrupted: {len(rows)} of {len(rows) + len(missing)} runs have ended")
        self.rows = rows
        self.missing = missing


def parse_axis(text: str) -> tuple[str, list[Any]]:
    """Return key and values of ``KEY=v1,v2,...``; values are parsed as YAML.

    Raises:
        InvalidInputError: If the key or the values are missing.
    """
    key, equals, values = text.partition("=")
    if not equals or not key.strip() or not values.strip():
        raise InvalidInputError(f"--over: must be KEY=v1,v2,..., not {text!r}")
    return key.strip(), parse_yaml(f"[{values}]", f"--over {key.strip()}")


@old_arguments(done="progress")
@checked(
    changes=instance(Mapping, None),
    progress=optional(function()),
    anyway=flag,
    keep=instance(str, Path, None),
)
def sweep(
    experiment: ExperimentSource,
    over: Mapping[str, Sequence[Any]],
    changes: Mapping[str, Any] | None = None,
    processes: int = 1,
    progress: Callable[[Row], None] | None = None,
    *,
    anyway: bool = False,
    keep: Path | None = None,
) -> list[Row]:
    """Run an experiment at each combination of values.

    Every combination is checked before the first run. A run that fails gets a row and does not stop
    the other runs.

    Args:
        experiment: A shipped name, a YAML file, a document or an experiment.
        over: Values to run, by dotted key.
        changes: New values of other keys, the same in each run.
        processes: Number of runs at a time; the results do not depend on it.
        progress: Called with each row when it is ready, in order.
        anyway: Whether a run may take any number of steps.
        keep: Folder that keeps each ended row until all rows have ended; rows that the folder
            already holds are not run again.

    Raises:
        InvalidInputError: If a combination is not a valid experiment, a path is out of reach, a key
            is both swept and changed, or other processes do not know the classes that it names.
        InterruptedSweepError: If the user interrupts the sweep; the error holds the rows so far.
    """
    return run_sweep(
        plan_sweep(experiment, over, changes, anyway=anyway), processes, progress, keep
    )


def run_sweep(
    plan: Plan,
    processes: int = 1,
    progress: Callable[[Row], None] | None = None,
    keep: Path | None = None,
) -> list[Row]:
    """Make the runs of a sweep; arguments, result and errors are those of `sweep`."""
    if not isinstance(processes, int) or processes < 1:
        raise InvalidInputError(
            f"processes: must be a whole number of at least 1, not {short(processes)}"
        )
    # One run at a time needs no process of its own, and knows the classes of this one.
    workers = processes_of(processes if processes > 1 else 0)
    perform = _simulate_known if processes > 1 else simulate_each
    store = None if keep is None else RecordStore(Path(keep))
    with nullcontext() if store is None else store.claim():
        jobs = Jobs(plan.rows, store)

        def tell(request: RunRequest, record: RunRecord) -> None:
            if progress is not None:
                progress(Row.of(request, record))

        complete = jobs.run(workers, perform, InOrder(plan.rows, jobs.records, tell).take)
        complete_rows = [each for each in plan.rows if each.key in jobs.records]
        rows = [Row.of(request, jobs.records[request.key]) for request in complete_rows]
        if not complete:
            missing = [each.changes for each in plan.rows if each.key not in jobs.records]
            raise InterruptedSweepError(rows, [tuple(values.values()) for values in missing])
        if store is not None:
            store.remove()
    return rows


def _simulate_known(requests: Sequence[RunRequest]) -> list[RunRecord]:
    """Simulate requests in another process than the one that has checked each of them.

    Raises:
        InvalidInputError: If one is refused, as this process lacks a class.
    """
    records = simulate_each(requests)
    for record in records:
        if record.status == "refused":
            raise InvalidInputError(
                f"{record.failure}; only this process knows it: name it so for the others, or run "
                "the sweep in one process"
            )
    return records


def write_csv(file: Path, keys: Sequence[str], rows: Sequence[Row]) -> None:
    """Write all values and metrics of a sweep to a CSV file, one line per run.

    Raises:
        InvalidInputError: If the file cannot be written.
    """
    names = list(dict.fromkeys(name for row in rows for name in row.metrics))
    lines = ([*row.values, *numbers_of(row.metrics, names), row.failure or ""] for row in rows)
    write_lines(file, [*keys, *names, "failure"], lines)

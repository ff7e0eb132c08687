"""Campaigns: many runs of one experiment, each kept when it ends, and their summary."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from ..errors import InvalidInputError
from ..experiment.heads import written_head
from ..inputs.arguments import checked, flag, function, instance, optional, whole
from ..inputs.complaints import require_type
from ..inputs.dataclass_fields import fields_of
from ..inputs.documents import to_yaml
from ..inputs.versions import versions
from ..runs.whole_file import written_whole
from .cluster import workers_of
from .document import CampaignDocument, read_campaign
from .engine import Take, carry_out
from .outcome import Order, Outcome
from .perform import Perform
from .plan import Plan, plan_campaign, unique_orders
from .side_by_side import run_each
from .store import RowStore
from .summary import Summary, summarize
from .table import Line, lines_of, metrics_in, write_table
from .tasks import tasks_of
from .workers import Executor, LostWorkersError, Processes, ThisProcess, Workers

#: Called with the number of runs that have ended, the number of all runs, and the newest outcome;
#: the first call counts the runs kept from before, and its outcome is None.
Progress = Callable[[int, int, Outcome | None], None]
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


@checked(
    folder=instance(str, Path),
    jobs=whole(),
    perform=function(),
    batch=optional(whole(1)),
    done=optional(function()),
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
    done: Progress | None = None,
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
        perform: Function that carries out a list of orders, in any process; by default each order
            by the method that the campaign's document names.
        batch: Number of rows handed to ``perform`` at a time; chosen by the orders by default.
        done: Called when a run has ended.
        again: Whether to retry rows whose worker crashed.

    Raises:
        InvalidInputError: If a row is no valid experiment, the folder cannot be written to, or
            another process is running this campaign.
    """
    require_type("jobs", jobs, int)
    plan = campaign if isinstance(campaign, Plan) else plan_campaign(read_campaign(campaign))
    folder = Path(folder)
    store = RowStore(folder / "rows")
    with store.claimed():
        _describe(plan, folder)
        orders = unique_orders(plan.rows)
        outcomes = kept_rows(store, orders, again)
        kept, workers = len(outcomes), _workers(jobs, executor)
        if done is not None:
            done(kept, len(orders), None)

        def take(order: Order, outcome: Outcome) -> None:
            store.put(order, outcome)
            outcomes[order.key] = outcome
            if done is not None:
                done(len(outcomes), len(orders), outcome)

        missing = [order for order in orders if order.key not in outcomes]
        tasks = tasks_of(missing, workers.slots, batch)
        ending, reason = _carry_out(tasks, perform, workers, take)
        lines = lines_of(plan.rows, outcomes)
        summary = summarize(plan.campaign, len(plan.rows), lines, folder / "experiment.yaml")
        result = CampaignResult(plan, folder, lines, summary, ending, reason, kept)
        _write(result, outcomes)
    return result


def kept_rows(store: RowStore, orders: list[Order], again: bool = False) -> dict[str, Outcome]:
    """Return the outcomes kept from earlier calls, by the keys of their orders.

    Args:
        store: Store of the outcomes.
        orders: The orders.
        again: Whether to leave out rows whose worker crashed, so that they are retried.
    """
    found = {order.key: store.get(order.key) for order in orders}
    return {
        key: outcome
        for key, outcome in found.items()
        if outcome is not None and not (again and outcome.status == "killed its worker")
    }


def _workers(jobs: int, executor: Executor | Workers | None) -> Workers:
    if executor is not None:
        return workers_of(executor)
    return Processes(jobs) if jobs > 0 else ThisProcess()


def _carry_out(
    tasks: list[list[Order]], perform: Perform, workers: Workers, take: Take
) -> tuple[Ending, str]:
    """Carry out tasks, and return how that ended and why."""
    try:
        if carry_out(tasks, perform, workers, take):
            return "complete", ""
    except LostWorkersError as error:
        return "lost", str(error)
    return "interrupted", "interrupted"


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


def _write(result: CampaignResult, outcomes: Mapping[str, Outcome]) -> None:
    metrics = result.plan.campaign.metrics or metrics_in(result.lines)
    write_table(result.folder / "table.csv", list(result.plan.campaign.vary), result.lines, metrics)
    record = {
        "status": result.ending,
        "reason": result.reason,
        "rows": len(result.plan.rows),
        "statuses": result.summary.statuses,
        "methods": result.summary.methods,
        "shares": {name: list(found) for name, found in result.summary.shares.items()},
        "versions": versions(),
        "timings": {"runs_wall_time_s": sum(each.wall_time_s for each in outcomes.values())},
    }
    with suppress(OSError), written_whole(result.folder / "campaign.json") as stream:
        stream.write(json.dumps(record, indent=2) + "\n")

"""Campaigns: many runs of one experiment, each kept when it ends, and their summary.

How orders are divided into tasks; a worker receives a task as a whole.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from math import ceil
from pathlib import Path
from typing import Any, Literal

from ..errors import InvalidInputError
from ..experiment.files import written_head
from ..inputs.documents import to_yaml
from ..inputs.fields import checked, flag, function, instance, optional, whole
from ..inputs.messages import fields_of, require_type
from ..inputs.packages import versions
from ..runs.folder import written_whole
from .document import CampaignDocument, read_campaign
from .plan import Plan, plan_campaign, run_each, unique_orders
from .requests import Order, Outcome, Perform, RowStore
from .summary import Line, Summary, lines_of, metrics_in, summarize, write_table
from .workers import (
    Executor,
    LostWorkersError,
    Processes,
    Take,
    ThisProcess,
    Workers,
    carry_out,
    workers_of,
)

# Rows of a batch: larger batches are no cheaper per row, and smaller ones save nothing.
_MOST, _FEWEST = 1000, 100
# Robot-steps of a batch, so that rows are kept and progress is shown about every half minute.
_STEPS = 2e7


def tasks_of(orders: Sequence[Order], slots: int, batch: int | None = None) -> list[list[Order]]:
    """Return orders as tasks: one task for each simulated order, and batches of the others.

    Args:
        orders: The orders.
        slots: Number of tasks that are carried out at a time.
        batch: Number of orders in every task; by default it follows from the orders.
    """
    if batch is not None:
        return _cut(list(orders), batch)
    # Only robots of one kind run side by side, so batches are made of orders of one kind.
    together = sorted((order for order in orders if order.method == "batch"), key=_kind)
    size = 1
    if together:
        wanted = min(_STEPS / max(map(_steps, together)), len(together) / slots)
        size = min(max(ceil(wanted), _FEWEST), _MOST)
    alone = [[order] for order in orders if order.method != "batch"]
    return [*_cut(together, size), *alone]


def _cut(orders: list[Order], size: int) -> list[list[Order]]:
    return [orders[k : k + size] for k in range(0, len(orders), size)]


#: Keys that tell whether robots may run side by side, but for their numbers; those before others
#: that always keep robots apart, for the tasks are cut from orders that are sorted by them.
_TELLING = (
    *("law", "period", "duration", "task", "filter", "feedback"),
    *("sensing", "dither", "disturbance", "arm"),
)


def _kind(order: Order) -> str:
    """Return a text that is equal for orders whose robots may run side by side."""
    known = {key: order.document.get(key) for key in _TELLING}
    kinds = [_without_numbers(known[key]) if key != "period" else known[key] for key in _TELLING]
    return json.dumps(kinds, sort_keys=True)


def _without_numbers(value: Any) -> Any:
    """Return plain data with 0.0 for each number that is not whole."""
    if isinstance(value, Mapping):
        return {str(key): _without_numbers(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [_without_numbers(entry) for entry in value]
    return 0.0 if isinstance(value, float) else value if isinstance(value, (str, int)) else None


def _steps(order: Order) -> float:
    document = order.document
    noise = document.get("dither") or document.get("disturbance") or {}
    step = min(document["period"], noise.get("hold", document["period"]))
    return max(1.0, float(document["duration"] / step))


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

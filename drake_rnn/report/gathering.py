"""Makes the runs that claims need, and judges the claims even if some of the runs fail."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import perf_counter

from ..campaigns import Order, Outcome
from ..campaigns.engine import Take, carry_out
from ..campaigns.perform import attempt, require_stamp
from ..campaigns.workers import Processes, ThisProcess, Workers
from ..claims import Claim, Claims, Criterion, Finding, Judge, Judgement
from ..claims.reading import quantities_of
from ..errors import DrakeRnnError
from ..inputs.own_code import described
from .kept_runs import KeptRuns, MissingRunError

#: Papers, each with the claims that a report is about.
Chosen = Sequence[tuple[Claims, Sequence[Claim]]]
#: Called with the kind of parts being made, the number that have ended, and the number of all.
Done = Callable[[str, int, int], None]

# Cost of a step of an arm with dynamics, in steps of an arm without.
_DYNAMIC = 4.0


def gather(chosen: Chosen, runs: KeptRuns, jobs: int, done: Done) -> bool:
    """Make the missing runs, and return True; return False if interrupted.

    A measure has to be tried to learn which runs it needs, so there are a few rounds. Measures of
    times come last, when nothing else is running.

    Args:
        chosen: The claims.
        runs: Where runs are kept; each is when it ends.
        jobs: Number of processes; 0 for this process itself.
        done: Called when a run has ended.
    """
    ended: set[str] = set()
    for timed in (False, True):
        while wanted := [o for o in _wanted(chosen, runs, timed) if o.key not in ended]:
            total = len(ended) + len(wanted)
            done("runs", len(ended), total)

            def take(order: Order, outcome: Outcome, total: int = total) -> None:
                runs.rows.put(order, outcome)
                ended.add(order.key)
                done("runs", len(ended), total)

            tasks = [[order] for order in sorted(wanted, key=_effort, reverse=True)]
            if not carry_out(tasks, partial(_keep_each, runs.place), workers(jobs), take):
                return False
    return True


def workers(jobs: int) -> Workers:
    """Return this number of processes on this machine; for 0, this process itself."""
    return Processes(jobs) if jobs > 0 else ThisProcess()


def told_to(done: Done, what: str, total: int) -> Take:
    """Return a function that counts outcomes and reports their number."""
    ended = 0

    def take(order: Order, outcome: Outcome) -> None:
        nonlocal ended
        ended += 1
        done(what, ended, total)

    return take


def judged(claims: Claims, claim: Claim, runs: KeptRuns) -> Judgement:
    """Return the judgement of a claim; its findings name the runs and measures that failed."""
    return _PatientJudge(claims, runs).judge(claim)


class _PatientJudge(Judge):
    """A judge who goes on when a run or a measure fails."""

    def find(self, criterion: Criterion) -> Finding:
        try:
            return super().find(criterion)
        except DrakeRnnError as error:
            return Finding(criterion, False, error=str(error))
        # A fault in a measure affects only the rows of this measure.
        except Exception as error:
            return Finding(criterion, False, error=described(error))


def _wanted(chosen: Chosen, runs: KeptRuns, timed: bool) -> list[Order]:
    """Return the runs that are missing, each once."""
    missing = {
        order.key: order
        for claims, several in chosen
        for claim in several
        if timed or not any(criterion.timed for criterion in claim.criteria)
        for order in _missing(claims, claim, runs)
    }
    return list(missing.values())


def _missing(claims: Claims, claim: Claim, runs: KeptRuns) -> Iterator[Order]:
    for quantity in quantities_of(claim):
        try:
            if quantity.measure is not None:
                runs.measured(claims, quantity)
            else:
                runs.metrics(str(quantity.run), quantity.set)
        except MissingRunError as missing:
            yield missing.order
        # The findings of the claim will report the fault.
        except Exception:
            continue


def _effort(order: Order) -> float:
    """Return the expected effort of a run, in any unit, so that long runs begin first."""
    document = order.document
    steps = document["duration"] / (document.get("period") or 1e-3)
    return float(steps * (_DYNAMIC if document.get("level") == "dynamic" else 1.0))


def _keep_each(place: Path, orders: Sequence[Order]) -> list[Outcome]:
    """Run orders one after another, and keep the results of those that have one.

    Raises:
        InvalidInputError: If they cannot be written.
    """
    outcomes = []
    for order in orders:
        require_stamp(order)
        began = perf_counter()
        outcome, result = attempt(order, "full")
        if result is not None:
            result.save(place / order.key)
        outcomes.append(replace(outcome, wall_time_s=perf_counter() - began))
    return outcomes

"""The contents of a report as plain data, which become ``report.json`` and the pages."""

from __future__ import annotations

import inspect
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from math import isfinite
from typing import Any, get_args

from ..claims import Claims, ClaimVerdict, Finding, Judgement, Quantity
from ..claims.claim import run_command
from ..experiment import ExperimentDocument
from ..inputs.complaints import plain
from ..measures import METRICS
from ..runs.folder import RECORD
from .gathering import Chosen
from .kept_runs import AskedRun, KeptRuns
from .origin import origin
from .pictures import FIGURE, PLAYBACK, pictures_of

#: Version of the format of ``report.json``; within a version, no key changes its meaning.
SCHEMA = 2
#: The verdicts, in the order in which they are shown.
VERDICTS: tuple[ClaimVerdict, ...] = get_args(ClaimVerdict)
_METRICS = {metric.name: metric for metric in METRICS}


def contents_of(chosen: Chosen, judgements: dict[str, Judgement], runs: KeptRuns) -> dict[str, Any]:
    """Return the contents of a report.

    Args:
        chosen: The claims.
        judgements: The judgement of each claim, by its id.
        runs: Where their runs are kept.
    """
    used: dict[str, AskedRun] = {}
    papers = []
    for claims, several in chosen:
        rows = [_row(claims, judgements[claim.id], runs, used) for claim in several]
        papers.append(_paper(claims, rows))
    verdicts = [row["verdict"] for paper in papers for row in paper["claims"]]
    return {
        "schema": SCHEMA,
        "versions": origin(),
        "counts": _counts(verdicts),
        "papers": papers,
        "runs": {key: _run(asked, runs) for key, asked in used.items()},
    }


def main_runs(contents: dict[str, Any]) -> set[str]:
    """Return the keys of each claim's main runs: the first of each part of its criteria."""
    found = set()
    for paper in contents["papers"]:
        for claim in paper["claims"]:
            for findings in parts_of(claim).values():
                keys = [
                    key
                    for finding in findings
                    for key in finding["runs"]
                    if contents["runs"][key]["status"] == "complete"
                ]
                found.update(keys[:1])
    return found


def parts_of(row: dict[str, Any]) -> dict[str, list[dict[str, Any]]]:
    """Return the findings of a claim's row by the part of the criteria, without empty parts."""
    parts: dict[str, list[dict[str, Any]]] = {}
    for finding in row["findings"]:
        parts.setdefault(finding["part"], []).append(finding)
    return parts


def failures(contents: dict[str, Any]) -> list[tuple[str, str]]:
    """Return the names of claims and runs that failed, each with the error."""
    told = [
        (claim["id"], finding["error"])
        for paper in contents["papers"]
        for claim in paper["claims"]
        for finding in claim["findings"]
        if finding["error"]
    ]
    return told + [
        (f"pictures of {run['command']}", run["picture_failure"])
        for run in contents["runs"].values()
        if run["picture_failure"]
    ]


def _paper(claims: Claims, rows: list[dict[str, Any]]) -> dict[str, Any]:
    return {
        "scheme": claims.scheme,
        **asdict(claims.paper),
        "citation": str(claims.paper),
        "page": claims.page,
        "counts": _counts(row["verdict"] for row in rows),
        "claims": rows,
    }


def _counts(verdicts: Iterable[str]) -> dict[str, int]:
    counted = Counter(verdicts)
    return {verdict: counted[verdict] for verdict in VERDICTS}


def _row(
    claims: Claims, judgement: Judgement, runs: KeptRuns, used: dict[str, AskedRun]
) -> dict[str, Any]:
    claim = judgement.claim
    findings = [
        {"part": part, **_finding(claims, finding, runs, used)}
        for part, several in judgement.parts.items()
        for finding in several
    ]
    return {
        "id": claim.id,
        "where": claim.where,
        "says": claim.says,
        "verdict": judgement.verdict,
        "why": why(judgement),
        "because": claims.reason(claim),
        "command": claim.command,
        "findings": findings,
        "runs": list(dict.fromkeys(key for finding in findings for key in finding["runs"])),
        "tests": list(claim.tests),
    }


def why(judgement: Judgement) -> str:
    """Return the reason for a verdict, in one sentence that is computed from the findings."""
    if judgement.verdict == "failed":
        broken = sum(bool(finding.error) for finding in judgement.findings)
        return f"{broken} of {len(judgement.findings)} numbers could not be measured."
    told = [f"{part}, {_kept(found)}" for part, found in judgement.parts.items() if found]
    if judgement.verdict == "holds":
        told = told[:1]
    if judgement.verdict == "cannot be checked":
        told.insert(0, "there is nothing to measure it by")
    sentence = "; ".join(told)
    return f"{sentence[0].upper()}{sentence[1:]}."


def _kept(findings: Sequence[Finding]) -> str:
    kept, total = sum(finding.holds for finding in findings), len(findings)
    if total == 1:
        return f"the one number is {'' if kept else 'not '}as asked"
    if kept == total:
        return f"{'both' if total == 2 else f'all {total}'} numbers are as asked"
    return f"{kept or 'none'} of {total} numbers {'are' if kept > 1 else 'is'} as asked"


def _finding(
    claims: Claims, finding: Finding, runs: KeptRuns, used: dict[str, AskedRun]
) -> dict[str, Any]:
    criterion = finding.criterion
    keys = []
    for quantity in filter(None, (criterion, criterion.per)):
        for asked in runs.used_by(claims, quantity):
            keys.append(asked.order.key)
            used.setdefault(asked.order.key, asked)
    return {
        "number": str(criterion),
        "meaning": _meaning(claims, criterion),
        "unit": _METRICS[criterion.metric].unit if criterion.metric and not criterion.per else None,
        "measure": criterion.measure,
        "given": plain(criterion.given),
        "command": criterion.command if criterion.run is not None else None,
        "metric": criterion.metric,
        "per": None if criterion.per is None else str(criterion.per),
        "at_least": criterion.at_least,
        "at_most": criterion.at_most,
        "asked": str(criterion.bounds),
        "paper": criterion.paper,
        "wide_because": criterion.wide_because,
        "value": finding.value if isfinite(finding.value) else None,
        "shown": str(finding),
        "met": finding.holds,
        "failure": finding.failure,
        "error": finding.error,
        "timed": criterion.timed,
        "runs": list(dict.fromkeys(keys)),
    }


def _meaning(claims: Claims, quantity: Quantity) -> str:
    """Return the meaning of a number: that of its metric, or the first sentence of its measure."""
    if quantity.metric is not None:
        return _METRICS[quantity.metric].meaning
    told = inspect.getdoc(claims.measures[str(quantity.measure)]) or ""
    return " ".join(told.partition("\n\n")[0].split()).removesuffix(".")


def _run(asked: AskedRun, runs: KeptRuns) -> dict[str, Any]:
    order = asked.order
    outcome, folder = runs.rows.get(order.key), runs.place / order.key
    pictures = pictures_of(folder)
    place = folder.relative_to(runs.place.parents[1]).as_posix()
    played = pictures is not None and (folder / PLAYBACK).is_file() and pictures.playback
    metrics = {} if outcome is None else outcome.metrics
    return {
        "experiment": asked.name,
        "changes": plain(asked.changes),
        "command": run_command(asked.name, asked.changes),
        "seed": order.document.get("seed", ExperimentDocument.seed),
        "duration_s": order.document["duration"],
        "status": "not made" if outcome is None else outcome.status,
        "failure": "" if outcome is None else outcome.failure,
        "until_s": None if outcome is None else outcome.until_s,
        "wall_time_s": None if outcome is None else outcome.wall_time_s,
        "metrics": {name: value if isfinite(value) else None for name, value in metrics.items()},
        "folder": place if (folder / RECORD).is_file() else None,
        "figure": f"{place}/{FIGURE}" if pictures and pictures.size else None,
        "figure_size": list(pictures.size) if pictures and pictures.size else None,
        "playback": f"{place}/{PLAYBACK}" if played else None,
        "picture_failure": pictures.failure if pictures else "",
    }

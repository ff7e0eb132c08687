"""The report on the papers: a folder with their claims, the measured numbers and the verdicts.

- Its contents as plain data, which become ``report.json`` and the pages; what it was made with.
- Pages of Markdown, also the tables of the repository's page of claims.
- Pages of HTML, which need no network.
"""

from __future__ import annotations

import inspect
import json
import platform
import subprocess
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from math import isfinite
from pathlib import Path
from typing import Any, Literal, get_args

from ..claims import Claims, ClaimVerdict, Finding, Judgement, Quantity
from ..claims.claims import run_command
from ..errors import InvalidInputError
from ..experiment import ExperimentDocument
from ..experiment.files import stamp
from ..inputs.files import json_of, page_templates
from ..inputs.messages import plain
from ..inputs.packages import versions
from ..jobs.requests import RunRequest
from ..laws.guarantee import Promise, promise_lines
from ..measures import METRICS
from ..runs.folder import RECORD, claim_folder, read_record, written_whole
from ..tables import markdown_rows
from .kept_runs import (
    FIGURE,
    PLAYBACK,
    ClaimChoice,
    KeptRuns,
    Progress,
    draw_missing,
    gather,
    judge,
    pictures_of,
)

_PACKAGE = Path(__file__).parents[1]


def origin() -> dict[str, str | None]:
    """Return the versions of what the numbers depend on, with the commit, None if not known."""
    return {
        **versions(),
        "python": platform.python_version(),
        "code": stamp().rpartition(" ")[2],
        "commit": _commit(),
    }


def _commit() -> str | None:
    """Return the commit of this package's files, marked if they have changed since."""
    if _git("ls-files", "--error-unmatch", "__init__.py") is None:
        # Not under version control, though a folder above it may be.
        return None
    commit = _git("rev-parse", "HEAD")
    return f"{commit}, changed since" if commit and _git("status", "--porcelain", ".") else commit


def _git(*arguments: str) -> str | None:
    try:
        process = subprocess.run(
            ["git", "-C", str(_PACKAGE), *arguments], capture_output=True, text=True, check=True
        )
    except (OSError, subprocess.CalledProcessError):
        return None
    return process.stdout.strip()


#: Version of the format of ``report.json``; within a version, no key changes its meaning.
SCHEMA = 2
#: The verdicts, in the order in which they are shown.
VERDICTS: tuple[ClaimVerdict, ...] = get_args(ClaimVerdict)
_METRICS = METRICS.by_name


def contents_of(
    choice: ClaimChoice, judgements: dict[str, Judgement], runs: KeptRuns
) -> dict[str, Any]:
    """Return the contents of a report.

    Args:
        choice: The claims.
        judgements: The judgement of each claim, by its id.
        runs: Where their runs are kept.
    """
    used: dict[str, RunRequest] = {}
    papers = []
    for claims, several in choice:
        rows = [_row(claims, judgements[claim.id], runs, used) for claim in several]
        papers.append(_paper(claims, rows))
    verdicts = [row["verdict"] for paper in papers for row in paper["claims"]]
    return {
        "schema": SCHEMA,
        "versions": origin(),
        "counts": _counts(verdicts),
        "papers": papers,
        "runs": {key: _run(request, runs) for key, request in used.items()},
    }


def main_runs(contents: dict[str, Any]) -> set[str]:
    """Return the keys of each claim's main runs: the first of each part of its criteria."""
    names = set()
    for paper in contents["papers"]:
        for claim in paper["claims"]:
            for findings in parts_of(claim).values():
                keys = [
                    key
                    for finding in findings
                    for key in finding["runs"]
                    if contents["runs"][key]["status"] == "complete"
                ]
                names.update(keys[:1])
    return names


def parts_of(row: dict[str, Any]) -> dict[str, list[dict[str, Any]]]:
    """Return the findings of a claim's row by the part of the criteria, without empty parts."""
    parts: dict[str, list[dict[str, Any]]] = {}
    for finding in row["findings"]:
        parts.setdefault(finding["part"], []).append(finding)
    return parts


def failures(contents: dict[str, Any]) -> list[tuple[str, str]]:
    """Return the names of claims and runs that failed, each with the error."""
    errors = [
        (claim["id"], finding["error"])
        for paper in contents["papers"]
        for claim in paper["claims"]
        for finding in claim["findings"]
        if finding["error"]
    ]
    return errors + [
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
    counter = Counter(verdicts)
    return {verdict: counter[verdict] for verdict in VERDICTS}


def _row(
    claims: Claims, judgement: Judgement, runs: KeptRuns, used: dict[str, RunRequest]
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
        error_count = sum(bool(finding.error) for finding in judgement.findings)
        return f"{error_count} of {len(judgement.findings)} numbers could not be measured."
    texts = [
        f"{part}, {_note_of(findings)}" for part, findings in judgement.parts.items() if findings
    ]
    if judgement.verdict == "holds":
        texts = texts[:1]
    if judgement.verdict == "cannot be checked":
        texts.insert(0, "there is nothing to measure it by")
    sentence = "; ".join(texts)
    return f"{sentence[0].upper()}{sentence[1:]}."


def _note_of(findings: Sequence[Finding]) -> str:
    holding, total = sum(finding.holds for finding in findings), len(findings)
    if total == 1:
        return f"the one number is {'' if holding else 'not '}as asked"
    if holding == total:
        return f"{'both' if total == 2 else f'all {total}'} numbers are as asked"
    return f"{holding or 'none'} of {total} numbers {'are' if holding > 1 else 'is'} as asked"


def _finding(
    claims: Claims, finding: Finding, runs: KeptRuns, used: dict[str, RunRequest]
) -> dict[str, Any]:
    criterion = finding.criterion
    keys = []
    for quantity in filter(None, (criterion, criterion.per)):
        for request in runs.used_by(claims, quantity):
            keys.append(request.key)
            used.setdefault(request.key, request)
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
    text = inspect.getdoc(claims.measures[str(quantity.measure)]) or ""
    return " ".join(text.partition("\n\n")[0].split()).removesuffix(".")


def _run(request: RunRequest, runs: KeptRuns) -> dict[str, Any]:
    record, folder = runs.rows.get(request.key), runs.place / request.key
    pictures = pictures_of(folder)
    place = folder.relative_to(runs.place.parents[1]).as_posix()
    has_playback = pictures is not None and (folder / PLAYBACK).is_file() and pictures.playback
    metrics = {} if record is None else record.metrics
    return {
        "experiment": request.experiment,
        "changes": plain(request.changes),
        "command": run_command(request.experiment, request.changes),
        "seed": request.document.get("seed", ExperimentDocument.seed),
        "duration_s": request.document["duration"],
        "status": "not made" if record is None else record.status,
        "failure": "" if record is None else record.failure,
        "until_s": None if record is None else record.until_s,
        "wall_time_s": None if record is None else record.wall_time_s,
        "metrics": {name: value if isfinite(value) else None for name, value in metrics.items()},
        "promises": _promises(folder),
        "folder": place if (folder / RECORD).is_file() else None,
        "figure": f"{place}/{FIGURE}" if pictures and pictures.size else None,
        "figure_size": list(pictures.size) if pictures and pictures.size else None,
        "playback": f"{place}/{PLAYBACK}" if has_playback else None,
        "picture_failure": pictures.failure if pictures else "",
    }


def _promises(folder: Path) -> list[str]:
    """Return what the run in a folder promises and what that rests on, in words."""
    try:
        promises = read_record(folder).get("promises", [])
    except InvalidInputError:
        return []
    lines = []
    for second in (False, True):
        several = [Promise.from_contents(each) for each in promises if each["second"] is second]
        lines += ["second: " * second + line for line in promise_lines(several)]
    return lines


_COLUMNS = ("claim", "place", "the paper says", "measured", "verdict", "why")
_RUN_COLUMNS = ("run", "seed", "simulated [s]", "wall time [s]", "status", "promises", "to look at")


def index_page(contents: dict[str, Any], page_of: dict[str, str]) -> str:
    """Return the page of all papers.

    Args:
        contents: What the report says.
        page_of: Names of the papers' pages, by scheme.
    """
    links = [
        f"- [{title_of(paper)}]({page_of[paper['scheme']]}): {paper['citation']}"
        for paper in contents["papers"]
    ]
    parts = [
        "# What the papers claim, and what holds",
        markdown_rows(counts_rows(contents)),
        "\n".join(links),
        _made_with(contents),
    ]
    return "\n\n".join(parts) + "\n"


def paper_page(contents: dict[str, Any], paper: dict[str, Any]) -> str:
    """Return one paper's page: its claims, and the runs that they were judged by."""
    keys = dict.fromkeys(key for claim in paper["claims"] for key in claim["runs"])
    runs = [contents["runs"][key] for key in keys]
    parts = [
        f"# {title_of(paper)}",
        paper["citation"],
        claims_table(paper),
        "## Runs",
        markdown_rows([_RUN_COLUMNS, *map(_run_cells, runs)]) if runs else "None.",
        _made_with(contents),
    ]
    return "\n\n".join(parts) + "\n"


def counts_table(contents: dict[str, Any]) -> str:
    """Return a table of how many claims of each paper hold."""
    return markdown_rows(counts_rows(contents))


def counts_rows(contents: dict[str, Any]) -> list[list[str]]:
    """Return its rows, the head first; failures have a column only if there are some."""
    verdicts = [each for each in VERDICTS if each != "failed" or contents["counts"]["failed"]]
    rows = [["scheme", "claims", *verdicts]]
    for paper in contents["papers"]:
        counts = [str(paper["counts"][verdict]) for verdict in verdicts]
        total = str(len(paper["claims"]))
        rows.append([paper["scheme"].replace("_", " "), total, *counts])
    return rows


def claims_table(paper: dict[str, Any]) -> str:
    """Return the table of one paper's claims."""
    return markdown_rows([_COLUMNS, *map(_claim, paper["claims"])])


def title_of(paper: dict[str, Any]) -> str:
    """Return the name of a paper's scheme as a heading."""
    return str(paper["scheme"]).replace("_", " ").capitalize()


def _claim(claim: dict[str, Any]) -> list[str]:
    rows: list[str] = []
    for part, findings in parts_of(claim).items():
        rows += [] if part == "as stated" else [f"*{part}:*"]
        rows += map(_finding_text, findings)
    return [
        f"`{claim['id']}`",
        claim["where"],
        claim["says"],
        "<br>".join(rows),
        claim["verdict"],
        claim["because"],
    ]


def _finding_text(finding: dict[str, Any]) -> str:
    what = f"`{finding['number']}`"
    if finding["command"] is not None:
        per = f", per `{finding['per']}`" if finding["per"] is not None else ""
        what = f"`{finding['command']}`: {finding['metric']}{per}"
    paper = f" (paper: {finding['paper']})" if finding["paper"] else ""
    wide = f" (wide: {finding['wide_because']})" if finding["wide_because"] else ""
    return f"{what}: **{finding['shown']}**, asked {finding['asked']}{paper}{wide}"


def _run_cells(run: dict[str, Any]) -> list[str]:
    links = {"figure": run["figure"], "playback": run["playback"]}
    return [
        f"`{run['command']}`",
        str(run["seed"]),
        "" if run["until_s"] is None else f"{run['until_s']:g}",
        "" if run["wall_time_s"] is None else f"{run['wall_time_s']:.1f}",
        f"{run['status']}: {run['failure']}" if run["failure"] else run["status"],
        "<br>".join(run["promises"]),
        ", ".join(f"[{name}]({link})" for name, link in links.items() if link),
    ]


def _made_with(contents: dict[str, Any]) -> str:
    known_versions = {name: number for name, number in contents["versions"].items() if number}
    return f"Made with {', '.join(f'{name} {number}' for name, number in known_versions.items())}."


#: A sign for each verdict, so that no reader depends on its colour.
SIGNS = {
    "holds": "✓",
    "holds with correction": "≈",
    "does not hold": "✗",
    "cannot be checked": "?",
    "failed": "!",
}
_ENVIRONMENT = page_templates(Path(__file__).parent / "templates")
_ENVIRONMENT.filters.update(title_of=title_of, parts_of=parts_of)
_ENVIRONMENT.globals.update(verdicts=VERDICTS, signs=SIGNS)


def index_html(contents: dict[str, Any], page_of: dict[str, str]) -> str:
    """Return the page of all papers.

    Args:
        contents: What the report says.
        page_of: Names of the papers' pages, by scheme.
    """
    return _ENVIRONMENT.get_template("index.html").render(
        contents=contents,
        page_of=page_of,
        failed=[
            (paper, claim)
            for paper in contents["papers"]
            for claim in paper["claims"]
            if claim["verdict"] == "failed"
        ],
    )


def paper_html(contents: dict[str, Any], paper: dict[str, Any], page_of: dict[str, str]) -> str:
    """Return one paper's page."""
    return _ENVIRONMENT.get_template("paper.html").render(
        contents=contents, paper=paper, page_of=page_of, runs=contents["runs"]
    )


#: Format of the pages.
Format = Literal["html", "md"]
_DATA = "report.json"


@dataclass(frozen=True)
class Report:
    """A report that was made, or begun.

    Attributes:
        folder: Its folder.
        contents: The contents of ``report.json``; empty if interrupted before the verdicts.
        complete: Whether it is complete; parts of an interrupted report are kept.
    """

    folder: Path
    contents: dict[str, Any]
    complete: bool

    @property
    def failures(self) -> list[tuple[str, str]]:
        """Claims and pictures that failed, each with the error."""
        return failures(self.contents) if self.contents else []


@dataclass(frozen=True)
class ReportSettings:
    """How a report is made.

    Attributes:
        jobs: Number of processes; 0 for this process itself.
        format: Format of the pages.
        pictures: Whether figures are drawn.
        playbacks: Whether playbacks are written.
        again: Whether runs are made again that failed before.
    """

    jobs: int = 1
    format: Format = "html"
    pictures: bool = True
    playbacks: bool = True
    again: bool = False


def make_report(
    claims: ClaimChoice,
    folder: str | Path,
    settings: ReportSettings | None = None,
    progress: Progress = lambda what, ended, total: None,
) -> Report:
    """Make the missing parts of a report, and write its pages.

    Runs, measured numbers and pictures are kept in the folder as they end. Called again, also after
    this process was killed, it makes the parts that are missing. The row of a part that fails says
    why.

    Args:
        claims: Papers with their claims.
        folder: Folder of the report, which is created if missing.
        settings: How it is made.
        progress: Called when a part has ended, with its kind, the number of such parts that have
            ended, and the number of all of them.

    Raises:
        InvalidInputError: If the folder cannot be written to, another process writes to it, or
            there are files of these names that no report has written.
    """
    folder, settings = Path(folder), settings or ReportSettings()
    pages = (f"{name}.{settings.format}" for name in ("index", *(c.scheme for c, _ in claims)))
    _refuse_others(folder, {_DATA, *pages})
    runs = KeptRuns(folder)
    with claim_folder(folder):
        try:
            return _make(claims, runs, folder, settings, progress)
        except KeyboardInterrupt:
            return Report(folder, {}, complete=False)


def _make(
    choice: ClaimChoice, runs: KeptRuns, folder: Path, settings: ReportSettings, progress: Progress
) -> Report:
    if settings.again:
        runs.forget_failed()
    if not gather(choice, runs, settings.jobs, progress):
        return Report(folder, {}, complete=False)
    judgements = {
        claim.id: judge(claims, claim, runs) for claims, several in choice for claim in several
    }
    contents = _write(contents_of(choice, judgements, runs), folder, settings.format)
    complete = True
    if settings.pictures:
        playbacks = main_runs(contents) if settings.playbacks else set()
        complete = draw_missing(runs, list(contents["runs"]), playbacks, settings.jobs, progress)
        contents = _write(contents_of(choice, judgements, runs), folder, settings.format)
    if complete:
        runs.remove_others()
    return Report(folder, contents, complete)


def _write(contents: dict[str, Any], folder: Path, form: Format) -> dict[str, Any]:
    """Write the pages that have changed, and remove pages of an earlier report.

    Returns:
        The contents with the names of the pages.
    """
    page_of = {paper["scheme"]: f"{paper['scheme']}.{form}" for paper in contents["papers"]}
    if form == "html":
        pages = {"index.html": index_html(contents, page_of)}
        for paper in contents["papers"]:
            pages[page_of[paper["scheme"]]] = paper_html(contents, paper, page_of)
    else:
        pages = {"index.md": index_page(contents, page_of)}
        for paper in contents["papers"]:
            pages[page_of[paper["scheme"]]] = paper_page(contents, paper)
    data = contents | {"pages": sorted(pages)}
    try:
        for name in set(_pages_before(folder)) - pages.keys():
            (folder / name).unlink(missing_ok=True)
        # The data come first: after this process is killed here, the next report knows its pages.
        _put(folder / _DATA, json.dumps(data, indent=1, allow_nan=False) + "\n")
        for name, text in pages.items():
            _put(folder / name, text)
    except OSError as error:
        raise InvalidInputError(f"report folder {folder}: {error.strerror}") from None
    return data


def _put(file: Path, text: str) -> None:
    if not file.is_file() or file.read_text(encoding="utf-8") != text:
        with written_whole(file) as stream:
            stream.write(text)


def _refuse_others(folder: Path, names: set[str]) -> None:
    """Refuse to overwrite a user's own files."""
    before = _pages_before(folder)
    ours = {_DATA, *before} if before else set()
    if others := sorted(name for name in names - ours if (folder / name).exists()):
        raise InvalidInputError(
            f"report folder {folder}: {others[0]} is not of a report; give another folder"
        )


def _pages_before(folder: Path) -> list[str]:
    """Return the pages that an earlier report has written."""
    try:
        contents = json_of(folder / _DATA)
        names = [Path(name).name for name in contents["pages"]]
    except (OSError, ValueError, KeyError, TypeError):
        return []
    return names if {"papers", "runs"} <= contents.keys() else []

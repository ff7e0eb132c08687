"""The report on the papers: a folder with their claims, the measured numbers and the verdicts."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from ..errors import InvalidInputError
from ..inputs.files import json_of
from ..runs.folder import claimed, written_whole
from .contents import (
    contents_of,
    failures,
    index_html,
    index_page,
    main_runs,
    paper_html,
    paper_page,
)
from .kept_runs import (
    Chosen,
    Done,
    KeptRuns,
    draw_missing,
    gather,
    judged,
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
    chosen: Chosen,
    folder: str | Path,
    settings: ReportSettings | None = None,
    done: Done = lambda what, ended, total: None,
) -> Report:
    """Make the missing parts of a report, and write its pages.

    Runs, measured numbers and pictures are kept in the folder as they end. Called again, also after
    this process was killed, it makes the parts that are missing. The row of a part that fails says
    why.

    Args:
        chosen: Papers with their claims.
        folder: Folder of the report, which is created if missing.
        settings: How it is made.
        done: Called when a part has ended, with its kind, the number of such parts that have ended,
            and the number of all of them.

    Raises:
        InvalidInputError: If the folder cannot be written to, another process writes to it, or
            there are files of these names that no report has written.
    """
    folder, settings = Path(folder), settings or ReportSettings()
    pages = (f"{name}.{settings.format}" for name in ("index", *(c.scheme for c, _ in chosen)))
    _refuse_others(folder, {_DATA, *pages})
    runs = KeptRuns(folder)
    with claimed(folder):
        try:
            return _made(chosen, runs, folder, settings, done)
        except KeyboardInterrupt:
            return Report(folder, {}, complete=False)


def _made(
    chosen: Chosen, runs: KeptRuns, folder: Path, settings: ReportSettings, done: Done
) -> Report:
    if settings.again:
        runs.forget_failed()
    if not gather(chosen, runs, settings.jobs, done):
        return Report(folder, {}, complete=False)
    judgements = {
        claim.id: judged(claims, claim, runs) for claims, several in chosen for claim in several
    }
    contents = _written(contents_of(chosen, judgements, runs), folder, settings.format)
    complete = True
    if settings.pictures:
        played = main_runs(contents) if settings.playbacks else set()
        complete = draw_missing(runs, list(contents["runs"]), played, settings.jobs, done)
        contents = _written(contents_of(chosen, judgements, runs), folder, settings.format)
    if complete:
        runs.remove_others()
    return Report(folder, contents, complete)


def _written(contents: dict[str, Any], folder: Path, form: Format) -> dict[str, Any]:
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
        told = json_of(folder / _DATA)
        names = [Path(name).name for name in told["pages"]]
    except (OSError, ValueError, KeyError, TypeError):
        return []
    return names if {"papers", "runs"} <= told.keys() else []

"""What the commands may be asked that judge the claims of papers."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Literal

import typer

from ..command import options
from ..options import MOST_JOBS, Jobs, Quiet, TableFiles


@options
class ShowClaims:
    """List the claims of the papers, or judge them."""

    ids: Annotated[
        list[str] | None,
        typer.Argument(metavar="[ID]...", help="Claims, e.g. slc-F2a, or papers, e.g. slc."),
    ] = None
    judge: Annotated[
        bool, typer.Option("--judge", help="Run the experiments and print the verdicts.")
    ] = False
    tables: TableFiles = None


@options
class Report:
    """Judge the papers' claims and write a report. Finished runs are kept and skipped."""

    ids: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[ID]...",
            help="Claims, e.g. slc-F2a, or papers, e.g. slc or state_adjustment; by default all.",
        ),
    ] = None
    folder: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder of the report.")] = (
        Path("out/report")
    )
    jobs: Jobs = min(os.cpu_count() or 1, MOST_JOBS)
    form: Annotated[
        Literal["html", "md"], typer.Option("--format", help="Pages as html or md.")
    ] = "html"
    pictures: Annotated[bool, typer.Option(help="Draw an overview of each run.")] = True
    playbacks: Annotated[bool, typer.Option(help="Write playbacks of the claims' main runs.")] = (
        True
    )
    again: Annotated[
        bool, typer.Option("--again", help="Retry runs that failed or cannot be read.")
    ] = False
    claims: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder with claims files, in place of the shipped ones."),
    ] = None
    quiet: Quiet = False

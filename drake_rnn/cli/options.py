"""Options that several commands have."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from .command import options
from .completing import complete_experiments

One = Annotated[
    str,
    typer.Argument(
        metavar="EXPERIMENT",
        help="Name of a shipped experiment, or a YAML file.",
        autocompletion=complete_experiments,
    ),
]
Set = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Change a key, e.g. law.kappa=8; repeatable."),
]
Out = Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the result folders.")]
Seed = Annotated[int | None, typer.Option(help="Seed of all random numbers.")]
Check = Annotated[
    bool,
    typer.Option(
        "--check",
        help="Exit with status 3 if a bound is broken: of accept, or a limit the law guarantees.",
    ),
]
Anyway = Annotated[
    bool, typer.Option("--anyway", help="Run even if it may take more than three hours.")
]
Figures = Annotated[bool, typer.Option("--figures/--no-figures", help="Draw figures.")]
Playback = Annotated[bool, typer.Option(help="Write playback.html.")]
#: Each run of several at a time is made by a process of its own, of some 200 MB.
MOST_JOBS = 256
Jobs = Annotated[int, typer.Option(min=1, max=MOST_JOBS, help="Number of parallel runs.")]
#: Where messages go by default: to this machine and no further.
Url = Annotated[
    str | None,
    typer.Option(
        metavar="URL",
        help="Address of the messages (LCM) of an iiwa, or of an FR3: its name or IP address.",
    ),
]
TableFiles = Annotated[
    list[Path] | None,
    typer.Option(
        "--table",
        metavar="FILE",
        help="Also write the table: a .md, .tex (LaTeX) or .csv file; repeatable.",
    ),
]
Metrics = Annotated[
    str | None,
    typer.Option(metavar="METRIC,...", help="Metrics of the table; by default those that matter."),
]
Labels = Annotated[
    str | None,
    typer.Option(metavar="NAME,...", help="What tables and figures call the runs, in their order."),
]
Quiet = Annotated[bool, typer.Option("--quiet", help="Print only warnings and errors.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print metrics and verdicts as JSON only.")]
DryRun = Annotated[
    bool, typer.Option("--dry-run", help="Check everything and estimate the time; run nothing.")
]
Duration = Annotated[
    float | None,
    typer.Option(help="Simulated time [s]; a window that ends later is dropped."),
]
Folder = Annotated[Path, typer.Argument(metavar="FOLDER", help="Result folder of a run.")]
Beside = Annotated[
    list[Path] | None,
    typer.Option(metavar="FOLDER", help="Also show the path of this result; repeatable."),
]


@options
class Changed:
    """Options of commands that run an experiment with changes."""

    out_folder: Out = Path("out")
    changes: Set = None


@options
class Checked(Changed):
    """Options of commands whose outcome a script may check."""

    duration: Duration = None
    check: Check = False
    quiet: Quiet = False


@options
class Planned(Checked):
    """Options of commands that tell scripts what they will do and what came out."""

    as_json: AsJson = False
    dry_run: DryRun = False


@options
class Printed:
    """Options of commands that draw figures for print."""

    form: Annotated[
        Literal["png", "pdf", "svg"], typer.Option("--format", help="Format of the figures.")
    ] = "png"
    width: Annotated[
        str | None,
        typer.Option(metavar="LENGTH", help="Width of the figures, e.g. 88mm for a column."),
    ] = None
    look: Annotated[
        Literal["screen", "journal"],
        typer.Option(help="Look of the figures; journal has serifs, fine lines and 600 dpi."),
    ] = "screen"

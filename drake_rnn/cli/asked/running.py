"""What the commands may be asked that run experiments."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from ..command import options
from ..completing import complete_campaigns, complete_experiments
from ..options import (
    Anyway,
    Changed,
    Checked,
    Figures,
    Jobs,
    Labels,
    Metrics,
    One,
    Planned,
    Playback,
    Printed,
    Seed,
    TableFiles,
)


@options
class Run(Planned):
    """Run experiments. Each gets a folder with metrics, figures and a playback."""

    experiments: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="EXPERIMENT...",
            help="Names of shipped experiments, or YAML files.",
            autocompletion=complete_experiments,
        ),
    ] = None
    resume: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="Go on with the run of this folder, which was stopped, instead of a new one.",
        ),
    ] = None
    seed: Seed = None
    figures: Figures = True
    playback: Playback = True
    beside: Annotated[
        list[str] | None,
        typer.Option(
            metavar="EXPERIMENT",
            help="Run this one first, and show its path in the playbacks of the others; "
            "repeatable.",
        ),
    ] = None
    jobs: Jobs = 1
    anyway: Anyway = False
    series: Annotated[
        Literal["full", "thin", "none"],
        typer.Option(
            help="Samples to store: one per log_period, at most 2000 of them, or only the last."
        ),
    ] = "full"


@options
class Live(Changed):
    """Play with an experiment in a browser while it runs, at the rate of real time."""

    experiment: One
    seed: Seed = None
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port of the page; 0 for any.")] = 8040
    host: Annotated[
        str, typer.Option(help="Address to listen at; other machines reach any but localhost.")
    ] = "localhost"
    obstacle_speed: Annotated[
        float,
        typer.Option(
            min=0.0,
            metavar="SPEED",
            help="Speed of obstacles that are dragged, where they have none [m/s]; 0 for none.",
        ),
    ] = 0.1


@options
class Fastest(Changed):
    """Run a path as fast as the limits on all derivatives allow."""

    experiment: One
    figures: Figures = True
    playback: Playback = True


@options
class Sweep(Planned, Printed):
    """Run an experiment with several values. Writes a table, a CSV file and a figure."""

    experiment: One
    over: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY=v1,v2,...",
            help="Values of a key; repeat for all combinations. Default: those in the document.",
        ),
    ] = None
    metrics: Metrics = None
    tables: TableFiles = None
    seed: Seed = None
    jobs: Jobs = 1
    anyway: Anyway = False


@options
class Campaign(Planned, Printed):
    """Run many variations of an experiment. Finished runs are kept and skipped."""

    campaign: Annotated[
        str,
        typer.Argument(
            metavar="CAMPAIGN",
            help="Name of a shipped campaign, or a YAML file.",
            autocompletion=complete_campaigns,
        ),
    ]
    samples: Annotated[
        int | None, typer.Option(min=1, help="Number of samples, in place of the campaign's.")
    ] = None
    method: Annotated[
        str | None,
        typer.Option(
            metavar="METHOD",
            help="auto, batch or simulate, in place of the campaign's.",
            autocompletion=lambda: ["auto", "batch", "simulate"],
        ),
    ] = None
    jobs: Jobs = 1
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Run on the Dask cluster of this scheduler."),
    ] = None
    again: Annotated[bool, typer.Option("--again", help="Retry rows whose worker crashed.")] = False
    tables: TableFiles = None
    anyway: Anyway = False
    as_json: Annotated[bool, typer.Option("--json", help="Print the summary as JSON only.")] = False


@options
class Tune(Checked):
    """Tune gains of a law by descent. The gains found are verified by Drake and written."""

    experiment: One
    numbers: Annotated[
        list[str],
        typer.Option(
            "--over",
            metavar="KEY,KEY,...",
            help="Numbers of the law to tune, e.g. law.kappa,law.rho; repeatable.",
        ),
    ]
    least: Annotated[str, typer.Option(metavar="METRIC", help="Metric to minimize.")] = (
        "position_error_rms_m"
    )
    between: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY=LOW,HIGH",
            help="Bounds of a number; repeatable. Default: a thirtieth and 30 times the start.",
        ),
    ] = None
    seed: Seed = None
    duration: Annotated[
        float | None,
        typer.Option(help="Simulated time to tune on [s]; Drake's runs use the document's."),
    ] = None
    steps: Annotated[int, typer.Option(min=1, help="Largest number of steps.")] = 30
    figures: Figures = True
    check: Annotated[
        bool, typer.Option("--check", help="Exit with status 3 if no better gains are found.")
    ] = False


@options
class Compare(Planned, Printed):
    """Compare runs. Experiments are run first, and their own results are not kept."""

    runs: Annotated[
        list[str],
        typer.Argument(
            metavar="RUN...",
            help="Names of shipped experiments, YAML files or result folders.",
            autocompletion=complete_experiments,
        ),
    ]
    metrics: Metrics = None
    labels: Labels = None
    tables: TableFiles = None
    seed: Seed = None

"""What each command may be asked: its options, and its help; a file for each kind of command.

- What the commands may be asked that run experiments.
- What the commands may be asked that look something up, or write a document to begin with.
- What the commands may be asked that draw or write saved results.
- What the commands may be asked that drive a robot, or are one.
- What the commands may be asked that judge the claims of papers.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Literal

import typer

from .command import (
    MOST_JOBS,
    Anyway,
    Beside,
    By,
    ChangeOptions,
    CheckOptions,
    Elsewhere,
    Figures,
    Folder,
    Jobs,
    Labels,
    Metrics,
    One,
    PlanOptions,
    Playback,
    PrintOptions,
    Quiet,
    Seed,
    Set,
    Statistic,
    TableFiles,
    Url,
    complete_arms,
    complete_campaigns,
    complete_experiments,
    complete_laws,
    complete_levels,
    complete_paths,
    options,
)


@options
class Run(PlanOptions):
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
    compiled: Annotated[
        bool,
        typer.Option(
            "--compiled", help="Compile the steps of the law: to C, or by JAX without a C compiler."
        ),
    ] = False


@options
class Shield(ChangeOptions):
    """Put a recorded stream of targets behind a shield; say what would have stopped a robot.

    The stream is a CSV, Parquet (LeRobot) or MCAP file, or a ROS JointTrajectory as YAML or JSON:
    joint positions, joint velocities, poses or twists of the tool, single or in chunks. Of two
    arms, with arm.pair, columns begin with the name of the arm, left/q1.
    """

    file: Annotated[
        Path | None,
        typer.Argument(metavar="FILE", help="File with the targets; --live needs none."),
    ] = None
    arm: Annotated[
        str, typer.Option(metavar="ARM", help="Arm that they are for: a shipped name, or a model.")
    ] = "panda"
    frame: Annotated[
        str | None, typer.Option(help="Frame E of its tool; a model file needs it.")
    ] = None
    period: Annotated[
        float | None,
        typer.Option(
            min=1e-4,
            max=0.1,
            help="Period of the arm's commands [s]; by default 0.001, without FILE 0.005.",
        ),
    ] = None
    live: Annotated[
        bool,
        typer.Option(
            "--live",
            help="Play it on a page in a browser, in real time; without FILE a target is dragged.",
        ),
    ] = False
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port of that page; 0 for any.")] = (
        8040
    )
    figures: Figures = True
    playback: Playback = True


@options
class Live(ChangeOptions):
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
class Fastest(ChangeOptions):
    """Run a path as fast as the limits on all derivatives allow."""

    experiment: One
    figures: Figures = True
    playback: Playback = True


@options
class Sweep(PlanOptions, PrintOptions):
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
class Campaign(PlanOptions, PrintOptions):
    """Run many variations of an experiment. Finished runs are kept and skipped."""

    campaign: Annotated[
        str,
        typer.Argument(
            metavar="CAMPAIGN",
            help="Name of a shipped campaign, a YAML file, or the folder of one that has run.",
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
    by: By = None
    labels: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,...",
            help="What tables and figures call the groups of --by, in their order; KEY=NAME "
            "names a column.",
        ),
    ] = None
    statistic: Statistic = "mean"
    metrics: Metrics = None
    tables: TableFiles = None
    anyway: Anyway = False
    as_json: Annotated[bool, typer.Option("--json", help="Print the summary as JSON only.")] = False


@options
class Tune(CheckOptions):
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
class Compare(PlanOptions, PrintOptions):
    """Compare runs. Experiments are run first, and their own results are not kept."""

    runs: Annotated[
        list[str],
        typer.Argument(
            metavar="RUN...",
            help="Names of shipped experiments, YAML files, result folders or campaign folders.",
            autocompletion=complete_experiments,
        ),
    ]
    metrics: Metrics = None
    labels: Labels = None
    by: By = None
    statistic: Statistic = "mean"
    tables: TableFiles = None
    seed: Seed = None


@options
class List:
    """List the shipped experiments."""

    word: Annotated[
        str, typer.Argument(help="Only those with this word in name, paper or expectation.")
    ] = ""
    arm: Annotated[
        str | None, typer.Option(help="Only those with this arm.", autocompletion=complete_arms)
    ] = None
    law: Annotated[
        str | None, typer.Option(help="Only those with this law.", autocompletion=complete_laws)
    ] = None
    level: Annotated[
        str | None,
        typer.Option(help="Only those at this level of detail.", autocompletion=complete_levels),
    ] = None
    tables: TableFiles = None


@options
class Doctor:
    """Say what is installed and works, and how to get what is missing; paste it into an issue.

    Versions, extras, programs, rights to write, a run of 0.1 s and its playback. The exit status is
    1 if something fails that every installation needs.
    """

    as_json: Annotated[bool, typer.Option("--json", help="Print it as JSON.")] = False


@options
class Show:
    """Print a document with comments on its keys, or draw its wiring."""

    experiment: One
    diagram: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Draw the wiring: a .svg, .png, .pdf or .dot file."),
    ] = None


@options
class Arms:
    """List the shipped arms, and the keys that describe an arm."""


@options
class Laws:
    """List the laws with their keys, or explain the keys of one."""

    name: Annotated[
        str | None,
        typer.Argument(help="Explain the keys of this law.", autocompletion=complete_laws),
    ] = None


@options
class Paths:
    """List the paths with their keys, or explain the keys of one."""

    name: Annotated[
        str | None,
        typer.Argument(help="Explain the keys of this path.", autocompletion=complete_paths),
    ] = None


@options
class Arm:
    """Print an arm's joints, limits, reach and inertia, and any doubts."""

    model: Annotated[
        str, typer.Argument(help="Name of a shipped arm, or a model file: URDF, SDF or MJCF.")
    ]
    frame: Annotated[
        str | None, typer.Option(help="Task frame E, or the frame that carries --tool.")
    ] = None
    tool: Annotated[
        str | None,
        typer.Option(metavar="YAML", help="Tool to add, e.g. '{ball: 0.012, length: 0.1}'."),
    ] = None
    changes: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="KEY=VALUE", help="Another key of the arm, e.g. mass_scale=1.1."
        ),
    ] = None
    out_folder: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder for the picture.")
    ] = Path("out")
    picture: Annotated[bool, typer.Option(help="Write a picture of the arm.")] = True
    fit: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Fit capsules to the arm's meshes and write them to a file for arm.capsules; or "
            "to those of its gripper, for arm.gripper.capsules; takes some 10 s for each link.",
        ),
    ] = None
    most: Annotated[
        int, typer.Option(min=1, max=8, help="Most fine capsules of a link, with --fit.")
    ] = 3
    effort: Annotated[
        int,
        typer.Option(
            min=1,
            max=8,
            help="Searches for closer fine capsules, each of so many times as many moves, with "
            "--fit.",
        ),
    ] = 1


@options
class New:
    """Write a module of your own, with a document and a test."""

    what: Annotated[Literal["law", "path", "environment"], typer.Argument(help="What to write.")]
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the module, e.g. my_law.")]
    shipped: Annotated[
        bool,
        typer.Option(
            "--shipped", help="A law of drake_rnn itself, whose sources are the current folder."
        ),
    ] = False


@options
class Compile:
    """Write a law with its arm's kinematics as files in C, with a test."""

    experiment: One
    to: Annotated[Path, typer.Option("--to", metavar="FOLDER", help="Folder for the files.")]
    changes: Set = None
    samples: Annotated[
        int, typer.Option(min=1, max=100_000, help="Number of samples of the test.")
    ] = 1000


@options
class PrintSchema:
    """Print the JSON schema of documents, by which editors complete and check their keys."""

    document: Annotated[
        Literal["experiment", "campaign", "claims"], typer.Argument(help="What is described.")
    ] = "experiment"


@options
class Figure(PrintOptions):
    """Draw one figure of several runs, for print."""

    what: Annotated[Literal["compare"], typer.Argument(help="What to draw.")]
    runs: Annotated[
        list[Path], typer.Argument(metavar="FOLDER...", help="Result folders of the runs.")
    ]
    panels: Annotated[
        str,
        typer.Option(
            metavar="PANEL,...",
            help="Its panels: path, error, orientation, speed, drift, distance, force; angle, "
            "velocity, acceleration, jerk, snap, crackle as shares of their bounds.",
        ),
    ] = "path,error,velocity"
    labels: Labels = None
    file: Annotated[
        Path | None,
        typer.Option("--to", metavar="FILE", help="The file; by default in out/compare_..."),
    ] = None
    files: Elsewhere = None


@options
class Plot(PrintOptions):
    """Draw the figures of a saved result again, into its folder."""

    folder: Folder
    only: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Draw only this figure, e.g. overview; repeatable."),
    ] = None
    files: Elsewhere = None


@options
class Replay:
    """Write the playback of a saved result again, into its folder."""

    folder: Folder
    beside: Beside = None
    files: Elsewhere = None


@options
class Export:
    """Write the series of a saved result for other tools, into its folder."""

    folder: Folder
    form: Annotated[
        Literal["csv", "parquet", "mcap", "trajectory"],
        typer.Option(
            "--format",
            help="Format of the file: table, recording of ROS 2 messages, or joints' motion.",
        ),
    ] = "csv"
    series: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Only this series; repeatable.")
    ] = None
    file: Annotated[Path | None, typer.Option("--to", metavar="FILE", help="The file.")] = None
    files: Elsewhere = None


@options
class Film:
    """Write a saved result as a moving picture, into its folder."""

    folder: Folder
    form: Annotated[
        Literal["webp", "gif", "mp4"],
        typer.Option("--format", help="Format of the file; mp4 needs ffmpeg."),
    ] = "webp"
    size: Annotated[
        str, typer.Option(metavar="WIDTHxHEIGHT", help="Size of its pictures [px].")
    ] = "640x400"
    frames_per_second: Annotated[
        float, typer.Option("--fps", help="Pictures in each second of the film [1/s].")
    ] = 12.0
    seconds: Annotated[
        float,
        typer.Option(
            help="Length without the last picture, which stays for 1 s [s]; "
            "longer runs are sped up."
        ),
    ] = 8.0
    begin: Annotated[
        float, typer.Option("--from", help="Time of the run at which the film begins [s].")
    ] = 0.0
    end: Annotated[
        float | None, typer.Option("--to", help="Time of the run at which it ends [s].")
    ] = None
    view: Annotated[
        Literal["arm", "close", "path"] | None,
        typer.Option(help="What it shows; by default the first view of the playback."),
    ] = None
    theme: Annotated[Literal["light", "dark"], typer.Option(help="Light or dark background.")] = (
        "light"
    )
    most_bytes: Annotated[
        str, typer.Option(metavar="SIZE", help="Largest size of the file, e.g. 800kB.")
    ] = "1.5MB"
    beside: Beside = None
    files: Elsewhere = None


@options
class Drive(CheckOptions):
    """Run an experiment on a robot, with safety monitors."""

    experiment: One
    robot: Annotated[
        str,
        typer.Option(
            metavar="ROBOT",
            help="Robot to drive: iiwa or fr3.",
            autocompletion=lambda: ["iiwa", "fr3"],
        ),
    ] = "iiwa"
    url: Url = None
    dry: Annotated[
        bool, typer.Option("--dry", help="Print what would be sent; no robot is needed.")
    ] = False
    begin: Annotated[
        str | None,
        typer.Option(
            "--from",
            metavar="q1,q2,...",
            help="With --dry, where the robot stands [rad]; by default at the start.",
        ),
    ] = None
    wait: Annotated[float | None, typer.Option(help="Time to wait for the robot [s].")] = None
    silence: Annotated[
        float | None, typer.Option(help="Time without a status after which it is stopped [s].")
    ] = None
    late: Annotated[
        float | None, typer.Option(help="Time that a cycle may be late by, on either side [s].")
    ] = None
    lag: Annotated[
        float | None,
        typer.Option(help="Distance from its command at which a joint stops the robot [rad]."),
    ] = None
    compiled: Annotated[
        bool | None,
        typer.Option(
            "--compiled/--no-compiled",
            help="Compile the steps of the law to C; by default where they can be.",
        ),
    ] = None
    figures: Figures = True
    playback: Playback = True


@options
class ServeRobot:
    """Simulate a robot behind its messages, in real time, with faults on request."""

    robot: Annotated[
        str,
        typer.Argument(metavar="ROBOT", help="Robot: iiwa.", autocompletion=lambda: ["iiwa"]),
    ]
    url: Url = None
    begin: Annotated[
        str | None,
        typer.Option(
            "--from", metavar="q1,q2,...", help="Where it stands [rad]; by default at home."
        ),
    ] = None
    delay: Annotated[float, typer.Option(help="Delay of every message, each way [s].")] = 0.0
    loss: Annotated[float, typer.Option(help="Share of messages that are lost, each way.")] = 0.0
    reorder: Annotated[
        float, typer.Option(help="Share of messages that later ones overtake, each way.")
    ] = 0.0
    noise: Annotated[
        float, typer.Option(help="Standard deviation of measured positions [rad].")
    ] = 0.0
    at: Annotated[
        float, typer.Option(help="When what follows begins, after the first command [s].")
    ] = 1.0
    stall: Annotated[float, typer.Option(help="Time for which it stands still [s].")] = 0.0
    silence: Annotated[float, typer.Option(help="Time for which it tells nothing [s].")] = 0.0
    limit_stop: Annotated[
        bool, typer.Option("--limit-stop", help="It stops, and takes no more commands.")
    ] = False
    clock: Annotated[float, typer.Option(help="Jump of its clock [s].")] = 0.0
    nan: Annotated[bool, typer.Option("--nan", help="It tells a position as NaN, once.")] = False
    beyond: Annotated[
        bool, typer.Option("--beyond", help="It tells a joint beyond its limit, once.")
    ] = False
    seed: Annotated[int, typer.Option(help="Seed of what is lost, overtaken and noisy.")] = 0


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

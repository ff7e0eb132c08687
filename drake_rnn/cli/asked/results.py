"""What the commands may be asked that draw or write saved results."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from ..command import options
from ..options import Beside, Folder, Labels, Printed


@options
class Figure(Printed):
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


@options
class Plot(Printed):
    """Draw the figures of a saved result again, into its folder."""

    folder: Folder
    only: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Draw only this figure, e.g. overview; repeatable."),
    ] = None


@options
class Replay:
    """Write the playback of a saved result again, into its folder."""

    folder: Folder
    beside: Beside = None


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

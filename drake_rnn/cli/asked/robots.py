"""What the commands may be asked that drive a robot, or are one."""

from __future__ import annotations

from typing import Annotated

import typer

from ..command import options
from ..options import Checked, Figures, One, Playback, Url


@options
class Drive(Checked):
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

"""What the commands may be asked that look something up, or write a document to begin with."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from ..command import options
from ..completing import complete_arms, complete_laws, complete_levels, complete_paths
from ..options import One, TableFiles


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
class PrintSchema:
    """Print the JSON schema of documents, by which editors complete and check their keys."""

    document: Annotated[
        Literal["experiment", "campaign", "claims"], typer.Argument(help="What is described.")
    ] = "experiment"

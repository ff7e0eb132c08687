"""The command line ``drake-rnn``: its commands, each from the file of its group."""

from __future__ import annotations

import signal
import sys
from pathlib import Path
from typing import Annotated

import typer

from ..inputs.versions import versions
from .again import plot, replay
from .campaigning import campaign
from .catalogue import list_arms, list_experiments, list_laws, list_paths
from .claims import show_claims
from .comparing import compare
from .describing import describe_arm
from .filming import film
from .new import new
from .report import report
from .running import run, run_fastest
from .showing import show
from .sweeping import sweep
from .tuning import tune_gains
from .usage import Commands


def _print_version(asked: bool) -> None:
    if asked:
        typer.echo("".join(f"{name} {number}\n" for name, number in versions().items()), nl=False)
        raise typer.Exit


def common(
    version: Annotated[
        bool,
        typer.Option(
            "--version", help="Print versions and exit.", callback=_print_version, is_eager=True
        ),
    ] = False,
) -> None:
    """Take the options that stand before a command."""


app = typer.Typer(
    cls=Commands,
    no_args_is_help=True,
    rich_markup_mode=None,  # it would read [s] as a style
    pretty_exceptions_enable=False,
    help="Recurrent-neural-network controllers for redundant manipulators, as Drake systems.",
)

app.callback()(common)
app.command("list")(list_experiments)
app.command()(show)
app.command("arms")(list_arms)
app.command("laws")(list_laws)
app.command("paths")(list_paths)
app.command("arm")(describe_arm)
app.command()(run)
app.command("fastest")(run_fastest)
app.command()(sweep)
app.command()(campaign)
app.command("tune")(tune_gains)
app.command()(compare)
app.command()(plot)
app.command()(replay)
app.command()(film)
app.command()(new)
app.command("claims")(show_claims)
app.command()(report)


def main() -> None:
    """Run the command line ``drake-rnn``.

    Modules in the current folder can be named in a document, as with ``python -m``. The folder
    comes last, so that no file in it stands in for an installed module.
    """
    if not sys.flags.safe_path:
        sys.path.append(str(Path.cwd()))
    # What stops a job on a server stops it as Ctrl-C does: what it had is kept.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    app()

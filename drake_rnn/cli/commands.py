"""The command line ``drake-rnn``: its commands, each from the file of its group."""

from __future__ import annotations

import signal
import sys
from pathlib import Path

import typer

from .claims import show_claims
from .describing import describe_arm, list_experiments
from .new import new
from .running import run, run_fastest
from .sweeping import sweep

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    rich_markup_mode=None,  # it would read [s] as a style
    pretty_exceptions_enable=False,
    help="Recurrent-neural-network controllers for redundant manipulators, as Drake systems.",
)

app.command("list")(list_experiments)
app.command("arm")(describe_arm)
app.command()(run)
app.command("fastest")(run_fastest)
app.command()(sweep)
app.command()(new)
app.command("claims")(show_claims)


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

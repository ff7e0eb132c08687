"""The command line ``drake-rnn`` and its commands."""

from __future__ import annotations

from typing import Annotated

import typer

from ..inputs.lending import lent
from . import asked
from .command import add_command
from .usage import Commands


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(lent("drake_rnn.inputs.versions:versions_text")(), nl=False)
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
for _name, _place, _options in (
    ("list", "listing:list_experiments", asked.List),
    ("show", "showing:show", asked.Show),
    ("arms", "catalogue:list_arms", asked.Arms),
    ("laws", "catalogue:list_laws", asked.Laws),
    ("paths", "catalogue:list_paths", asked.Paths),
    ("arm", "describing:describe_arm", asked.Arm),
    ("run", "running:run", asked.Run),
    ("live", "live:play_live", asked.Live),
    ("fastest", "running:run_fastest", asked.Fastest),
    ("sweep", "sweeping:sweep", asked.Sweep),
    ("campaign", "campaigning:campaign", asked.Campaign),
    ("tune", "tuning:tune_gains", asked.Tune),
    ("compare", "comparing:compare", asked.Compare),
    ("figure", "printing:figure", asked.Figure),
    ("plot", "again:plot", asked.Plot),
    ("replay", "again:replay", asked.Replay),
    ("export", "exporting:export_result", asked.Export),
    ("film", "filming:film", asked.Film),
    ("drive", "driving:drive_robot", asked.Drive),
    ("robot", "driving:serve_robot", asked.ServeRobot),
    ("new", "new:new", asked.New),
    ("schema", "schemas:print_schema", asked.PrintSchema),
    ("claims", "claims:show_claims", asked.ShowClaims),
    ("report", "report:report", asked.Report),
):
    add_command(app, _name, _place, _options)

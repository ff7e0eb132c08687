"""The command line ``drake-rnn`` and its commands, those of installed packages among them.

A package offers a command as an entry point of the group ``drake_rnn.commands``: its name, and a
class made by `drake_rnn.cli.command.options` with a method ``run``. Its options are the fields of
the class, and its help is the docstring. Such a package is loaded when its command is named, or
when the commands are listed.
"""

from __future__ import annotations

from dataclasses import is_dataclass
from functools import partial
from importlib.metadata import EntryPoint
from typing import Annotated, Any

import typer

from ..inputs.kinds import describe, find_entry_points
from ..inputs.packages import import_name
from . import arguments as asked
from .command import (
    Commands,
    UsageError,
    add_command,
)

_GROUP = "drake_rnn.commands"


def _print_version(is_asked: bool) -> None:
    if is_asked:
        typer.echo(import_name("drake_rnn.inputs.packages:versions_text")(), nl=False)
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


class _AllCommands(Commands):
    """The shipped commands, and those that installed packages offer."""

    def list_commands(self, ctx: Any) -> list[str]:
        """See `TyperGroup.list_commands`."""
        return [
            *super().list_commands(ctx),
            *sorted(find_entry_points(_GROUP).names - {*self.commands}),
        ]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """See `TyperGroup.get_command`."""
        command = super().get_command(ctx, cmd_name)
        if command is not None:
            return command
        offers = list(find_entry_points(_GROUP).select(name=cmd_name))
        if len(offers) > 1:
            packages = " and by ".join(map(_package, offers))
            raise UsageError(f"command {cmd_name!r} is offered by {packages}; keep one", ctx)
        return _load(offers[0], ctx) if offers else None

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """See `TyperGroup.format_commands`; a package that cannot be loaded is told."""
        super().format_commands(ctx, formatter)
        rows: list[tuple[str, str]] = []
        for offer in sorted(find_entry_points(_GROUP)):
            if offer.name in self.commands:
                rows.append((offer.name, f"not that of {_package(offer)}: the name is taken"))
                continue
            try:
                rows += self.help_rows([(offer.name, self.get_command(ctx, offer.name))])
            except UsageError as error:
                rows.append((offer.name, error.format_message()))
        if rows:
            with formatter.section("Commands of installed packages"):
                formatter.write_dl(rows)


def _load(offer: EntryPoint, ctx: Any) -> Any:
    """Return the command of an installed package."""
    what = f"command {offer.name!r} of {_package(offer)}"
    try:
        cls = offer.load()
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        raise UsageError(f"{what} cannot be loaded: {describe(error)}", ctx) from error
    if not (isinstance(cls, type) and is_dataclass(cls) and callable(vars(cls).get("run"))):
        raise UsageError(
            f"{what} is no class made by drake_rnn.cli.command.options with a method run", ctx
        )
    alone = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
    add_command(alone, offer.name, cls, lambda: vars(cls)["run"])
    return typer.main.get_command(alone)


def _package(offer: EntryPoint) -> str:
    return "an installed package" if offer.dist is None else f"the package {offer.dist.name}"


app = typer.Typer(
    cls=_AllCommands,
    no_args_is_help=True,
    rich_markup_mode=None,  # it would read [s] as a style
    pretty_exceptions_enable=False,
    help="Recurrent-neural-network controllers for redundant manipulators, as Drake systems.",
)
app.callback()(common)
for _name, _place, _options in (
    ("list", "listing:list_experiments", asked.List),
    ("show", "catalogue:show", asked.Show),
    ("arms", "catalogue:list_arms", asked.Arms),
    ("laws", "catalogue:list_laws", asked.Laws),
    ("paths", "catalogue:list_paths", asked.Paths),
    ("arm", "catalogue:describe_arm", asked.Arm),
    ("run", "running:run", asked.Run),
    ("live", "driving:play_live", asked.Live),
    ("fastest", "running:run_fastest", asked.Fastest),
    ("sweep", "campaigning:sweep", asked.Sweep),
    ("campaign", "campaigning:campaign", asked.Campaign),
    ("tune", "comparing:tune_gains", asked.Tune),
    ("compare", "comparing:compare", asked.Compare),
    ("figure", "presenting:figure", asked.Figure),
    ("plot", "presenting:plot", asked.Plot),
    ("replay", "presenting:replay", asked.Replay),
    ("export", "presenting:export_result", asked.Export),
    ("film", "presenting:film", asked.Film),
    ("drive", "driving:drive_robot", asked.Drive),
    ("robot", "driving:serve_robot", asked.ServeRobot),
    ("shield", "shielding:shield", asked.Shield),
    ("new", "catalogue:new", asked.New),
    ("compile", "catalogue:compile_law", asked.Compile),
    ("schema", "catalogue:print_schema", asked.PrintSchema),
    ("claims", "presenting:show_claims", asked.ShowClaims),
    ("report", "presenting:report", asked.Report),
    ("doctor", "listing:examine_installation", asked.Doctor),
):
    add_command(app, _name, _options, partial(import_name, f"{__package__}.{_place}"))

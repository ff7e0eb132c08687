"""How a command is called, and left before its end: in one sentence, like any other refusal."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup, TyperOption

from .statuses import BAD_INPUT, INTERRUPTED

# Length up to which the help of a command is shown among the others [characters].
_LONGEST = 300
#: The class that typer's errors of usage share, which has no public name.
UsageError: Any = typer.BadParameter.__mro__[1]


class Command(TyperCommand):
    """A command; an option that takes one value is refused if it is given twice."""

    def parse_args(self, ctx: Any, args: list[str]) -> Any:
        """See `TyperCommand.parse_args`."""
        parser: Any = self.make_parser(ctx)
        _, _, given = parser.parse_args(list(args))
        for option in given:
            one = isinstance(option, TyperOption) and not (option.multiple or option.is_flag)
            if one and given.count(option) > 1:
                raise UsageError(f"option {option.opts[0]!r} is given twice", ctx)
        return super().parse_args(ctx, args)


#: Commands that go by another name elsewhere.
_ALSO = {
    "figures": "plot",
    "draw": "plot",
    "playback": "replay",
    "page": "replay",
    "video": "film",
    "simulate": "run",
    "experiments": "list",
    "robots": "arms",
}


class Commands(TyperGroup):
    """The commands; an unknown one, or options and arguments that it cannot take, are refused."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """See `TyperGroup.resolve_command`; names the command that an unknown one may stand for."""
        name = args[0]
        if self.get_command(ctx, name) is None:
            meant = [_ALSO[name]] if name in _ALSO else get_close_matches(name, self.commands, 1)
            hint = f"; perhaps {meant[0]!r} is meant" if meant else ""
            raise UsageError(f"no such command {name!r}{hint}", ctx)
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """See `TyperGroup.format_commands`; help that is longer than a line is not cut."""
        with formatter.section("Commands"):
            formatter.write_dl(self.help_rows(self.commands.items()))

    def help_rows(self, commands: Iterable[tuple[str, Any]]) -> list[tuple[str, str]]:
        """Return the name and the short help of each command."""
        return [(name, command.get_short_help_str(_LONGEST)) for name, command in commands]

    def make_context(self, *args: Any, **options: Any) -> Any:
        """See `TyperGroup.make_context`."""
        with _plainly():
            return super().make_context(*args, **options)

    def invoke(self, ctx: Any) -> Any:
        """See `TyperGroup.invoke`."""
        with _plainly():
            return super().invoke(ctx)


@contextmanager
def _plainly() -> Iterator[None]:
    try:
        yield
    except UsageError as error:
        # Without any argument the message is the help itself.
        if type(error).__name__ == "NoArgsIsHelpError":
            raise
        said = " ".join(error.format_message().split()).removesuffix(".")
        said = said.replace("Value error, ", "")
        command = "drake-rnn" if error.ctx is None else _name(error.ctx)
        # Not by rich, which takes as long to import as all of this.
        typer.secho("error", fg="red", nl=False, err=True)
        typer.echo(f" {said[:1].lower() + said[1:]}; see `{command} --help`", err=True)
        raise typer.Exit(BAD_INPUT) from error
    except KeyboardInterrupt as interrupt:
        # Typer would say nothing.
        typer.echo(str(interrupt) or "interrupted", err=True)
        raise typer.Exit(INTERRUPTED) from None


def _name(ctx: Any) -> str:
    """Return how a command is called."""
    return "drake-rnn" if ctx.parent is None else f"{_name(ctx.parent)} {ctx.info_name}"

"""A command: a class with its options, and a function that is imported when the command runs.

- So what a command is called with is read, completed, explained and refused before anything large
  is imported, and each command imports what it needs.
- Options that several commands have.
- What a shell offers when a name is begun.
- How a command is called, and left before its end: in one sentence, like any other refusal.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import MISSING, dataclass, fields
from difflib import get_close_matches
from inspect import Parameter, Signature, getdoc
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, dataclass_transform, get_type_hints

import typer
from typer.core import TyperCommand, TyperGroup, TyperOption

import drake_rnn

from ..diagrams import CAMPAIGNS, EXPERIMENTS
from ..errors import InvalidInputError
from ..inputs.packages import import_name
from ..models import MODELS
from .starting import BAD_INPUT, INTERRUPTED, note_start

# Length up to which the help of a command is shown among the others [characters].
_LONGEST = 300
#: The class that typer's errors of usage share, which has no public name.
UsageError: Any = typer.BadParameter.__mro__[1]


class Command(TyperCommand):
    """A command; an option that takes one value is refused if it is given twice."""

    def parse_args(self, ctx: Any, args: list[str]) -> Any:
        """See `TyperCommand.parse_args`."""
        parser: Any = self.make_parser(ctx)
        _, _, order = parser.parse_args(list(args))
        for option in order:
            one = isinstance(option, TyperOption) and not (option.multiple or option.is_flag)
            if one and order.count(option) > 1:
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
            suggestions = (
                [_ALSO[name]]
                if name in _ALSO
                else get_close_matches(name, self.list_commands(ctx), 1)
            )
            hint = f"; perhaps {suggestions[0]!r} is meant" if suggestions else ""
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
        text = " ".join(error.format_message().split()).removesuffix(".")
        text = text.replace("Value error, ", "")
        command = "drake-rnn" if error.ctx is None else _name(error.ctx)
        # Not by rich, which takes as long to import as all of this.
        typer.secho("error", fg="red", nl=False, err=True)
        typer.echo(f" {text[:1].lower() + text[1:]}; see `{command} --help`", err=True)
        raise typer.Exit(BAD_INPUT) from error
    except KeyboardInterrupt as interrupt:
        # Typer would say nothing.
        typer.echo(str(interrupt) or "interrupted", err=True)
        raise typer.Exit(INTERRUPTED) from None


def _name(ctx: Any) -> str:
    """Return how a command is called."""
    return "drake-rnn" if ctx.parent is None else f"{_name(ctx.parent)} {ctx.info_name}"


T = TypeVar("T")


@dataclass_transform(frozen_default=True, kw_only_default=True)
def options(cls: type[T]) -> type[T]:
    """Make a class a frozen dataclass of options, each an annotated field with its default."""
    return dataclass(frozen=True, kw_only=True)(cls)


def add_command(app: typer.Typer, name: str, args: type, find: Callable[[], Any]) -> None:
    """Add a command to the command line.

    Args:
        app: The command line.
        name: Name of the command.
        args: Class made by `options`. Its docstring is the help of the command.
        find: Returns the function that carries it out, which is given an object of the class; it
            is called when the command runs.
    """

    def carry_out(**given: Any) -> None:
        function = find()
        # Every command imports it, as it prints.
        errors = import_name(f"{__package__}.console:errors")
        note_start()
        with errors():
            _require_current_folder()
            function(args(**given))

    vars(carry_out)["__signature__"] = Signature(_parameters(args))
    app.command(name, cls=Command, help=getdoc(args))(carry_out)


def _require_current_folder() -> None:
    """Refuse to work in a folder that was removed, which Drake and relative names need."""
    try:
        os.getcwd()
    except OSError as error:
        raise InvalidInputError(
            f"current folder: {error.strerror}; change to a folder that exists"
        ) from None


def _parameters(args: type) -> list[Parameter]:
    """Return the options of a class: its own, then those that it shares, the commonest first."""
    hints, defaults = get_type_hints(args, include_extras=True), {}
    for field in fields(args):
        defaults[field.name] = Parameter.empty if field.default is MISSING else field.default
    own, *bases = args.__mro__
    order = [
        name for cls in (own, *reversed(bases)) for name in vars(cls).get("__annotations__", ())
    ]
    return [
        Parameter(name, Parameter.KEYWORD_ONLY, default=defaults[name], annotation=hints[name])
        for name in dict.fromkeys(order)
    ]


def _completer(names: Callable[[], Iterable[str]]) -> Callable[[str], list[str]]:
    """Return a function that returns those of the names that begin as is written so far."""

    def complete(incomplete: str) -> list[str]:
        return sorted(name for name in names() if name.startswith(incomplete))

    return complete


def _stems(files: Iterable[Path]) -> list[str]:
    return [file.stem for file in files]


# By the names of files: a shell is not kept waiting for the rooms that read them.
complete_experiments = _completer(lambda: _stems(EXPERIMENTS.glob("*/*.yaml")))
complete_campaigns = _completer(lambda: _stems(CAMPAIGNS.glob("*.yaml")))
complete_arms = _completer(lambda: (file.parent.name for file in MODELS.glob("*/arm.yaml")))
# Their rooms are imported when they are asked for.
complete_laws = _completer(lambda: drake_rnn.LAWS)
complete_paths = _completer(lambda: drake_rnn.PATHS)
complete_levels = _completer(lambda: drake_rnn.BODIES)


One = Annotated[
    str,
    typer.Argument(
        metavar="EXPERIMENT",
        help="Name of a shipped experiment, or a YAML file.",
        autocompletion=complete_experiments,
    ),
]
Set = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Change a key, e.g. law.kappa=8; repeatable."),
]
Out = Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the result folders.")]
Seed = Annotated[int | None, typer.Option(help="Seed of all random numbers.")]
Check = Annotated[
    bool,
    typer.Option(
        "--check",
        help="Exit with status 3 if a bound is broken: of accept, or a limit the law guarantees.",
    ),
]
Anyway = Annotated[
    bool, typer.Option("--anyway", help="Run even if it may take more than three hours.")
]
Figures = Annotated[bool, typer.Option("--figures/--no-figures", help="Draw figures.")]
Playback = Annotated[bool, typer.Option(help="Write playback.html.")]
#: Each run of several at a time is made by a process of its own, of some 200 MB.
MOST_JOBS = 256
Jobs = Annotated[int, typer.Option(min=1, max=MOST_JOBS, help="Number of parallel runs.")]
#: Where messages go by default: to this machine and no further.
Url = Annotated[
    str | None,
    typer.Option(
        metavar="URL",
        help="Address of the messages (LCM) of an iiwa, or of an FR3: its name or IP address.",
    ),
]
TableFiles = Annotated[
    list[Path] | None,
    typer.Option(
        "--table",
        metavar="FILE",
        help="Also write the table: a .md, .tex (LaTeX) or .csv file; repeatable.",
    ),
]
Metrics = Annotated[
    str | None,
    typer.Option(metavar="METRIC,...", help="Metrics of the table; by default those that matter."),
]
By = Annotated[
    str | None,
    typer.Option(
        metavar="KEY,...",
        help="Group the rows by these keys, e.g. law.kind,arm: a table and a figure of the groups.",
    ),
]
Statistic = Annotated[
    Literal["mean", "quantiles"],
    typer.Option(help="Of groups of runs: mean and standard deviation, or quantiles."),
]
Labels = Annotated[
    str | None,
    typer.Option(metavar="NAME,...", help="What tables and figures call the runs, in their order."),
]
Quiet = Annotated[bool, typer.Option("--quiet", help="Print only warnings and errors.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print metrics and verdicts as JSON only.")]
DryRun = Annotated[
    bool, typer.Option("--dry-run", help="Check everything and estimate the time; run nothing.")
]
Duration = Annotated[
    float | None,
    typer.Option(help="Simulated time [s]; a window that ends later is dropped."),
]
Folder = Annotated[Path, typer.Argument(metavar="FOLDER", help="Result folder of a run.")]
Elsewhere = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=FILE",
        help="A file that the run has read, where it is now, e.g. arm.model=cell.urdf; repeatable.",
    ),
]
Beside = Annotated[
    list[Path] | None,
    typer.Option(metavar="FOLDER", help="Also show the path of this result; repeatable."),
]


@options
class ChangeOptions:
    """Options of commands that run an experiment with changes."""

    out_folder: Out = Path("out")
    changes: Set = None


@options
class CheckOptions(ChangeOptions):
    """Options of commands whose outcome a script may check."""

    duration: Duration = None
    check: Check = False
    quiet: Quiet = False


@options
class PlanOptions(CheckOptions):
    """Options of commands that tell scripts what they will do and what came out."""

    as_json: AsJson = False
    dry_run: DryRun = False


@options
class PrintOptions:
    """Options of commands that draw figures for print."""

    form: Annotated[
        Literal["png", "pdf", "svg"], typer.Option("--format", help="Format of the figures.")
    ] = "png"
    width: Annotated[
        str | None,
        typer.Option(metavar="LENGTH", help="Width of the figures, e.g. 88mm for a column."),
    ] = None
    look: Annotated[
        Literal["screen", "journal"],
        typer.Option(help="Look of the figures; journal has serifs, fine lines and 600 dpi."),
    ] = "screen"

"""A command: a class with its options, and a function that is imported when the command runs.

So what a command is called with is read, completed, explained and refused before anything large is
imported, and each command imports what it needs.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import MISSING, dataclass, fields
from inspect import Parameter, Signature, getdoc
from typing import Any, TypeVar, dataclass_transform, get_type_hints

import typer

from ..errors import InvalidInputError
from ..inputs.lending import lent
from .interrupting import begun
from .usage import Command

T = TypeVar("T")


@dataclass_transform(frozen_default=True, kw_only_default=True)
def options(cls: type[T]) -> type[T]:
    """Make a class a frozen dataclass of options, each an annotated field with its default."""
    return dataclass(frozen=True, kw_only=True)(cls)


def add_command(app: typer.Typer, name: str, asked: type, find: Callable[[], Any]) -> None:
    """Add a command to the command line.

    Args:
        app: The command line.
        name: Name of the command.
        asked: Class made by `options`. Its docstring is the help of the command.
        find: Returns the function that carries it out, which is given an object of the class; it
            is called when the command runs.
    """

    def carry_out(**given: Any) -> None:
        function = find()
        # Every command imports it, as it prints.
        errors = lent(f"{__package__}.console:errors")
        begun()
        with errors():
            _require_current_folder()
            function(asked(**given))

    vars(carry_out)["__signature__"] = Signature(_parameters(asked))
    app.command(name, cls=Command, help=getdoc(asked))(carry_out)


def _require_current_folder() -> None:
    """Refuse to work in a folder that was removed, which Drake and relative names need."""
    try:
        os.getcwd()
    except OSError as error:
        raise InvalidInputError(
            f"current folder: {error.strerror}; change to a folder that exists"
        ) from None


def _parameters(asked: type) -> list[Parameter]:
    """Return the options of a class: its own, then those that it shares, the commonest first."""
    hints, defaults = get_type_hints(asked, include_extras=True), {}
    for field in fields(asked):
        defaults[field.name] = Parameter.empty if field.default is MISSING else field.default
    own, *shared = asked.__mro__
    order = [
        name for cls in (own, *reversed(shared)) for name in vars(cls).get("__annotations__", ())
    ]
    return [
        Parameter(name, Parameter.KEYWORD_ONLY, default=defaults[name], annotation=hints[name])
        for name in dict.fromkeys(order)
    ]

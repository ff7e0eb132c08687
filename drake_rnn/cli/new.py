"""The files that a law, a path or an environment of a user's own starts from."""

from __future__ import annotations

import keyword
import os
import re
from functools import partial
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path

from rich.markup import escape

from ..errors import InvalidInputError
from ..runs.whole_file import require_replaceable, written_whole
from .asked import New
from .console import errors, out
from .schemas import schema_text
from .shipping import write_shipped

_TEMPLATES = files("drake_rnn.cli") / "templates"
#: What the first line of the document names.
_SCHEMA = "experiment.schema.json"


def write_start(own: str, name: str, folder: Path) -> list[Path]:
    """Write a module, a document, its schema and a test, which run as they are.

    Args:
        own: What the module is to hold: a law, a path or an environment.
        name: Name of the module.
        folder: Folder to write to.

    Returns:
        The files.

    Raises:
        InvalidInputError: If the name is taken, or a file exists or cannot be written.
    """
    title = "".join(word.capitalize() for word in name.split("_"))
    written = {}
    for template in sorted((_TEMPLATES / own).iterdir(), key=lambda each: each.name):
        file = folder / template.name.removesuffix(".txt").replace(f"my_{own}", name)
        text = template.read_text(encoding="utf-8").replace(f"my_{own}", name)
        written[file] = text.replace(f"My{own.capitalize()}", title)
    # A schema is made anew: the language server of an editor finds it beside the document.
    schema = {folder / _SCHEMA: schema_text("experiment")}
    for file in written:
        if os.path.lexists(file):
            raise InvalidInputError(f"{file}: already exists, and is not overwritten")
    for file in schema:
        require_replaceable(file)
    if find_spec(name) is not None:
        raise InvalidInputError(f"name: there is a Python module {name!r} already; take another")
    try:
        for file, text in (written | schema).items():
            with written_whole(file) as stream:
                stream.write(text)
    except OSError as error:
        raise InvalidInputError(f"{folder}: {error.strerror}") from None
    return [*written, *schema]


def new(asked: New) -> None:
    """Write what is asked for, and say what to do next."""
    what, name = asked.what, asked.name
    with errors():
        if asked.shipped and what != "law":
            raise InvalidInputError(f"--shipped: is for a law, not for {what}")
        if not re.fullmatch(r"[a-z][a-z0-9]*(_[a-z0-9]+)*", name) or keyword.iskeyword(name):
            raise InvalidInputError(
                f"name: must be a module's name in lower case, e.g. my_law, not {name!r}"
            )
        write = write_shipped if asked.shipped else partial(write_start, what)
        for file in write(name, Path()):
            out.print(escape(f"written  {file}"), soft_wrap=True)
    then = f"drake-rnn run {name}.yaml; pytest test_{name}.py"
    if asked.shipped:
        then = f"fill in what says FILL IN; python docs/make_schemes.py; drake-rnn run {name}"
    out.print(f"next     {then}", soft_wrap=True)

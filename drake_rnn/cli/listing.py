"""The shipped experiments, as a table.

Nothing that a run needs is imported, no room of the package that imports Drake or NumPy: the start
of `drake-rnn list` is a good part of what it takes.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import yaml
from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from ..diagrams import EXPERIMENTS
from ..errors import InvalidInputError
from ..inputs.packages import import_name
from .arguments import List
from .console import errors, out, print_table

#: Width from which the table also has the papers [characters].
_ROOM = 120
# The names that an option may give; their rooms are imported where a name is refused.
_NAMES = {
    "arm": "drake_rnn.robot.load_arm:shipped_arms",
    "law": "drake_rnn.laws:LAWS",
    "level": "drake_rnn.systems:BODIES",
}


@dataclass(frozen=True)
class Listing:
    """What the table says of an experiment.

    Attributes:
        law: Kind of its law.
        name: Its name.
        arm: Name of its arm, or the model file.
        level: Its level of detail.
        paper: The paper that it is from; empty if it is from none.
        expect: What to expect of it.
    """

    law: str
    name: str
    arm: str
    level: str
    paper: str
    expect: str


def list_experiments(args: List) -> None:
    """List those of the shipped experiments that are asked for."""
    with errors():
        if args.tables:
            import_name("drake_rnn.cli.tables:require_tables")(args.tables)
        listings = shipped_listings()
        names = {"arm": args.arm, "law": args.law, "level": args.level}
        filters = {key: name for key, name in names.items() if name is not None}
        for key, name in filters.items():
            _require_known(key, name, {vars(each)[key] for each in listings})
        selection = [
            each
            for each in listings
            if args.word.lower() in f"{each.name} {each.paper} {each.expect}".lower()
            and filters.items() <= vars(each).items()
        ]
        if not selection:
            raise InvalidInputError("there is no such experiment; drake-rnn list shows all")
        print_table(listings_table(selection, out.width))
        if out.width < _ROOM:
            out.print(f"papers are shown from {_ROOM} columns on")
        if args.tables:
            import_name("drake_rnn.cli.tables:write_tables")(_sheet(selection), args.tables)


def _require_known(key: str, name: str, all_names: set[str]) -> None:
    """Raise an InvalidInputError for a name of an option that there is not."""
    if name in all_names:
        return
    available = import_name(_NAMES[key])
    if name not in (names := list(available() if callable(available) else available)):
        nearest = import_name("drake_rnn.inputs.messages:nearest")
        raise InvalidInputError(f"--{key}: no {name!r}; {nearest(name, names)}")


def shipped_listings() -> list[Listing]:
    """Return what the table says of the shipped experiments, law by law."""
    listings = map(_listing, EXPERIMENTS.glob("*/*.yaml"))
    return sorted(listings, key=lambda each: (each.law, each.name))


def _listing(file: Path) -> Listing:
    # The base loader leaves every scalar as the text that it is, which is all that is shown. Tests
    # hold the shipped documents, and this table, to how a run reads them.
    loader = vars(yaml).get("CBaseLoader", yaml.BaseLoader)
    document = yaml.load(file.read_bytes(), loader)
    arm = document["arm"]
    return Listing(
        law=document["law"]["kind"],
        name=document.get("name", file.stem),
        arm=arm if isinstance(arm, str) else arm["model"],
        level=document.get("level", "kinematic"),
        paper=document.get("paper", ""),
        expect=document.get("expect", ""),
    )


def _sheet(listings: list[Listing]) -> Any:
    """Return the table of experiments for files."""
    tables = import_module("drake_rnn.tables")
    names = ("law", "name", "arm", "level", "paper", "what to expect")
    sheet = tables.Sheet(
        tuple(tables.Column(tables.Heading(name), long=name in names[-2:]) for name in names)
    )
    sheet.rows += map(astuple, listings)
    return sheet


def listings_table(listings: list[Listing], width: int) -> Table:
    """Return a table of experiments for the terminal, in sections by law, within 80 characters.

    Args:
        listings: The experiments, sorted by law.
        width: Room for the table [characters]; papers are shown if there is enough.
    """
    wide = width >= _ROOM
    table = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for column in ("law: name", "arm", "level"):
        table.add_column(column, overflow="fold", no_wrap=True)
    for column in (*(["paper"] if wide else []), "what to expect"):
        table.add_column(column, overflow="fold")
    before = ""
    for each in listings:
        if each.law != before:
            table.add_section()
            table.add_row(f"[bold]{escape(each.law)}[/]")
            before = each.law
        sentences = (*([each.paper] if wide else []), each.expect)
        table.add_row(*map(escape, (each.name, each.arm, each.level, *sentences)))
    return table

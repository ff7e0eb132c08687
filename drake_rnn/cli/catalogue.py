"""What there is to name in a document: experiments, arms, laws and paths."""

from __future__ import annotations

import re
import sys

from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from ..errors import InvalidInputError
from ..experiment import ExperimentDocument, read_document, shipped_experiments
from ..experiment.law import ORIGINS
from ..inputs.complaints import nearest
from ..inputs.documents import construct
from ..inputs.explained import Key, first_sentence, keys_of
from ..laws import LAWS
from ..measures import raised
from ..paths import PATHS
from ..robot.arm_description import ArmDescription
from ..robot.load_arm import load_arm, shipped_arms
from ..systems import BODIES
from ..tables import Column, Heading, Sheet
from .asked import Arms, Laws, List, Paths
from .console import errors, out, print_table
from .written_tables import require_tables, write_tables

# The units in the meaning of a key.
_UNITS = re.compile(r"\[[^\]]*\]")
#: Width from which a table of experiments also has their papers [characters].
_ROOM = 120
#: Columns of that table that have sentences.
_SENTENCES = {"paper", "what to expect"}


def list_experiments(asked: List) -> None:
    """List those of the shipped experiments that are asked for."""
    with errors():
        require_tables(asked.tables)
        for option, name, known in (
            ("--arm", asked.arm, shipped_arms()),
            ("--law", asked.law, list(LAWS)),
            ("--level", asked.level, list(BODIES)),
        ):
            if name is not None and name not in known:
                raise InvalidInputError(f"{option}: no {name!r}; {nearest(name, known)}")
        chosen = [
            document
            for document in shipped_documents()
            if asked.word.lower() in f"{document.name} {document.paper} {document.expect}".lower()
            and asked.arm in (None, arm_of(document))
            and asked.law in (None, document.law["kind"])
            and asked.level in (None, document.level)
        ]
        if not chosen:
            raise InvalidInputError("there is no such experiment; drake-rnn list shows all")
        sheet = experiments_sheet(chosen)
        print_table(experiments_table(sheet, out.width))
        if out.width < _ROOM:
            out.print(f"papers are shown from {_ROOM} columns on")
        write_tables(sheet, asked.tables)


def shipped_documents() -> list[ExperimentDocument]:
    """Return the documents of the shipped experiments, law by law."""
    # Read as documents only, because one of the experiments is refused.
    documents = [
        construct(ExperimentDocument, read_document(name), name) for name in shipped_experiments()
    ]
    return sorted(documents, key=lambda document: (str(document.law["kind"]), document.name))


def arm_of(document: ExperimentDocument) -> str:
    """Return the name of a document's arm, or its model file."""
    return document.arm if isinstance(document.arm, str) else str(document.arm["model"])


def experiments_sheet(documents: list[ExperimentDocument]) -> Sheet:
    """Return a table of experiments."""
    names = ("law", "name", "arm", "level", "paper", "what to expect")
    sheet = Sheet(tuple(Column(Heading(each), long=each in _SENTENCES) for each in names))
    for document in documents:
        kind, arm = str(document.law["kind"]), arm_of(document)
        row = (kind, document.name, arm, document.level, document.paper, document.expect)
        sheet.rows.append(row)
    return sheet


def experiments_table(sheet: Sheet, width: int) -> Table:
    """Return a table of experiments for the terminal, in sections by law, within 80 characters.

    Args:
        sheet: The experiments, sorted by law.
        width: Room for the table [characters]; papers are shown if there is enough.
    """
    wide = width >= _ROOM
    table = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for column in ("law: name", "arm", "level", *(["paper"] if wide else []), "what to expect"):
        table.add_column(column, overflow="fold", no_wrap=column not in _SENTENCES)
    before = ""
    for kind, *cells, paper, expect in (map(str, row) for row in sheet.rows):
        if kind != before:
            table.add_section()
            table.add_row(f"[bold]{escape(kind)}[/]")
            before = kind
        table.add_row(*map(escape, (*cells, *([paper] if wide else []), expect)))
    return table


def list_arms(asked: Arms) -> None:
    """List the shipped arms, and the keys that describe an arm."""
    with errors():
        table = Table(box=SIMPLE_HEAD)
        for column in ("arm", "joints", "task frame E", "tool"):
            table.add_column(column)
        for name in shipped_arms():
            arm = load_arm(name)
            tool = f"ball of {arm.tool.ball * 1e3:g} mm" if arm.tool else "none"
            table.add_row(*map(escape, (name, str(len(arm.joints)), arm.frame, tool)))
        print_table(table)
        out.print("drake-rnn arm NAME shows all that is known of one. Keys of arm in a document:")
        print_table(keys_table(keys_of(ArmDescription)))


def list_laws(asked: Laws) -> None:
    """List the laws, or explain the keys of one."""
    with errors():
        lines = {kind: first_sentence(sys.modules[cls.__module__]) for kind, cls in LAWS.items()}
        keys = {kind: keys_of(cls, ("kind", *ORIGINS)) for kind, cls in LAWS.items()}
        _print_kinds("law", lines, keys, asked.name)


def list_paths(asked: Paths) -> None:
    """List the paths, or explain the keys of one."""
    with errors():
        lines = {kind: first_sentence(cls) for kind, cls in PATHS.items()}
        keys = {kind: keys_of(cls) for kind, cls in PATHS.items()}
        _print_kinds("path", lines, keys, asked.name)


def _print_kinds(
    section: str, lines: dict[str, str], keys: dict[str, list[Key]], name: str | None
) -> None:
    """Print one line and the keys for each kind, or a table of the keys of one."""
    if name is not None:
        if name not in keys:
            raise InvalidInputError(f"{section}: no {name!r}; {nearest(name, list(keys))}")
        out.print(f"[bold]{name}[/]  {escape(lines[name])}")
        print_table(keys_table(keys[name]))
        return
    table = Table(box=SIMPLE_HEAD)
    table.add_column(section, no_wrap=True)
    table.add_column("what it is, and its keys (with their defaults)")
    for kind, line in lines.items():
        written = ", ".join(
            key.name if key.default is None else f"{key.name} ({key.default})" for key in keys[kind]
        )
        table.add_row(kind, f"{escape(line)}\n[dim]{escape(written)}[/]")
    print_table(table)


def _raised(units: re.Match[str]) -> str:
    return raised(units[0])


def keys_table(keys: list[Key]) -> Table:
    """Return a table of keys with defaults and meanings."""
    table = Table(box=SIMPLE_HEAD)
    table.add_column("key", no_wrap=True)
    table.add_column("default", overflow="fold")
    table.add_column("meaning", ratio=1)
    for key in keys:
        default = "must be given" if key.default is None else key.default
        table.add_row(*map(escape, (key.name, default, _UNITS.sub(_raised, key.meaning))))
    return table

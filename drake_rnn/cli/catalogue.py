"""What there is to name in a document: experiments, arms, laws and paths."""

from __future__ import annotations

import re

from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from ..errors import InvalidInputError
from ..experiment.law import ORIGINS
from ..inputs.complaints import nearest
from ..inputs.keys import Key, keys_of, summary_of
from ..laws import LAWS
from ..measures import raised
from ..paths import PATHS
from ..robot.arm_description import ArmDescription
from ..robot.load_arm import load_arm, shipped_arms
from .asked import Arms, Laws, Paths
from .console import errors, out, print_table

# The units in the meaning of a key.
_UNITS = re.compile(r"\[[^\]]*\]")


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
        lines = {kind: summary_of(cls) for kind, cls in LAWS.items()}
        keys = {kind: keys_of(cls, ("kind", *ORIGINS)) for kind, cls in LAWS.items()}
        _print_kinds("law", lines, keys, asked.name)


def list_paths(asked: Paths) -> None:
    """List the paths, or explain the keys of one."""
    with errors():
        lines = {kind: summary_of(cls) for kind, cls in PATHS.items()}
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

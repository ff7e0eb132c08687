"""An experiment's document, with comments that explain its keys."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import indent, wrap
from typing import Any

import typer

from ..diagrams import wiring_graph
from ..experiment import (
    ExperimentDocument,
    key_meanings,
    load_experiment,
    read_document,
    section_meanings,
)
from ..experiment.heads import schema_line
from ..inputs.documents import construct, to_yaml
from ..inputs.keys import shortened
from ..runs import build_diagram
from .asked import Show
from .console import errors
from .graphs import write_graph

_WIDTH, _BESIDE = 80, "beside"


def show(asked: Show) -> None:
    """Print the document, or draw the wiring."""
    with errors():
        if asked.diagram is None:
            typer.echo(schema_line("experiment") + commented(asked.experiment), nl=False)
            return
        built, _ = build_diagram(load_experiment(asked.experiment))
        write_graph(wiring_graph(built), asked.diagram)


def commented(experiment: str) -> str:
    """Return an experiment's document as YAML with comments that explain its keys.

    Raises:
        InvalidInputError: If there is no such experiment, or a key is wrong.
    """
    document = read_document(experiment)
    construct(ExperimentDocument, document, "")
    meanings = key_meanings()
    order = [name for name in meanings if name in document]
    blocks = []
    for name in order:
        value = document[name]
        inner = section_meanings(name, value)
        text = _comment(meanings[name], 0)
        if isinstance(value, Mapping) and value and inner:
            text += f"{name}:\n" + "".join(_entry(k, v, inner.get(k, "")) for k, v in value.items())
        else:
            text += _line(name, value)
        blocks.append(text)
    return "\n".join(blocks)


def _entry(key: str, value: Any, meaning: str) -> str:
    return _comment(meaning, 2) + indent(_line(key, value), "  ")


def _line(key: str, value: Any) -> str:
    # Beside another collection a plain value has a line of its own; alone it would be in braces.
    return to_yaml({key: value, _BESIDE: []}).removesuffix(f"{_BESIDE}: []\n")


def _comment(meaning: str, depth: int) -> str:
    begin = f"{' ' * depth}# "
    lines = wrap(shortened(meaning), _WIDTH, initial_indent=begin, subsequent_indent=begin)
    return "".join(f"{line}\n" for line in lines)

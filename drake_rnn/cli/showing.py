"""An experiment's document, with comments that explain its keys."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import is_dataclass
from textwrap import indent, wrap
from typing import Any, get_args, get_type_hints

import typer

from ..environments import ENVIRONMENTS
from ..experiment import ExperimentDocument, read_document
from ..inputs.documents import construct, to_yaml
from ..inputs.explained import keys_of, shortened
from ..inputs.kinds import Kinds
from ..laws import LAWS
from ..measures import METRICS
from ..paths import PATHS
from ..robot.arm_description import ArmDescription
from ..robot.limits import LIMIT_UNITS
from .console import errors
from .options import One

_KINDS: dict[str, Kinds[Any]] = {"law": LAWS, "path": PATHS, "environment": ENVIRONMENTS}
_WIDTH, _BESIDE = 80, "beside"


def show(
    experiment: One,
) -> None:
    """Print an experiment's document with comments on its keys; it can be run again."""
    with errors():
        typer.echo(commented(experiment), nl=False)


def commented(experiment: str) -> str:
    """Return an experiment's document as YAML with comments that explain its keys.

    Raises:
        InvalidInputError: If there is no such experiment, or a key is wrong.
    """
    document = read_document(experiment)
    construct(ExperimentDocument, document, "")
    meanings = _meanings(ExperimentDocument)
    order = [name for name in meanings if name in document]
    blocks = []
    for name in order:
        value = document[name]
        inner = _section_meanings(name, value)
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


def _meanings(cls: type) -> dict[str, str]:
    return {key.name: key.meaning for key in keys_of(cls, ())}


def _section_meanings(name: str, value: Any) -> dict[str, str]:
    """Return what the keys within a section mean; empty if it has none."""
    if not isinstance(value, Mapping):
        return {}
    if name == "accept":
        return {metric.name: f"{metric.meaning} [{metric.unit}]" for metric in METRICS}
    if name == "limits":
        return {limit: f"[{unit}]" for limit, unit in LIMIT_UNITS.items()}
    if name == "arm":
        return _meanings(ArmDescription)
    if name in _KINDS:
        cls = _KINDS[name].named_by(value, modules=True)
        return _meanings(cls) | {"kind": ""}
    hint = get_type_hints(ExperimentDocument)[name]
    classes = [each for each in (hint, *get_args(hint)) if is_dataclass(each)]
    return _meanings(classes[0]) if classes and isinstance(classes[0], type) else {}

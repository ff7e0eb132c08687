"""SRDF, MoveIt's description beside a model: named postures, and pairs of bodies not to look at."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element

from ..errors import InvalidInputError
from ..inputs.files import content_of, is_file
from ..inputs.messages import decimal
from .model.packages import MOST_BYTES, Packages, expand_xacro, is_xacro, parse_xml

# What is read, and what only says how the rest is to be understood.
_READ = frozenset({"group", "group_state", "disable_collisions", "enable_collisions"})


@dataclass(frozen=True)
class Srdf:
    """The contents of an SRDF file.

    Attributes:
        file: The file.
        postures: Positions of joints by the name of the posture, ``group/name`` [rad or m].
        disabled: Pairs of links that are not to be looked at, each with its reason.
        unused: Kinds of elements that are not used.
    """

    file: Path
    postures: Mapping[str, Mapping[str, float]]
    disabled: Mapping[frozenset[str], str]
    unused: tuple[str, ...]


def read_srdf(
    file: Path, packages: Mapping[str, str], arguments: Mapping[str, object] | None = None
) -> Srdf:
    """Return the contents of an SRDF file, whose macros are expanded.

    Args:
        file: The file.
        packages: Folders of packages by name.
        arguments: Arguments of its macros.

    Raises:
        InvalidInputError: If it cannot be read, or a position in it is no number.
    """
    if not is_file(file):
        raise InvalidInputError(f"arm.srdf: no file {str(file)!r}")
    try:
        root = parse_xml(content_of(file, MOST_BYTES))
        if root is not None and is_xacro(root):
            root = parse_xml(expand_xacro(file, Packages(packages, file), arguments, "arm.srdf"))
        if root is None or root.tag != "robot":
            raise ValueError("is no SRDF file")
        if root.find("link") is not None:
            raise ValueError("is a model, which is given in arm.model; an SRDF file has no links")
        return _read(file, root)
    except InvalidInputError:
        raise
    except ValueError as error:
        raise InvalidInputError(f"arm.srdf: {file} {error}") from None


def _read(file: Path, root: Element) -> Srdf:
    postures = {
        f"{state.get('group', '')}/{state.get('name', '')}": _positions(state)
        for state in root.findall("group_state")
    }
    pairs = {_pair(each): each.get("reason", "") for each in root.findall("disable_collisions")}
    for each in root.findall("enable_collisions"):
        pairs.pop(_pair(each), None)
    unused = dict.fromkeys(child.tag for child in root if child.tag not in _READ)
    return Srdf(file, postures, pairs, tuple(unused))


def _pair(element: Element) -> frozenset[str]:
    return frozenset((element.get("link1", ""), element.get("link2", "")))


def _positions(state: Element) -> dict[str, float]:
    """Return the position of each joint of a state; those of joints with several are left out."""
    found = {}
    for joint in state.findall("joint"):
        name, values = joint.get("name", ""), joint.get("value", "").split()
        if len(values) == 1:
            try:
                found[name] = decimal(values[0])
            except ValueError as error:
                raise ValueError(f"{state.get('name')}: {name}: {error}") from None
    return found

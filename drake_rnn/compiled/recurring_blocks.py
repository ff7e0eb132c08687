"""Blocks of statements in C that recur, but for the names in them, as functions.

What a law does for each joint is traced joint by joint, so the same branch is printed for each. As
one function it is a quarter of the text, which a compiler takes a third of the time for, and the
same operations in the same order, so that the bits stay.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from itertools import takewhile
from textwrap import wrap
from typing import NamedTuple

# Blocks of fewer statements stay where they are.
_LEAST = 8
_WIDTH = 88
_WORD = re.compile(r"(?<![\w.])[A-Za-z_]\w*(?!\w*\()")
_DECLARATION = re.compile(r"\s*(?:for \()?(const )?(double|int) (\*?)(\w+)(\[\d+\])?")
_ASSIGNMENT = re.compile(r"\s*(\w+) = ")
_TABLE = re.compile(r"t\d+")
# Words that mean the same everywhere.
_COMMON = frozenset(("const", "double", "int", "for", "if", "else", "break", "NAN", "HUGE_VAL"))


class _Name(NamedTuple):
    """What is declared: a number, or an array or what points to one."""

    kind: str
    is_array: bool
    is_constant: bool


class _Block(NamedTuple):
    """Statements between two lines, and their own names in order of appearance."""

    first: int
    last: int
    names: tuple[str, ...]


def without_recurring_blocks(lines: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return functions, and statements that call them where the same branch recurs.

    Args:
        lines: Statements, one a line, in which each name is declared once.
    """
    declared: dict[str, _Name] = {}
    for line in lines:
        if found := _DECLARATION.match(line):
            constant, kind, pointer, name, size = found.groups()
            declared[name] = _Name(kind, bool(pointer or size), bool(constant))
    functions: list[str] = []
    calls: dict[int, tuple[int, list[str]]] = {}
    for text, blocks in _groups(lines):
        left = [
            block
            for block in blocks
            if not any(first <= block.first < last for first, (last, _) in calls.items())
        ]
        if len(left) > 1 and (shape := _shape(text, left, declared)) is not None:
            name = f"block_{len(functions)}"
            functions.append(_function(name, text, shape))
            for block in left:
                calls[block.first] = block.last, _call(name, block, shape, lines[block.first])
    statements, number = [], 0
    while number < len(lines):
        if number in calls:
            number, call = calls[number]
            statements += call
        else:
            statements.append(lines[number])
            number += 1
    return functions, statements


def _groups(lines: Sequence[str]) -> list[tuple[str, list[_Block]]]:
    """Return the text of branches that recur with the places where they do, long ones first.

    In the text names are ``v0``, ``v1`` and so on.
    """
    words = [_own_words(line) for line in lines]
    shapes = [_WORD.sub(_shape_of_word, line.strip()) for line in lines]
    alike: dict[int, list[tuple[int, int]]] = {}
    open_blocks: list[int] = []
    for number, line in enumerate(shapes):
        if line.startswith("}"):
            first = open_blocks.pop() + 1
            if number - first >= _LEAST and not shapes[first - 1].startswith("for"):
                alike.setdefault(hash(tuple(shapes[first:number])), []).append((first, number))
        if line.endswith("{"):
            open_blocks.append(number)
    groups: dict[str, list[_Block]] = {}
    for places in alike.values():
        for first, last in places if len(places) > 1 else ():
            names = tuple(dict.fromkeys(name for row in words[first:last] for name in row))
            text = _with_numbers(lines[first:last], names)
            groups.setdefault(text, []).append(_Block(first, last, names))
    several = [(text, blocks) for text, blocks in groups.items() if len(blocks) > 1]
    return sorted(several, key=lambda each: each[1][0].first - each[1][0].last)


def _with_numbers(lines: Sequence[str], names: Sequence[str]) -> str:
    """Return statements with numbers in the place of names."""
    new = {name: f"v{k}" for k, name in enumerate(names)}
    depth = len(lines[0]) - len(lines[0].lstrip())
    text = "\n".join(line[depth:] for line in lines)
    return _WORD.sub(lambda found: new.get(found[0], found[0]), text)


def _own_words(line: str) -> list[str]:
    return [word for word in _WORD.findall(line) if not _is_common(word)]


def _is_common(word: str) -> bool:
    return word in _COMMON or _TABLE.fullmatch(word) is not None


def _shape_of_word(found: re.Match[str]) -> str:
    return found[0] if _is_common(found[0]) else "v"


class _Parameter(NamedTuple):
    """What a function is given: the number of its name, what that is, and if it is set."""

    place: int
    name: _Name
    is_set: bool


def _shape(
    text: str, blocks: Sequence[_Block], declared: Mapping[str, _Name]
) -> list[_Parameter] | None:
    """Return the parameters of a function in the place of blocks; None if there can be none."""
    inner, assigned = set(), set()
    for line in text.split("\n"):
        if found := _DECLARATION.match(line):
            inner.add(found[4])
        elif found := _ASSIGNMENT.match(line):
            assigned.add(found[1])
    outer = [k for k in range(len(blocks[0].names)) if f"v{k}" not in inner]
    kinds = {tuple(declared.get(block.names[k]) for k in outer) for block in blocks}
    if len(kinds) > 1 or None in (names := kinds.pop()):
        return None
    return [
        _Parameter(k, name, f"v{k}" in assigned)
        for k, name in zip(outer, names, strict=True)
        if name is not None
    ]


def _function(name: str, text: str, parameters: Sequence[_Parameter]) -> str:
    texts = []
    for place, (kind, is_array, is_constant), is_set in parameters:
        constant = "const " if is_array and is_constant else ""
        pointer = "*" if is_array else "*restrict " if is_set else ""
        texts.append(f"{constant}{kind} {pointer}v{place}")
        if is_set and not is_array:
            text = re.sub(rf"\bv{place}\b", f"(*v{place})", text)
    head = wrap(f"static void {name}({', '.join(texts)})", _WIDTH, subsequent_indent="    ")
    return "\n".join((*head, "{", *("    " + line for line in text.split("\n")), "}", ""))


def _call(name: str, block: _Block, parameters: Sequence[_Parameter], line: str) -> list[str]:
    depth = " " * sum(1 for _ in takewhile(str.isspace, line))
    texts = [
        f"{'&' if is_set and not known.is_array else ''}{block.names[place]}"
        for place, known, is_set in parameters
    ]
    return wrap(
        f"{name}({', '.join(texts)});",
        _WIDTH,
        initial_indent=depth,
        subsequent_indent=depth + "    ",
    )

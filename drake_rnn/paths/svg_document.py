"""SVG files as text: their elements, styles and numbers, read within bounds that are counted."""

from __future__ import annotations

import re
from collections.abc import Iterator
from xml.etree.ElementTree import Element
from xml.parsers.expat import ExpatError, ParserCreate

from ..inputs.messages import short

#: Lines and curves that a drawing may have.
MOST_SEGMENTS = 2000
#: Largest number that a drawing may have.
MOST_NUMBER = 1e12
_SVG = "http://www.w3.org/2000/svg"
_HREF = "http://www.w3.org/1999/xlink href"
# Elements and attributes of a file, how deep elements are nested, rules of its style sheets that
# count, characters of these or for which its entities stand, and its entities.
_MOST_NODES, _MOST_DEEP, _MOST_RULES, _MOST_CHARACTERS, _MOST_ENTITIES = (
    100_000,
    100,
    100,
    1_000_000,
    100,
)
# Characters of the value that an attribute has by default.
_MOST_DEFAULT = 100
# Properties of styles that change what is drawn.
_PROPERTIES = {"display", "visibility", "transform", "x", "y", "width", "height"}
_PROPERTIES |= {"transform-origin", "cx", "cy", "r", "rx", "ry"}
_SELECTOR = re.compile(r"(?:\*|[\w-]+)?(?:[.#][\w-]+)*")
_PART = re.compile(r"\*|[.#]?[\w-]+")
# Numbers that each command of a path takes.
_NUMBERS = {"M": 2, "L": 2, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "T": 2, "A": 7, "Z": 0}
_BLANK = re.compile(r"[\s,]*", re.ASCII)
_COMMAND = re.compile(r"[MLHVCSQTAZ]", re.IGNORECASE)
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?", re.ASCII | re.IGNORECASE)
# Flags of arcs may be written without a space.
_FLAG = re.compile(r"[01]")


def label(element: Element) -> str:
    """Return what an element is called in messages."""
    name = element.get("id", "")
    plain = re.fullmatch(r"[\w.:-]{1,40}", name)
    return f"{element.tag} {name if plain else short(name)}" if name else f"a {element.tag}"


def read_tree(text: str) -> Element:
    """Return the outermost element of an SVG file; the properties of styles become attributes.

    Elements of other namespaces are left out.

    Raises:
        ValueError: If it is no SVG, or has more or deeper elements than any drawing.
    """
    reader = _Reader(text)
    try:
        reader.parser.Parse(text, True)
    except ExpatError as error:
        raise ValueError(f"is no SVG: {error}") from None
    if reader.root is None:
        raise ValueError("is no SVG: its outermost element must be svg")
    _apply_styles(reader.root)
    return reader.root


class _Reader:
    """What makes elements of the events of an XML parser, and counts them."""

    def __init__(self, text: str) -> None:
        self.root: Element | None = None
        self.parser = ParserCreate(namespace_separator=" ")
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = lambda _: self._open.pop()
        self.parser.CharacterDataHandler = self._data
        self.parser.EntityDeclHandler = self._entity
        self.parser.AttlistDeclHandler = self._default
        self._text = text
        self._open: list[Element | None] = []
        self.parser.buffer_text = True
        self._nodes = self._entities = self._expanded = self._styled = 0

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        space, _, local = name.rpartition(" ")
        if not self._open and (local != "svg" or space not in ("", _SVG)):
            raise ValueError("is no SVG: its outermost element must be svg")
        self._nodes += 1 + len(attributes)
        if self._nodes > _MOST_NODES:
            raise ValueError(f"has more than {_MOST_NODES} elements and attributes together")
        if len(self._open) >= _MOST_DEEP:
            container = next(
                (each for each in self._open if each is not None and each.get("id")), None
            )
            what = short(local) if container is None else f"in {label(container)}"
            raise ValueError(f"{what}: elements may be nested {_MOST_DEEP} deep")
        parent = self._open[-1] if self._open else None
        if space not in ("", _SVG) or (self._open and parent is None):
            self._open.append(None)
            return
        if _HREF in attributes:
            attributes.setdefault("href", attributes[_HREF])
        element = Element(local, attributes)
        if parent is None:
            self.root = element
        else:
            parent.append(element)
        self._open.append(element)

    def _data(self, text: str) -> None:
        element = self._open[-1]
        if element is not None and element.tag == "style":
            self._styled += len(text)
            if self._styled > _MOST_CHARACTERS:
                raise ValueError(f"style: may have {_MOST_CHARACTERS} characters")
            # A part of the text each; as children they need no text to be copied.
            element.append(Element("text", {"": text}))

    def _default(self, element: str, name: str, kind: str, value: str | None, _: object) -> None:
        """Refuse values that each element of a name is given without writing them."""
        if value is not None and len(value) > _MOST_DEFAULT:
            raise ValueError(f"has a default of {short(name)} of {len(value)} characters")

    def _entity(self, name: str, parameter: int, value: str | None, *_: object) -> None:
        """Refuse entities that lead out of the file or grow; drawing programs write short ones."""
        if parameter or value is None:
            raise ValueError(f"has the entity {short(name)}, which is in another file")
        if "&" in value:
            raise ValueError(f"has the entity {short(name)}, which is made of others")
        self._entities += 1
        if self._entities > _MOST_ENTITIES:
            raise ValueError(f"has more than {_MOST_ENTITIES} entities")
        self._expanded += self._text.count(f"&{name};") * len(value)
        if self._expanded > _MOST_CHARACTERS:
            raise ValueError(f"has entities that stand for more than {_MOST_CHARACTERS} characters")


def _apply_styles(root: Element) -> None:
    """Set the properties of style sheets, and those of each element's own style, as attributes."""
    sheets = ["".join(part.get("", "") for part in style) for style in root.iter("style")]
    rules: list[tuple[list[int], set[str], dict[str, str]]] = []
    for selector, properties in _rules("\n".join(sheets)):
        if not selector or not _SELECTOR.fullmatch(selector):
            key = next(iter(properties))
            raise ValueError(
                f"style: the selector {short(selector)} is not read; give {key} to the elements"
            )
        parts = _PART.findall(selector)
        kinds = "".join(part[0] for part in parts)
        rules.append(([kinds.count("#"), kinds.count("."), kinds != "*"], set(parts), properties))
        if len(rules) > _MOST_RULES:
            raise ValueError(f"style: may have {_MOST_RULES} rules that hide or place elements")
    rules.sort(key=lambda rule: rule[0])
    for element in root.iter():
        own = {"*", element.tag, f"#{element.get('id', '')}"}
        own.update(f".{name}" for name in element.get("class", "").split())
        for _, names, properties in rules:
            if names <= own:
                element.attrib.update(properties)
        element.attrib.update(_properties(element.get("style", "")))


def _rules(sheet: str) -> Iterator[tuple[str, dict[str, str]]]:
    """Give each selector of a style sheet with those of its properties that count."""
    first, *others = sheet.split("/*")
    for block in (first + "".join(part.partition("*/")[2] for part in others)).split("}"):
        before, _, body = block.rpartition("{")
        outer, inner, selectors = before.rpartition("{")
        properties = _properties(body)
        if not properties or "@" in selectors:
            continue
        if inner:
            raise ValueError(f"style: rules in {short(outer.strip())} are not read")
        for selector in selectors.rpartition(";")[2].split(","):
            yield selector.strip(), properties


def _properties(body: str) -> dict[str, str]:
    pairs = (entry.partition(":") for entry in body.split(";"))
    properties = {key.strip().lower(): value.partition("!")[0].strip() for key, _, value in pairs}
    return {key: value for key, value in properties.items() if key in _PROPERTIES and value}


def numbers(text: str, most: int) -> list[float]:
    """Return the numbers of a list, with commas or spaces between them.

    Raises:
        ValueError: If there is anything else, or more than ``most``.
    """
    values, end = _numbers(text, 0, most + 1)
    if len(values) > most:
        raise ValueError(f"has more than {most} numbers, which it may have")
    if end < len(text):
        raise ValueError(f"no number at {short(text[end : end + 20])}")
    return values


def _numbers(text: str, begin: int, most: int, flags: bool = False) -> tuple[list[float], int]:
    """Return up to ``most`` numbers from a place on, and where the next word begins."""
    values: list[float] = []
    end = _after(text, begin)
    while len(values) < most:
        match = (_FLAG if flags and len(values) in (3, 4) else _NUMBER).match(text, end)
        if not match:
            break
        values.append(float(match[0]))
        if abs(values[-1]) > MOST_NUMBER:
            raise ValueError(f"has the number {short(match[0])}; it may be up to {MOST_NUMBER:g}")
        end = _after(text, match.end())
    return values, end


def _after(text: str, end: int) -> int:
    """Return where the next word begins."""
    match = _BLANK.match(text, end)
    return end if match is None else match.end()


def path_data(text: str) -> tuple[str, int]:
    """Return the data of a path in the plainest form, and how many lines and curves they are.

    Each command is written with its numbers. Arcs with a radius of 0 are lines, as SVG says.

    Raises:
        ValueError: If something cannot be read, or there are too many lines and curves.
    """
    parts: list[str] = []
    count, end = 0, _after(text, 0)
    while end < len(text):
        match = _COMMAND.match(text, end)
        if not match:
            what = "number" if parts else "command"
            raise ValueError(f"no {what} at {short(text[end : end + 20].strip())}")
        command, end = match[0], _after(text, match.end())
        if not parts and command not in "Mm":
            raise ValueError(f"must begin with M, not {command}")
        more = True
        while more:
            part, end = _part(text, end, command)
            parts.append(part)
            count += part[0] not in "MmZz"
            if count > MOST_SEGMENTS or len(parts) > 3 * MOST_SEGMENTS:
                raise ValueError(
                    f"has more than {MOST_SEGMENTS} lines and curves, which it may have"
                )
            # What follows a move are lines.
            command = {"M": "L", "m": "l"}.get(command, command)
            more = command not in "Zz" and _NUMBER.match(text, end) is not None
    return " ".join(parts), count


def _part(text: str, end: int, command: str) -> tuple[str, int]:
    """Return a command with its numbers, and where the next word begins."""
    kind = command.upper()
    size = _NUMBERS[kind]
    values, end = _numbers(text, end, size, flags=kind == "A")
    if len(values) < size:
        if end < len(text) and not _COMMAND.match(text, end):
            what = "no flag, 0 or 1," if kind == "A" and len(values) in (3, 4) else "no number"
            raise ValueError(f"{what} at {short(text[end : end + 20].strip())}")
        raise ValueError(
            f"{command} takes {size} numbers at a time, and has {len(values)} in the end"
        )
    if kind == "A" and not (values[0] and values[1]):
        command, values = "L" if command == "A" else "l", values[5:]
    if kind == "A" and len(values) == 7:
        values = [
            abs(values[0]),
            abs(values[1]),
            values[2] % 360.0,
            *map(int, values[3:5]),
            *values[5:],
        ]
    return " ".join([command, *map(repr, values)]), end

"""Drawings in SVG files.

First their text: elements, styles and numbers, read within bounds that are counted. Then what of
them is displayed, as strokes.
"""

# No postponed annotations: older pydantic resolves inherited ones in the subclass's module.

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property
from itertools import islice
from typing import Annotated, Any, Literal, NamedTuple
from xml.etree.ElementTree import Element
from xml.parsers.expat import ExpatError, ParserCreate

import numpy as np

from ..inputs.fields import Array, Length, validated
from ..inputs.files import content_of, require_few, require_readable
from ..inputs.keys import Meaning
from ..inputs.messages import (
    nearest,
    plural,
    short,
)
from ..inputs.packages import import_extra
from .drawing import (
    Drawing,
    Stroke,
    divide,
)
from .pieces import points_along

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
    radii = [abs(value) for value in values[:2]]
    if kind == "A" and min(radii) <= _THIN * max(radii):
        command, values = "L" if command == "A" else "l", values[5:]
    if kind == "A" and len(values) == 7:
        largest = max(radii)
        if largest < _SMALL:
            # Radii that are too small for the ends of an arc are enlarged alike.
            radii = [radius / largest * _SMALL for radius in radii]
        values = [
            *radii,
            values[2] % 360.0,
            *map(int, values[3:5]),
            *values[5:],
        ]
    return " ".join([command, *map(repr, values)]), end


_MOST_BYTES = 10_000_000
# Elements that are displayed, each counted as often as it is used; how often uses are nested.
_MOST_DISPLAYED, _MOST_USES = 20_000, 30
# Ids that are compared with one that is not found.
_MOST_COMPARED = 2000
# Functions of one transform, its characters, and the largest number of a map.
_MOST_FUNCTIONS, _MOST_TEXT, _MOST_SCALE = 100, 5000, 1e15
# Length of a line, relative to the drawing's, that is none; least extent of a drawing, relative to
# its distance from the page's origin.
_NONE = 1e-9
# Radius or side of a shape that is none, as a share of its largest; radius below which the ends of
# an arc are no closer [px].
_THIN, _SMALL = 1e-12, 1e-9
# Angle of an arc that may be its chord [rad], and its height over that as a share of it.
_SHORT, _FLAT = 1e-3, 1e-7
# Size of a page that gives none.
_PAGE = (1000.0, 1000.0)
_GROUPS = {"svg", "g", "a", "switch"}
# Classes of svgelements for shapes, and the lengths that these have.
_SHAPES = {
    "path": ("Path", ()),
    "rect": ("Rect", ("x", "y", "width", "height", "rx", "ry")),
    "circle": ("Circle", ("cx", "cy", "r")),
    "ellipse": ("Ellipse", ("cx", "cy", "rx", "ry")),
    "line": ("SimpleLine", ("x1", "y1", "x2", "y2")),
    "polyline": ("Polyline", ()),
    "polygon": ("Polygon", ()),
}
_VISIBLE = {*_GROUPS, *_SHAPES, "use"}
_SIZES = {"width", "height", "r", "rx", "ry"}
_PPI = 96.0
_LENGTH = re.compile(r"([-+.\d]+(?:e[-+]?\d+)?)\s*(px|in|cm|mm|pt|pc|%)?", re.ASCII | re.IGNORECASE)
_FUNCTION = re.compile(r"[\s,]*([a-z]+)\s*\(([^()]*)\)[\s,]*", re.ASCII | re.IGNORECASE)
_UNIT = re.compile(r"(?<=[\d.])(deg|grad|rad|turn|px|pt|pc)", re.ASCII | re.IGNORECASE)
_ASPECT = re.compile(r"none|x(Min|Mid|Max)Y(Min|Mid|Max)( (meet|slice))?")
# How many numbers the functions of a transform take.
_FUNCTIONS = {"matrix": (6,), "translate": (1, 2), "scale": (1, 2), "rotate": (1, 3)}
_FUNCTIONS |= dict.fromkeys(
    ("skewx", "skewy", "translatex", "translatey", "scalex", "scaley"), (1,)
)
# What svgelements raises where it does not expect what it reads.
_ERRORS = (ArithmeticError, LookupError, AttributeError, TypeError, RuntimeError)


@validated
class Svg(Drawing):
    """The shapes that an SVG file displays: paths, lines, polygons, rectangles, circles, ellipses.

    They are drawn in their order, with their transforms, each as its outline. Text, images, clips
    and the width of lines are no part of it. The origin is the centre of what is drawn.
    """

    kind: Literal["svg"] = "svg"
    summary = (
        "The shapes that an SVG file displays: paths, lines, polygons, rectangles, circles, "
        "ellipses."
    )
    file: Annotated[str, Meaning("The SVG file.")]
    size: Annotated[
        Length,
        Meaning("Width or height of what is drawn, whichever is larger.", unit="m"),
    ]
    element: Annotated[
        str | None,
        Meaning(
            "Id of the shape or group that is drawn, also if it is hidden or a definition; None "
            "for the whole file.",
        ),
    ] = None

    @cached_property
    def _strokes(self) -> list[Stroke]:
        require_readable(self.file)
        try:
            text = content_of(self.file, _MOST_BYTES).decode("utf-8-sig")
            lines = _lines(_paths(text, self.element))
        except OSError as error:
            raise ValueError(f"file {self.file}: cannot be read: {error.strerror}") from None
        except UnicodeDecodeError:
            raise ValueError(f"file {self.file}: is not a text file") from None
        except ValueError as error:
            raise ValueError(f"file {self.file}: {error}") from None
        except _ERRORS as error:
            raise ValueError(f"file {self.file}: {_unread(error)}") from None
        points = np.concatenate([points for stroke in lines for points in stroke])
        low, high = points.min(axis=0), points.max(axis=0)
        # A page's y points down.
        scale = self.size / (high - low).max() * np.array([1.0, -1.0])
        flat = ([(points - (low + high) / 2) * scale for points in stroke] for stroke in lines)
        return [
            [part for points in stroke for part in divide(np.pad(points, ((0, 0), (0, 1))))]
            for stroke in flat
        ]


def _paths(text: str, element: str | None) -> list[Any]:
    """Return the shapes of a file, or of its element of this id, as paths on the page.

    Raises:
        ValueError: If the file is no SVG, has no such element or no shapes, or has something that
            cannot be read.
    """
    (svg,) = import_extra("path.kind: svg", "svg", "svgelements")
    shapes: list[tuple[Element, _Place, dict[str, Any]]] = []
    count = 0
    for shape, place in _visible_shapes(svg, read_tree(text), element):
        with _name_errors(shape):
            values, lines = _values(svg, shape, place.size)
        count += lines
        if count > MOST_SEGMENTS:
            raise ValueError(
                f"{label(place.uses[0] if place.uses else shape)}: with it the drawing has more "
                f"than {MOST_SEGMENTS} lines and curves, which it may have"
            )
        shapes.append((shape, place, values if lines and place.matrix.determinant else {}))
    if not shapes:
        raise ValueError("has no path, and no other shape, to be drawn")
    return [_path(svg, *each) for each in shapes if each[2]]


def _values(svg: Any, shape: Element, size: tuple[float, float]) -> tuple[dict[str, Any], int]:
    """Return what svgelements is given for a shape, and how many lines and curves it has.

    Raises:
        ValueError: If something is not valid, or there are too many.
    """
    if shape.tag == "path":
        data, count = path_data(shape.get("d", ""))
        return {"d": data}, count
    if shape.tag in ("polyline", "polygon"):
        try:
            coordinates = numbers(shape.get("points", ""), 2 * MOST_SEGMENTS + 2)
        except ValueError as error:
            raise ValueError(f"points: {error}") from None
        if len(coordinates) % 2:
            raise ValueError(f"points: must be pairs of numbers, not {len(coordinates)} numbers")
        return {"points": " ".join(map(repr, coordinates))}, len(coordinates) // 2
    keys = [key for key in _SHAPES[shape.tag][1] if shape.get(key, "").strip() != "auto"]
    values = {key: _length(svg, shape, key, size) for key in keys if key in shape.attrib}
    largest = max((values[key] for key in _SIZES if key in values), default=0.0)
    values |= {key: 0.0 for key in _SIZES if values.get(key, largest) < _THIN * largest}
    radii = {key: values[key] for key in ("rx", "ry") if key in values}
    if len(radii) == 1:
        values |= dict.fromkeys(("rx", "ry"), *radii.values())
    sides = {"rect": ("width", "height"), "circle": ("r",), "ellipse": ("rx", "ry")}
    is_drawn = all(values.get(key) for key in sides.get(shape.tag, ()))
    curves = 8 if shape.tag == "rect" and radii else 1 if shape.tag == "line" else 4
    return values, curves if is_drawn else 0


def _path(svg: Any, shape: Element, place: "_Place", values: dict[str, Any]) -> Any:
    """Return a shape as a path on the page, as svgelements reads it."""
    try:
        read = getattr(svg, _SHAPES[shape.tag][0])({**values, "transform": place.matrix})
        read.reify()
        return svg.Path(read)
    except (ValueError, *_ERRORS) as error:
        raise ValueError(f"{label(shape)}: {_unread(error)}") from None


def _unread(error: Exception) -> str:
    if isinstance(error, ArithmeticError):
        return "cannot be read as SVG: its numbers are too large or too small to compute with"
    return " ".join(f"cannot be read as SVG: {type(error).__name__} {error}".split())


def _length(svg: Any, element: Element, key: str, size: tuple[float, float]) -> float:
    """Return one of an element's lengths in pixels; 0 if it is not given.

    Args:
        svg: The module svgelements.
        element: The element.
        key: The attribute.
        size: Width and height to which percentages refer.
    """
    text = element.get(key, "").strip()
    if not text or text == "auto":
        return 0.0
    match = _LENGTH.fullmatch(text[:_MOST_TEXT])
    try:
        values = numbers(match[1], 1) if match else []
    except ValueError as error:
        raise ValueError(f"{key}: {error}") from None
    if len(values) != 1:
        raise ValueError(
            f"{key}: must be a length in px, pt, pc, mm, cm, in or %, not {short(text)}"
        )
    if values[0] < 0.0 and key in _SIZES:
        raise ValueError(f"{key}: must not be negative, not {short(text)}")
    whole = size[0] if key in ("x", "cx", "x1", "x2", "rx", "width") else size[1]
    if key == "r":
        whole = math.hypot(*size) / math.sqrt(2.0)
    unit = (match[2] or "").lower() if match else ""
    return float(svg.Length(values[0], unit).value(ppi=_PPI, relative_length=whole))


def _matrix(svg: Any, element: Element, outer: Any) -> Any:
    """Return the map from an element's own coordinates to the page.

    Args:
        svg: The module svgelements.
        element: The element.
        outer: Map from the coordinates around it, as svgelements' Matrix.
    """
    text = element.get("transform", "").strip()
    if not text or text == "none":
        return outer
    end = count = 0
    while end < len(text) <= _MOST_TEXT and count < _MOST_FUNCTIONS:
        match = _FUNCTION.match(text, end)
        if not match:
            break
        values = numbers(_UNIT.sub("", match[2]), 6)
        if len(values) not in _FUNCTIONS.get(match[1].lower(), ()):
            raise ValueError(f"transform: no {match[1][:40]} of {plural(len(values), 'number')}")
        count, end = count + 1, match.end()
    if end < len(text):
        raise ValueError(
            f"transform: must be up to {_MOST_FUNCTIONS} of matrix, translate, scale, rotate, "
            f"skewX and skewY, not {short(text[end : end + 40])}"
        )
    matrix = _about_origin(svg, element, svg.Matrix(text, ppi=_PPI)) * outer
    # Not so for NaN.
    if not all(abs(matrix[k]) <= _MOST_SCALE for k in range(6)):
        raise ValueError(f"transform: must not enlarge beyond {_MOST_SCALE:g}")
    return matrix


def _about_origin(svg: Any, element: Element, matrix: Any) -> Any:
    """Return a transform about the origin that an element gives for it."""
    if "transform-origin" not in element.attrib:
        return matrix
    origin = numbers(_UNIT.sub("", element.attrib["transform-origin"].strip()), 2)
    if len(origin) != 2:
        raise ValueError(f"transform-origin: must be two numbers, not {len(origin)}")
    x, y = origin
    return svg.Matrix.translate(-x, -y) * matrix * svg.Matrix.translate(x, y)


def _viewport(svg: Any, element: Element, place: "_Place") -> "_Place":
    """Return where the contents of an svg or symbol are displayed, by its viewport and viewBox."""
    box = numbers(element.get("viewBox", ""), 4)
    if box and (len(box) != 4 or min(box[2:]) <= 0.0):
        raise ValueError(
            f"viewBox: must be x, y, width and height, these above 0, not "
            f"{short(element.get('viewBox'))}"
        )
    attributes_element = Element(element.tag, {"width": "100%", "height": "100%"} | element.attrib)
    attributes_element.attrib |= {
        k: v for k, v in (place.sized or {}).items() if k in ("width", "height")
    }
    x, y, width, height = (
        _length(svg, attributes_element, k, place.size) for k in ("x", "y", "width", "height")
    )
    if not box:
        return place._replace(
            matrix=svg.Matrix.translate(x, y) * place.matrix, size=(width, height)
        )
    aspect = element.get("preserveAspectRatio", "xMidYMid").strip()
    if not _ASPECT.fullmatch(aspect):
        raise ValueError(f"preserveAspectRatio: must be as xMidYMid meet, not {short(aspect)}")
    text = svg.Viewbox.viewbox_transform(x, y, width, height, *box, aspect)
    return place._replace(matrix=svg.Matrix(text) * place.matrix, size=(box[2], box[3]))


def _lines(paths: list[Any]) -> list[list[Array]]:
    """Return the strokes of paths, as points of their lines and curves, shape (k, 2).

    Raises:
        ValueError: If there are none, too many, or ones that have no shape.
    """
    parts = [part for path in paths for part in path.as_subpaths()]
    visible = [[each for each in part if _is_drawn(each)] for part in parts]
    require_few(sum(map(len, visible)), "lines and curves", MOST_SEGMENTS)
    ends = [[p.x, p.y] for part in visible for each in part for p in _marks(each)]
    if not np.isfinite(ends).all():
        raise ValueError("has a point that is not finite")
    extent = float(np.ptp(ends, axis=0).max()) if ends else 0.0
    if extent < _NONE * np.abs(ends).max(initial=0.0):
        raise ValueError(
            f"is {extent:.3g} large on its page, too small at its distance from the origin"
        )
    point_strokes = [[_points(each, _NONE * extent) for each in part] for part in visible]
    strokes = [[points for points in stroke if points is not None] for stroke in point_strokes]
    if not any(strokes):
        raise ValueError("has no line that is drawn")
    return [stroke for stroke in strokes if stroke]


def _marks(segment: Any) -> list[Any]:
    """Return points that show where a segment is; the centre of an arc may be far away."""
    if type(segment).__name__ == "Arc":
        return [segment.start, segment.point(0.5), segment.end]
    return [point for point in segment if point is not None]


def _is_drawn(segment: Any) -> bool:
    kind = type(segment).__name__
    return kind != "Move" and (kind != "Close" or segment.start != segment.end)


def _is_flat(segment: Any) -> bool:
    """Return whether a segment is an arc of so large an ellipse that it is its chord."""
    if type(segment).__name__ != "Arc" or not abs(segment.sweep) < _SHORT:
        return False
    middle = segment.get_start_t() + 0.5 * segment.sweep
    away = math.hypot(segment.rx * math.cos(middle), segment.ry * math.sin(middle))
    chord = math.hypot(segment.end.x - segment.start.x, segment.end.y - segment.start.y)
    return bool(away * segment.sweep**2 / 8.0 <= _FLAT * chord)


def _points(segment: Any, none: float) -> Array | None:
    """Return the points of a line or curve, shape (k, 2); None for one without length."""
    if type(segment).__name__ in ("Line", "Close") or _is_flat(segment):
        line = np.array([[end.x, end.y] for end in (segment.start, segment.end)])
        return line if np.ptp(line, axis=0).max() > none else None
    return points_along(lambda shares: np.asarray(segment.npoint(shares)), none)


class _Place(NamedTuple):
    """Where and how an element is displayed.

    Attributes:
        matrix: Map from the coordinates around it to those of the page, as svgelements' Matrix.
        size: Width and height of its viewport, to which percentages refer.
        visible: Whether ``visibility`` lets it be seen.
        uses: Elements by whose use it is displayed, from the outermost on.
        sized: Attributes of the use that displays a symbol or svg.
    """

    matrix: Any
    size: tuple[float, float]
    visible: bool = True
    uses: tuple[Element, ...] = ()
    sized: Mapping[str, str] | None = None


def _visible_shapes(
    svg: Any, root: Element, elements: str | None
) -> Iterator[tuple[Element, _Place]]:
    """Give the shapes that are displayed, and where, in the order in which they are painted.

    Args:
        svg: The module svgelements.
        root: The outermost element.
        elements: Id of the element that is drawn, also if it is hidden or a definition; None for
            all.

    Raises:
        ValueError: If there is no such element, something is not valid, or more is displayed than
            a drawing may have.
    """
    ids: dict[str, Element] = {}
    for element in root.iter():
        if name := element.get("id"):
            ids.setdefault(name, element)
    first = root if elements is None else _target(ids, elements)
    waiting = [(first, _around(svg, root, first))] if elements or _is_displayed(root) else []
    count = 0
    while waiting:
        element, place = waiting.pop()
        with _name_errors(element):
            place = _place(
                svg, element, place, is_visible=elements is not None and element is first
            )
            inner = _inner(svg, ids, element, place, is_group=element is first)
        if element.tag in _SHAPES and place.visible:
            yield element, place
        # Each function of a transform takes its time, too.
        count += len(inner) + element.get("transform", "").count("(")
        if count > _MOST_DISPLAYED:
            raise ValueError(
                f"{label(place.uses[0] if place.uses else element)}: with it more than "
                f"{_MOST_DISPLAYED} elements and transforms are displayed, each counted as "
                "often as it is used"
            )
        waiting += reversed(inner)


def _target(ids: Mapping[str, Element], name: str) -> Element:
    if name not in ids:
        # Comparison takes its time.
        some = sorted(each for each in islice(ids, _MOST_COMPARED) if len(each) <= len(name) + 20)
        hint = nearest(name, some) if some and len(name) <= 60 else "no id is like it"
        raise ValueError(f"has no element {short(name)}; {hint}")
    return ids[name]


@contextmanager
def _name_errors(element: Element) -> Iterator[None]:
    """Name an element in what is said of it."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"{label(element)}: {error}") from None


def _page(root: Element) -> tuple[float, float]:
    """Return the width and height of a page that are 100 % of it."""
    with _name_errors(root):
        box = numbers(root.get("viewBox", ""), 4)
    return (box[2], box[3]) if len(box) == 4 else _PAGE


def _around(svg: Any, root: Element, element: Element) -> _Place:
    """Return where an element lies by all that it is in, however that is hidden."""
    place = _Place(svg.Matrix(), _page(root))
    if element is root:
        return place
    parents = {child: parent for parent in root.iter() for child in parent}
    outer = [element]
    while outer[-1] is not root:
        outer.append(parents[outer[-1]])
    for parent in outer[:0:-1]:
        with _name_errors(parent):
            place = _place(svg, parent, place, is_visible=True)
            if parent.tag == "svg":
                place = _viewport(svg, parent, place)
    return place


def _place(svg: Any, element: Element, place: _Place, is_visible: bool) -> _Place:
    """Return where an element is displayed: its own transform and visibility in those around it."""
    visibility = element.get("visibility", "inherit").strip().lower()
    own = place.visible if visibility == "inherit" else visibility == "visible"
    matrix = _matrix(svg, element, place.matrix)
    return place._replace(matrix=matrix, visible=is_visible or own)


def _is_displayed(element: Element) -> bool:
    is_hidden = element.get("display", "").strip().lower() == "none"
    return not is_hidden and not element.get("requiredExtensions", "").strip()


def _inner(
    svg: Any, ids: Mapping[str, Element], element: Element, place: _Place, is_group: bool
) -> Sequence[tuple[Element, _Place]]:
    """Return what a group or a use displays, and where; nothing for other elements."""
    if element.tag == "use":
        return _used(svg, ids, element, place)
    is_viewport = element.tag == "svg" or place.sized is not None
    if element.tag in _SHAPES or not (is_group or is_viewport or element.tag in _GROUPS):
        return ()
    if is_viewport:
        place = _viewport(svg, element, place)._replace(sized=None)
    children = [child for child in element if _is_displayed(child)]
    if element.tag == "switch":
        children = [child for child in children if "systemLanguage" not in child.attrib][:1]
    return [(c, place) for c in children if c.tag in _VISIBLE]


def _used(
    svg: Any, ids: Mapping[str, Element], element: Element, place: _Place
) -> Sequence[tuple[Element, _Place]]:
    """Return what a use displays, and where."""
    href = element.get("href", "").strip()
    if not href.startswith("#"):
        if href:
            raise ValueError(f"may use an element of its own file, as #id, not {short(href)}")
        return ()
    target = _target(ids, href[1:])
    if element in place.uses:
        raise ValueError("uses itself, or an element in which it is")
    if len(place.uses) == _MOST_USES:
        raise ValueError(f"is used by {_MOST_USES} uses, each by the next; no more may be")
    if not _is_displayed(target) or target.tag not in {*_VISIBLE, "symbol"}:
        return ()
    x, y = (_length(svg, element, key, place.size) for key in ("x", "y"))
    attributes = element.attrib if target.tag in ("svg", "symbol") else None
    matrix = svg.Matrix.translate(x, y) * place.matrix
    return [(target, place._replace(matrix=matrix, uses=(*place.uses, element), sized=attributes))]

"""Drawings in SVG files."""

# No postponed annotations: see `path`.
import re
from functools import cached_property
from io import StringIO
from typing import Any, Literal
from xml.etree.ElementTree import ParseError

import numpy as np

from ..inputs.complaints import nearest
from ..inputs.csv_rows import require_few
from ..inputs.extras import needed
from ..inputs.fields import Array, Length, validated
from ..inputs.given_file import content_of
from .drawing import Drawing
from .strokes import Stroke, divided

#: Lines and curves that a drawing may have.
MOST_SEGMENTS = 2000
_MOST_BYTES = 10_000_000
# Points of a curve through which a spline leads, and at which its length is looked at before.
_POINTS, _LOOKED_AT = 25, 129
# Length, relative to the drawing's, of a line that is none.
_NONE = 1e-9
# Commands of a path, and how many numbers each takes; arcs may write their flags without spaces.
_NUMBERS = {"m": 2, "l": 2, "h": 1, "v": 1, "c": 6, "s": 4, "q": 4, "t": 2, "z": 0}
_COMMAND = re.compile(r"\s*([MLHVCSQTAZ])([^MLHVCSQTAZ]*)", re.IGNORECASE)
_NUMBER = re.compile(r"[\s,]*([-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)", re.IGNORECASE)


@validated
class Svg(Drawing):
    """The shapes of an SVG file: paths, lines, polygons, rectangles, circles, ellipses.

    They are drawn in their order, with their transforms, each as its outline. Text, images, clips
    and the width of lines are no part of it. The origin is the centre of what is drawn.

    Args:
        file: The SVG file.
        size: Width or height of what is drawn, whichever is larger [m].
        element: Id of the shape or group that is drawn; None for the whole file.
    """

    kind: Literal["svg"] = "svg"
    file: str
    size: Length
    element: str | None = None

    @cached_property
    def _strokes(self) -> list[Stroke]:
        try:
            text = content_of(self.file, _MOST_BYTES).decode("utf-8-sig")
            lines = _lines(_shapes(text, self.element))
        except OSError as error:
            raise ValueError(f"file {self.file}: cannot be read: {error.strerror}") from None
        except UnicodeDecodeError:
            raise ValueError(f"file {self.file}: is not a text file") from None
        except ParseError as error:
            raise ValueError(f"file {self.file}: is no SVG: {error}") from None
        except ValueError as error:
            raise ValueError(f"file {self.file}: {error}") from None
        points = np.concatenate([points for stroke in lines for points in stroke])
        low, high = points.min(axis=0), points.max(axis=0)
        # A page's y points down.
        scale = self.size / (high - low).max() * np.array([1.0, -1.0])
        flat = ([(points - (low + high) / 2) * scale for points in stroke] for stroke in lines)
        return [
            [part for points in stroke for part in divided(np.pad(points, ((0, 0), (0, 1))))]
            for stroke in flat
        ]


def _shapes(text: str, element: str | None) -> list[Any]:
    """Return the shapes of a file, or of its element of this id, as paths.

    Raises:
        ValueError: If the file is no SVG, has no such element or no shapes, or has a path that
            cannot be read.
    """
    (svg,) = needed("path.kind: svg", "svg", "svgelements")
    drawing = svg.SVG.parse(StringIO(text), reify=True)
    if not isinstance(drawing, svg.SVG):
        raise ValueError("is no SVG: its outermost element must be svg")
    within: Any = drawing
    if element is not None:
        within = drawing.get_element_by_id(element)
        if within is None:
            ids = sorted({each.id for each in drawing.elements() if each.id})
            hint = nearest(element, ids) if ids else "it has no ids"
            raise ValueError(f"has no element {element!r}; {hint}")
    each = within.select() if isinstance(within, svg.Group) else [within]
    shapes = [shape for shape in each if isinstance(shape, svg.Shape)]
    if not shapes:
        raise ValueError("has no path, and no other shape, to be drawn")
    for shape in shapes:
        if isinstance(shape, svg.Path):
            _require_readable(str(shape.values.get("d", "")), shape.id)
    return [svg.Path(shape) for shape in shapes]


def _require_readable(data: str, name: str | None) -> None:
    """Raise a ValueError for data of a path that a reader would cut short without a word."""
    where = f"path {name}" if name else "a path"
    at = 0
    while data[at:].strip():
        found = _COMMAND.match(data, at)
        if not found:
            raise ValueError(f"{where}: no command at {data[at : at + 20].strip()!r}")
        command, rest = found.groups()
        count, end = 0, 0
        while number := _NUMBER.match(rest, end):
            count, end = count + 1, number.end()
        if rest[end:].strip(" \t\r\n,"):
            raise ValueError(f"{where}: no number at {rest[end : end + 20].strip()!r}")
        each = _NUMBERS.get(command.lower())
        wrong = count if not each else count % each or not count
        if each is not None and wrong:
            raise ValueError(f"{where}: {command} takes {each} numbers, and has {count}")
        at = found.end()


def _lines(paths: list[Any]) -> list[list[Array]]:
    """Return the strokes of paths, as points of their lines and curves, shape (k, 2).

    Raises:
        ValueError: If there are none, too many, or ones that are not finite.
    """
    strokes: list[list[Array]] = []
    for path in paths:
        for part in path.as_subpaths():
            stroke = [_points(segment) for segment in part if type(segment).__name__ != "Move"]
            strokes.append([points for points in stroke if points is not None])
    strokes = [stroke for stroke in strokes if stroke]
    if not strokes:
        raise ValueError("has no line that is drawn")
    require_few(sum(map(len, strokes)), "lines and curves", MOST_SEGMENTS)
    return strokes


def _points(segment: Any) -> Array | None:
    """Return the points of a line or curve, shape (k, 2); None for one without length."""
    ends = [segment.start, segment.end]
    if not all(end is not None and np.isfinite([end.x, end.y]).all() for end in ends):
        raise ValueError("has a point that is not finite")
    if type(segment).__name__ in ("Line", "Close"):
        line = np.array([[end.x, end.y] for end in ends])
        return line if np.ptp(line, axis=0).max() > _NONE else None
    shares = np.linspace(0.0, 1.0, _LOOKED_AT)
    looked_at = np.asarray(segment.npoint(shares))
    if not np.isfinite(looked_at).all():
        raise ValueError("has a point that is not finite")
    way = np.cumsum([0.0, *np.linalg.norm(np.diff(looked_at, axis=0), axis=1)])
    if way[-1] <= _NONE:
        return None
    even = np.interp(np.linspace(0.0, way[-1], _POINTS), way, shares)
    return np.asarray(segment.npoint(even))

"""Text in single-stroke letters."""

# No postponed annotations: see `path`.
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from HersheyFonts import HersheyFonts
from pydantic import Field

from ..inputs.complaints import nearest
from ..inputs.fields import Array, Length, validated
from ..inputs.keys import Meaning
from .drawing import Drawing
from .strokes import Stroke, divided

#: Names of the fonts.
FONTS: list[str] = list(HersheyFonts().default_font_names)
#: Characters that a text may have: more take hours to write.
MOST_CHARACTERS = 500
# Distance of two lines, relative to the height of capital letters.
_LINES = 1.6
# Length of a line, relative to the shorter one beside it, from which it is straight in a curve.
_LONG = 2.0


@validated
class Text(Drawing):
    """Text in letters of single strokes, by Hershey's fonts.

    The path passes the points of each letter, with a smooth curve through those between which the
    letter's lines turn by less than 55 degrees; the others are corners. The text's own origin is
    the centre of what is drawn.

    Source:
        A. V. Hershey, Calligraphy for Computers, 1967.
    """

    kind: Literal["text"] = "text"
    summary = "Text in letters of single strokes, by Hershey's fonts."
    text: Annotated[
        str,
        Field(strict=True, max_length=MOST_CHARACTERS),
        Meaning("What is written; lines are divided by line breaks."),
    ]
    size: Annotated[Length, Meaning("Height of capital letters.", unit="m")]
    font: Annotated[
        str,
        Meaning(
            "Name of a font of the package HersheyFonts. Letters of ``futural``, ``rowmans`` and "
            "``scripts`` are lines alone, those of most others outlines.",
        ),
    ] = "futural"

    @cached_property
    def _strokes(self) -> list[Stroke]:
        lines = self._lines
        if not lines:
            raise ValueError(f"text: must have a letter that is drawn, unlike {self.text!r}")
        corners = np.concatenate(lines)
        middle = (corners.min(axis=0) + corners.max(axis=0)) / 2.0
        return [list(map(_even, divided(points - middle))) for points in lines]

    @property
    def _lines(self) -> list[Array]:
        """Points of each line of the letters, shape (k, 3) [m]."""
        if self.font not in FONTS:
            raise ValueError(f"font: no font {self.font!r}; {nearest(self.font, FONTS)}")
        font = HersheyFonts()
        font.load_default_font(self.font)
        drawn: list[Array] = []
        for number, text in enumerate(self.text.split("\n")):
            x = 0.0
            for character in text:
                glyph = font.all_glyphs.get(character)
                if glyph is None or (not glyph.strokes and character != " "):
                    raise ValueError(f"text: the font {self.font} has no {character!r}")
                height = glyph.base_line - glyph.cap_line
                base = glyph.base_line - _LINES * height * number
                left = x - glyph.left_offset
                for stroke in glyph.strokes:
                    points = np.array([(left + a, base - b, 0.0) for a, b in stroke])
                    drawn.append(self.size / height * points)
                x += glyph.char_width
        return drawn


def _even(points: Array) -> Array:
    """Return points with more of them on lines that are long beside the next ones.

    Without these the curve through the points would swing out where a line leads into a bend.
    """
    if len(points) == 2:
        return points
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    framed = np.concatenate(([np.inf], chords, [np.inf]))
    beside = np.minimum(framed[:-2], framed[2:])
    counts = np.where(chords > _LONG * beside, np.ceil(2.0 * chords / beside), 1.0).astype(int)
    between = [
        p + np.arange(count)[:, None] / count * (q - p)
        for count, (p, q) in zip(counts, pairwise(points), strict=True)
    ]
    return np.vstack([*between, points[-1:]])

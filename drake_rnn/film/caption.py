"""The strip below each picture: name, legend, live numbers, speed and time.

Numbers of a run that a film shows beside its time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import NamedTuple

import matplotlib
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from ..colours import DESIRED, FORCE, TARGET, TRACED
from ..inputs.fields import Array
from ..measures import told
from ..runs.result import Result
from .encoding import FilmSettings


@dataclass(frozen=True)
class Numbers:
    """Numbers over time, as they are written.

    Attributes:
        time: Times of the samples, shape (k,) [s].
        written: Each number at each of them, as text.
    """

    time: Array
    written: list[list[str]]

    def at(self, time: float) -> list[str]:
        """Return the numbers of the last sample that is not later than ``time`` [s]."""
        sample = int(np.searchsorted(self.time, time + 1e-9, side="right")) - 1
        return [each[max(sample, 0)] for each in self.written]

    @property
    def widest(self) -> list[str]:
        """The longest text of each number."""
        return [max(each, key=len) for each in self.written]


def live_numbers(result: Result) -> Numbers:
    """Return the numbers that a film shows: force, errors of Jacobian, joints, tool."""
    written = []
    series = result.series
    if result.experiment.contact is not None:
        written.append([f"{force:.2f} N" for force in series["normal_force"]])
    if "J_hat" in series and series["J_hat"].shape == series["J"].shape:
        off = np.linalg.norm(series["J_hat"] - series["J"], axis=(1, 2))
        share = 100.0 * off / np.linalg.norm(series["J"], axis=(1, 2))
        written.append([f"Jacobian off by {each:.0f} %" for each in share])
    if "joint_error" in series:
        written.append([f"{each:.2f} rad to go" for each in np.abs(series["joint_error"]).max(1)])
    if "pixels" in series:
        written.append([f"error {told(float(each), 'px', 2)}" for each in result.pixel_error])
    else:
        written.append([f"error {told(float(each), 'm', 2)}" for each in result.position_error])
    return Numbers(result.time - result.time[0], written)


#: Height of letters in a wide picture and in a narrow one, and width from which it is wide [px].
_LARGE, _SMALL, _WIDE = 14, 12, 480
#: Height of a row over the height of its letters.
_SPACED = 1.6
_GAP, _EDGE, _BAR = 16, 10, 3
_FIGURE_SPACE = "\u2007"


@dataclass(frozen=True)
class _Colours:
    ground: str
    text: str
    faint: str
    done: str


_THEMES = {
    "light": _Colours("#FFFFFF", "#1A222C", "#D3D9E0", "#55606D"),
    "dark": _Colours("#1C2229", "#E9EDF2", "#37414C", "#A3AEBB"),
}


class _Entry(NamedTuple):
    """A piece of text, with a coloured sign before it."""

    text: str
    sign: str = ""
    colour: str = ""


class Caption:
    """The caption of a film.

    The caption stands in one row if there is room, else in two. In two rows, a name that is too
    long is cut, and numbers that do not fit beside the legend are left out.

    Args:
        results: The run that the film shows, and those beside it.
        settings: What the film shows.
        speed: How much faster than the run it is.
        span: Times of the run at which the film begins and ends [s].
    """

    def __init__(
        self,
        results: Sequence[Result],
        settings: FilmSettings,
        speed: float,
        span: tuple[float, float],
    ) -> None:
        self._size, self._colours = settings.size, _THEMES[settings.theme]
        self._speed, self._span = speed, span
        height = _LARGE if settings.size[0] >= _WIDE else _SMALL
        self._plain, self._bold = _font("DejaVuSans", height), _font("DejaVuSans-Bold", height)
        self._row = round(_SPACED * height)
        # For several runs, labels beside the paths show the errors.
        numbers = live_numbers(results[0]) if len(results) == 1 else Numbers(results[0].time, [])
        title = " beside ".join(
            each.experiment.name or each.experiment.arm.name for each in results
        )
        room = settings.size[0] - 2 * _EDGE
        before_clock = room - self._width(self._clock(span[1]))
        legend, left = self._that_fit(_legend(results[0]), room)
        widest = [_Entry(text) for text in numbers.widest]
        one_row = self._bold.getlength(title) + _GAP + (room - left) + sum(map(self._width, widest))
        self._rows = 1 if one_row <= before_clock else 2
        if self._rows == 2:
            title = _cut(title, self._bold, before_clock)
            kept = self._that_fit(widest, left)[0]
            written = [numbers.written[widest.index(each)] for each in kept]
            numbers = Numbers(numbers.time, written)
        self._title, self._legend, self._numbers = title, legend, numbers

    @property
    def height(self) -> int:
        """Height of the strip [px]."""
        return self._rows * self._row + _BAR

    def below(self, picture: Image.Image, time: float) -> Image.Image:
        """Return a picture with its caption.

        Args:
            picture: The picture, without the strip's height.
            time: Its time in the run [s].
        """
        whole = Image.new("RGB", self._size, self._colours.ground)
        whole.paste(picture, (0, 0))
        draw = ImageDraw.Draw(whole)
        self._draw_bar(draw, time)
        numbers = [_Entry(text) for text in self._numbers.at(time)]
        y = self._size[1] - self._row * (self._rows - 0.5)
        draw.text((_EDGE, y), self._title, self._colours.text, self._bold, "lm")
        if self._rows == 1:
            left = _EDGE + self._bold.getlength(self._title) + _GAP
            self._draw_from_left(draw, (left, y), self._legend)
            self._draw_from_right(draw, y, [*numbers, self._clock(time)])
        else:
            self._draw_from_right(draw, y, [self._clock(time)])
            self._draw_from_left(draw, (_EDGE, y + self._row), self._legend)
            self._draw_from_right(draw, y + self._row, numbers)
        return whole

    def _draw_bar(self, draw: ImageDraw.ImageDraw, time: float) -> None:
        """Draw how much of the film has passed."""
        width, height = self._size
        top = height - self.height
        begin, end = self._span
        done = round(width * (time - begin) / (end - begin))
        draw.rectangle((0, top, width, top + _BAR - 1), fill=self._colours.faint)
        if done > 0:
            draw.rectangle((0, top, done - 1, top + _BAR - 1), fill=self._colours.done)

    def _draw_from_left(
        self, draw: ImageDraw.ImageDraw, at: tuple[float, float], entries: Sequence[_Entry]
    ) -> None:
        x, y = at
        for entry in entries:
            sign = f"{entry.sign} " if entry.sign else ""
            draw.text((x, y), entry.sign, entry.colour or self._colours.text, self._bold, "lm")
            text_at = (x + self._plain.getlength(sign), y)
            draw.text(text_at, entry.text, self._colours.text, self._plain, "lm")
            x += self._width(entry)

    def _draw_from_right(
        self, draw: ImageDraw.ImageDraw, y: float, entries: Sequence[_Entry]
    ) -> None:
        x: float = self._size[0] - _EDGE
        for entry in reversed(entries):
            draw.text((x, y), entry.text, self._colours.text, self._plain, "rm")
            x -= self._width(entry)

    def _clock(self, time: float) -> _Entry:
        # The clock has the same width during the whole film.
        digits = len(f"{self._span[1]:.1f}")
        written = f"{time:.1f}".rjust(digits, _FIGURE_SPACE) + " s"
        faster = "" if self._speed < 1.005 else f"{self._speed:.3g}×   "
        return _Entry(faster + written)

    def _width(self, entry: _Entry) -> float:
        """Return the width of a piece, with the gap that follows [px]."""
        text = f"{entry.sign} {entry.text}" if entry.sign else entry.text
        return self._plain.getlength(text) + _GAP

    def _that_fit(self, entries: Sequence[_Entry], room: float) -> tuple[list[_Entry], float]:
        """Return the pieces that fit into the room, and the room that is left [px]."""
        kept = []
        for entry in entries:
            if (width := self._width(entry)) <= room:
                kept.append(entry)
                room -= width
        return kept, room


def _legend(result: Result) -> list[_Entry]:
    """Return the objects that the playback draws, with their colours."""
    experiment = result.experiment
    traced = _Entry("traced", "●", TRACED)
    if experiment.target is not None:
        return [_Entry("target", "●", TARGET), traced]
    legend = [_Entry("desired", "●", DESIRED), traced]
    passed = experiment.desired.traversal + experiment.path_delay
    if not experiment.desired.closed and result.time[-1] - result.time[0] >= passed * (1.0 - 1e-9):
        legend.append(_Entry("end", "■", DESIRED))
    if experiment.contact is not None:
        legend.append(_Entry("force", "↑", FORCE))
    return legend


def _cut(text: str, font: ImageFont.FreeTypeFont, room: float) -> str:
    """Return a text that is as wide as there is room for, or less."""
    if font.getlength(text) <= room:
        return text
    while text and font.getlength(text + "…") > room:
        text = text[:-1]
    return text + "…"


@cache
def _font(name: str, height: int) -> ImageFont.FreeTypeFont:
    """Return a font that comes with Matplotlib, so that a film is alike on all machines."""
    file = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / f"{name}.ttf"
    return ImageFont.truetype(str(file), height)

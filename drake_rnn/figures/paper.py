"""What figures are drawn for: the format of the file, the width on the page, and the look."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Literal, get_args

from ..errors import InvalidInputError
from ..inputs.arguments import checked, choice, number, optional

#: Formats of files.
Form = Literal["png", "pdf", "svg"]
FORMS: tuple[Form, ...] = get_args(Form)
#: Looks: that of a screen, and serifs and fine lines as a journal's page has them.
Look = Literal["screen", "journal"]
LOOKS: tuple[Look, ...] = get_args(Look)

#: Units of a width [inch].
_UNITS = {"mm": 1 / 25.4, "cm": 1 / 2.54, "in": 1.0}
#: Least and largest width [mm].
_LEAST, _LARGEST = 40.0, 1000.0
_LENGTH = re.compile(rf"(\d+(?:\.\d+)?|\.\d+)\s*({'|'.join(_UNITS)})")


@checked(form=choice(FORMS), width=optional(number(above=0.0)), look=choice(LOOKS))
@dataclass(frozen=True)
class Paper:
    """What figures are drawn for.

    Attributes:
        form: Format of the files: ``png``, ``pdf`` or ``svg``.
        width: Width of each figure [inch]; None for that which suits the figure.
        look: ``screen``; or ``journal``, with serifs, fine lines and 600 dots per inch.
    """

    form: Form = "png"
    width: float | None = None
    look: Look = "screen"


def parse_width(text: str) -> float:
    """Return a width such as ``88mm``, ``8.8cm`` or ``3.5in`` in inches.

    Raises:
        InvalidInputError: If it is no such length, or none that a page has.
    """
    if (found := _LENGTH.fullmatch(text.strip())) is None:
        raise InvalidInputError(
            f"width: must be a length such as 88mm, 8.8cm or 3.5in, not {text!r}"
        )
    width = float(found[1]) * _UNITS[found[2]]
    if not _LEAST <= round(width / _UNITS["mm"], 6) <= _LARGEST:
        raise InvalidInputError(f"width: must be from {_LEAST:g} to {_LARGEST:g} mm, not {text!r}")
    return width


#: What figures are drawn for by default.
SCREEN = Paper()
_CURRENT: ContextVar[Paper] = ContextVar("paper", default=SCREEN)


@contextmanager
def drawn_for(paper: Paper) -> Iterator[None]:
    """Draw figures within the block for a paper, as with Matplotlib's own contexts of styles."""
    token = _CURRENT.set(paper)
    try:
        yield
    finally:
        _CURRENT.reset(token)


def current() -> Paper:
    """Return what figures are drawn for now; outside of all blocks, for a screen."""
    return _CURRENT.get()


def wide(own: float) -> float:
    """Return the width to draw a figure in: that of the paper, or else its own [inch]."""
    return current().width or own

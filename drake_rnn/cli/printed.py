"""What options say that figures are drawn for."""

from __future__ import annotations

from ..figures import Paper, parse_width
from .command import Printed


def paper_of(asked: Printed) -> Paper:
    """Return what the options say that figures are drawn for.

    Raises:
        InvalidInputError: If the width is none.
    """
    width = None if asked.width is None else parse_width(asked.width)
    return Paper(asked.form, width, asked.look)

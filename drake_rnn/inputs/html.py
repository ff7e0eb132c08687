"""What a notebook shows: tables, and views that higher rooms draw."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from .lending import lent

#: What a notebook shows of a result below its metrics: functions from a result to HTML, by the name
#: ``module:function``, whose module is imported when a notebook asks.
VIEWS: dict[str, str] = {}


def html_views(result: object) -> str:
    """Return all views of a result as HTML."""
    return "".join(lent(view)(result) for view in VIEWS.values())


def html_table(title: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table as HTML; all but the first column to the right.

    Args:
        title: What stands above it.
        head: Names of the columns.
        rows: Texts of the cells.
    """
    lines = [_row("th", head), *(_row("td", row) for row in rows)]
    return f"<table><caption>{escape(title)}</caption>{''.join(lines)}</table>"


def _row(cell: str, texts: Sequence[str]) -> str:
    sides = ("left", *("right" for _ in texts[1:]))
    cells = (
        f'<{cell} style="text-align: {side}">{escape(text)}</{cell}>'
        for side, text in zip(sides, texts, strict=True)
    )
    return f"<tr>{''.join(cells)}</tr>"

"""Tables as Markdown."""

from __future__ import annotations

from collections.abc import Sequence

from .sheet import Cell, Heading, Sheet

#: Mark of a number that is outside its bound, and what it means.
BROKEN, BROKEN_MEANS = "†", "violates its acceptance bound"


def markdown(sheet: Sheet) -> str:
    """Return a table as Markdown, with its title above and its note below."""
    head = [column.heading.on_page for column in sheet.columns]
    rules = ["---:" if column.right else "---" for column in sheet.columns]
    notes = [f"{BROKEN} {BROKEN_MEANS}"] if sheet.broken else []
    parts = [f"**{sheet.title}**"] if sheet.title else []
    parts.append(
        markdown_rows([head, *([_text(each) for each in row] for row in sheet.rows)], rules)
    )
    parts += filter(None, [*notes, sheet.note])
    return "\n\n".join(parts) + "\n"


def markdown_rows(rows: Sequence[Sequence[str]], rules: Sequence[str] = ()) -> str:
    """Return a table of texts as Markdown, without a newline at its end.

    Args:
        rows: The rows, the head first.
        rules: What stands below the head of each column, which aligns it.
    """
    head, *others = rows
    rule = f"|{'|'.join(rules or ['---'] * len(head))}|"
    return "\n".join([_line(head), rule, *map(_line, others)])


def _text(entry: Heading | Cell | str) -> str:
    if isinstance(entry, Heading):
        return entry.on_page
    mark = f" {BROKEN}" if isinstance(entry, Cell) and entry.broken else ""
    return f"{entry}{mark}"


def _line(cells: Sequence[str]) -> str:
    texts = (cell.replace("|", "\\|").replace("\n", " ") for cell in cells)
    return f"| {' | '.join(texts)} |"

"""Printing of Markdown tables, row by row."""


def row(*cells: object) -> None:
    """Print one row of a table."""
    print("|", " | ".join(str(cell) for cell in cells), "|")


def head(*cells: str) -> None:
    """Print the header of a table."""
    print()
    row(*cells)
    print("|" + "---|" * len(cells))

"""Tables as Markdown, printed row by row."""


def row(*cells: object) -> None:
    """Print one row of a table."""
    print("|", " | ".join(str(cell) for cell in cells), "|")


def head(*cells: str) -> None:
    """Print the first rows of a table."""
    print()
    row(*cells)
    print("|" + "---|" * len(cells))

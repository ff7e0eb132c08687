"""Printing of Markdown tables, row by row."""

from collections.abc import Mapping

from drake_rnn.measures import violation_metric
from drake_rnn.robot.limits import LIMIT_UNITS


def row(*cells: object) -> None:
    """Print one row of a table."""
    print("|", " | ".join(str(cell) for cell in cells), "|")


def head(*cells: str, made_by: str = "") -> None:
    """Print the header of a table; of a page that is printed whole, below what makes it."""
    print()
    if made_by:
        print(f"<!-- made by {made_by}; of 0 -->")
    row(*cells)
    print("|" + "---|" * len(cells))


def broken_limits(metrics: Mapping[str, float]) -> str:
    """Return the limits that a run exceeds and by how much, or "none"."""
    excess = {name: metrics.get(violation_metric(name), 0.0) for name in LIMIT_UNITS}
    broken = [f"{name}: {by:.2g} {LIMIT_UNITS[name]}" for name, by in excess.items() if by > 0.0]
    return ", ".join(broken) or "none"

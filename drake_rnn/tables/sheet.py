"""A table before it has a format: headings with units, and cells with numbers.

A terminal shows it with the names and SI units that documents have; pages have words, and the unit
with the prefix that suits the numbers. `drake_rnn.measures.rounded` writes the numbers of both.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from ..measures import METRICS, prefixed, raised, rounded

_METRICS = {metric.name: metric for metric in METRICS}


@dataclass(frozen=True)
class Heading:
    """What a column or a row holds.

    Attributes:
        name: Name as documents and commands have it.
        words: Name as a page has it; empty for the same.
        unit: SI unit; empty for none.
    """

    name: str
    words: str = ""
    unit: str = ""

    def __str__(self) -> str:
        return self.name

    @property
    def on_page(self) -> str:
        """The name as a page has it, with the unit."""
        words = self.words or self.name
        return f"{words} [{raised(self.unit)}]" if self.unit else words


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes:
        heading: What it holds.
        right: Whether it is aligned at the right, as numbers are.
        long: Whether it has sentences, which are broken into lines.
    """

    heading: Heading
    right: bool = False
    long: bool = False


@dataclass(frozen=True)
class Cell:
    """Numbers in a text.

    Attributes:
        numbers: The numbers, in the SI unit of the column or the row.
        form: Text with a ``{}`` for each of them.
        bound: Bound that the first number is expected to keep, for the terminal; empty for none.
        kept: Whether it keeps the bound; pages mark a number that does not.
    """

    numbers: tuple[float, ...] = ()
    form: str = "{}"
    bound: str = ""
    kept: bool = True

    @property
    def broken(self) -> bool:
        """Whether there is a number outside of its bound, or none where a bound asks for one."""
        return not self.kept and bool(self.numbers or self.bound)

    def __str__(self) -> str:
        return self.form.format(*map(rounded, self.numbers))


@dataclass(frozen=True)
class Sheet:
    """A table.

    Attributes:
        columns: Its columns.
        rows: Its rows, with an entry for each column. The first entry may be a `Heading`, whose
            unit is that of the row.
        title: Title; empty for none.
        note: What stands below it; empty for nothing.
    """

    columns: tuple[Column, ...]
    rows: list[tuple[Heading | Cell | str, ...]] = field(default_factory=list)
    title: str = ""
    note: str = ""

    def for_page(self) -> Sheet:
        """Return the table in words, its numbers in units with the prefixes that suit them."""
        columns, cells = list(self.columns), [list(row) for row in self.rows]
        for k, column in enumerate(columns):
            heading, factor = _suited(column.heading, (row[k] for row in cells))
            columns[k] = replace(column, heading=heading)
            for row in cells:
                row[k] = _scaled(row[k], factor)
        for row in cells:
            if isinstance(row[0], Heading):
                row[0], factor = _suited(row[0], row[1:])
                row[1:] = [_scaled(entry, factor) for entry in row[1:]]
        return replace(self, columns=tuple(columns), rows=[tuple(row) for row in cells])

    @property
    def broken(self) -> bool:
        """Whether any number is outside the bound that it is expected to keep."""
        return any(isinstance(each, Cell) and each.broken for row in self.rows for each in row)


def metric_heading(name: str) -> Heading:
    """Return the heading of a metric; in words only if it is a known one."""
    metric = _METRICS.get(name)
    if metric is None:
        return Heading(name)
    return Heading(name, metric.words, "" if metric.unit == "1" else metric.unit)


def _suited(heading: Heading, entries: Iterable[Heading | Cell | str]) -> tuple[Heading, float]:
    """Return a heading with the unit that suits some entries, and the factor to that unit."""
    if not heading.unit:
        return heading, 1.0
    numbers = [abs(n) for each in entries if isinstance(each, Cell) for n in each.numbers]
    # Rounded before the prefix is chosen: 0.1 m rather than 100 mm for 0.09999999 m.
    largest = float(rounded(max(filter(math.isfinite, numbers), default=0.0)))
    unit, factor = prefixed(largest, heading.unit)
    return replace(heading, unit=unit), factor


def _scaled(entry: Heading | Cell | str, factor: float) -> Heading | Cell | str:
    if isinstance(entry, Cell) and factor != 1.0:
        return replace(entry, numbers=tuple(factor * number for number in entry.numbers))
    return entry

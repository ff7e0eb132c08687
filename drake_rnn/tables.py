r"""Tables: built once as a `Sheet`, and written as Markdown, LaTeX or CSV.

A sheet has headings with units, and cells with numbers. A terminal shows the names that documents
have, and the unit beside each number; pages have words, and the unit in the heading. Both take the
prefix that suits the numbers, which `drake_rnn.measures.format_number` writes.

LaTeX has the rules of the package booktabs, and nothing that pdfLaTeX could not set: powers of ten,
Greek letters and signs are formulas: their fonts have outlines, where the signs of text fonts may
be bitmaps.

A file has the format that its name ends in.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from io import StringIO
from pathlib import Path
from unicodedata import name as name_of
from unicodedata import normalize

from .errors import InvalidInputError
from .measures import METRICS, format_number, prefix_unit, superscript
from .runs.folder import require_output, written_whole

# What was a module in this one until 0.3 is found under its name, see `moved_modules`.
__path__: list[str] = []

_METRICS = METRICS.by_name


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
        return f"{words} [{superscript(self.unit)}]" if self.unit else words


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


#: Form of a cell with a mean and a standard deviation, whose digits end at the same place.
SPREAD = "{} ± {}"
#: Share of a mean below which a deviation is that of rounding.
_ROUNDING = 1e-9


def spread_text(mean: float, deviation: float) -> str:
    """Return a mean and its standard deviation, the latter with two significant digits."""
    if not (math.isfinite(mean) and deviation > _ROUNDING * abs(mean) and math.isfinite(deviation)):
        rounded = 0.0 if deviation <= _ROUNDING * abs(mean) else deviation
        return f"{format_number(mean)} ± {format_number(rounded)}"
    deviation = float(f"{deviation:.1e}")
    place = math.floor(math.log10(deviation)) - 1
    mean = round(mean, -place) + 0.0
    order = math.floor(math.log10(max(abs(mean), deviation)))
    if -4 <= order < 6:
        return f"{mean:.{max(0, -place)}f} ± {deviation:.{max(0, -place)}f}"
    digits = 0 if mean == 0.0 else max(0, math.floor(math.log10(abs(mean))) - place)
    return f"{mean:.{digits}e} ± {deviation:.1e}"


@dataclass(frozen=True)
class Cell:
    """Numbers in a text.

    Attributes:
        numbers: The numbers, in the SI unit of the column or the row.
        form: Text with a ``{}`` for each of them.
        bound: Bound that the first number is expected to keep, for the terminal; empty for none.
        kept: Whether it keeps the bound; a number that does not is marked.
        unit: Unit that is written behind them; empty where the heading has it.
    """

    numbers: tuple[float, ...] = ()
    form: str = "{}"
    bound: str = ""
    kept: bool = True
    unit: str = ""

    @property
    def is_broken(self) -> bool:
        """Whether there is a number outside of its bound, or none where a bound asks for one."""
        return not self.kept and bool(self.numbers or self.bound)

    def __str__(self) -> str:
        is_spread = self.form == SPREAD
        spread = spread_text(*self.numbers) if is_spread else ""
        text = spread or self.form.format(*map(format_number, self.numbers))
        return f"{text} {self.unit}" if self.unit and self.numbers else text


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
        return self._suited(beside=False)

    def for_terminal(self) -> Sheet:
        """Return the table with the unit beside each number, with the prefix that suits them."""
        return self._suited(beside=True)

    def _suited(self, beside: bool) -> Sheet:
        """Return the table in the units that suit, which stand beside the numbers or above."""
        columns, cells = list(self.columns), [list(row) for row in self.rows]
        for k, column in enumerate(columns):
            heading, entries = _suited(column.heading, [row[k] for row in cells], beside)
            columns[k] = replace(column, heading=heading)
            for row, entry in zip(cells, entries, strict=True):
                row[k] = entry
        for row in cells:
            if isinstance(row[0], Heading):
                row[0], row[1:] = _suited(row[0], row[1:], beside)
        return replace(self, columns=tuple(columns), rows=[tuple(row) for row in cells])

    @property
    def is_broken(self) -> bool:
        """Whether any number is outside the bound that it is expected to keep."""
        return any(isinstance(each, Cell) and each.is_broken for row in self.rows for each in row)


def metric_heading(name: str) -> Heading:
    """Return the heading of a metric; in words only if it is a known one."""
    metric = _METRICS.get(name)
    if metric is None:
        return Heading(name)
    return Heading(name, metric.words, "" if metric.unit == "1" else metric.unit)


#: Least number that stays in the unit of the others of its row or column.
_SMALL = 1e-3


def _suited(
    heading: Heading, entries: Sequence[Heading | Cell | str], beside: bool
) -> tuple[Heading, list[Heading | Cell | str]]:
    """Return a heading and its entries in the unit that suits them.

    Args:
        heading: The heading, with the unit that the entries have.
        entries: The entries.
        beside: Whether the unit is beside each number. One that is far smaller than others then
            has the prefix that suits itself.
    """
    if not heading.unit:
        return heading, list(entries)
    numbers = [abs(n) for each in entries if isinstance(each, Cell) for n in each.numbers]
    unit, factor = _unit_of(max(filter(math.isfinite, numbers), default=0.0), heading)

    def scaled(entry: Heading | Cell | str) -> Heading | Cell | str:
        if not isinstance(entry, Cell) or not entry.numbers:
            return entry
        own, by = unit, factor
        if beside and 0.0 < factor * abs(entry.numbers[0]) < _SMALL:
            own, by = _unit_of(abs(entry.numbers[0]), heading)
        shown = tuple(by * number for number in entry.numbers)
        return replace(entry, numbers=shown, unit=own if beside else "")

    return replace(heading, unit=unit), [scaled(entry) for entry in entries]


def _unit_of(size: float, heading: Heading) -> tuple[str, float]:
    # Rounded before the prefix is chosen: 0.1 m rather than 100 mm for 0.09999999 m.
    return prefix_unit(float(format_number(size)), heading.unit)


#: Mark of a number that is outside its bound, and what it means.
BROKEN, BROKEN_MEANS = "†", "violates its acceptance bound"


def markdown(sheet: Sheet) -> str:
    """Return a table as Markdown, with its title above and its note below."""
    head = [column.heading.on_page for column in sheet.columns]
    rules = ["---:" if column.right else "---" for column in sheet.columns]
    notes = [f"{BROKEN} {BROKEN_MEANS}"] if sheet.is_broken else []
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
    return "\n".join([_markdown_line(head), rule, *map(_markdown_line, others)])


def _text(entry: Heading | Cell | str) -> str:
    if isinstance(entry, Heading):
        return entry.on_page
    mark = f" {BROKEN}" if isinstance(entry, Cell) and entry.is_broken else ""
    return f"{entry}{mark}"


def _markdown_line(cells: Sequence[str]) -> str:
    texts = (cell.replace("|", "\\|").replace("\n", " ") for cell in cells)
    return f"| {' | '.join(texts)} |"


#: Number of rows from which on a table may be broken between pages.
_LONG = 40
#: Share of a line that all columns of sentences have together.
_SENTENCES = 0.72
_ESCAPES = {each: f"\\{each}" for each in "&%$#_{}"}
_ESCAPES |= {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}
# A line that begins with a bracket would be an option of the end of the line before it.
_ESCAPES |= {"[": "{[}", "]": "{]}", "\n": r" \newline "}
_ESCAPES |= {"<": "$<$", ">": "$>$", "|": "$|$", "µ": r"$\mu$", "°": r"$^\circ$"}
_ESCAPES |= {"≤": r"$\le$", "≥": r"$\ge$", "×": r"$\times$", "−": "$-$", "±": r"$\pm$"}
_ESCAPES |= {"∞": r"$\infty$", "≈": r"$\approx$", "→": r"$\to$", "·": r"$\cdot$", "∈": r"$\in$"}
_ESCAPES |= {"–": "--", "…": r"\dots{}", "’": "'", "‖": r"$\|$", "√": r"$\surd$", "∫": r"$\int$"}
_NUMBER = re.compile(r"(?<![\w.])(-?\d+(?:\.\d+)?)(?:e([+-]\d+))?(?![\w.]*\w)")
_POWER = re.compile(r"\^\d")
_SIGNS = {"<=": "≤", ">=": "≥"}


def latex(sheet: Sheet) -> str:
    """Return a table as LaTeX; a document inputs it, within a ``table`` of its own caption."""
    breaks = len(sheet.rows) > _LONG
    tabular = "longtable" if breaks else "tabular"
    packages = "booktabs and longtable" if breaks else "booktabs"
    sentences = sum(column.long for column in sheet.columns)
    kinds = "".join(_kind(column, sentences) for column in sheet.columns)
    head = _latex_line([_set(column.heading.on_page) for column in sheet.columns])
    mark = rf"{_LATEX_DAGGER} {_set(BROKEN_MEANS)}" if sheet.is_broken else ""
    notes = [note for note in (mark, _set(sheet.note)) if note]
    width = len(sheet.columns)
    below = [rf"\multicolumn{{{width}}}{{@{{}}l@{{}}}}{{\footnotesize {n}}} \\" for n in notes]
    return "\n".join(
        [
            *([f"% {sheet.title}"] if sheet.title else []),
            f"% Needs the package{'s' * breaks} {packages}.",
            rf"\begin{{{tabular}}}{{@{{}}{kinds}@{{}}}}",
            r"\toprule",
            head,
            r"\midrule",
            *([r"\endhead"] if breaks else []),
            *(_latex_line([_entry(each) for each in row]) for row in sheet.rows),
            r"\bottomrule",
            *below,
            rf"\end{{{tabular}}}",
            "",
        ]
    )


_LATEX_DAGGER = r"$^\dagger$"


def _kind(column: Column, sentences: int) -> str:
    if column.long:
        return rf">{{\raggedright\arraybackslash}}p{{{_SENTENCES / sentences:.2f}\linewidth}}"
    return "r" if column.right else "l"


def _latex_line(cells: list[str]) -> str:
    return " & ".join(cells) + r" \\"


def _entry(entry: Heading | Cell | str) -> str:
    if isinstance(entry, Heading):
        return _set(entry.on_page)
    mark = _LATEX_DAGGER if isinstance(entry, Cell) and entry.is_broken else ""
    return _set(str(entry)) + mark


def _set(text: str) -> str:
    """Return a text as LaTeX sets it, its numbers with minus signs and powers of ten."""
    for sign, single in _SIGNS.items():
        text = text.replace(sign, single)
    text = _POWER.sub(lambda found: superscript(found[0]), text)
    parts, end = [], 0
    for match in _NUMBER.finditer(text):
        number, power = match.groups()
        parts += [_escape(text[end : match.start()]), _number(number, power)]
        end = match.end()
    return "".join([*parts, _escape(text[end:])])


def _number(number: str, power: str | None) -> str:
    if power is not None:
        return rf"${number} \times 10^{{{int(power)}}}$"
    return f"${number}$" if number.startswith("-") else number


def _escape(text: str) -> str:
    return "".join(map("".join, map(_letters, text)))


def _letters(letter: str) -> Iterator[str]:
    """Yield LaTeX for a letter: as it is, escaped, or as a formula by its name in Unicode."""
    if letter in _ESCAPES or letter.isascii():
        yield _ESCAPES.get(letter, letter)
        return
    plain, letter_name = normalize("NFKC", letter), name_of(letter, "")
    if letter_name.startswith("SUPERSCRIPT"):
        yield f"$^{{{plain.replace('−', '-')}}}$"
    elif letter_name.startswith("SUBSCRIPT"):
        yield f"$_{{{plain.replace('−', '-')}}}$"
    elif letter_name.startswith("GREEK"):
        size, word = letter_name.split()[1], letter_name.split()[3].lower()
        yield f"$\\{word if size == 'SMALL' else word.capitalize()}$"
    else:
        yield letter


def _csv(sheet: Sheet) -> str:
    stream = StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow([column.heading.on_page for column in sheet.columns])
    for row in sheet.rows:
        writer.writerow([each.on_page if isinstance(each, Heading) else str(each) for each in row])
    return stream.getvalue()


#: What writes each format, by the ending of the file's name.
FORMATS: dict[str, Callable[[Sheet], str]] = {".md": markdown, ".tex": latex, ".csv": _csv}


def require_format(file: Path, what: str = "table") -> None:
    """Raise an InvalidInputError unless the name of a file ends in a known format."""
    if file.suffix not in FORMATS:
        formats = ", ".join(FORMATS)
        raise InvalidInputError(f"{what}: {file}: must end in one of {formats}")


def write_sheet(sheet: Sheet, file: Path) -> None:
    """Write a table to a file, which is replaced at once, in words and in units that suit.

    A CSV file has neither title, notes nor marks of broken bounds.

    Args:
        sheet: The table.
        file: The file, whose name ends in one of `FORMATS`; its folder is made.

    Raises:
        InvalidInputError: If there is no such format, or it cannot be written.
    """
    require_format(file)
    require_output(file, "table")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with written_whole(file) as stream:
            stream.write(FORMATS[file.suffix](sheet.for_page()))
    except OSError as error:
        raise InvalidInputError(f"table {file}: {error.strerror}") from None

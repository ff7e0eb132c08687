r"""Tables as LaTeX, with the rules of the package booktabs.

The text has nothing that pdfLaTeX could not set: powers of ten, Greek letters and signs are
formulas: their fonts have outlines, where the signs of text fonts may be bitmaps.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from unicodedata import name as name_of
from unicodedata import normalize

from ..measures import raised
from .markdown import BROKEN_MEANS
from .sheet import Cell, Column, Heading, Sheet

#: Number of rows from which on a table may be broken between pages.
_LONG = 40
#: Share of a line that all columns of sentences have together.
_SENTENCES = 0.72
_ESCAPED = {each: f"\\{each}" for each in "&%$#_{}"}
_ESCAPED |= {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}
# A line that begins with a bracket would be an option of the end of the line before it.
_ESCAPED |= {"[": "{[}", "]": "{]}", "\n": r" \newline "}
_ESCAPED |= {"<": "$<$", ">": "$>$", "|": "$|$", "µ": r"$\mu$", "°": r"$^\circ$"}
_ESCAPED |= {"≤": r"$\le$", "≥": r"$\ge$", "×": r"$\times$", "−": "$-$", "±": r"$\pm$"}
_ESCAPED |= {"∞": r"$\infty$", "≈": r"$\approx$", "→": r"$\to$", "·": r"$\cdot$", "∈": r"$\in$"}
_ESCAPED |= {"–": "--", "…": r"\dots{}", "’": "'", "‖": r"$\|$", "√": r"$\surd$", "∫": r"$\int$"}
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
    head = _line([_set(column.heading.on_page) for column in sheet.columns])
    marked = rf"{_BROKEN} {_set(BROKEN_MEANS)}" if sheet.broken else ""
    notes = [note for note in (marked, _set(sheet.note)) if note]
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
            *(_line([_entry(each) for each in row]) for row in sheet.rows),
            r"\bottomrule",
            *below,
            rf"\end{{{tabular}}}",
            "",
        ]
    )


_BROKEN = r"$^\dagger$"


def _kind(column: Column, sentences: int) -> str:
    if column.long:
        return rf">{{\raggedright\arraybackslash}}p{{{_SENTENCES / sentences:.2f}\linewidth}}"
    return "r" if column.right else "l"


def _line(cells: list[str]) -> str:
    return " & ".join(cells) + r" \\"


def _entry(entry: Heading | Cell | str) -> str:
    if isinstance(entry, Heading):
        return _set(entry.on_page)
    mark = _BROKEN if isinstance(entry, Cell) and entry.broken else ""
    return _set(str(entry)) + mark


def _set(text: str) -> str:
    """Return a text as LaTeX sets it, its numbers with minus signs and powers of ten."""
    for sign, single in _SIGNS.items():
        text = text.replace(sign, single)
    text = _POWER.sub(lambda found: raised(found[0]), text)
    parts, end = [], 0
    for found in _NUMBER.finditer(text):
        number, power = found.groups()
        parts += [_escaped(text[end : found.start()]), _number(number, power)]
        end = found.end()
    return "".join([*parts, _escaped(text[end:])])


def _number(number: str, power: str | None) -> str:
    if power is not None:
        return rf"${number} \times 10^{{{int(power)}}}$"
    return f"${number}$" if number.startswith("-") else number


def _escaped(text: str) -> str:
    return "".join(map("".join, map(_letters, text)))


def _letters(letter: str) -> Iterator[str]:
    """Yield LaTeX for a letter: as it is, escaped, or as a formula by its name in Unicode."""
    if letter in _ESCAPED or letter.isascii():
        yield _ESCAPED.get(letter, letter)
        return
    plain, called = normalize("NFKC", letter), name_of(letter, "")
    if called.startswith("SUPERSCRIPT"):
        yield f"$^{{{plain.replace('−', '-')}}}$"
    elif called.startswith("SUBSCRIPT"):
        yield f"$_{{{plain.replace('−', '-')}}}$"
    elif called.startswith("GREEK"):
        size, word = called.split()[1], called.split()[3].lower()
        yield f"$\\{word if size == 'SMALL' else word.capitalize()}$"
    else:
        yield letter

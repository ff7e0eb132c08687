"""The pages stay few and short: their number, their words of prose, and the length of sentences.

Tables, headings, fenced code and formulas on lines of their own are no prose; within a line a
formula counts as one word.
"""

from __future__ import annotations

import re

from doc_pages import ROOT, text_of

from row_helpers import each

DOCS = sorted(str(file.relative_to(ROOT)) for file in (ROOT / "docs").rglob("*.md"))
#: The most that there may be.
PAGES, WORDS, OF_README, OF_A_SENTENCE = 42, 42_000, 900, 22
#: Pages of schemes among them; a further scheme has a page of its own, of at most so many words.
#: So has a further product.
SCHEMES, OF_A_SCHEME = 12, 1_000
PRODUCTS = {"docs/shield.md", "docs/fr3_policy.md"}
FURTHER = sum(page.startswith("docs/schemes/") for page in DOCS) - SCHEMES + len(PRODUCTS)
#: Pages with sentences of a script whose tables would have to be made again with them.
MADE = {"docs/cross.md"}
#: What is no prose: front matter, comments, fences and formulas, tables, headings and pictures.
_NOT_PROSE = re.compile(
    r"\A---\n.*?\n---\n|<!--.*?-->|^(?P<fence>`{3,}|:{3,}).*?^(?P=fence)$|^\$\$.*?\$\$$"
    r"|^[ ]*(?:\||#|!\[)[^\n]*$",
    re.DOTALL | re.MULTILINE,
)
_PLACE_OF_A_LINK = re.compile(r"\]\([^)]*\)")
_FORMULA = re.compile(r"\$[^$\n]+(?:\n[^$\n]+)?\$")
_BLOCK = re.compile(r"\n\s*\n|\n(?=\s*(?:[-*]|\d+\.)\s)")
_END = re.compile(r"(?<=[.!?:])\*{0,2}\s+(?=[\[A-Z`\"*$(])")


def words_of(page: str) -> list[list[str]]:
    """Return the words of each sentence of a page."""
    text = _FORMULA.sub("$", _PLACE_OF_A_LINK.sub("]", _NOT_PROSE.sub("", text_of(page))))
    blocks = [" ".join(block.split()) for block in _BLOCK.split(text)]
    return [sentence.split() for block in blocks for sentence in _END.split(block) if sentence]


def test_there_are_few_pages() -> None:
    assert set(DOCS) >= PRODUCTS
    assert len(DOCS) <= PAGES + FURTHER


def test_the_pages_together_are_short() -> None:
    words = sum(len(words) for page in DOCS for words in words_of(page))
    assert words <= WORDS + FURTHER * OF_A_SCHEME


def test_the_readme_is_short() -> None:
    assert len(text_of("README.md").split()) <= OF_README


@each("page", sorted({"README.md", *DOCS} - MADE))
def test_sentences_are_short(page: str) -> None:
    """On average; of single words, such as the items of a list, there are no sentences."""
    lengths = [len(words) for words in words_of(page) if len(words) > 2]
    assert sum(lengths) <= OF_A_SENTENCE * max(1, len(lengths))

"""The pages of the repository, and what stands in them."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import drake_rnn

ROOT = Path(__file__).parents[2]

#: Every page, relative to the root.
PAGES = sorted(
    str(file.relative_to(ROOT))
    for pattern in (
        "*.md",
        "docs/*.md",
        "docs/schemes/*.md",
        "docs/notebooks/*.md",
        "diagrams/*.md",
        "diagrams/campaigns/*.md",
        "diagrams/experiments/*.md",
        "models/*.md",
        "notebooks/*.md",
        "paper/checklist.md",
    )
    for file in ROOT.glob(pattern)
)

# Also those of a directive of the site, e.g. ```{toctree}.
_FENCE = re.compile(r"^```(\w*|\{[\w-]+\}.*?)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_SPAN = re.compile(r"`([^`]+)`")


def text_of(page: str) -> str:
    """Return the text of a page."""
    return (ROOT / page).read_text()


def fenced(page: str, language: str) -> list[tuple[int, str]]:
    """Return the fenced blocks in a language, each with the number of its first line."""
    text = text_of(page)
    return [
        (text.count("\n", 0, match.start(2)) + 1, match[2])
        for match in _FENCE.finditer(text)
        if match[1] == language
    ]


def cells(page: str) -> list[tuple[int, str]]:
    """Return the Python of a notebook's cells, each with the number of its first line."""
    return [
        (line, re.sub(r"^%.*$", "", code, flags=re.MULTILINE))
        for line, code in fenced(page, "{code-cell} ipython3")
    ]


def prose(page: str) -> str:
    """Return the text of a page without its fenced blocks."""
    return _FENCE.sub("", text_of(page))


def spans(text: str) -> list[str]:
    """Return the code spans of a text, each on one line."""
    return [" ".join(span.split()) for span in _SPAN.findall(text)]


def tables(page: str) -> Iterator[tuple[list[str], list[list[str]]]]:
    """Yield head and rows of every table."""
    lines = prose(page).splitlines()
    for number, line in enumerate(lines):
        if re.fullmatch(r"\|(?:-+\|)+", line):
            rows = []
            for row in lines[number + 1 :]:
                if not row.startswith("|"):
                    break
                rows.append(_cells(row))
            yield _cells(lines[number - 1]), rows


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]


def assert_public(code: str, others: set[str]) -> None:
    """Python of a page imports only public names of this package, and ``others``."""
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Import):
            assert {alias.name.split(".")[0] for alias in node.names} <= others
        elif isinstance(node, ast.ImportFrom) and node.module == "drake_rnn":
            assert {alias.name for alias in node.names} <= set(drake_rnn.__all__)
        elif isinstance(node, ast.ImportFrom):
            assert node.module is not None
            # It needs an optional package, and so is none of the names above.
            if node.module == "drake_rnn.shield.environment":
                continue
            assert node.module.split(".")[0] in others

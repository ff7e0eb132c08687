"""A table of measured numbers names its command, and is no older than what makes it."""

import re
import shutil
from pathlib import Path

import pytest
from doc_pages import PAGES, ROOT, text_of
from stale_tables import MARK, stale

from row_helpers import each

#: Pages of which a test compares every row with what makes it.
MADE_WHOLE = ("docs/claims.md", "docs/metrics.md")
#: Tables of numbers that nobody measured, by the first words of their head.
NOT_MEASURED = {
    "| arm | joints |": "models",
    "| exit status |": "codes",
    "| Python |": "versions",
    "| printed | here |": "corrections of a paper",
    "| scheme | `rise_time` T |": "choices",
    "| joint | 1 | 2 |": "a robot's own limits",
    "| part |": "a layout in bytes",
    "| `activation` | $\\phi(x)$ |": "formulas",
}
#: Parts of the package that tables are made of.
PARTS = ("drake_rnn/laws", "drake_rnn/shield")
_NUMBER = re.compile(r"\d")
_WORDS = re.compile(r"[A-Za-z]")


@pytest.mark.long
def test_no_table_is_older_than_what_made_it() -> None:
    older = [f"{table.page}:{table.line}: {table.command}" for table in stale()]
    assert not older, (
        "make these tables again, or show with benchmarks/bits.py that no run has changed; "
        f"then note it: python docs/stale_tables.py --remade PAGE: {older}"
    )


def _all_tables(page: str) -> list[tuple[str, list[str]]]:
    """Return the line above each table of a page, and the table's lines."""
    lines = text_of(page).splitlines()
    begins = [k for k in range(1, len(lines) - 1) if re.fullmatch(r"\|[-:| ]+\|", lines[k + 1])]
    found = []
    for begin in begins:
        end = next((k for k in range(begin, len(lines)) if lines[k][:1] != "|"), len(lines))
        found.append((lines[begin - 1], lines[begin:end]))
    return found


def _is_measured(rows: list[str]) -> bool:
    """Return whether at least two cells of five are numbers, with a unit or a few words."""
    cells = [cell for row in rows for cell in row.strip("|").split("|")]
    numbers = [cell for cell in cells if _NUMBER.search(cell) and len(_WORDS.findall(cell)) < 15]
    return len(numbers) >= 0.4 * len(cells)


@each("page", [page for page in PAGES if page not in MADE_WHOLE])
def test_a_table_of_numbers_names_its_command(page: str) -> None:
    for above, (head, _, *rows) in _all_tables(page):
        if head.startswith(tuple(NOT_MEASURED)) or not _is_measured(rows):
            continue
        wanted = "<!-- made by COMMAND; of 0 -->"
        assert MARK.fullmatch(above), f"{page}: write {wanted} above the table: {head}"


@pytest.fixture(scope="module")
def copied(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("root")
    for folder in ("benchmarks", "diagrams", "docs", "examples", *PARTS):
        shutil.copytree(ROOT / folder, root / folder)
    for file in ("README.md", "drake_rnn/__init__.pyi"):
        shutil.copy(ROOT / file, root / file)
    return root


@pytest.mark.parametrize(
    ("file", "before", "after", "older"),
    [
        ("benchmarks/guard_times.py", "(None, 1, 6, 16, 23)", "(None, 1, 6)", "docs/shield.md"),
        ("benchmarks/recursive_tables.py", '"""Print', '"""Show', None),
        ("drake_rnn/laws/recursive.py", "class ", "# A note.\nclass ", None),
        ("drake_rnn/laws/recursive.py", 'Meaning("', 'Meaning("It is so. ' + 80 * "x", None),
        (
            "drake_rnn/laws/joint_drift_free.py",
            "1.0 / h, v / h",
            "2.0 / h, v / h",
            "docs/schemes/joint_drift_free.md",
        ),
    ],
)
@pytest.mark.long
def test_what_is_edited_makes_its_tables_old(
    copied: Path, file: str, before: str, after: str, older: str | None
) -> None:
    text = (copied / file).read_text()
    assert before in text
    try:
        (copied / file).write_text(text.replace(before, after, 1))
        pages = {table.page for table in stale(copied)}
    finally:
        (copied / file).write_text(text)
    assert older in pages if older else not pages


@pytest.mark.long
def test_a_table_that_is_older_is_none_that_lies_if_a_reader_of_its_page_is_told(
    copied: Path,
) -> None:
    page = copied / "docs" / "shield_evidence.md"
    text = page.read_text()
    assert "docs/shield_evidence.md" not in {table.page for table in stale(copied)}
    try:
        page.write_text(text.replace("made before 29 November", "made on 29 November"))
        assert "docs/shield_evidence.md" in {table.page for table in stale(copied)}
    finally:
        page.write_text(text)

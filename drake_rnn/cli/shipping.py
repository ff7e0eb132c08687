"""What a law of this package needs, written into its sources, each with what is to be filled in."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple

from ..errors import InvalidInputError
from ..runs.whole_file import written_whole

_TEMPLATES = files("drake_rnn.cli") / "templates" / "shipped_law"
#: Files of a law, by template.
_FILES = {
    "law.py.txt": "drake_rnn/laws/my_law.py",
    "experiment.yaml.txt": "diagrams/experiments/my_law/my_law.yaml",
    "test.py.txt": "tests/laws/test_my_law.py",
    "page.md.txt": "docs/schemes/my_law.md",
}


class _Entry(NamedTuple):
    """Lines of a file of all laws that each law has for itself.

    Attributes:
        file: The file.
        opens: Pattern of the line before the entries.
        closes: Pattern of what the line after them begins with.
        named: Pattern of an entry, with the name that entries are sorted by as its group; empty if
            a new one is the last.
        name: That name of the new one.
        text: The new one.
    """

    file: str
    opens: str
    closes: str
    named: str
    name: str
    text: str


_LAWS, _PACKAGE = "drake_rnn/laws/__init__.py", "drake_rnn/__init__.pyi"
_NAMED = r'^    "?(\w+)"?,$'
_ENTRIES = (
    _Entry(
        *(_LAWS, r"from \.\.inputs\.kinds .*", "$", r"^from \.(\w+) import", "my_law"),
        "from .my_law import MyLaw\n",
    ),
    _Entry(
        _LAWS, r"    \{", r"    \},", r'^ +"(\w+)": \w+,$', "my_law", '        "my_law": MyLaw,\n'
    ),
    _Entry(_LAWS, r"__all__ = \[", r"\]", _NAMED, "MyLaw", '    "MyLaw",\n'),
    _Entry(
        *(_PACKAGE, r"from \.laws import \(", r"\)", r"^    (\w+) as \w+,$", "MyLaw"),
        "    MyLaw as MyLaw,\n",
    ),
    _Entry(
        *("docs/choosing.md", r"\| scheme, and an experiment with it .*", "$", "", ""),
        "| [my law](schemes/my_law.md)<br>`my_law` | | | | | | FILL IN from "
        "`python benchmarks/scheme_costs.py my_law` |\n",
    ),
    _Entry(
        *("diagrams/experiments/README.md", "# Experiments", r"\Z", "", ""),
        "\n## My law\n\n`my_law/`. FILL IN what the experiments of this scheme show.\n\n"
        "| experiment | arm | what to expect | paper |\n|---|---|---|---|\n",
    ),
    _Entry(
        *("CHANGELOG.md", r"## \[Unreleased\]", r"## \[", "", ""),
        "- The law `my_law`: FILL IN what it is for.\n\n",
    ),
)


def write_shipped(name: str, root: Path) -> list[Path]:
    """Write a law with experiment, test and page, and enter it where all laws are entered.

    Args:
        name: Name of its module, which is its kind.
        root: Root of the sources of this package.

    Returns:
        The files, new ones first.

    Raises:
        InvalidInputError: If there are no such sources, the name is taken there, or a file has no
            place for the law.
    """
    for entry in _ENTRIES:
        if not (root / entry.file).is_file():
            raise InvalidInputError(
                "--shipped: needs the sources of drake_rnn in the current folder; "
                f"{root / entry.file} is not there"
            )
    words = name.split("_")
    title, sentence = "".join(map(str.capitalize, words)), " ".join(words)

    def named(text: str) -> str:
        text = text.replace("my_law", name).replace("MyLaw", title).replace("my law", sentence)
        return text.replace("My law", sentence.capitalize())

    if re.search(
        rf"^    {title} as {title},$", (root / _PACKAGE).read_text(encoding="utf-8"), re.M
    ):
        raise InvalidInputError(f"name: drake_rnn has {title} already; take another")
    written = {
        root / named(file): named((_TEMPLATES / each).read_text(encoding="utf-8"))
        for each, file in _FILES.items()
    }
    _require_free(written)
    for entry in _ENTRIES:
        file = root / entry.file
        text = written.get(file) or file.read_text(encoding="utf-8")
        written[file] = _entered(text, entry._replace(name=named(entry.name)), named(entry.text))
    for file, text in written.items():
        file.parent.mkdir(exist_ok=True)
        with written_whole(file) as stream:
            stream.write(text)
    return list(written)


def _require_free(files: Iterable[Path]) -> None:
    for file in files:
        # A package hides a module of the same name.
        for taken in (file, file.with_suffix("")) if file.suffix == ".py" else (file,):
            if os.path.lexists(taken):
                raise InvalidInputError(f"{taken}: is there already, and is not overwritten")


def _entered(text: str, entry: _Entry, lines: str) -> str:
    opened = re.search(f"^{entry.opens}$", text, re.M)
    closed = opened and re.compile(f"^{entry.closes}", re.M).search(text, opened.end() + 1)
    if opened is None or closed is None:
        raise InvalidInputError(f"{entry.file}: has no {entry.opens!r}; write there {lines!r}")
    at = closed.start()
    if entry.named:
        for found in re.compile(entry.named, re.M).finditer(text, opened.end(), at):
            if _order(found[1]) > _order(entry.name):
                at = found.start()
                break
    return text[:at] + lines + text[at:]


def _order(name: str) -> tuple[bool, bool, str]:
    """Return what names are sorted by: constants come first, then classes."""
    return not name.isupper(), not name[0].isupper(), name.lower()

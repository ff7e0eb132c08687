"""Tell which tables of the pages are older than what made them.

A table of measured numbers stands below a line that names its command, and the digest of what the
command is made of::

    <!-- made by python benchmarks/recursive_tables.py; of 1f0c93ab -->

What a table is made of: the script with its own modules, the experiments and campaigns that
command, script or table name, the files of their laws, and those of the shield where the script
imports a public name of it. Comments, docstrings and what is said of
keys do not count.

::

    python docs/stale_tables.py                      # lists the tables that are older
    python docs/stale_tables.py --remade docs/schemes/recursive.md
    python docs/stale_tables.py --before "before the certificate ..." docs/avoidance.md

The second notes the digests of today in a page: after its tables were made again, or after
`benchmarks/bits.py compare` has shown that no bit of their runs has changed. The third marks the
tables of a page that are older and are not made again, with words that a reader of the page must
find on it::

    <!-- made by python benchmarks/avoidance.py; of 1f0c93ab; measured before ... -->
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import io
import json
import re
import shlex
import sys
import tokenize
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeGuard

from ruamel.yaml import YAML

ROOT = Path(__file__).parents[1]
PAGES = ("README.md", "docs/*.md", "docs/schemes/*.md")
#: The line above a table that a command made.
MARK = re.compile(
    r"<!-- made by (?P<command>.+?); of (?P<digest>\w+)(?:; measured (?P<before>before .+?))? -->"
)
_FIELD = re.compile(r"\{[^{}]*\}")
_LAWS, _SHIELD = Path("drake_rnn/laws"), Path("drake_rnn/shield")
#: A line of the public interface, with the module of its names.
_PUBLIC = re.compile(r"^from \.(?P<module>[\w.]+) import (?P<names>.+)$", re.MULTILINE)
#: Modules of it without the algebra of any law, which no number follows from.
_NO_ALGEBRA = ("__init__", "called", "law", "layout", "report")
#: What the documents say of a run that does not change the run.
_SAID = ("accept", "expect", "paper")


@dataclass(frozen=True)
class Table:
    """A table that a command made.

    Attributes:
      page: Path of its page, relative to the root.
      line: Number of the line that names its command.
      command: The command.
      noted: Digest of what the command was made of when it was run.
      text: The table.
      before: Words of the page that say that it is older than today's code; empty if it is not.
    """

    page: str
    line: int
    command: str
    noted: str
    text: str
    before: str = ""


def tables(root: Path = ROOT) -> Iterator[Table]:
    """Yield the tables of all pages that name their commands."""
    for file in (file for pattern in PAGES for file in sorted(root.glob(pattern))):
        lines = file.read_text().splitlines()
        for number, line in enumerate(lines, 1):
            if mark := MARK.fullmatch(line):
                below = lines[number : _end(lines, number)]
                page = str(file.relative_to(root))
                noted = mark["command"], mark["digest"], "\n".join(below), mark["before"] or ""
                yield Table(page, number, *noted)


def _end(lines: list[str], begin: int) -> int:
    """Return the index of the first line at or after another that is not of a table."""
    return next((k for k in range(begin, len(lines)) if not lines[k].startswith("|")), len(lines))


def digest(command: str, text: str = "", root: Path = ROOT) -> str:
    """Return the digest of what a command is made of.

    Args:
      command: The command, as one would type it in the root.
      text: The table; experiments that it names belong to the command.
      root: Root of the sources.
    """
    found = hashlib.sha256(command.encode())
    for file in made_of(command, text, root):
        found.update(str(file.relative_to(root)).encode())
        found.update(_what_counts(file).encode())
    return found.hexdigest()[:8]


def made_of(command: str, text: str = "", root: Path = ROOT) -> list[Path]:
    """Return the files that a command is made of, as `digest` has them."""
    scripts = [root / word for word in shlex.split(command) if word.endswith(".py")]
    scripts = _with_imports(scripts, lambda script: script.parent)
    words = {re.escape(word) for word in re.findall(r"\w+", f"{command} {text}")}
    words = words.union(*(_strings(script.read_text()) for script in scripts))
    named = re.compile("|".join(words))
    shipped = _shipped(root)
    contents = {file.stem: content for file, content in shipped.items()}
    names = {name for name in contents if named.fullmatch(name)}
    bases = [contents[name].get("experiment") for name in names]
    names |= {base for base in bases if isinstance(base, str)}
    documents = [file for file in shipped if file.stem in names]
    kinds = {law["kind"] for name in names for law in _laws(contents[name])}
    laws = [
        file
        for file in (root / _LAWS).glob("*.py")
        if file.stem not in _NO_ALGEBRA and (file.stem in kinds or named.fullmatch(file.stem))
    ]
    laws = _with_imports(laws, lambda _: root / _LAWS)
    shield = _with_imports(_shield_of(scripts, root), lambda _: root / _SHIELD)
    return scripts + documents + laws + shield


def _shield_of(scripts: Iterable[Path], root: Path) -> Iterator[Path]:
    """Yield the modules of the shield whose public names are imported."""
    imported = {name for script in scripts for _, name in _imports(script.read_text())}
    package = root / "drake_rnn"
    for line in _PUBLIC.finditer((package / "__init__.pyi").read_text()):
        module = package.joinpath(*line["module"].split(".")).with_suffix(".py")
        names = {f"drake_rnn.{name.split()[0]}" for name in line["names"].split(",")}
        if module.is_relative_to(root / _SHIELD) and names & imported:
            yield module


def _laws(document: Any) -> Iterator[Any]:
    """Yield the sections `law` of an experiment, or of a campaign and its own experiment."""
    if "law" in document:
        yield document["law"]
    varied = document.get("vary", {}).get("law", [])
    if isinstance(varied, dict):
        yield from (grid["fixed"] for grid in varied.get("of", []))
    if isinstance(document.get("experiment"), dict):
        yield from _laws(document["experiment"])


@cache
def _strings(text: str) -> set[str]:
    """Return expressions for the words of a module's strings.

    A field that is formatted stands for any letters, beside at least four that are given.
    """
    found = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.JoinedStr):
            parts = (p.value if isinstance(p, ast.Constant) else "{}" for p in node.values)
            found |= set("".join(map(str, parts)).split())
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            found |= set(node.value.split())
    plain = {re.escape(word) for word in found if "{" not in word}
    formatted = [_FIELD.split(word) for word in found if "{" in word]
    return plain | {
        r"\w*".join(map(re.escape, given)) for given in formatted if len("".join(given)) >= 4
    }


@cache
def _shipped(root: Path) -> dict[Path, Any]:
    """Return the contents of all experiments and campaigns, by file."""
    return {file: _loaded(file.read_text()) for file in sorted(root.glob("diagrams/*/**/*.yaml"))}


@cache
def _loaded(text: str) -> Any:
    return YAML(typ="safe").load(text)


def _with_imports(files: Iterable[Path], folder_of: Callable[[Path], Path]) -> list[Path]:
    """Return modules with those that they import in turn from a folder."""
    found: set[Path] = set()
    waiting = list(files)
    while waiting:
        file = waiting.pop()
        if file in found:
            continue
        found.add(file)
        waiting += _imported(file, folder_of(file))
    return sorted(found)


@cache
def _imported(file: Path, folder: Path) -> list[Path]:
    """Return the modules in a folder, or below it, that a module imports."""
    found = []
    for level, name in _imports(file.read_text()):
        # Of an import from ..parts the folder is as many levels up as there are dots.
        base = file.parents[level - 1] if level else folder
        module = base.joinpath(*name.split(".")).with_suffix(".py")
        inside = module.is_file() and module.is_relative_to(folder)
        if inside and module.stem not in _NO_ALGEBRA:
            found.append(module)
    return found


@cache
def _imports(text: str) -> list[tuple[int, str]]:
    """Return what a module imports: the number of dots, and a name that may be a module's."""
    found = []
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            found += [(0, alias.name) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            inside = f"{node.module}." if node.module else ""
            names = [f"{inside}{alias.name}" for alias in node.names]
            found += [(node.level, name) for name in [*names, *filter(None, [node.module])]]
    return found


@cache
def _what_counts(file: Path) -> str:
    """Return a file's text without what changes no number."""
    text = file.read_text()
    return _run_of(text) if file.suffix == ".yaml" else _code_of(text)


@cache
def _run_of(text: str) -> str:
    counts = {key: value for key, value in _loaded(text).items() if key not in _SAID}
    return json.dumps(counts, sort_keys=True, default=str)


@cache
def _code_of(text: str) -> str:
    lines = text.splitlines()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            lines[token.start[0] - 1] = lines[token.start[0] - 1][: token.start[1]]
    said = [node for node in ast.walk(ast.parse(text)) if _is_said(node)]
    # From the end, so that places before stay where they are.
    for node in sorted(said, key=lambda node: (node.lineno, node.col_offset), reverse=True):
        first, last = node.lineno - 1, (node.end_lineno or node.lineno) - 1
        before = lines[first].encode()[: node.col_offset].decode()
        after = lines[last].encode()[node.end_col_offset :].decode()
        lines[first : last + 1] = [before + after] + [""] * (last - first)
    code = "\n".join(line.rstrip() for line in lines if line.strip())
    # How a field is broken into lines depends on what is said of it.
    return re.sub(r",[\s,]*(?=\])|\s+", "", code) if "Meaning" in code else code


def _is_said(node: ast.AST) -> TypeGuard[ast.expr | ast.stmt]:
    """Return whether a node is a docstring, the meaning of a key, or the summary of a class."""
    if isinstance(node, ast.Assign):
        return any(isinstance(each, ast.Name) and each.id == "summary" for each in node.targets)
    if isinstance(node, ast.Call):
        return isinstance(node.func, ast.Name) and node.func.id == "Meaning"
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def _look_anew() -> None:
    """Forget what files had in them: they may have been edited."""
    for looked in (_shipped, _imported, _what_counts):
        looked.cache_clear()


def stale(root: Path = ROOT) -> list[Table]:
    """Return the tables that are older than what made them, where their page does not say so."""
    _look_anew()
    said = {page: _said(root / page) for page in {table.page for table in tables(root)}}
    return [
        table
        for table in tables(root)
        if digest(table.command, table.text, root) != table.noted
        and not (table.before and table.before in said[table.page])
    ]


def _said(page: Path) -> str:
    """Return what a reader finds on a page, in one line."""
    return " ".join(re.sub(r"<!--.*?-->", "", page.read_text(), flags=re.DOTALL).split())


def note(page: Path, root: Path = ROOT, before: str = "") -> None:
    """Note the digests of today in a page, or that those of its tables that are older remain so.

    Args:
        page: The page.
        root: Root of the sources.
        before: Words that say so on the page, from "before" on; empty for digests of today.
    """
    _look_anew()
    lines = page.read_text().splitlines(keepends=True)
    for table in tables(root):
        if root / table.page == page.resolve():
            now = digest(table.command, table.text, root)
            noted = now if not before or now == table.noted else table.noted
            told = f"; measured {before}" if noted != now else ""
            lines[table.line - 1] = f"<!-- made by {table.command}; of {noted}{told} -->\n"
    page.write_text("".join(lines))


def main() -> int:
    """Carry out the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--remade", nargs="+", type=Path, default=[], metavar="PAGE")
    parser.add_argument("--before", nargs=2, metavar=("WORDS", "PAGE"))
    options = parser.parse_args()
    if options.before is not None:
        words, page = options.before
        note(Path(page), before=words)
        return 0
    if options.remade:
        for page in options.remade:
            note(page)
        return 0
    older = stale()
    for table in older:
        print(f"{table.page}:{table.line}: older than what made it: {table.command}")
    return int(bool(older))


if __name__ == "__main__":
    sys.exit(main())

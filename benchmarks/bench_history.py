"""Keep what benchmarks print, by commit; draw it, and tell of ratios that have grown.

``python benchmarks/bench_history.py run SCRIPT ...`` runs a benchmark as ``python SCRIPT ...``
would, and adds a line of JSON for each figure of its tables to build/bench/history.jsonl: commit,
its time, the benchmark, the row, the column, the value, and whether it is a ratio, in units of a
cost that was measured at the same moment. ``check`` fails if a ratio of the newest commit is more
than a tenth above the median of the commits before. ``draw`` writes build/bench/history.svg.

The file is built, and stands in no commit: machines differ. A workflow keeps it from night to
night.
"""

from __future__ import annotations

import argparse
import io
import json
import re
import runpy
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import redirect_stdout
from pathlib import Path
from statistics import median
from typing import Any, TextIO

import matplotlib as mpl
from matplotlib.figure import Figure
from rich.console import Console
from rich.table import Table

ROOT = Path(__file__).parents[1]
HISTORY = ROOT / "build" / "bench" / "history.jsonl"
#: How much larger a ratio may be than the median of those before, of at most so many commits.
MOST, BEFORE = 1.10, 5
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?\b")
# Columns of a table that name its row, and those that are no measurements.
_NAMES = {"arms", "arrays", "bounded", "pairs", "robots", "steps by", "what"}
_OTHERS = {"at most", "end force, bare [N]", "p and J", "period", "real_time_factor", "targets"}
# Differences of what was measured: a little noise is much of them.
_DIFFERENCES = {"Drake's loop", "more [u]", "ports", "recorder"}
_RATIO = re.compile(r"\bunits?\b|\bu\b|\bratio\b|of import")


def figures(
    title: str, head: Sequence[str], rows: Iterable[Sequence[str]]
) -> Iterator[dict[str, Any]]:
    """Yield the figures of a table.

    Args:
        title: What stands above it.
        head: Its columns.
        rows: The texts of its cells.
    """
    for cells in rows:
        named = [cells[0], *(c for h, c in zip(head[1:], cells[1:], strict=True) if h in _NAMES)]
        # Two columns may have one name: a unit belongs to what stands before it.
        before = ""
        for column, cell in zip(head[1:], cells[1:], strict=True):
            number = _NUMBER.match(cell)
            if column in _NAMES | _OTHERS or number is None:
                continue
            is_ratio = bool(_RATIO.search(column) or "in units" in title)
            is_ratio = is_ratio and column not in _DIFFERENCES
            name = f"{before}, {column}" if column in ("u", "units") else column
            before = column
            row = ", ".join(" ".join(each.replace("`", "").split()) for each in named)
            figure = {"row": row, "column": name, "value": float(number[0])}
            yield {**figure, "step": _step(number[0]), "ratio": is_ratio}


def _step(text: str) -> float:
    """Return the value of the last digit of a number."""
    mantissa, _, exponent = text.partition("e")
    return float(10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2])))


def markdown_tables(text: str) -> Iterator[tuple[list[str], list[list[str]]]]:
    """Yield head and rows of the Markdown tables in a text."""
    lines = text.splitlines()
    for number, line in enumerate(lines):
        if number and re.fullmatch(r"\|(?:-+\|)+", line):
            end = next(
                (k for k in range(number + 1, len(lines)) if not lines[k].startswith("|")),
                len(lines),
            )
            head, *rows = (
                [cell.strip() for cell in each.strip()[1:-1].split("|")]
                for each in (lines[number - 1], *lines[number + 1 : end])
            )
            yield head, rows


class _Both(io.StringIO):
    """Keeps what is printed, which is shown as well."""

    def __init__(self, shown: TextIO) -> None:
        super().__init__()
        self._shown = shown

    def write(self, text: str) -> int:
        self._shown.write(text)
        return super().write(text)


def run(script: str, arguments: Sequence[str]) -> list[dict[str, Any]]:
    """Run a benchmark as a program, and return the figures of all tables that it prints."""
    found: list[dict[str, Any]] = []
    printing = Console.print

    def tapped(console: Console, *objects: Any, **options: Any) -> None:
        for table in objects:
            if isinstance(table, Table):
                columns = [list(map(str, column.cells)) for column in table.columns]
                head = [str(column.header) for column in table.columns]
                found.extend(figures(str(table.title), head, zip(*columns, strict=True)))
        printing(console, *objects, **options)

    Console.print, argv = tapped, sys.argv  # type: ignore[method-assign]
    sys.argv = [script, *arguments]
    sys.path.insert(0, str(Path(script).parent))
    text = _Both(sys.stdout)
    try:
        with redirect_stdout(text):
            runpy.run_path(script, run_name="__main__")
    finally:
        Console.print, sys.argv = printing, argv  # type: ignore[method-assign]
        sys.path.pop(0)
    for head, rows in markdown_tables(text.getvalue()):
        found += figures("", head, rows)
    return found


def commit() -> dict[str, str]:
    """Return the commit that is measured, marked if the package differs from it, and its time."""

    def git(*arguments: str) -> str:
        done = subprocess.run(
            ("git", *arguments), cwd=ROOT, capture_output=True, text=True, check=True
        )
        return done.stdout.strip()

    changed = "+" if git("status", "--porcelain", "--", "drake_rnn", "diagrams", "models") else ""
    return {
        "commit": git("rev-parse", "--short=12", "HEAD") + changed,
        "time": git("log", "-1", "--format=%cI"),
    }


def name_of(line: Mapping[str, Any]) -> str:
    """Return the name of the figure of a line."""
    return f"{line['benchmark']}: {line['row']}: {line['column']}"


def ratios(lines: Iterable[Mapping[str, Any]]) -> dict[str, dict[str, float]]:
    """Return by figure and commit, the oldest first, the least ratio of each."""
    found: dict[str, dict[str, float]] = defaultdict(dict)
    for line in sorted(lines, key=lambda each: str(each["time"])):
        if line["ratio"]:
            values = found[name_of(line)]
            values[line["commit"]] = min(line["value"], values.get(line["commit"], float("inf")))
    return found


def grown(lines: Iterable[Mapping[str, Any]]) -> list[str]:
    """Return a sentence on each ratio of the newest commit that has grown by more than rounding."""
    lines, sentences = list(lines), []
    steps = {name_of(line): line["step"] for line in lines}
    for name, values in ratios(lines).items():
        *before, now = values.values()
        if not before:
            continue
        usual, rounding = median(before[-BEFORE:]), 0.5 * steps[name]
        if now - rounding > MOST * (usual + rounding):
            sentences.append(f"{name}: {now:g}, {now / usual:.2f} times the {usual:g} of before")
    return sentences


def draw(lines: Iterable[Mapping[str, Any]], file: Path) -> None:
    """Draw the ratios over the commits, each over its first one, a panel for each benchmark."""
    panels: dict[str, dict[str, dict[str, float]]] = defaultdict(dict)
    for name, values in ratios(lines).items():
        benchmark, _, figure = name.partition(": ")
        panels[benchmark][figure] = values
    with mpl.rc_context({"svg.hashsalt": "bench"}):
        picture = Figure(figsize=(11, 2.6 * len(panels)), layout="constrained")
        axes = picture.subplots(len(panels), squeeze=False)[:, 0]
        for ax, (benchmark, each) in zip(axes, panels.items(), strict=True):
            order = list(dict.fromkeys(one for values in each.values() for one in values))
            for figure, values in each.items():
                first = next(iter(values.values()))
                places = [order.index(one) for one in values]
                ax.plot(places, [value / first for value in values.values()], ".-", label=figure)
            ax.axhline(MOST, color="0.6", linestyle=":")
            ax.set_title(benchmark, loc="left", fontsize=9)
            ax.set_xticks(range(len(order)), [one[:7] for one in order], rotation=90, fontsize=7)
            ax.set_ylabel("of the first")
            ax.legend(fontsize=5, ncols=2, loc="center left", bbox_to_anchor=(1.0, 0.5))
        picture.savefig(file)


def _read() -> list[dict[str, Any]]:
    if not HISTORY.is_file():
        return []
    return [json.loads(line) for line in HISTORY.read_text().splitlines()]


def _run(script: str, arguments: Sequence[str]) -> None:
    at = commit()
    name = " ".join((Path(script).stem, *arguments))
    HISTORY.parent.mkdir(parents=True, exist_ok=True)
    lines = [{**at, "benchmark": name, **figure} for figure in run(script, arguments)]
    with HISTORY.open("a") as stream:
        stream.writelines(json.dumps(line, ensure_ascii=False) + "\n" for line in lines)


def _check() -> None:
    lines = _read()
    if sentences := grown(lines):
        head = "ratios have grown by more than a tenth; of several `make bench` the least counts:"
        raise SystemExit("\n".join((head, *sentences)))
    print(f"{len(ratios(lines))} ratios, none has grown by more than a tenth")


def _draw() -> None:
    if not (lines := _read()):
        raise SystemExit(f"{HISTORY.relative_to(ROOT)} is not there: make bench")
    draw(lines, file := HISTORY.with_suffix(".svg"))
    print(file.relative_to(ROOT))


def main() -> None:
    """Do what the command line asks for."""
    what: dict[str, Callable[[], None]] = {"check": _check, "draw": _draw}
    if sys.argv[1:2] == ["run"] and len(sys.argv) > 2:
        _run(sys.argv[2], sys.argv[3:])
        return
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument(
        "what", choices=("run", *what), help="`run` takes a script and its arguments"
    )
    asked = parser.parse_args().what
    if asked == "run":
        parser.error("run: give a script")
    what[asked]()


if __name__ == "__main__":
    main()

"""What is shipped, and what is installed and works, as tables.

Nothing that a run needs is imported, no room of the package that imports Drake or NumPy: the start
of `drake-rnn list` is a good part of what it takes, and `drake-rnn doctor` is for where these
cannot be imported.
"""

from __future__ import annotations

import json
import platform
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import asdict, astuple, dataclass
from importlib import import_module
from importlib.metadata import PackageNotFoundError, requires, version
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any, Literal

import typer
from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from ..diagrams import EXPERIMENTS
from ..errors import InvalidInputError
from ..inputs.packages import PROGRAMS, c_compiler, find_program, import_name, packages_of
from .arguments import Doctor, List
from .console import errors, out, print_table
from .starting import FAILED

#: Width from which the table also has the papers [characters].
_ROOM = 120
# The names that an option may give; their rooms are imported where a name is refused.
_NAMES = {
    "arm": "drake_rnn.robot.load_arm:shipped_arms",
    "law": "drake_rnn.laws:LAWS",
    "level": "drake_rnn.systems:BODIES",
}


@dataclass(frozen=True)
class Listing:
    """What the table says of an experiment.

    Attributes:
        law: Kind of its law.
        name: Its name.
        arm: Name of its arm, or the model file.
        level: Its level of detail.
        paper: The paper that it is from; empty if it is from none.
        expect: What to expect of it.
    """

    law: str
    name: str
    arm: str
    level: str
    paper: str
    expect: str


def list_experiments(args: List) -> None:
    """List those of the shipped experiments that are asked for."""
    with errors():
        if args.tables:
            import_name("drake_rnn.cli.tables:require_tables")(args.tables)
        listings = shipped_listings()
        names = {"arm": args.arm, "law": args.law, "level": args.level}
        filters = {key: name for key, name in names.items() if name is not None}
        for key, name in filters.items():
            _require_known(key, name, {vars(each)[key] for each in listings})
        selection = [
            each
            for each in listings
            if args.word.lower() in f"{each.name} {each.paper} {each.expect}".lower()
            and filters.items() <= vars(each).items()
        ]
        if not selection:
            raise InvalidInputError("there is no such experiment; drake-rnn list shows all")
        print_table(listings_table(selection, out.width))
        if out.width < _ROOM:
            out.print(f"papers are shown from {_ROOM} columns on")
        if args.tables:
            import_name("drake_rnn.cli.tables:write_tables")(_sheet(selection), args.tables)


def _require_known(key: str, name: str, all_names: set[str]) -> None:
    """Raise an InvalidInputError for a name of an option that there is not."""
    if name in all_names:
        return
    available = import_name(_NAMES[key])
    if name not in (names := list(available() if callable(available) else available)):
        nearest = import_name("drake_rnn.inputs.messages:nearest")
        raise InvalidInputError(f"--{key}: no {name!r}; {nearest(name, names)}")


def shipped_listings() -> list[Listing]:
    """Return what the table says of the shipped experiments, law by law."""
    listings = map(_listing, EXPERIMENTS.glob("*/*.yaml"))
    return sorted(listings, key=lambda each: (each.law, each.name))


def _listing(file: Path) -> Listing:
    # Imported here, as the other command also tells whether it is installed.
    yaml = import_module("yaml")
    # The base loader leaves every scalar as the text that it is, which is all that is shown. Tests
    # hold the shipped documents, and this table, to how a run reads them.
    loader = vars(yaml).get("CBaseLoader", yaml.BaseLoader)
    document = yaml.load(file.read_bytes(), loader)
    arm = document["arm"]
    return Listing(
        law=document["law"]["kind"],
        name=document.get("name", file.stem),
        arm=arm if isinstance(arm, str) else arm["model"],
        level=document.get("level", "kinematic"),
        paper=document.get("paper", ""),
        expect=document.get("expect", ""),
    )


def _sheet(listings: list[Listing]) -> Any:
    """Return the table of experiments for files."""
    tables = import_module("drake_rnn.tables")
    names = ("law", "name", "arm", "level", "paper", "what to expect")
    sheet = tables.Sheet(
        tuple(tables.Column(tables.Heading(name), long=name in names[-2:]) for name in names)
    )
    sheet.rows += map(astuple, listings)
    return sheet


def listings_table(listings: list[Listing], width: int) -> Table:
    """Return a table of experiments for the terminal, in sections by law, within 80 characters.

    Args:
        listings: The experiments, sorted by law.
        width: Room for the table [characters]; papers are shown if there is enough.
    """
    wide = width >= _ROOM
    table = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for column in ("law: name", "arm", "level"):
        table.add_column(column, overflow="fold", no_wrap=True)
    for column in (*(["paper"] if wide else []), "what to expect"):
        table.add_column(column, overflow="fold")
    before = ""
    for each in listings:
        if each.law != before:
            table.add_section()
            table.add_row(f"[bold]{escape(each.law)}[/]")
            before = each.law
        sentences = (*([each.paper] if wide else []), each.expect)
        table.add_row(*map(escape, (each.name, each.arm, each.level, *sentences)))
    return table


@dataclass(frozen=True)
class Check:
    """What was looked at, and what came out.

    Attributes:
        name: What was looked at.
        state: ``ok``; ``missing`` for what need not be there; ``failed`` for what must work.
        detail: What was found.
        remedy: The command that brings what is missing; empty if nothing is.
    """

    name: str
    state: Literal["ok", "missing", "failed"]
    detail: str
    remedy: str = ""


#: Modules of each extra that users install, and what it brings.
EXTRAS: dict[str, tuple[tuple[str, ...], str]] = {
    "cluster": (("distributed",), "campaigns on a cluster"),
    "compiler": (("jax", "ziglang"), "steps in C where no compiler is installed"),
    "film": (("selenium",), "films"),
    "franka": (("pylibfranka",), "driving an FR3"),
    "gym": (("gymnasium",), "shields around environments"),
    "jax": (("jax",), "tuning, compiled laws"),
    "looks": (("example_robot_data", "fast_simplification"), "makers' meshes"),
    "mcap": (("mcap_ros2",), "recordings of ROS 2"),
    "parquet": (("pyarrow",), "Parquet"),
    "plan": (("ompl",), "plans to a goal"),
    "svg": (("svgelements",), "paths from drawings"),
    "xacro": (("xacro",), "robot models in xacro"),
}
#: The programs that some commands need: what they are for, and their package on Debian and Ubuntu.
_PROGRAM_USES = {
    "chromium": ("films", "chromium"),
    "chromedriver": ("films", "chromium-driver"),
    "C compiler": ("compiled laws", "gcc"),
    "dot": ("drawings of the wiring", "graphviz"),
    "ffmpeg": ("films in MP4", "ffmpeg"),
}
_COLOURS = {"ok": "green", "missing": "yellow", "failed": "red"}
#: Of which a run of 0.1 s is made.
_SHORT_RUN = "slc_nephroid_known"
#: It takes some seconds; of a machine on which it takes so long something is wrong [s].
_PATIENCE = 300


def examine_installation(args: Doctor) -> None:
    """Print what is installed and works; the status is 1 if something that must work does not."""
    checks = [
        *dependency_checks(),
        *extra_checks(),
        *program_checks(),
        *folder_checks(),
        *run_checks(),
    ]
    works = all(check.state != "failed" for check in checks)
    if args.as_json:
        typer.echo(json.dumps(_report(checks, works), indent=2))
    else:
        _print_checks(checks)
    if not works:
        raise typer.Exit(FAILED)


def _report(checks: list[Check], works: bool) -> dict[str, Any]:
    return {"works": works, "system": _system(), "checks": [asdict(check) for check in checks]}


def _system() -> str:
    return f"Python {platform.python_version()}, {platform.platform()}"


def _print_checks(checks: list[Check]) -> None:
    table = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0), title=_system(), title_justify="left")
    for column in ("what", "", "found, or the command that brings it"):
        table.add_column(column, overflow="fold")
    for check in checks:
        state = f"[{_COLOURS[check.state]}]{check.state}[/]"
        lines = filter(None, (check.detail, check.remedy))
        table.add_row(escape(check.name), state, escape("\n".join(lines)))
    print_table(table)


def dependency_checks() -> Iterator[Check]:
    """Compare the versions of what every installation has with their lower bounds."""
    yield Check("drake-rnn", "ok", version("drake-rnn"))
    for line in requires("drake-rnn") or []:
        requirement, _, marker = line.partition(";")
        name, _, bound = requirement.strip().partition(">=")
        if "extra" in marker:
            continue
        remedy = _installing(f"'{requirement.strip()}'")
        try:
            found = version(name)
        except PackageNotFoundError:
            yield Check(name, "failed", "not installed", remedy)
            continue
        if _numbers(found) < _numbers(bound):
            yield Check(name, "failed", f"{found}, older than {bound}", remedy)
        else:
            yield Check(name, "ok", found)


def _installing(packages: str) -> str:
    """Return the command that installs packages here, also where uv has made an environment."""
    if find_spec("pip") is None:
        return f"uv pip install --python {sys.executable} {packages}"
    return f"{sys.executable} -m pip install {packages}"


def _numbers(text: str) -> tuple[int, ...]:
    """Return the numbers at the beginning of a version."""
    release = re.match(r"[\d.]*", text)
    numbers = [int(number) for number in (release[0] if release else "").split(".") if number]
    while numbers and not numbers[-1]:
        numbers.pop()
    return tuple(numbers)


def extra_checks() -> Iterator[Check]:
    """Look for the modules of each extra; none needs to be there."""
    for extra, (modules, use) in EXTRAS.items():
        missing = [name for name in modules if find_spec(name) is None]
        if missing:
            remedy = _installing(packages_of(extra))
            yield Check(f"extra {extra}", "missing", f"for {use}; no {missing[0]}", remedy)
        else:
            yield Check(f"extra {extra}", "ok", f"for {use}")


def program_checks() -> Iterator[Check]:
    """Look for the programs that some commands need."""
    for name in PROGRAMS:
        use, package = _PROGRAM_USES[name]
        try:
            is_compiler = name == "C compiler"
            file = " ".join(c_compiler() or ()) if is_compiler else find_program(name)
        except InvalidInputError as error:
            yield Check(name, "failed", str(error), "unset CC")
            continue
        if not file:
            yield Check(name, "missing", f"for {use}", f"apt-get install {package}")
        else:
            yield Check(name, "ok", f"for {use}: {file}")


def folder_checks() -> Iterator[Check]:
    """Try to write where commands write: here, and to the cache."""
    try:
        cache = import_name("drake_rnn.inputs.files:cache_folder")()
    except ImportError:
        # What is missing is told already.
        return
    for name, folder, remedy in (
        ("current folder", Path.cwd(), "cd to a folder that can be written to, or give --out"),
        ("cache", cache, "export XDG_CACHE_HOME=FOLDER"),
    ):
        place = next(each for each in (folder, *folder.parents) if each.exists())
        try:
            with TemporaryDirectory(dir=place):
                pass
        except OSError as error:
            yield Check(name, "failed", f"{folder}: {error.strerror}", remedy)
        else:
            yield Check(name, "ok", str(folder))


def run_checks() -> Iterator[Check]:
    """Make a run of 0.1 s and its playback, in a process that may end in any way."""
    with TemporaryDirectory(prefix="drake_rnn_") as scratch:
        short = ("--duration", "0.1", "--set", "window=null", "--set", "accept=null")
        options = (*short, "--no-figures", "--quiet", "--out", scratch)
        command = (sys.executable, "-m", "drake_rnn", "run", _SHORT_RUN, *options)
        began = perf_counter()
        try:
            done = subprocess.run(
                command, capture_output=True, text=True, check=False, timeout=_PATIENCE
            )
            said, status = done.stderr.strip().splitlines(), done.returncode
        except subprocess.TimeoutExpired:
            said, status = [f"not done after {_PATIENCE} s"], FAILED
        took = f"{perf_counter() - began:.1f} s with its start"
        names = {"a run of 0.1 s": "result.npz", "its playback": "playback.html"}
        for name, file in names.items():
            made = Path(scratch) / _SHORT_RUN / file
            if made.is_file():
                size = f"{made.stat().st_size} B"
                yield Check(name, "ok", took if file == "result.npz" else size)
            else:
                detail = said[-1] if said else f"ended with the status {status}"
                yield Check(name, "failed", detail, " ".join(("drake-rnn", *command[3:-1], "out")))

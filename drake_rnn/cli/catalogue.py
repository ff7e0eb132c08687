"""Commands that look something up, or write a document to begin with.

- What there is to name in a document: experiments, arms, laws and paths.
- What is known of an arm, with a picture of it.
- An experiment's document, with comments that explain its keys.
- The files that a law, a path or an environment of a user's own starts from.
- What a law of this package needs, written into its sources, each with what is to be filled in.
- JSON schemas of documents, for editors.
- The wiring of a diagram, as a picture by Graphviz.
"""

from __future__ import annotations

import json
import keyword
import os
import re
import shutil
import subprocess
from collections.abc import Iterable, Mapping
from functools import partial
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from shlex import quote
from textwrap import indent, wrap
from typing import Any, NamedTuple

import typer
from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from ..diagrams import wiring_graph
from ..errors import InvalidInputError
from ..experiment import (
    document_class,
    key_meanings,
    load_experiment,
    read_document,
    section_meanings,
)
from ..experiment.components import ORIGINS
from ..experiment.files import checked_changes, schema_line, set_key
from ..inputs.documents import construct, parse_yaml, to_yaml
from ..inputs.keys import Key, keys_of, shorten, summary_of
from ..inputs.kinds import Kinds, find_entry_points
from ..inputs.messages import nearest
from ..inputs.packages import import_name
from ..laws import LAWS
from ..measures import superscript
from ..paths import PATHS
from ..playback.arm_drawing import NoPictureError, write_arm_picture
from ..robot import arm as robot
from ..robot.arm_description import ArmDescription
from ..robot.clearance.arm_clearance import fit_arm
from ..robot.load_arm import arm_report, load_arm, shipped_arms
from ..robot.postures import proposed_home
from ..runs import build_diagram
from ..runs.folder import replacing, require_output, require_replaceable, written_whole
from .arguments import Arm, Arms, Compile, Laws, New, Paths, PrintSchema, Show
from .console import err, errors, out, print_table, status
from .saving import changes_of, require_writable
from .tables import arm_joints_sheet, arm_table, fits_table, print_sheet

# The units in the meaning of a key.
_UNITS = re.compile(r"\[[^\]]*\]")


def list_arms(args: Arms) -> None:
    """List the shipped arms, and the keys that describe an arm."""
    with errors():
        table = Table(box=SIMPLE_HEAD)
        for column in ("arm", "joints", "task frame E", "tool"):
            table.add_column(column)
        for name in shipped_arms():
            arm = load_arm(name)
            tool = f"ball of {arm.tool.ball * 1e3:g} mm" if arm.tool else "none"
            table.add_row(*map(escape, (name, str(len(arm.joints)), arm.frame, tool)))
        print_table(table)
        out.print("drake-rnn arm NAME shows all that is known of one. Keys of arm in a document:")
        print_table(keys_table(keys_of(ArmDescription)))


def describe_arm(args: Arm) -> None:
    """Print what is known of the arm, and write its picture."""
    with errors():
        fields: dict[str, Any] = {}
        for key, value in checked_changes(_changes_of_arm(args)).items():
            set_key(fields, key, value)
        if args.fit is not None:
            return _fit_arm(load_arm(args.model, **fields), args)
        report = arm_report(load_arm(args.model, **fields))
        print_sheet(arm_joints_sheet(report))
        print_table(arm_table(report))
        for warning in report.warnings:
            err.print(f"[yellow]warning[/] {escape(warning)}")
        if args.picture:
            file = args.out_folder / f"{report.arm.name}.png"
            require_writable(args.out_folder)
            try:
                write_arm_picture(report.arm, report.home, file)
            except NoPictureError as error:
                err.print(f"[yellow]warning[/] no {escape(str(error))}")
            else:
                out.print(f"picture  {file}", markup=False)
    return None


def _fit_arm(arm: robot.Arm, args: Arm) -> None:
    """Fit capsules to what an arm's model has, one for each body and fine ones, and write them."""
    file = Path(str(args.fit))
    require_writable(file.parent)
    home = proposed_home(arm) if arm.home is None else arm.home
    frame = "" if args.frame is None else f" --frame {args.frame}"
    gripper = arm.description.gripper
    if gripper is not None:
        frame += f" --set gripper.model={Path(gripper.model).name}"
    made_by = f"drake-rnn arm {arm.model.name}{frame} --fit {file.name}"
    made_by += f" --most {args.most} --effort {args.effort}"
    with status(f"fitting capsules, some {10 * args.effort**2} s for each link"):
        text, fits = fit_arm(arm, home, args.most, made_by, args.effort)
    print_table(fits_table(fits))
    file.write_text(text)
    out.print(f"capsules  {file}", markup=False)


def _changes_of_arm(args: Arm) -> dict[str, Any]:
    """Return the keys of the arm that options give, by dotted key."""
    overrides: dict[str, Any] = {} if args.frame is None else {"frame": args.frame}
    if args.tool is not None:
        overrides["tool"] = parse_yaml(args.tool, "--tool")
    changes = changes_of(args.changes)
    for key in overrides.keys() & changes.keys():
        raise InvalidInputError(f"--set: {key} is given twice, as --{key} gives it too")
    return overrides | changes


def list_laws(args: Laws) -> None:
    """List the laws, or explain the keys of one."""
    with errors():
        laws = _with_own(LAWS, args.name)
        lines = {kind: summary_of(cls) for kind, cls in laws.items()}
        keys = {kind: keys_of(cls, ("kind", *ORIGINS)) for kind, cls in laws.items()}
        _print_kinds("law", lines, keys, args.name)


def list_paths(args: Paths) -> None:
    """List the paths, or explain the keys of one."""
    with errors():
        paths = _with_own(PATHS, args.name)
        lines = {kind: summary_of(cls) for kind, cls in paths.items()}
        keys = {kind: keys_of(cls) for kind, cls in paths.items()}
        _print_kinds("path", lines, keys, args.name)


def _with_own(kinds: Kinds[Any], name: str | None) -> dict[str, type]:
    """Return the classes by kind, with one of a user's own that is asked for by its name."""
    all_kinds: dict[str, type] = dict(kinds)
    if (
        name is not None
        and name not in all_kinds
        and (":" in name or name in find_entry_points(kinds.group).names)
    ):
        all_kinds[name] = kinds.named_by({"kind": name})
    return all_kinds


def _print_kinds(
    section: str, lines: dict[str, str], keys: dict[str, list[Key]], name: str | None
) -> None:
    """Print one line and the keys for each kind, or a table of the keys of one."""
    if name is not None:
        if name not in keys:
            raise InvalidInputError(f"{section}: no {name!r}; {nearest(name, list(keys))}")
        out.print(f"[bold]{name}[/]  {escape(lines[name])}")
        print_table(keys_table(keys[name]))
        return
    table = Table(box=SIMPLE_HEAD)
    table.add_column(section, no_wrap=True)
    table.add_column("what it is, and its keys (with their defaults)")
    for kind, line in lines.items():
        text = ", ".join(
            key.name if key.default is None else f"{key.name} ({key.default})" for key in keys[kind]
        )
        table.add_row(kind, f"{escape(line)}\n[dim]{escape(text)}[/]")
    print_table(table)


def _superscript(units: re.Match[str]) -> str:
    return superscript(units[0])


def keys_table(keys: list[Key]) -> Table:
    """Return a table of keys with defaults and meanings."""
    table = Table(box=SIMPLE_HEAD)
    table.add_column("key", no_wrap=True)
    table.add_column("default", overflow="fold")
    table.add_column("meaning", ratio=1)
    for key in keys:
        default = "must be given" if key.default is None else key.default
        table.add_row(*map(escape, (key.name, default, _UNITS.sub(_superscript, key.meaning))))
    return table


_WIDTH, _BESIDE = 80, "beside"


def show(args: Show) -> None:
    """Print the document, or draw the wiring."""
    with errors():
        if args.diagram is None:
            typer.echo(schema_line("experiment") + comment(args.experiment), nl=False)
            return
        diagram, _ = build_diagram(load_experiment(args.experiment))
        write_graph(wiring_graph(diagram), args.diagram)


def comment(experiment: str) -> str:
    """Return an experiment's document as YAML with comments that explain its keys.

    Raises:
        InvalidInputError: If there is no such experiment, or a key is wrong.
    """
    document = read_document(experiment)
    construct(document_class(document), document, "")
    meanings = key_meanings()
    order = [name for name in meanings if name in document]
    blocks = []
    for name in order:
        value = document[name]
        inner = section_meanings(name, value)
        text = _comment(meanings[name], 0)
        if isinstance(value, Mapping) and value and inner:
            text += f"{name}:\n" + "".join(_entry(k, v, inner.get(k, "")) for k, v in value.items())
        else:
            text += _line(name, value)
        blocks.append(text)
    return "\n".join(blocks)


def _entry(key: str, value: Any, meaning: str) -> str:
    return _comment(meaning, 2) + indent(_line(key, value), "  ")


def _line(key: str, value: Any) -> str:
    # Beside another collection a plain value has a line of its own; alone it would be in braces.
    return to_yaml({key: value, _BESIDE: []}).removesuffix(f"{_BESIDE}: []\n")


def _comment(meaning: str, depth: int) -> str:
    begin = f"{' ' * depth}# "
    lines = wrap(shorten(meaning), _WIDTH, initial_indent=begin, subsequent_indent=begin)
    return "".join(f"{line}\n" for line in lines)


_LAW_TEMPLATES = files("drake_rnn.cli") / "templates" / "shipped_law"
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
_NAME_LINE = r'^    "?(\w+)"?,$'
_ENTRIES = (
    _Entry(
        *(_LAWS, r"from \.\.inputs\.kinds .*", "$", r"^from \.([\w.]+) import", "my_law"),
        "from .my_law import MyLaw\n",
    ),
    _Entry(
        _LAWS, r"    \{", r"    \},", r'^ +"(\w+)": \w+,$', "my_law", '        "my_law": MyLaw,\n'
    ),
    _Entry(_LAWS, r"__all__ = \[", r"\]", _NAME_LINE, "MyLaw", '    "MyLaw",\n'),
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
    contents = {
        root / named(file): named((_LAW_TEMPLATES / each).read_text(encoding="utf-8"))
        for each, file in _FILES.items()
    }
    _require_free(contents)
    for entry in _ENTRIES:
        file = root / entry.file
        text = contents.get(file) or file.read_text(encoding="utf-8")
        contents[file] = _enter(text, entry._replace(name=named(entry.name)), named(entry.text))
    for file, text in contents.items():
        file.parent.mkdir(exist_ok=True)
        with written_whole(file) as stream:
            stream.write(text)
    return list(contents)


def _require_free(files: Iterable[Path]) -> None:
    for file in files:
        # A package hides a module of the same name.
        for place in (file, file.with_suffix("")) if file.suffix == ".py" else (file,):
            if os.path.lexists(place):
                raise InvalidInputError(f"{place}: is there already, and is not overwritten")


def _enter(text: str, entry: _Entry, lines: str) -> str:
    begin = re.search(f"^{entry.opens}$", text, re.M)
    end = begin and re.compile(f"^{entry.closes}", re.M).search(text, begin.end() + 1)
    if begin is None or end is None:
        raise InvalidInputError(f"{entry.file}: has no {entry.opens!r}; write there {lines!r}")
    at = end.start()
    if entry.named:
        for match in re.compile(entry.named, re.M).finditer(text, begin.end(), at):
            if _order(match[1]) > _order(entry.name):
                at = match.start()
                break
    return text[:at] + lines + text[at:]


def _order(name: str) -> tuple[bool, bool, str]:
    """Return what names are sorted by: constants come first, then classes."""
    return not name.isupper(), not name[0].isupper(), name.lower()


#: What makes the schema of each kind of document; each imports much.
_MADE_BY = {
    "experiment": "drake_rnn.experiment.keys:experiment_schema",
    "campaign": "drake_rnn.jobs.plan:campaign_schema",
    "claims": "drake_rnn.claims.claims:claims_schema",
}
#: Kinds of documents that have a schema.
DOCUMENTS = tuple(_MADE_BY)


def print_schema(args: PrintSchema) -> None:
    """Print the schema of a kind of documents."""
    typer.echo(schema_text(args.document), nl=False)


def schema_text(document: str) -> str:
    """Return the JSON schema of a kind of documents, one of `DOCUMENTS`, as text."""
    return json.dumps(import_name(_MADE_BY[document])(), indent=1) + "\n"


_TEMPLATES = files("drake_rnn.cli") / "templates"
#: What the first line of the document names.
_SCHEMA = "experiment.schema.json"


def write_start(own: str, name: str, folder: Path) -> list[Path]:
    """Write a module, a document, its schema and a test, which run as they are.

    Args:
        own: What the module is to hold: a law, a path or an environment.
        name: Name of the module.
        folder: Folder to write to.

    Returns:
        The files.

    Raises:
        InvalidInputError: If the name is taken, or a file exists or cannot be written.
    """
    title = "".join(word.capitalize() for word in name.split("_"))
    contents = {}
    for template in sorted((_TEMPLATES / own).iterdir(), key=lambda each: each.name):
        file = folder / template.name.removesuffix(".txt").replace(f"my_{own}", name)
        text = template.read_text(encoding="utf-8").replace(f"my_{own}", name)
        contents[file] = text.replace(f"My{own.capitalize()}", title)
    # A schema is made anew: the language server of an editor finds it beside the document.
    schema = {folder / _SCHEMA: schema_text("experiment")}
    for file in contents:
        if os.path.lexists(file):
            raise InvalidInputError(f"{file}: already exists, and is not overwritten")
    for file in schema:
        require_replaceable(file)
    if find_spec(name) is not None:
        raise InvalidInputError(f"name: there is a Python module {name!r} already; take another")
    try:
        for file, text in (contents | schema).items():
            with written_whole(file) as stream:
                stream.write(text)
    except OSError as error:
        raise InvalidInputError(f"{folder}: {error.strerror}") from None
    return [*contents, *schema]


def new(args: New) -> None:
    """Write what is asked for, and say what to do next."""
    what, name = args.what, args.name
    with errors():
        if args.shipped and what != "law":
            raise InvalidInputError(f"--shipped: is for a law, not for {what}")
        if not re.fullmatch(r"[a-z][a-z0-9]*(_[a-z0-9]+)*", name) or keyword.iskeyword(name):
            raise InvalidInputError(
                f"name: must be a module's name in lower case, e.g. my_law, not {name!r}"
            )
        write = write_shipped if args.shipped else partial(write_start, what)
        for file in write(name, Path()):
            out.print(escape(f"written  {file}"), soft_wrap=True)
    then = f"drake-rnn run {name}.yaml; pytest test_{name}.py"
    if args.shipped:
        then = f"fill in what says FILL IN; python docs/make_schemes.py; drake-rnn run {name}"
    out.print(f"next     {then}", soft_wrap=True)


def compile_law(args: Compile) -> None:
    """Write the law of an experiment as files in C, and say what their test has shown."""
    with errors():
        require_writable(args.to, "--to")
        experiment = load_experiment(args.experiment, changes_of(args.changes))
        with status("compiling"):
            report = import_name("drake_rnn.law_files:write_law")(experiment, args.to, args.samples)
    for name in import_name("drake_rnn.law_files:FILES"):
        out.print(escape(f"written  {args.to / name}"), soft_wrap=True)
    for line in report or ["no C compiler is found; nothing was measured"]:
        out.print(escape(f"test     {line}"), soft_wrap=True)
    folder, build = quote(str(args.to)), quote(str(args.to / "build"))
    command = f"cmake -S {folder} -B {build} && cmake --build {build} && {build}/replay"
    out.print(escape(f"build    {command}"), soft_wrap=True)


#: What Graphviz can write of what is of use here.
_FORMATS = (".svg", ".png", ".pdf")


def write_graph(graph: str, file: Path) -> None:
    """Write a graph: its text, or a picture, as the file's name says.

    Raises:
        InvalidInputError: If the file has another ending, Graphviz is needed and not installed, or
            the file cannot be written.
    """
    if file.suffix not in (".dot", *_FORMATS):
        endings = ", ".join((".dot", *_FORMATS))
        raise InvalidInputError(f"--diagram: must end with one of {endings}, not {file.name!r}")
    program = shutil.which("dot")
    if file.suffix != ".dot" and program is None:
        raise InvalidInputError(
            f"--diagram: {file.suffix} needs Graphviz, whose program dot is not installed; "
            "install the package graphviz, or write a .dot file"
        )
    require_output(file, "--diagram")
    try:
        if file.suffix == ".dot" or program is None:
            with written_whole(file) as stream:
                stream.write(graph)
            return
        process = subprocess.run(
            [program, f"-T{file.suffix[1:]}"],
            input=graph.encode(),
            capture_output=True,
            check=True,
        )
        with replacing(file) as new:
            new.write_bytes(process.stdout)
    except OSError as error:
        raise InvalidInputError(f"--diagram: {file}: {error.strerror}") from None

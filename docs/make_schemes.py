"""Write what pages say of every scheme: python docs/make_schemes.py.

Made from classes, documents and the schemes' own pages: the rows of experiments, the traits, the
keys of laws, the sections of the reference, the list of schemes and the JSON schemas of documents.
What a row says that no class knows, such as a name, a measured cost or how to choose a key, stays
as it is on the page.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, get_args

from drake_rnn import LAWS, Experiment, Law, load_experiment
from drake_rnn.cli.catalogue import (
    DOCUMENTS,
    schema_text,
)
from drake_rnn.experiment import read_document
from drake_rnn.experiment.components import ORIGINS
from drake_rnn.inputs.keys import Only, keys_of, meanings_of
from drake_rnn.robot.limits import LIMIT_UNITS

ROOT = Path(__file__).parents[1]
EXPERIMENTS = "diagrams/experiments/README.md"
CHOOSING = "docs/choosing.md"
KEYS = "docs/experiments.md"
REFERENCE = "docs/reference/laws.rst"
INDEX = "docs/index.md"
#: First words of what is made: of a table its head, of a list the line before.
_EXPERIMENTS_HEAD = "| experiment | arm | what to expect | paper |"
_TRAITS_HEAD = "| scheme, and an experiment with it | sees |"
_KEYS_HEAD = "| kind | keys (default) |"
_INDEX_HEAD = "Each page has the problem and the equations"
# Defaults that are sections, or that no document gives.
_ELSEWHERE = {"secondary": "see below", "measurement": "follows from `sensing`"}
# Signals that show the arm's structure.
_STRUCTURE = ("J", "Jdot_v", "J_omega", "M")


def pages() -> dict[str, str]:
    """Return the pages as they should be, by their path."""
    text = {page: (ROOT / page).read_text() for page in (EXPERIMENTS, CHOOSING, KEYS, INDEX)}
    return {
        EXPERIMENTS: _remade(text[EXPERIMENTS], _EXPERIMENTS_HEAD, _experiment_rows),
        CHOOSING: _remade(text[CHOOSING], _TRAITS_HEAD, lambda above, rows: map(_traits_row, rows)),
        KEYS: _remade(text[KEYS], _KEYS_HEAD, lambda above, rows: map(_keys_row, sorted(LAWS))),
        INDEX: re.sub(
            rf"(?<=\n)({_INDEX_HEAD}[^|]*?\n\n)(?:- .*\n)*", rf"\1{_scheme_list()}", text[INDEX]
        ),
        REFERENCE: _reference((ROOT / REFERENCE).read_text()),
        **{f"diagrams/schemas/{name}.json": schema_text(name) for name in DOCUMENTS},
        **{f"docs/schemes/{page}": _gains(page) for page in sorted(set(map(page_of, LAWS)))},
    }


def _remade(text: str, head: str, rows_of: Callable[[str, list[str]], Iterator[str]]) -> str:
    """Return a page with other rows below each table's head, given what is above and the rows."""
    made, (first, *parts) = [], re.split(rf"^({re.escape(head)}.*\n\|[-|]*\|\n)", text, flags=re.M)
    for found, rest in zip(parts[::2], parts[1::2], strict=True):
        rows = re.findall(r"\A(?:\|.*\n)*", rest)[0]
        made += [first, found, *(f"{row}\n" for row in rows_of(first, rows.splitlines()))]
        first = rest.removeprefix(rows)
    return "".join(made) + first


def _experiment_rows(above: str, rows: list[str]) -> Iterator[str]:
    """Yield the rows of the folder that the text above names last, one for each document."""
    folder = re.findall(r"^`(\w+)/`", above, re.M)[-1]
    for file in sorted((ROOT / EXPERIMENTS).parent.glob(f"{folder}/*.yaml")):
        name, document = file.stem, read_document(file.stem)
        arm = document["arm"] if isinstance(document["arm"], str) else document["arm"]["model"]
        # A model in a file beside the document.
        arm = Path(arm).name
        expect = document["expect"] + " (full dynamics)" * (document.get("level") == "dynamic")
        yield f"| [{name}]({folder}/{name}.yaml) | {arm} | {expect} | {document['paper']} |"


def _traits_row(row: str) -> str:
    """Return a row of the traits; its name with the experiment, and its cost, stay."""
    scheme, *_, cost = (cell.strip() for cell in row[1:-1].split("|"))
    experiment = load_experiment(re.findall(r"`(\w+)`$", scheme)[0])
    return f"| {' | '.join((scheme, *traits(experiment), cost))} |"


def traits(experiment: Experiment) -> tuple[str, str, str, str, str]:
    """Return what a scheme sees and keeps, its task, whether joints return, and its noise."""
    law, document = experiment.law, experiment.document
    sees = [signal for signal in _STRUCTURE if signal in law.inputs.parts]
    sees += ["J by its reference"] if law.joint_preview is not None else []
    # Noise on top of the law's command is not the law's, a filter behind it is.
    kept = law.keeps if document.filter is None else experiment.guarantees.arm.limits
    return (
        ", ".join(sees) or "none",
        _span_of(kept),
        _task_of(law),
        _pulled_to(law),
        "no" if document.dither is None else "yes",
    )


def _span_of(kept: tuple[str, ...]) -> str:
    """Return names of limits: none, one, or the first and the last."""
    order = list(LIMIT_UNITS)
    places = [order.index(name) for name in kept]
    assert places == list(range(places[0], places[0] + len(places))) if places else True
    return " to ".join(dict.fromkeys((kept[0], kept[-1]))) if kept else "none"


def _task_of(law: Law) -> str:
    if "normal_force" in law.inputs.parts:
        return "pose, force"
    sizes = fields_of_class(type(law)).get("task_size")
    turns = "R_WE" in law.inputs.parts or (sizes is not None and 6 in get_args(sizes.annotation))
    return "position, pose" if turns else "position"


def _pulled_to(law: Any) -> str:
    """Return where a law pulls the joints that its task leaves free."""
    if hasattr(law, "target"):
        return "to the target"
    weights = [getattr(law, "return_gain", 0.0), getattr(law, "return_weight", 0.0)]
    if hasattr(law, "secondary"):
        weights.append(law.secondary.posture)
    # The minimum acceleration norm is the scheme without its other terms.
    return "yes" if max(weights) > 0.0 and getattr(law, "scheme", "") != "man" else "no"


def _keys_row(kind: str) -> str:
    """Return the row of a law's keys, with those of its sections."""
    sections = sections_of(LAWS[kind])
    told = []
    for key in keys_of(LAWS[kind], ("kind", *ORIGINS)):
        inner = keys_of(sections[key.name]) if key.name in sections else []
        parts = [text for text in (key.default,) if text is not None and text[0] != "{"]
        parts += [", ".join(f"`{part.name}` {part.default or 'to be given'}" for part in inner)] * (
            len(inner) > 0
        )
        told.append(f"`{key.name}`" + f" ({'; '.join(parts)})" * (len(parts) > 0))
    return f"| [`{kind}`](schemes/{page_of(kind)}#gains) | {', '.join(told)} |"


def _gains(page: str) -> str:
    """Return a page with a row for each key of each law that it describes."""
    text = (ROOT / "docs" / "schemes" / page).read_text()
    for kind in filter(lambda kind: page_of(kind) == page, LAWS):
        text = _remade(text, f"| key of `{kind}` |", partial(_gain_rows, kind))
    return text


def _gain_rows(kind: str, above: str, rows: list[str]) -> Iterator[str]:
    """Yield the rows of a law's keys: in the order of the page, and after these any others."""
    written = {row.split("`")[1]: [cell.strip() for cell in split_row(row)] for row in rows}
    keys: dict[str, tuple[str | None, str]] = {}
    sections = sections_of(LAWS[kind])
    acts_with = {name: said.only for name, said in meanings_of(LAWS[kind]).items()}
    for key in keys_of(LAWS[kind], ("kind", *(set(ORIGINS) - {"measurement"}))):
        keys[key.name] = (_ELSEWHERE.get(key.name, key.default), key.meaning)
        for part in keys_of(sections[key.name]) if key.name in sections else ():
            keys[f"{key.name}.{part.name}"] = part.default, part.meaning
            acts_with[f"{key.name}.{part.name}"] = part.only
    for name in sorted(keys, key=lambda name: [*written, name].index(name)):
        default, meaning = keys[name]
        cell, default = f"`{name}`", "must be given" if default is None else default
        if name in written:
            cell, before, meaning = written[name]
            default = before if _number(before) == _number(default) else default
        yield f"| {cell} | {default} | {_with_conditions(meaning, acts_with.get(name, ()))} |"


def _with_conditions(meaning: str, conditions: Sequence[Only]) -> str:
    """Return a meaning that ends in what its key acts with, as its class says."""
    if not conditions:
        return meaning
    told = (f"`{each.key}: {each}`" if each.values else f"`{each.key}`" for each in conditions)
    bare = re.sub(r"\.?( Acts only with .*)?$", "", meaning)
    return f"{bare}. Acts only with {' and '.join(told)}"


def split_row(row: str) -> list[str]:
    """Return the cells of a row of a table."""
    return re.split(r"(?<!\\)\|", row)[1:-1]


def _number(cell: str) -> float | str:
    """Return the number that a cell writes, in whatever way; or its words."""
    try:
        return float(cell)
    except ValueError:
        return cell


def sections_of(law: type[Law]) -> dict[str, type]:
    """Return the classes of a law's fields that are sections of a document, by name."""
    return {
        name: kind
        for name, field in fields_of_class(law).items()
        for kind in (field.annotation, *get_args(field.annotation))
        if name not in ORIGINS and fields_of_class(kind)
    }


def fields_of_class(cls: Any) -> dict[str, Any]:
    """Return the fields of a class that checks them, by name; none of any other."""
    return dict(getattr(cls, "__pydantic_fields__", {}))


def page_of(kind: str) -> str:
    """Return the name of the page in docs/schemes/ with the table of a law's keys.

    Raises:
        LookupError: If there is none.
    """
    for file in sorted((ROOT / "docs" / "schemes").glob("*.md")):
        if f"| key of `{kind}` |" in file.read_text():
            return file.name
    raise LookupError(
        f"docs/schemes/{kind}.md: write the page, with a table that begins | key of `{kind}` | "
        "default | what it does, how to choose it |"
    )


def _scheme_list() -> str:
    files = sorted((ROOT / "docs" / "schemes").glob("*.md"))
    titles = {file.name: file.read_text().partition("\n")[0].removeprefix("# ") for file in files}
    return "".join(f"- [{title}](schemes/{name})\n" for name, title in titles.items())


def _reference(text: str) -> str:
    """Return the page of the reference with a section for each law, between the others."""
    before, after = text.partition("Adaptive\n--------")[0], text.partition("Sections of laws\n")[2]
    sections = [
        f"{law.__name__}\n{'-' * len(law.__name__)}\n\n"
        f".. automodule:: {law.__module__}\n   :no-members:\n   :no-index:\n\n"
        f".. currentmodule:: drake_rnn\n\n"
        f".. autoclass:: {law.__name__}\n   :show-inheritance:\n\n"
        for law in LAWS.values()
    ]
    return f"{before}{''.join(sections)}Sections of laws\n{after}"


def main() -> None:
    """Write the pages."""
    for page, text in pages().items():
        (ROOT / page).write_text(text)


if __name__ == "__main__":
    main()

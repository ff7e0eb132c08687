"""Print the page of what goes with what: python docs/make_pairs.py > docs/compatibility.md."""

from drake_rnn.features import FEATURES
from drake_rnn.features.pairs import PAIRS, TRAITS, Pair

_HEAD = """\
# What goes with what

<!-- Made by `python docs/make_pairs.py > docs/compatibility.md`; a test compares the two. -->

An experiment has a law and, as it likes, features: a camera, obstacles, a filter and so on. It runs
as a diagram in Drake; some also run in a batch, compiled, in a live page or on a robot. These
tables list everything that cannot be combined, with the sentence that says so. What they do not
list can be combined. They are printed from one table, `drake_rnn/features/pairs.py`, which is asked
first: before anything else of a document is made, and by `AddLoop`. A row that says "in documents"
does not bind a diagram of your own.

## Features at a glance

`no`: cannot be combined. `part`: not with every setting; the table below says which. An empty cell:
goes together, if the law can do both.

"""
_FEATURES = {
    "camera": "camera",
    "faults": "joint locks",
    "dither": "dither",
    "disturbance": "disturbance",
    "filter": "filter",
    "sensing": "sensing",
    "environment": "contact",
    "obstacles": "avoided obstacles",
    "safety": "safety",
    "second": "second arm",
    "integrator": "integrator",
}
_FEATURES |= {each.key: each.key for each in FEATURES if each.section is not None}
# What these do about obstacles: safety avoids them if it is told to, a second arm always.
_AVOIDING = {"safety": "part", "second": "no"}
_SECTIONS = (
    ("Features with each other", lambda kinds: not {"law", "host"} & kinds),
    ("Features and laws", lambda kinds: "law" in kinds and "host" not in kinds),
    ("Where an experiment runs", lambda kinds: "host" in kinds),
)


def page() -> str:
    """Return the text of the page."""
    return _HEAD + _matrix() + "".join(_section(*each) for each in _SECTIONS)


def _matrix() -> str:
    names = [f"`{name}`" for name in _FEATURES]
    rows = ["| | " + " | ".join(names) + " |", "|---" * (1 + len(names)) + "|"]
    for one in _FEATURES:
        cells = [_cell(one, other) for other in _FEATURES]
        rows.append(f"| `{one}` | " + " | ".join(cells) + " |")
    return "\n".join(rows) + "\n"


def _cell(one: str, other: str) -> str:
    """Return whether two features, by their sections, exclude each other: no, part or nothing."""
    if one == other:
        return "·"
    whole = {_FEATURES[one], _FEATURES[other]}
    rows = [pair for pair in PAIRS if not pair.needs and _of(pair) == {one, other}]
    if any({pair.one, pair.other} == whole for pair in rows):
        return "no"
    for avoiding, among in ((one, other), (other, one)):
        if avoiding in _AVOIDING and not rows and among != "obstacles":
            found = _cell("obstacles", among)
            return min(found, _AVOIDING[avoiding], key=("", "part", "no").index)
    return "part" if rows else ""


def _of(pair: Pair) -> set[str]:
    # A feature without a trait of its own is named by its key.
    return {TRAITS[name].of if name in TRAITS else name for name in (pair.one, pair.other)}


def _section(title: str, belongs) -> str:
    rows = [pair for pair in PAIRS if belongs(_of(pair))]
    head = f"\n## {title}\n\n| this | | with this | is refused with |\n|---|---|---|---|\n"
    return head + "".join(map(_row, rows))


def _row(pair: Pair) -> str:
    relation = "needs" if pair.needs else "does not go with"
    where = " (in documents)" if pair.documents_only else ""
    sentence = pair.sentence().replace("|", "\\|").replace("`", "")
    return f"| {pair.one} | {relation} | {pair.other} | `{sentence}`{where} |\n"


if __name__ == "__main__":
    print(page(), end="")

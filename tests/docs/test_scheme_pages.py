"""The pages of the schemes and the page of choosing one say what the code says."""

import re
import runpy
from functools import cache

import pytest
from doc_pages import ROOT, fenced, prose, spans, tables, text_of

from drake_rnn import LAWS, load_experiment, shipped_experiments
from drake_rnn.claims import SCHEMES, read_claims
from drake_rnn.experiment import parse_change, read_document

PAGES = sorted(str(file.relative_to(ROOT)) for file in (ROOT / "docs" / "schemes").glob("*.md"))
CHOOSING = "docs/choosing.md"
#: Experiments of the table of traits.
TRAITS = re.findall(r"<br>`(\w+)` \|", text_of(CHOOSING))
#: What makes the pages, and what it knows of them.
MADE = runpy.run_path(str(ROOT / "docs" / "make_schemes.py"))
page_of, EXPERIMENTS = MADE["page_of"], MADE["EXPERIMENTS"]
#: Where each scheme page's section of changes begins from.
_BASE = re.compile(r"changes of\s+`drake-rnn run (\w+)`")
_CHANGE = re.compile(r"(?:law|limits|integrator)\.[\w.]+=\S+")
#: Head of the table of what goes wrong with a key.
WRONG = ["key", "too small", "too large"]
_CLAIM = re.compile(r"(?:slc|jdf|mf|rec|sa)-\w[\w.]*")


@cache
def claims():
    """Names of all claims, which take a second to read."""
    return {claim.id for scheme in SCHEMES for claim in read_claims(scheme).claims}


def only(page, what, found):
    """Return the one that a page has of something; what it lacks is said."""
    assert len(found) == 1, f"{page}: write {what} once, not {len(found)} times"
    return found[0]


def gain_table(kind):
    """Return page and rows of the table of a law's keys."""
    page = f"docs/schemes/{page_of(kind)}"
    found = [rows for head, rows in tables(page) if head[0] == f"key of `{kind}`"]
    return page, only(page, f"the table | key of `{kind}` |", found)


@pytest.mark.parametrize("page", PAGES)
@pytest.mark.long
def test_every_change_that_goes_wrong_can_be_run(page):
    base = only(page, "changes of `drake-rnn run EXPERIMENT`", _BASE.findall(prose(page)))
    wrong = [rows for head, rows in tables(page) if head == WRONG]
    rows = only(page, f"| {' | '.join(WRONG)} |", wrong)
    gains = [found for head, found in tables(page) if head[0].startswith("key of")]
    keys = {spans(row[0])[0] for found in gains for row in found}
    assert all(len(row) == 3 and spans(row[0])[0] in keys for row in rows)
    for text in [span for row in rows for cell in row[1:] for span in spans(cell)]:
        changes = dict(parse_change(part) for part in text.split() if _CHANGE.fullmatch(part))
        if changes and "--set" not in text:
            load_experiment(base, changes)


@pytest.mark.parametrize("page", PAGES)
def test_a_page_has_its_parts(page):
    titles = re.findall(r"^## (.*)$", prose(page), re.MULTILINE)
    for part in ("Problem and equations", "Symbols", "Gains", "A minimal experiment"):
        assert part in titles, part
    assert any(title.startswith(("Corrected", "What is not as")) for title in titles)
    assert any(title.startswith("What it does not") or "do not do" in title for title in titles)
    assert titles[-1] in ("Paper", "Sources")
    assert "```math\n" in text_of(page)


@pytest.mark.parametrize("page", [*PAGES, CHOOSING])
def test_every_claim_that_is_named_exists(page):
    named = {span for span in spans(prose(page)) if _CLAIM.fullmatch(span)}
    assert named <= claims()


# Symbols.


def shapes_of(kind):
    """Return the shapes of state and inputs by name, of experiments with a law."""
    found = {}
    for law in (load_experiment(name).law for name in experiments_of(kind)):
        for layout in (law.state, law.inputs):
            for part, (_, shape) in layout.parts.items():
                found.setdefault(part, set()).add(
                    (shape, law.limits.size, getattr(law, "task_size", 3))
                )
    return found


def experiments_of(kind):
    """Return a law's experiments in the table of traits and in the commands of its page."""
    commands = "".join(block for _, block in fenced(gain_table(kind)[0], "sh"))
    return [
        name
        for name in shipped_experiments()
        if (name in TRAITS or re.search(rf"\b{name}\b", commands))
        and read_document(name)["law"]["kind"] == kind
    ]


@pytest.mark.parametrize("kind", LAWS)
def test_every_symbol_is_a_signal_or_a_key_and_has_its_shape(kind):
    page, rows = gain_table(kind)
    keys = {spans(row[0])[0] for row in rows} | {"period", "limits", "home"}
    known = shapes_of(kind)
    keys |= {f"limits.{name}" for name in ("velocity", "acceleration")}
    found = [rows for head, rows in tables(page) if head[1:4] == ["here", "unit", "shape"]]
    symbols = only(page, "| symbol | here | unit | shape | meaning |", found)
    for _, here, _, shape, meaning in symbols:
        assert meaning
        names = spans(here)
        written = re.findall(r"\([^)]*\)", shape)
        for number, name in enumerate(names):
            if name not in known:
                # What a reading at a period keeps beside the law's own state.
                assert name in keys or name in ("covariance",), name
                continue
            text = written[min(number, len(written) - 1)]
            assert any(fits(text, *found) for found in known[name]), (name, text, known[name])


def fits(text, shape, joints, rows):
    """Return whether a written shape, e.g. (m, n), is this one; other letters fit any size."""
    parts = [part.strip() for part in text.strip("()").split(",") if part.strip()]
    if len(parts) != len(shape):
        return False
    sizes = {"n": joints, "N": joints, "m": rows}
    for part, size in zip(parts, shape, strict=True):
        if part.isdigit() and int(part) != size:
            return False
        if part in sizes and size != sizes[part] and not (part == "n" and "N" in text):
            return False
    return True


# What is made.


def test_every_key_is_explained():
    for kind in LAWS:
        page, rows = gain_table(kind)
        for row in rows:
            assert len(row) == 3
            assert row[2], f"{page}: write in its row what {row[0]} does"


def test_nothing_is_left_to_be_filled_in():
    """`drake-rnn new law NAME --shipped` leaves its mark where a law's own words go."""
    left = [
        f"{file.relative_to(ROOT)}:{number}: {line.strip()}"
        for pattern in (
            "drake_rnn/laws/*.py",
            "tests/laws/*.py",
            "docs/schemes/*.md",
            CHOOSING,
            "diagrams/experiments/*/*.yaml",
            "diagrams/experiments/README.md",
            "CHANGELOG.md",
        )
        for file in ROOT.glob(pattern)
        for number, line in enumerate(file.read_text().splitlines(), 1)
        if "FILL IN" in line
    ]
    assert not left, "\n".join(left)


def test_what_pages_say_of_the_schemes_is_made_of_them():
    for page, made in MADE["pages"]().items():
        assert text_of(page) == made, f"{page}: run python docs/make_schemes.py"


def test_every_law_has_its_traits_and_every_page_is_reached_from_choosing():
    traced = {load_experiment(name).law.kind for name in TRAITS}
    for kind in set(LAWS) - traced:
        pytest.fail(
            f"{CHOOSING}: write a row of the traits, | [NAME](schemes/{page_of(kind)})<br>"
            f"`EXPERIMENT` | | | | | | COST |, with an experiment in diagrams/experiments/{kind}/; "
            "then run python docs/make_schemes.py"
        )
    for page in PAGES:
        assert page.removeprefix("docs/") in text_of(CHOOSING), f"{CHOOSING}: name {page}"
    for kind in LAWS:
        assert f"\n`{kind}/`" in text_of(EXPERIMENTS), (
            f"{EXPERIMENTS}: write a section that begins `{kind}/`. and ends with the table's head"
        )
